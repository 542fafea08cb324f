"""Surrogates of archives as functions with units: in Python and on the command line."""

from __future__ import annotations

import csv
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from study_text import study_text

import uqpen
from uqpen.surrogates.fitted_surrogate import Prediction
from uqpen.surrogates.output_surrogate import OutputSurrogate
from uqpen.surrogates.separate_fits import OutputFit


def bend(load, span, height):  # type: ignore[no-untyped-def]
    """A polynomial of second degree, which a polynomial chaos is equal to."""
    return {"tip": load * span / height}


@dataclass(frozen=True, eq=False)
class LevelFit(OutputFit):
    level: float

    def predict(self, points):
        return Prediction(np.full(len(points), self.level), np.full(len(points), 2e-3))


@dataclass(frozen=True)
class Level(OutputSurrogate):
    """A user-defined surrogate, with a standard deviation of 2 mm."""

    output_fit = LevelFit

    def fit_output(self, points, values, rng):
        return LevelFit(0.1)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    study = uqpen.Study(
        model=bend,
        inputs={
            "load": uqpen.Uniform("10 kN", "20 kN"),
            "span": uqpen.Uniform("1 m", "2 m"),
            "height": "10 cm",
        },
        outputs={"tip": uqpen.OutputSpec("mm")},
        designs={"training": uqpen.MonteCarlo(runs=60)},
        surrogates={
            "pce": uqpen.PolynomialChaos(design="training"),
            "level": Level(design="training"),
        },
        seed=1,
    )
    path = tmp_path_factory.mktemp("surrogates") / "beam.nc"
    uqpen.make_archive(study, path)
    return path


@pytest.fixture(scope="module")
def archive(path):
    return uqpen.open_archive(path)


def test_a_quantity_a_number_in_si_and_an_array_with_a_unit_are_the_same_point(archive):
    pce = archive.surrogate("pce")
    in_kn = xr.DataArray(15.0, attrs={"units": "kN"})
    found = [pce(load=load, span="150 cm") for load in ("15 kN", 15e3, in_kn)]
    # bend() takes kN, m and cm, and gives mm: 15 * 1.5 / 10.
    np.testing.assert_allclose([each["tip"] for each in found], 2.25e-3, rtol=1e-9)
    assert found[0]["tip"].attrs == {"long_name": "tip", "units": "m", "display_units": "mm"}
    assert not found[0]["extrapolated"].any()


def test_points_are_broadcast_by_their_dimensions(archive):
    pce = archive.surrogate("pce")
    load = xr.DataArray([11e3, 13e3, 15e3], dims="load")
    span = xr.DataArray([1.2, 1.4], dims="span")
    grid = pce(load=load, span=span)["tip"]
    assert grid.dims == ("load", "span")
    np.testing.assert_allclose(grid, np.outer(load / 1e3, span) / 10 / 1e3, rtol=1e-9)
    pairs = pce(load=["11 kN", "13 kN"], span=[1.2, 1.4])["tip"]
    assert pairs.dims == ("run",)
    np.testing.assert_allclose(pairs, [grid[0, 0], grid[1, 1]], rtol=1e-12)


def test_its_own_training_runs_are_not_extrapolated(archive):
    runs = archive["runs/training"].to_dataset()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = archive.surrogate("pce")(load=runs["load"], span=runs["span"], height="10 cm")
    np.testing.assert_allclose(found["tip"], runs["tip"], rtol=1e-9)


def test_a_point_outside_of_the_training_range_warns_and_is_marked(archive):
    pce = archive.surrogate("pce")
    with pytest.warns(uqpen.ExtrapolationWarning, match=r"1 of 2 points is .* load 10\.\d+ to"):
        found = pce(load=["15 kN", "30 kN"], span="1.5 m")
    marked = found["extrapolated"]
    assert marked.sel(input="load").values.tolist() == [False, True]
    assert not marked.sel(input="span").any()
    np.testing.assert_allclose(found["tip"][1], 4.5e-3, rtol=1e-9)


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({"load": "15 kN"}, "pce also needs span"),
        ({"lod": 1.0}, 'pce has no input "lod"; did you mean "load"?'),
        ({"load": "15 m"}, 'found load = "15 m"; expected a force, such as "5 kN"'),
        ({"load": ["15"]}, 'found load = "15", a number without a unit; expected a force'),
        ({"load": True}, "found load = true; expected a force"),
        ({"load": [15e3, np.nan]}, "found load with values that are not finite"),
        ({"load": [[1], [1, 2]]}, "found load = lists of different lengths; expected a value"),
        ({"load": [[15e3]]}, "found load = an array of shape (1, 1); expected one value"),
        ({"load": [1e3, 2e3], "span": [1, 2, 3]}, "the inputs differ in their points"),
        (
            {"load": 15e3, "span": 1.5, "height": "11 cm"},
            "height is 10 cm in all training runs; pce has no other value",
        ),
    ],
)
def test_mistakes(archive, inputs, message):
    with pytest.raises(uqpen.UqpenError) as caught:
        archive.surrogate("pce")(**inputs)
    assert message in str(caught.value)


