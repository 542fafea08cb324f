"""Archives of every schema that there has been are read, checked and repeated by this uqpen.

They stand in ``tests/data/archives``, packed, beside the studies that they were made of. For a new
schema: ``uqpen study schema_N.toml -o schema_N.nc && gzip -9n schema_N.nc`` in that folder.
"""

from __future__ import annotations

import gzip
import hashlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.archive.content import group_hashes, recorded_hashes
from uqpen.archive.migrations import MIGRATIONS, migrate
from uqpen.archive.provenance import SCHEMA
from uqpen.archive.read import group_names, model_trees, open_archive, read_as_written
from uqpen.archive.reworded import reworded
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.results.source_statistics import SourceStatistics
from uqpen.verification.check_result import CheckOutcome
from uqpen.verification.diff import diff_archives
from uqpen.verification.differences import find_differences
from uqpen.verification.verify import verify
from uqpen.workflow.repetition import TOLERANCE

# To open an archive of an earlier schema and to make its study again takes a second each.
pytestmark = pytest.mark.slow

FOLDER = Path(__file__).parents[1] / "data" / "archives"
NAMES = sorted(path.name.removesuffix(".nc.gz") for path in FOLDER.glob("*.nc.gz"))

NAN = np.nan
# By archive, group and variable of the present schema: what stands in the file, to the bit.
OF_ISHIGAMI = {
    "runs/monte_carlo/y": {3: 0.2450454206611793},
    "statistics/monte_carlo/y/mean": {
        ...: [3.6915976938972275, 2.247985374392933, 5.135210013401522]
    },
    "statistics/blocks/y/first_order": {
        (..., 0): [0.8860775861308721, 0.6169951125916516, 0.010820809803753608]
    },
    "statistics/trajectories/y/mu_star": {
        0: [4.69362561011677, 2.4792627373373985, 6.907988482896142]
    },
    "statistics/report/y/response": {0: [0.1, NAN, NAN]},
}
FIGURES = {
    "schema_1": OF_ISHIGAMI,
    "schema_1_several": {
        "differences/other/monte_carlo/y/mean": {
            ...: [0.0055917021048407095, -0.03316532730327712, 0.04434873151295854]
        },
        "models/other/runs/given/y": {
            ...: [0.0, 5.438935876135478, -0.4182691450792503, 5.9602432581853275]
        },
    },
    "schema_2": OF_ISHIGAMI,
    "schema_2_several": {
        "differences/other/monte_carlo/y/mean": {...: [-0.5, -0.5, -0.5]},
        "models/other/runs/given/y": {...: [0.5, -0.5, 0.515625, 1.5]},
    },
    "schema_3": OF_ISHIGAMI
    | {
        "statistics/monte_carlo/y/mean": {
            ...: [3.6915976938972275, 2.037671323203666, 5.5461142398741705]
        },
    },
    "schema_3_several": {
        "differences/other/monte_carlo/y/mean": {...: [-0.5, -0.5, -0.5]},
        "models/other/runs/given/y": {...: [0.5, -0.5, 0.515625, 1.5]},
    },
}

# Those with a surrogate of an earlier recipe, which is not repeated.
WITH_EARLIER_SURROGATE = ("schema_1", "schema_2", "schema_3")
# Those with intervals of a later recipe than the first.
INTERVAL_RECIPES = {"schema_3": 2}


class Kept(NamedTuple):
    """An archive that is kept, unpacked."""

    name: str
    path: Path
    written: xr.DataTree
    tree: xr.DataTree


