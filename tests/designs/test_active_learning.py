"""Active learning of a rare event: exact probabilities, failed runs, mistakes, the same bytes."""

import math

import numpy as np
import pytest
from interrupted_study import check_interruptions_and_workers
from scipy import special

import uqpen
from uqpen.archive.structure import find_faults
from uqpen.core.labels import CORRECTION_WEIGHT, PREDICTED_EVENT
from uqpen.report.sections.answer import answer
from uqpen.results.archive_view import ArchiveView
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables

COPULA = {
    "copula": "gaussian",
    "of": "normal-scores",
    "pairs": [{"inputs": ["a", "b"], "correlation": 0.5}],
}
INPUTS = {"a": uqpen.Normal(0.0, 1.0), "b": uqpen.Normal(0.0, 1.0)}
HALF_SPACE = special.ndtr(-4.0)


def half_space(a, b):
    """The sum exceeds 4 √2 with the probability of a standard normal variable above 4."""
    return {"depth": a + b, "speed": a - b}


def study(
    function=half_space,
    event=f"depth > {4 * 2**0.5!r} m",
    *,
    learning=40,
    correction=150,
    inputs=INPUTS,
    **settings,
):
    model = uqpen.PythonModel(
        function, {"a": "1", "b": "1"}, {"depth": "m", "speed": "m/s"}, vectorized=True
    )
    design = uqpen.ActiveLearning(event=event, learning=learning, correction=correction, batch=10)
    # Of many tests, some intervals of 95 % would have to miss.
    return uqpen.Study(
        model, inputs, designs={"rare": design}, seed=4, confidence_level=0.999, **settings
    )


def probability(tree):
    (found,) = tree["joint_probabilities/rare"]["joint_probability"]
    return found


def beside(tree, name):
    """A number that stands beside the probability."""
    return float(tree["joint_probabilities/rare"][f"joint_probability_{name}"].item())


def contains(found, exact):
    """Check that the interval contains a value, and that it says something: few runs are made."""
    _, lower, upper = found.values
    return bool(lower <= exact <= upper < 3 * lower)


@pytest.fixture(scope="module")
def tree():
    return uqpen.run(study())


def test_the_probability_of_a_half_space_is_in_the_interval(tree):
    found = probability(tree)
    assert contains(found, HALF_SPACE)
    # So many plain runs would most likely have seen none.
    assert tree["runs/rare"].sizes["run"] * HALF_SPACE < 0.01


def test_the_surrogate_alone_stands_beside_it(tree):
    found = probability(tree)
    # The runs of so simple an event contradict it in hardly any point.
    assert beside(tree, "surrogate_estimate") == pytest.approx(HALF_SPACE, rel=0.2)
    assert beside(tree, "equivalent_runs") > 100 * tree["runs/rare"].sizes["run"]
    assert "the surrogate alone says" in found.attrs["note"]
    assert "which has no interval" in found.attrs["note"]
    assert "runs of the model alone" in found.attrs["note"]
    assert "parts of the event that no run has met" in found.attrs["note"]


def test_weights_are_of_the_runs_that_correct(tree):
    runs = tree["runs/rare"]
    weights, predicted = runs[CORRECTION_WEIGHT].values, runs[PREDICTED_EVENT].values
    assert ((weights > 0) == (predicted >= 0)).all()
    assert (weights > 0).sum() == 150
    # They add up to the probability of all inputs, and to that of the event, with the error of 50
    # draws of each kind.
    assert weights.sum() == pytest.approx(1, rel=0.5)
    assert weights[predicted == 1].sum() == pytest.approx(HALF_SPACE, rel=0.5)


def test_it_is_right_whatever_the_surrogate_says():
    # 20 runs tell little of a function that waves; so the runs that correct it have to.
    def waves(a, b):
        return {"depth": a + np.sin(9 * b), "speed": b}

    # By the integral over a of the share of b where the sine exceeds 2 - a.
    b = special.ndtri((np.arange(100_000) + 0.5) / 100_000)
    exact = special.ndtr(np.sin(9 * b) - 2).mean()
    found = probability(uqpen.run(study(waves, "depth > 2 m", learning=20, correction=900)))
    _, lower, upper = found.values
    assert lower <= exact <= upper


