"""Several models in one study: the same points, a tree for each, and paired differences."""

import numpy as np
import pytest
from study_text import study_text

import uqpen
from uqpen.archive.estimates import interval_text
from uqpen.archive.read import open_archive
from uqpen.archive.write import write
from uqpen.core.errors import StudyError
from uqpen.execution import worst_status_runs
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.results.source_statistics import SourceStatistics

pytestmark = pytest.mark.slow

MODELS = """
import numpy as np

def square(x, shift):
    return {"y": x**2 + shift, "z": x}

def picky(x, shift):
    return {"y": np.where(x > 0.9, np.nan, x**2 + 2 * x + shift)}
"""


def model(function, inputs, outputs, replaced=None):
    """Return the table of a model, which may have its own values for some inputs."""
    own = {"with": replaced} if replaced else {}
    table = {"python": f"models.py:{function}", "vectorized": True, **own}
    return {**table, "inputs": inputs, "outputs": outputs}


STUDY = study_text(
    seed=3,
    models={
        "first": model("square", {"x": "1", "shift": "1"}, {"y": "m", "z": "1"}),
        "shifted": model("square", {"x": "1", "shift": "1"}, {"y": "m", "z": "1"}, {"shift": 1.5}),
        "picky": model("picky", {"x": "1", "shift": "1"}, {"y": "m"}),
    },
    inputs={"x": (0, 1), "shift": 0},
    outputs={"y": {"exceeds": ["0.5 m"]}},
    designs={
        "mc": {"kind": "monte-carlo", "runs": 1_000},
        "lhs": {"kind": "latin-hypercube", "runs": 1_000},
    },
)


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    (folder / "models.py").write_text(MODELS)
    return uqpen.run(uqpen.parse_study(STUDY, folder=folder))


def test_all_models_run_at_the_same_points_but_for_what_they_are_given(tree):
    points = [tree[f"models/{name}/runs/mc"]["x"].values for name in ("first", "shifted", "picky")]
    assert (points[0] == points[1]).all()
    assert (points[0] == points[2]).all()
    shifts = [float(tree[f"models/{name}/runs/mc"]["shift"]) for name in ("first", "shifted")]
    assert shifts == [0.0, 1.5]


@pytest.mark.parametrize("design", ["mc", "lhs"])
def test_a_difference_that_does_not_depend_on_the_draw_has_no_error(tree, design):
    mean = tree[f"differences/shifted/{design}/y"]["mean"]
    # Differences of squares of up to 1 are exact to rounding.
    assert mean.values == pytest.approx([1.5] * 3, abs=1e-12)


@pytest.mark.parametrize("design", ["mc", "lhs"])
def test_differences_are_of_the_runs_that_came_back_from_both(tree, design):
    difference = tree[f"differences/picky/{design}/y"]
    lost = int((tree[f"models/first/runs/{design}"]["x"] > 0.9).sum())
    assert difference["mean"].attrs["runs_used"] == 1000 - lost
    assert difference.attrs["minus"] == "first"
    estimate, lower, upper = difference["mean"].values
    assert lower < 0.9 < upper  # the mean of 2 x, given that x is at most 0.9
    assert estimate == pytest.approx(0.9, abs=0.06)


def test_an_output_that_only_one_model_has_has_no_difference(tree):
    assert "z" not in tree["differences/picky/mc"].children
    assert "mean" in tree["differences/shifted/mc/z"]


def test_a_difference_is_better_known_than_either(tree):
    def width(path):
        mean = tree[path]["mean"].values
        return float(mean[2] - mean[1])

    assert width("differences/picky/mc/y") < 2.2 * width("models/first/statistics/mc/y")


def test_the_archive_of_several_models_reads_back(tree, tmp_path):
    write(tree, tmp_path / "models.nc")
    read = open_archive(tmp_path / "models.nc")
    reported = archive_json(read)
    assert list(reported["models"]) == ["first", "shifted", "picky"]
    assert reported["models"]["first"]["designs"]["mc"]["runs"] == 1000
    mean = reported["differences"]["shifted"]["mc"]["outputs"]["y"]["mean"]
    assert mean["estimate"] == pytest.approx(1.5)
    titles = [table.title for table in output_tables(read)]
    assert titles[0] == "first: y [m]"
    assert "picky minus first: y [m]" in titles


def test_an_adaptive_study_gets_the_gravest_status(tree):
    first, picky = (tree[f"models/{name}/runs/mc"].to_dataset() for name in ("first", "picky"))
    status = worst_status_runs([first, picky])["status"].values
    assert (status == picky["status"].values).all()
    assert np.count_nonzero(status) > 0


SHIFT = "with = { shift = 1.5 }"


@pytest.mark.parametrize(
    ("old", "new", "key", "found"),
    [
        (SHIFT, "with = { shfit = 1.5 }", "models.shifted.with.shfit", "unknown"),
        (SHIFT, "with = { x = 1.5 }", "models.shifted.with.x", "at random"),
        (SHIFT, 'with = { shift = "1 m" }', "models.shifted.with.shift", "1 m"),
        ("[models.picky]", '[models."p y"]', "models.p y", '"p y"'),
        ('outputs = { y = "m" }', 'outputs = { y = "s" }', "models.picky", 'an output "y" [s]'),
        ("[models.first]", '[model]\nuse = "ishigami"\n[models.first]', "models", "[model] and"),
    ],
)
def test_mistakes_are_met_at_their_place(tmp_path, old, new, key, found):
    (tmp_path / "models.py").write_text(MODELS)
    with pytest.raises(StudyError) as caught:
        uqpen.parse_study(STUDY.replace(old, new, 1), folder=tmp_path)
    assert any(p.key == key and found in p.found for p in caught.value.problems), caught.value


