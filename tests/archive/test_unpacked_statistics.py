"""Statistics of a group, unpacked as they are asked for."""

import pytest

import uqpen
from uqpen.archive import unpacked_statistics
from uqpen.archive.estimates import statistic_names, unpack
from uqpen.archive.unpacked_statistics import UnpackedStatistics
from uqpen.results.output_tables import output_tables

STUDY = """\
seed = 1
[model]
python = "model.py:simulate"
inputs = {{ a = "1", b = "1" }}
outputs = {{ {outputs} }}
vectorized = true
[inputs]
a = "0 ± 1"
b = "0 ± 1"
[designs.plain]
kind = "monte-carlo"
runs = 64
"""


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> uqpen.Archive:
    folder = tmp_path_factory.mktemp("unpacked")
    source = "def simulate(a, b):\n    return {f'y{k}': a + k * b for k in range(4)}\n"
    (folder / "model.py").write_text(source, encoding="utf-8")
    outputs = ", ".join(f'y{number} = "1"' for number in range(4))
    study = uqpen.parse_study(STUDY.format(outputs=outputs), folder=folder)
    return uqpen.run(study, map=map)


def test_they_are_those_of_the_group(archive: uqpen.Archive) -> None:
    dataset = archive["statistics/plain/y1"].to_dataset()
    found = UnpackedStatistics(dataset)
    assert list(found) == statistic_names(dataset)
    assert len(found) == len(list(found.attributes()))
    assert "mean_interval" not in found
    assert found.get("frobnicate") is None
    for name, array in found.items():
        assert array.identical(unpack(dataset, name))
        assert found[name] is array


def test_tables_unpack_no_statistic_of_an_output_they_do_not_show(
    archive: uqpen.Archive, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def counted(dataset, name):  # type: ignore[no-untyped-def]
        asked.append(name)
        return unpack(dataset, name)

    monkeypatch.setattr(unpacked_statistics, "unpack", counted)
    assert list(output_tables(archive))
    # A distribution function is never in a table.
    assert asked
    assert not {"cdf", "cdf_band", "percentile"} & set(asked)
