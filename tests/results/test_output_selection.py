"""One output of an archive, and a field at one place, as a scalar output is shown."""

import json
import re

import pytest
from click.testing import CliRunner
from study_text import study_text

import uqpen
from uqpen.cli.show import show
from uqpen.core.errors import QuantityError, UnknownNameError
from uqpen.results.field_tables import select_output
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables

# `copy` is the curve at 1 day, so that all its figures are known.
MODEL = """\
def simulate(x):
    return {"curve": [x, 2 * x, float("nan") if x > 0 else 3 * x], "copy": 2 * x, "infected": x}
"""
STUDY = study_text(
    {
        "python": "model.py:simulate",
        "inputs": {"x": "1"},
        "outputs": {
            "curve": {
                "unit": "cm",
                "along": {"time": {"unit": "day", "values": [0, 1, 4]}},
                "may_end": True,
            },
            "copy": "cm",
            "infected": "1",
        },
    },
    seed=11,
    inputs={"x": "0 ± 1"},
    outputs={"curve": {"exceeds": ["1 cm"]}, "copy": {"exceeds": ["1 cm"]}},
    designs={"copy": {"kind": "monte-carlo", "runs": 40}},
)


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("selection")
    (folder / "model.py").write_text(MODEL)
    (folder / "study.toml").write_text(STUDY)
    uqpen.write(uqpen.run(uqpen.load_study(folder / "study.toml")), folder / "study.nc")
    return folder / "study.nc"


@pytest.fixture(scope="module")
def tree(archive):
    return uqpen.open_archive(archive)


def unmarked(cells):
    """Return cells without the marks of their notes, whose numbers differ between tables."""
    return [re.sub(" [¹²³⁴⁵⁶⁷⁸⁹]$", "", cell) for cell in cells]


def test_at_a_place_a_field_is_shown_as_a_number(tree):
    place, _ = select_output(tree, "curve", ["time=1 day"])
    shown = next(output_tables(place))
    number = next(output_tables(select_output(tree, "copy")[0]))
    assert (shown.title, number.title) == ("curve at time = 1 day [cm]", "copy [cm]")
    rows, expected = ({label: unmarked(cells) for label, cells in t.rows} for t in (shown, number))
    assert rows.pop("P(reached)")[0].startswith("1.00")
    assert {"mean", "sd", "median", "P(> 1 cm)"} <= rows.keys()
    alone = {label: cells for label, cells in rows.items() if "all places" not in label}
    assert alone == {label: expected[label] for label in alone}
    assert "mean, all places at once" in rows


def test_where_curves_end_it_says_how_many_got_there(tree):
    rows = dict(next(output_tables(select_output(tree, "curve", ["time=4"])[0])).rows)
    share = float((tree["runs/copy"]["x"] <= 0).mean())
    assert rows["P(reached)"][0].startswith(f"{share:.2g}")


def test_json_has_the_place(tree):
    found = archive_json(select_output(tree, "curve", ["time=1 day"])[0])["designs"]["copy"]
    whole = archive_json(tree)["designs"]["copy"]["outputs"]
    assert list(found["outputs"]) == ["curve"]
    assert found["outputs"]["curve"]["at"] == {"time": 86_400.0}
    assert found["outputs"]["curve"]["mean"] == whole["copy"]["mean"]
    assert found["outputs"]["curve"]["exceedance"] == whole["copy"]["exceedance"]


@pytest.mark.parametrize(
    ("text", "position", "remark"),
    [
        ("time=24 h", 1, ""),
        ("time = 1", 1, ""),
        ("time=4 day", 2, ""),
        ("time=2 day", 1, "time = 1 day is the nearest to 2 day"),
    ],
)
def test_the_nearest_place_is_taken_and_named(tree, text, position, remark):
    place = select_output(tree, "curve", [text])[1][0]
    assert (place.position, place.remark) == (position, remark)


@pytest.mark.parametrize(
    ("output", "at", "error", "message"),
    [
        ("curv", [], UnknownNameError, 'no output "curv"; did you mean "curve"?'),
        ("curve", ["tine=1"], UnknownNameError, 'no dimension "tine"; did you mean "time"?'),
        ("copy", ["time=1"], UnknownNameError, "it is a single number or category"),
        ("curve", ["time=5"], QuantityError, "expected time = 0 day to 4 day"),
        ("curve", ["time=nan"], QuantityError, "expected time = 0 day to 4 day"),
        ("curve", ["time=0", "time=1"], QuantityError, "one place along each dimension"),
        ("curve", ["time=1 m"], QuantityError, "expected a time"),
        ("curve", ["time"], QuantityError, "a place, such as time=1"),
    ],
)
def test_a_mistake_is_named(tree, output, at, error, message):
    with pytest.raises(error) as refused:
        select_output(tree, output, at)
    assert message in str(refused.value)


def shown(*arguments):
    return CliRunner().invoke(show, list(arguments))


def test_the_command_shows_one_output(archive):
    every = shown(str(archive), "--output", "curve", "--at", "time=2 day")
    assert every.exit_code == 0
    assert "curve at time = 1 day [cm]" in every.output
    assert "time = 1 day is the nearest to 2 day" in every.stderr
    assert "copy [cm]" not in every.output
    as_json = shown(str(archive), "--json", "--output", "copy").stdout
    assert list(json.loads(as_json)["designs"]["copy"]["outputs"]) == ["copy"]
    assert "--at needs --output" in shown(str(archive), "--at", "time=1").output


def test_the_fits_of_a_surrogate_are_cut_to_the_output(tmp_path):
    (tmp_path / "model.py").write_text(MODEL)
    surrogate = '[surrogates.pce]\nkind = "polynomial-chaos"\ndesign = "copy"\n'
    (tmp_path / "study.toml").write_text(STUDY + surrogate)
    tree = uqpen.run(uqpen.load_study(tmp_path / "study.toml"))
    for output in ("copy", "infected", "curve"):
        cut, _ = select_output(tree, output)
        fits = next(table for table in output_tables(cut) if table.title.startswith("pce: fit"))
        assert [name for name, _ in fits.rows] == [output]