LACKING = study_text(
    seed=3,
    models={
        "both": model("both", {"a": "1", "b": "1"}, {"y": "1"}),
        "one": model("one", {"a": "1"}, {"y": "1"}),
    },
    inputs={"a": (0, 1), "b": (0, 1)},
    designs={
        "blocks": {"kind": "saltelli", "base": 256},
        "steps": {"kind": "one-at-a-time"},
        "spread": {"kind": "latin-hypercube", "runs": 200},
    },
    surrogates={"pce": {"kind": "polynomial-chaos", "design": "spread"}},
)


def test_an_input_that_a_model_does_not_take_has_no_part_in_it(tmp_path):
    source = "def both(a, b): return {'y': a + b}\ndef one(a): return {'y': a**2}\n"
    (tmp_path / "models.py").write_text(source)
    tree = uqpen.run(uqpen.parse_study(LACKING, folder=tmp_path))
    exact = tree["models/one/statistics/pce/y"]["first_order"].sel(bound="estimate")
    assert exact["input"].values.tolist() == ["a", "b"]
    assert exact.values == pytest.approx([1, 0], abs=1e-12)
    spread = tree["models/one/statistics/spread/y"]
    _, lower, upper = spread["first_order"].sel(input="b").values
    assert lower < 0 < upper
    blocks = SourceStatistics(tree["models/one"]).statistics("blocks", "y")
    assert float(blocks["first_order"].sel(input="a", bound="estimate")) == pytest.approx(
        1, abs=0.1
    )
    assert float(blocks["total_order"].sel(input="b", bound="estimate")) == 0.0
    assert interval_text(blocks["total_order"].sel(input="b"), "note")
    write(tree, tmp_path / "lacking.nc")
    assert list(archive_json(open_archive(tmp_path / "lacking.nc"))["models"]) == ["both", "one"]


def test_a_surrogate_of_a_model_that_lacks_a_fixed_input_of_another(tmp_path):
    source = "def both(a, b): return {'y': a + b}\ndef one(a): return {'y': a**2}\n"
    (tmp_path / "models.py").write_text(source)
    old = "b = { uniform = { lower = 0, upper = 1 } }"
    tree = uqpen.run(uqpen.parse_study(LACKING.replace(old, 'b = "2"'), folder=tmp_path))
    fitted = {name: tree[f"models/{name}/surrogates/pce/input"] for name in ("both", "one")}
    assert float(fitted["both"]["fixed_b"]) == 2.0
    assert list(fitted["one"].data_vars) == ["a_recurrence"]
    means = tree["models/one/statistics/pce/y"]["mean"]
    assert float(means.sel(bound="estimate")) == pytest.approx(1 / 3)


OWN_INPUTS = study_text(
    seed=3,
    models={
        "first": model("first", {"x": "m"}, {"y": "m"}),
        "second": model("second", {"slope": "1", "x": "m"}, {"y": "m"}),
        "third": model("third", {"offset": "mm"}, {"y": "m"}),
    },
    inputs={"x": "(1 ± 0.1) m", "slope": "2 ± 0.1", "offset": "(3 ± 1) mm"},
    designs={
        "mc": {"kind": "monte-carlo", "runs": 200},
        "indices": {"kind": "saltelli", "base": 64},
    },
)

OWN_FUNCTIONS = """
def first(x):
    return {"y": x}

def second(slope, x):
    return {"y": slope * x}

def third(offset):
    return {"y": 0.001 * offset}
"""


@pytest.fixture(scope="module")
def folder_of_functions(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own_inputs")
    (folder / "models.py").write_text(OWN_FUNCTIONS)
    return folder


def test_a_model_takes_its_own_of_the_inputs_of_all(folder_of_functions):
    tree = uqpen.run(uqpen.parse_study(OWN_INPUTS, folder=folder_of_functions))
    runs = {name: tree[f"models/{name}/runs/mc"] for name in ("first", "second", "third")}
    assert (runs["first"]["y"] == runs["first"]["x"]).all()
    assert (runs["second"]["y"] == runs["second"]["slope"] * runs["second"]["x"]).all()
    # The function takes millimetres, and the archive has metres: equal but for rounding.
    assert np.allclose(runs["third"]["y"], runs["third"]["offset"], rtol=1e-12)
    assert (runs["third"]["x"] == runs["first"]["x"]).all()  # one draw, whoever takes it
    # An input has no effect on a model that does not take it.
    total = tree["models/first/statistics/indices/y"]["total_order"].sel(bound="estimate")
    assert total.sel(input=["slope", "offset"]).values.tolist() == [0.0, 0.0]
    assert total.sel(input="x").item() == pytest.approx(1.0, abs=0.3)  # of 64 rows


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('slope = "2 ± 0.1"\n', "", r"inputs\.slope\n +found +nothing"),
        ('slope = "1", x = "m"', 'slope = "1", x = "kg"',
         r'models\.second\n +found +an input "x" \[kg\]\n'
         r" +expected +a unit of the same dimension as in the models above it, \[m\]"),
    ],
)  # fmt: skip
def test_inputs_of_all_models_are_given_once(folder_of_functions, old, new, expected):
    with pytest.raises(StudyError, match=expected):
        uqpen.parse_study(OWN_INPUTS.replace(old, new), folder=folder_of_functions)