def test_a_class_from_outside_is_given_and_never_loaded(archive):
    with pytest.raises(uqpen.UqpenError, match="follows from code that the archive names"):
        archive.surrogate("level")
    # A constant says less of the runs than their mean.
    with pytest.warns(uqpen.RefutationWarning, match="level, tip: the surrogate is refuted: it"):
        found = archive.surrogate("level", kind=Level)(load="15 kN", span="1.5 m")
    assert float(found["tip"]) == 0.1
    assert float(found["tip_std"]) == 2e-3
    assert found["tip_std"].attrs["units"] == "m"
    with pytest.raises(uqpen.UqpenError, match='no surrogate "gp"'):
        archive.surrogate("gp")


SEVERAL = study_text(
    models={"one": {"use": "ishigami"}, "two": {"use": "ishigami", "with": {"x3": 2}}},
    inputs={"x1": (-3, 3), "x2": 1, "x3": 1},
    designs={"some": {"kind": "monte-carlo", "runs": 20}},
    surrogates={"pce": {"kind": "polynomial-chaos", "design": "some", "order": 1}},
)


def test_of_several_models_each_has_its_own():
    archive = uqpen.run(uqpen.parse_study(SEVERAL))
    with pytest.raises(uqpen.UqpenError, match='no surrogate "pce"; did you mean "two/pce"'):
        archive.surrogate("pce")
    one, two = (archive.surrogate(f"{name}/pce") for name in ("one", "two"))
    assert (one.ranges["x3"], two.ranges["x3"]) == ((1, 1), (2, 2))
    assert one(x1=1.0)["y"] != two(x1=1.0)["y"]


POINTS = "point,load [kN],span [cm]\n1,15,150\n2,25,150\n"


@pytest.fixture
def predict(path, command_line):
    """The command with a table of points."""

    def call(points, *arguments, name="pce"):
        Path("points.csv").write_text(points)
        return command_line("predict", f"{path}:{name}", "points.csv", *arguments)

    return call


def test_a_table_of_points_gets_columns_of_predictions(predict):
    done = predict(POINTS)
    first, second = csv.DictReader(done.out.splitlines())
    assert list(first) == ["load [kN]", "span [cm]", "tip [mm]", "extrapolated"]
    assert float(first["tip [mm]"]) == pytest.approx(2.25)
    assert float(second["tip [mm]"]) == pytest.approx(3.75)
    assert (first["extrapolated"], second["extrapolated"]) == ("", "load")
    assert "columns that are no input: point\n" in done.err
    assert "1 of 2 points is outside of the training range: load 10." in done.err
    done = predict(POINTS, "-o", "out.json")
    assert (done.code, done.out) == (0, "2 rows: out.json\n")
    done = predict(POINTS.rpartition("2,")[0], "-o", "out.json")
    assert (done.code, done.out) == (0, "1 row: out.json\n")


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ("load [kN]\n15\n", '"points.csv": pce also needs span'),
        ("load [kN],spam [m]\n15,1\n", 'column "spam": did you mean "span"? known: load, span'),
        (
            "load [kN],span [kN]\n15,1\n",
            '"points.csv", column "span" is in "kN"; expected a length',
        ),
        ("load [kN],span [foo]\n15,1\n", '"points.csv", column "span": found "foo"'),
        ("load [kN],load [N]\n15,1\n", '"points.csv": column "load" stands twice'),
        ("load [kN],span [m]\n15,x\n", 'line 2, column "span": found "x", expected a number'),
    ],
)
def test_a_table_that_does_not_fit(predict, points, message):
    done = predict(points)
    assert (done.code, done.out) == (2, "")
    assert message in done.err


def test_code_that_an_archive_names_is_not_executed(predict, command_line):
    assert "follows from code that the archive names" in predict(POINTS, name="level").err
    assert command_line("predict", "a.csv", "b.csv").err == "a.csv: expected ARCHIVE.nc:NAME\n"


def test_a_surrogate_is_run_by_hand_in_the_units_of_its_study(path, command_line):
    done = command_line("run", f"{path}:pce", "--set", "load=20 kN", "--set", "span=200 cm")
    assert done.out.splitlines()[2].split() == ["tip", "4", "mm"]
    assert done.err.startswith("the point is outside of the training range: load")
    at_medians = command_line("run", f"{path}:pce").out.splitlines()
    assert at_medians[2].split() == ["tip", "2.25", "mm"]
