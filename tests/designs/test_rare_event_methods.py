"""What holds of every method for a rare event: exact probabilities, failed runs, mistakes."""

import math
from functools import partial

import numpy as np
import pytest
from interrupted_study import STUDY, check_interruptions_and_workers
from rare_event_studies import probability
from rare_event_studies import study as study_by
from scipy import special

import uqpen
from uqpen.archive.structure import find_faults
from uqpen.report.sections.answer import answer
from uqpen.results.archive_view import ArchiveView
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables

# Each with the largest ratio of its bounds, as few runs are made. Those of subset simulation at a
# confidence of 0.999 would say nothing.
METHODS = {
    "subset-simulation": (partial(uqpen.SubsetSimulation, samples=400), 30),
    "importance-sampling": (partial(uqpen.ImportanceSampling, samples=1000), 3),
    "active-learning": (
        partial(uqpen.ActiveLearning, learning=40, correction=150, batch=10),
        4,
    ),
}
COPULA = {
    "copula": "gaussian",
    "of": "normal-scores",
    "pairs": [{"inputs": ["a", "b"], "correlation": 0.5}],
}
HALF_SPACE = f"depth > {4 * 2**0.5!r} m"
P_HALF_SPACE = special.ndtr(-4.0)


@pytest.fixture(scope="module", params=METHODS)
def method(request):
    return request.param


@pytest.fixture(scope="module")
def made(method):
    """Make the archive of an event by a method."""
    design, _ = METHODS[method]
    level = 0.95 if method == "subset-simulation" else 0.999

    def make(event, *arguments, **settings):
        settings = {"confidence_level": level, **settings}
        return uqpen.run(study_by(design(event=event), *arguments, **settings))

    return make


@pytest.fixture(scope="module")
def check(method, made):
    """Check that the interval contains a probability, and that it says something."""
    _, widest = METHODS[method]

    def contains(exact, event, *arguments, **settings):
        found = probability(made(event, *arguments, **settings))
        _, lower, upper = found.values
        assert lower <= exact <= upper < widest * lower
        return found

    return contains


@pytest.fixture(scope="module")
def tree(made):
    return made(HALF_SPACE)


def test_the_probability_of_a_half_space_is_in_the_interval(tree):
    _, lower, upper = probability(tree).values
    assert lower <= P_HALF_SPACE <= upper
    # So many plain runs would most likely have seen none.
    assert tree["runs/rare"].sizes["run"] * P_HALF_SPACE < 1


def test_inputs_may_depend_on_each_other_and_be_truncated(check):
    # P(a + b > 7) of a copula: both have a correlation of 0.5, so the sum a variance of 3.
    check(special.ndtr(-7 / math.sqrt(3)), "depth > 7 m", dependence=COPULA)
    cut = uqpen.Truncated(uqpen.Normal(0.0, 1.0), lower=-1.0, upper=4.5)
    share = special.ndtr(4.5) - special.ndtr(-1)
    exact = (special.ndtr(-4) - special.ndtr(-4.5)) / share
    check(exact, "depth > 4 m", inputs={"a": cut, "b": uqpen.Uniform(0.0, 1e-9)})


def test_it_is_conditional_on_admissible_draws(made):
    # Of a > 0 twice the probability of both signs, by symmetry less that of a <= 0.
    nodes, weights = np.polynomial.legendre.leggauss(200)
    a = 5 * (nodes + 1)
    density = np.exp(-(a**2) / 2) / math.sqrt(2 * math.pi)
    exact = 2 * float((5 * weights * density * special.ndtr(a - 5)).sum())
    found = probability(made("depth > 5 m", constraints=["a > 0"]))
    _, lower, upper = found.values
    assert lower <= exact <= upper
    assert found.attrs["conditional_on"] == "admissible inputs"


def test_two_distant_modes_are_both_met(check):
    def two(a, b):
        return {"depth": np.abs(a), "speed": b}

    check(2 * special.ndtr(-3.5), "depth > 3.5 m", two)


def test_all_or_any_limits_of_several_outputs(check):
    check(special.ndtr(-3 / math.sqrt(2)) ** 2, "depth > 3 m and speed > 3 m/s")
    tail = special.ndtr(-5 / math.sqrt(2))
    check(2 * tail - tail**2, "depth > 5 m or speed < -5 m/s")