def test_inputs_may_depend_on_each_other_and_be_truncated():
    # P(a + b > 7) of a copula: both have a correlation of 0.5, so the sum a variance of 3.
    dependent = study(event="depth > 7 m", dependence=COPULA)
    assert contains(probability(uqpen.run(dependent)), special.ndtr(-7 / math.sqrt(3)))
    cut = uqpen.Truncated(uqpen.Normal(0.0, 1.0), lower=-1.0, upper=4.5)
    one = study(event="depth > 4 m", inputs={"a": cut, "b": uqpen.Uniform(0.0, 1e-9)})
    share = special.ndtr(4.5) - special.ndtr(-1)
    assert contains(probability(uqpen.run(one)), (special.ndtr(-4) - special.ndtr(-4.5)) / share)


def test_two_distant_modes_are_both_met():
    def two(a, b):
        return {"depth": np.abs(a), "speed": b}

    assert contains(probability(uqpen.run(study(two, "depth > 3.5 m"))), 2 * special.ndtr(-3.5))


def test_all_or_any_limits_of_several_outputs():
    both = probability(uqpen.run(study(event="depth > 3 m and speed > 3 m/s")))
    either = probability(uqpen.run(study(event="depth > 5 m or speed < -5 m/s")))
    tail = special.ndtr(-5 / math.sqrt(2))
    assert contains(both, special.ndtr(-3 / math.sqrt(2)) ** 2)
    assert contains(either, 2 * tail - tail**2)


def test_it_is_conditional_on_admissible_draws():
    found = probability(uqpen.run(study(constraints=["a > 0"], event="depth > 5 m")))
    # Of a > 0 twice the probability of both signs, by symmetry less that of a <= 0.
    nodes, weights = np.polynomial.legendre.leggauss(200)
    a = 5 * (nodes + 1)
    density = np.exp(-(a**2) / 2) / math.sqrt(2 * math.pi)
    exact = 2 * float((5 * weights * density * special.ndtr(a - 5)).sum())
    _, lower, upper = found.values
    assert lower <= exact <= upper
    assert found.attrs["conditional_on"] == "admissible inputs"


def test_failed_runs_are_neither_safe_nor_in_the_event():
    def fails(a, b):
        # Beyond 3.5 the solver fails where b is above 0: half of the event is unknown.
        return {"depth": np.where((a > 3.5) & (b > 0), np.nan, a), "speed": b}

    found = probability(uqpen.run(study(fails, "depth > 3 m")))
    known = special.ndtr(-3.0) - special.ndtr(-3.5) / 2
    estimate, lower, upper = found.values
    assert lower < known < estimate * 1.5
    assert upper > special.ndtr(-3.0)
    assert "for any outcome of the missing runs" in found.attrs["interval"]


def test_a_failing_region_gives_bounds_and_does_not_stop_the_learning():
    def fails(a, b):
        return {"depth": np.where(a > 2, np.nan, b), "speed": a}

    tree = uqpen.run(study(fails, "depth > 3.5 m"))
    _, lower, upper = probability(tree).values
    assert upper > special.ndtr(-2.0), "all failed runs may have it"
    assert lower <= special.ndtr(-3.5) * special.ndtr(2.0)
    runs = tree["runs/rare"]
    is_lost = np.isnan(runs["depth"].values[runs[CORRECTION_WEIGHT].values == 0])
    assert is_lost.mean() < 0.5, "it does not go on where runs fail"


def test_an_event_that_no_run_shows_has_no_number():
    def never(a, b):
        return {"depth": np.minimum(a, 1.0), "speed": b}

    found = probability(uqpen.run(study(never, "depth > 2 m")))
    assert np.isnan(found.values).all()
    assert "no run shows the event" in found.attrs["note"]