@pytest.fixture(scope="module", params=NAMES)
def kept(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Kept:
    """Each archive in turn."""
    path = tmp_path_factory.mktemp("kept") / f"{request.param}.nc"
    path.write_bytes(gzip.decompress((FOLDER / f"{request.param}.nc.gz").read_bytes()))
    return Kept(request.param, path, read_as_written(path), open_archive(path))


def test_there_is_one_of_every_schema() -> None:
    assert sorted(MIGRATIONS) == list(range(1, SCHEMA))
    for schema in range(1, SCHEMA + 1):
        assert f"schema_{schema}" in NAMES, f"no archive of schema {schema} is kept"
    assert set(FIGURES) == set(NAMES)


def test_it_is_of_its_schema_and_study(kept: Kept) -> None:
    assert kept.written.attrs["uqpen_schema"] == int(kept.name.split("_")[1])
    text = (FOLDER / f"{kept.name}.toml").read_text()
    assert kept.tree.attrs["study_text"] == text
    assert kept.tree.attrs["study_sha256"] == hashlib.sha256(text.encode()).hexdigest()


def test_it_opens_with_the_same_figures(kept: Kept) -> None:
    assert kept.tree.attrs["uqpen_schema"] == SCHEMA
    for path, figures in FIGURES[kept.name].items():
        group, _, variable = path.rpartition("/")
        for position, expected in figures.items():
            found = kept.tree[group][variable].values[position]
            np.testing.assert_array_equal(found, expected, path)


def test_up_to_2_what_stood_by_kind_stands_by_source_and_output(kept: Kept) -> None:
    if kept.written.attrs["uqpen_schema"] > 2:
        assert {node.path for node in kept.written.subtree} == {n.path for n in kept.tree.subtree}
        return
    written, read = model_trees(kept.written), model_trees(kept.tree)
    assert list(written) == list(read)
    for name, model in written.items():
        assert "comparison" in model.children, "it repeated what stands with its source"
        after = SourceStatistics(read[name])
        assert not {"moments", "quantiles", "comparison", "statuses"} & set(read[name].children)
        for source in model.children["moments"].children:
            moments = model["moments"][source].to_dataset()
            for statistic in ("mean", "std", "half_spread", "skewness", "kurtosis"):
                if f"y_{statistic}" in moments:
                    _agrees(after.get(source, "y", statistic), moments[f"y_{statistic}"])
        for source in model.children["quantiles"].children:
            quantiles = model["quantiles"][source].to_dataset()
            _agrees(after.get(source, "y", "quantile"), quantiles["y"])
            functions = model["cdfs"][source].to_dataset()
            _agrees(after.get(source, "y", "cdf"), functions["y_probability"])
            _agrees(after.get(source, "y", "cdf_band"), functions["y_band"])
            _agrees(after.get(source, "y", "cdf_value"), functions["y"])
        for design in group_names(model, "statuses"):
            ends = model["statuses"][design].to_dataset()
            found = after.failures(design)["probability"]
            assert found["status"].values.tolist() == list(ends.data_vars)
            for end, array in ends.data_vars.items():
                _agrees(found.sel(status=end), array)


def _agrees(found: xr.DataArray | None, written: xr.DataArray) -> None:
    """Assert that the numbers are those that were written, and the texts up to their wording."""
    assert found is not None
    np.testing.assert_array_equal(found.values, written.values)
    for name in ("interval", "interval_label", "note"):
        if name in written.attrs:
            texts = found.coords[name].values if found.ndim else found.attrs[name]
            assert set(np.ravel(texts)) == {reworded(written.attrs[name])}


def test_it_is_shown(kept: Kept) -> None:
    rows = [row for table in output_tables(kept.tree) for row in dict(table.rows)]
    assert "mean" in rows
    assert archive_json(kept.tree)["schema"] == SCHEMA


def test_its_hashes_are_those_of_what_was_written(kept: Kept) -> None:
    before = group_hashes(kept.written)
    assert before == recorded_hashes(kept.written)
    migrate(kept.written)
    assert group_hashes(kept.written) == before, "what was read is not touched"


@pytest.mark.processor
def test_it_is_verified(kept: Kept, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    folder = None if "files" in kept.tree.children else FOLDER
    parts = list(verify(kept.path, folder=folder, runs=None, trust=True))
    assert {"hashes", "study", "runs", "statistics"} <= {part.name for part in parts}
    told = [part.text for part in parts if part.name == "surrogates"]
    earlier = ["not checked: chaos; another uqpen has fitted and corrected them"]
    assert told == (earlier if kept.name in WITH_EARLIER_SURROGATE else [])
    (intervals,) = (part for part in parts if part.name == "intervals")
    assert intervals.verdict is CheckOutcome.UNCHECKED
    recipe = INTERVAL_RECIPES.get(kept.name, 1)
    assert f"made by an earlier recipe ({recipe}, here " in intervals.text
    compared = [part for part in parts if part.name not in ("surrogates", "intervals")]
    assert {part.verdict for part in compared} <= {CheckOutcome.EQUAL, CheckOutcome.CLOSE}


def have_close_runs(one: xr.DataTree, other: xr.DataTree) -> bool:
    """Return whether the runs differ by no more than another processor's last bits."""
    groups = [node.path for node in one.subtree if "status" in node.data_vars]
    pairs = [(one[path].to_dataset(), other[path].to_dataset()) for path in groups]
    return all(each.relative <= TOLERANCE for pair in pairs for each in find_differences(*pair))


@pytest.mark.processor
def test_its_differences_from_a_new_one_are_explained(kept: Kept) -> None:
    now = uqpen.run(uqpen.load_study(FOLDER / f"{kept.name}.toml"))
    told = {section.name: section.lines for section in diff_archives(kept.tree, now)}
    # What another schema, version or processor brings along, but no other run or estimate.
    is_close = "made with" in told and have_close_runs(kept.tree, now)
    last_bits = {"points", "outputs"} if is_close else set()
    assert set(told) <= {"root", "groups", "made with", "equal", "other groups", *last_bits}
    groups = told.get("groups", ())
    assert all(line.endswith("is in the second only") for line in groups)


def test_from_1_what_measures_of_sensitivity_lie_along_has_a_name(kept: Kept) -> None:
    groups = [node for node in kept.tree.subtree if "input" in node.coords]
    named = {node.path: node["input"].attrs["long_name"] for node in groups}
    of_surrogates = {path for path in named if path.startswith("/surrogates")}
    assert {named[path] for path in named.keys() - of_surrogates} == {"input"}
    if kept.name == "schema_1":
        assert "long_name" not in kept.written["sensitivity/report"]["input"].attrs
        assert kept.tree["statistics/report/y"]["input"].values.tolist() == ["x1"]


def test_what_is_read_can_be_written_again(kept: Kept, tmp_path: Path) -> None:
    uqpen.write(kept.tree, tmp_path / "again.nc")
    again = read_as_written(tmp_path / "again.nc")
    assert again.attrs["uqpen_schema"] == SCHEMA
    assert group_hashes(again) == recorded_hashes(again) == group_hashes(kept.tree)