def test_failed_runs_are_neither_safe_nor_in_the_event(made):
    def fails(a, b):
        # Beyond 3.5 the solver fails where b is above 0: half of the event is unknown.
        return {"depth": np.where((a > 3.5) & (b > 0), np.nan, a), "speed": b}

    found = probability(made("depth > 3 m", fails))
    known = special.ndtr(-3.0) - special.ndtr(-3.5) / 2
    estimate, lower, upper = found.values
    assert lower < known < estimate * 1.5
    assert upper > special.ndtr(-3.0)
    assert "for any outcome of the missing runs" in found.attrs["interval"]


def test_an_event_that_no_run_shows_has_no_number(made):
    def never(a, b):
        return {"depth": np.minimum(a, 1.0), "speed": b}

    found = probability(made("depth > 2 m", never))
    assert np.isnan(found.values).all()
    assert "no run shows the event" in found.attrs["note"]


def test_tables_json_and_page_have_it(tree, method):
    assert not list(find_faults(tree))
    table = next(each for each in output_tables(tree) if "joint probabilities" in each.title)
    assert any(row[0].startswith("P(depth > 5.65") for row in table.rows)
    (found,) = archive_json(tree)["designs"]["rare"]["joint_probabilities"].values()
    assert found["lower"] < P_HALF_SPACE < found["upper"]
    page = str(list(answer(ArchiveView(tree, "")))).lower()
    assert "by rare: in 0.00" in page
    unmet = {"subset-simulation": "replicate", "importance-sampling": "draw"}
    expected = "the surrogate alone says"
    if method in unmet:
        expected = f"parts of the event that no {unmet[method]} met are not in it"
    assert expected in page


MISTAKES = [
    ("subset-simulation", 'event = "depth"', 'an event such as "depth > 3 m"'),
    ("subset-simulation", 'event = "width > 3 m"', "an output that is a number"),
    ("subset-simulation", 'event = "depth > 3 kg"', '"3 kg"'),
    (
        "subset-simulation",
        'event = "depth > 3 m and speed < 1 m/s or depth < 1 m"',
        "not by both",
    ),
    ("subset-simulation", 'event = "depth > 3 m"\nsamples = 105', "a multiple of 10"),
    ("subset-simulation", 'event = "depth > 3 m"\nreplicates = 2', "at least 3"),
    ("importance-sampling", 'event = "depth > 3 m"\nsamples = 100', "at least 200"),
    ("importance-sampling", 'event = "depth > 3 m"\nstart = "gradient"', '"cross-entropy"'),
    ("active-learning", 'event = "width > 3 m"', "an output that is a number"),
    ("active-learning", 'event = "depth > 3 m"\nlearning = 10', "at least 20"),
    ("active-learning", 'event = "depth > 3 m"\ncorrection = 10', "at least 60"),
    ("active-learning", 'event = "depth > 3 m"\ncriterion = "u"', '"u-function"'),
    ("active-learning", 'event = "depth > 3 m"\ntolerance = 2', "below 1"),
    ("form", 'event = "depth > 3 kg"', '"3 kg"'),
]


@pytest.mark.parametrize(("kind", "settings", "expected"), MISTAKES)
def test_mistakes_are_met_before_a_run(tmp_path, kind, settings, expected):
    (tmp_path / "model.py").write_text("def model(a, b): raise SystemExit\n")
    text = STUDY.replace('depth = "m"', 'depth = "m", speed = "m/s"')
    (tmp_path / "study.toml").write_text(f'{text}kind = "{kind}"\n{settings}\n')
    with pytest.raises(uqpen.StudyError) as raised:
        uqpen.load_study(tmp_path / "study.toml")
    assert expected in str(raised.value)


@pytest.mark.slow
@pytest.mark.processor
@pytest.mark.parametrize(
    ("design", "stops", "depth"),
    [
        ('kind = "subset-simulation"\nevent = "depth > 5 m"\nsamples = 100', (14,), "a + b"),
        ('kind = "importance-sampling"\nevent = "depth > 5 m"\nsamples = 200', (5,), "a + b"),
        (
            'kind = "active-learning"\nevent = "depth > 7 m"\nlearning = 20\ncorrection = 60',
            (4,),
            "a + b + 0.1 * (a - b) ** 2",
        ),
    ],
)
def test_a_kill_at_any_round_and_workers_change_no_byte(tmp_path, design, stops, depth):
    check_interruptions_and_workers(tmp_path, f"{design}\n", stops=stops, depth=depth)