def test_a_constant_output_has_no_surrogate_and_no_number():
    def constant(a, b):
        return {"depth": 0 * a, "speed": b}

    tree = uqpen.run(study(constant, "depth > 2 m"))
    assert np.isnan(probability(tree).values).all()
    assert np.isnan(beside(tree, "surrogate_estimate"))


def test_an_output_with_two_values_is_no_obstacle():
    def steps(a, b):
        return {"depth": (a > 2.0) + (a > 3.0) * 1.0, "speed": b}

    _, lower, upper = probability(uqpen.run(study(steps, "depth > 1.5 m"))).values
    assert lower <= special.ndtr(-3.0) <= upper


@pytest.mark.parametrize("criterion", ["u-function", "expected-feasibility"])
def test_either_criterion_learns_where_the_limit_is(criterion):
    def curved(a, b):
        return {"depth": a + 0.1 * b**2, "speed": b}

    model = uqpen.PythonModel(
        curved, {"a": "1", "b": "1"}, {"depth": "m", "speed": "m/s"}, vectorized=True
    )
    design = uqpen.ActiveLearning("depth > 3 m", learning=40, batch=3, criterion=criterion)
    runs = uqpen.run(uqpen.Study(model, INPUTS, designs={"rare": design}, seed=4))["runs/rare"]
    to_learn = runs[CORRECTION_WEIGHT].values == 0
    away = np.abs(runs["depth"].values[to_learn] - 3)
    # The first 14 are spread over the inputs.
    assert np.median(away[14:]) < np.median(away[:14]) / 3


def test_tables_json_and_page_have_it(tree):
    assert not list(find_faults(tree))
    table = next(each for each in output_tables(tree) if "joint probabilities" in each.title)
    assert any(row[0].startswith("P(depth > 5.65") for row in table.rows)
    (found,) = archive_json(tree)["designs"]["rare"]["joint_probabilities"].values()
    assert found["lower"] < HALF_SPACE < found["upper"]
    assert found["surrogate_estimate"] == pytest.approx(HALF_SPACE, rel=0.2)
    page = str(list(answer(ArchiveView(tree, ""))))
    assert "By rare: In 0.00" in page
    assert "the surrogate alone says" in page.lower()


@pytest.mark.parametrize(
    ("settings", "found", "expected"),
    [
        ({"event": "depth"}, '"depth"', 'an event such as "depth > 3 m"'),
        ({"event": "width > 3 m"}, '"width"', "an output that is a number"),
        ({"event": "depth > 3 m", "learning": 10}, "10", "at least 20"),
        ({"event": "depth > 3 m", "correction": 10}, "10", "at least 60"),
        ({"event": "depth > 3 m", "criterion": "u"}, '"u"', '"u-function"'),
        ({"event": "depth > 3 m", "tolerance": 2}, "2", "below 1"),
    ],
)
def test_mistakes_are_met_before_a_run(tmp_path, settings, found, expected):
    (tmp_path / "model.py").write_text("def model(a, b): raise SystemExit\n")
    keys = "\n".join(
        f"{key} = '{value}'" if isinstance(value, str) else f"{key} = {value}"
        for key, value in settings.items()
    )
    (tmp_path / "study.toml").write_text(
        '[model]\npython = "model.py:model"\n'
        'inputs = { a = "1", b = "1" }\noutputs = { depth = "m", speed = "m/s" }\n'
        '[inputs]\na = "0 ± 1"\nb = "0 ± 1"\n'
        f'[designs.rare]\nkind = "active-learning"\n{keys}\n'
    )
    with pytest.raises(uqpen.StudyError) as raised:
        uqpen.load_study(tmp_path / "study.toml")
    assert found in str(raised.value)
    assert expected in str(raised.value)


DESIGN = """\
kind = "active-learning"
event = "depth > 7 m"
learning = 30
correction = 60
"""


@pytest.mark.slow
@pytest.mark.processor
def test_a_kill_at_any_batch_and_workers_change_no_byte(tmp_path):
    depth = "a + b + 0.1 * (a - b) ** 2"
    check_interruptions_and_workers(tmp_path, DESIGN, stops=(2, 4), depth=depth)
