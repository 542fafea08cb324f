"""Probabilities of events that concern several outputs."""

import numpy as np
import pytest
from scipy import special

import uqpen
from uqpen.archive.structure import find_faults
from uqpen.report.sections.answer import answer
from uqpen.results.archive_view import ArchiveView
from uqpen.results.json import archive_json
from uqpen.results.long_table import long_table
from uqpen.results.output_tables import output_tables
from uqpen.statistics.joint_probability import joint_probabilities


def model(a, b):
    return {"depth": np.where(a > 0.97, np.nan, a), "width": (a + b) / 2, "rest": 1 - a}


def study(events):
    return uqpen.Study(
        uqpen.PythonModel(
            model, {"a": "1", "b": "1"}, {"depth": "m", "width": "m", "rest": "m"}, vectorized=True
        ),
        {"a": uqpen.Uniform(0, 1), "b": uqpen.Uniform(0, 1)},
        designs={"mc": uqpen.MonteCarlo(runs=200), "sobol": uqpen.SobolSequence(runs=256)},
        joint_probabilities=events,
        seed=1,
    )


EVENTS = {
    "safe": ["depth < 60 cm", "width < 0.5 m"],
    "unsafe": {"any": ["depth > 60 cm", "width > 0.5 m"], "at_most": "10 %"},
    # The output "rest" is the complement of "depth", so that this never occurs.
    "never": {"all": ["depth > 0.7 m", "rest > 0.7 m"], "at_most": 0.2},
}


@pytest.fixture(scope="module")
def tree():
    return uqpen.run(study(EVENTS))


def probabilities(tree, design="mc"):
    return tree[f"joint_probabilities/{design}"]["joint_probability"]


def test_the_interval_is_the_exact_binomial_one_for_any_outcome_of_failed_runs(tree):
    runs = tree["runs/mc"]
    done = runs["status"].values == 0
    depth, width = runs["depth"].values[done], runs["width"].values[done]
    occurs = int(((depth < 0.6) & (width < 0.5)).sum())
    failed, every = int((~done).sum()), len(done)
    assert failed > 0
    assert probabilities(tree).sel(event="safe").values == pytest.approx(
        [
            occurs / done.sum(),
            special.betaincinv(occurs, every - occurs + 1, 0.025),
            special.betaincinv(occurs + failed + 1, every - occurs - failed, 0.975),
        ]
    )


def test_all_hold_or_any_is_exceeded_are_complements(tree):
    for design in ("mc", "sobol"):
        found = probabilities(tree, design)
        safe, unsafe = found.sel(event="safe").values, found.sel(event="unsafe").values
        assert unsafe == pytest.approx([1 - safe[0], 1 - safe[2], 1 - safe[1]])


CONDITIONAL = {
    "deep": {"all": ["depth > 0.6 m"], "given": ["width > 0.5 m"], "at_most": 0.9},
    "impossible": {"all": ["depth > 0.6 m"], "given": {"any": ["width > 2 m"]}},
}


@pytest.fixture(scope="module")
def conditional():
    return uqpen.run(study(CONDITIONAL))


def test_a_conditional_probability_is_exact_given_the_number_of_its_runs(conditional):
    runs = conditional["runs/mc"]
    done = runs["status"].values == 0
    depth, width = runs["depth"].values[done], runs["width"].values[done]
    counted = width > 0.5
    occurs, every = int((depth[counted] > 0.6).sum()), int(counted.sum())
    failed = int((~done).sum())
    found = probabilities(conditional).sel(event="deep")
    note = archive_json(conditional)["designs"]["mc"]["joint_probabilities"]["deep"]["note"]
    # A failed run may meet the condition without the event, or with it.
    assert found.values == pytest.approx(
        [
            occurs / every,
            special.betaincinv(occurs, every + failed - occurs + 1, 0.025),
            special.betaincinv(occurs + failed + 1, every - occurs, 0.975),
        ]
    )
    assert f"of the {every} runs that meet the condition" in note


def test_replicates_give_a_conditional_probability_as_a_ratio(conditional):
    # Above the line a + b = 1, of a < 0.97: 0.97 - 0.97 * (1 - 0.97 / 2); of it where a > 0.6.
    exact = (0.37 - (0.4**2 - 0.03**2) / 2) / (0.97 - (1 - 0.03**2) / 2)
    value, lower, upper = probabilities(conditional, "sobol").sel(event="deep").values
    assert lower <= exact <= upper
    assert value == pytest.approx(exact, abs=0.09)  # two standard errors of 120 runs


def test_a_condition_that_no_run_meets_gives_no_number(conditional):
    reported = archive_json(conditional)["designs"]["mc"]["joint_probabilities"]["impossible"]
    assert reported["estimate"] is None
    assert reported["note"] == "no completed run meets the condition: width > 2 m"
    assert reported["condition"] == "depth > 0.6 m, given width > 2 m"


def test_a_conditional_probability_by_blocks_is_the_same(conditional):
    runs = conditional["runs/sobol"].to_dataset()
    events = study(CONDITIONAL).joint_events
    whole, by_blocks = (
        joint_probabilities(runs, events, 0.95, in_memory=size)["joint_probability"]
        for size in (1000, 64)
    )
    # Sums of whole numbers in another order: a few roundings apart.
    np.testing.assert_allclose(by_blocks.values, whole.values, rtol=1e-9)
    assert by_blocks["note"].values.tolist() == whole["note"].values.tolist()


def test_outputs_occur_together(tree):
    never = probabilities(tree).sel(event="never").values
    assert never[:2].tolist() == [0.0, 0.0]
    # Half of the unit square below the line a + b = 1, without the corner at a > 0.6, of a < 0.97.
    exact = (0.5 - 0.4**2 / 2) / 0.97
    assert float(probabilities(tree, "sobol").sel(event="safe")[0]) == pytest.approx(
        exact, abs=0.02
    )


def test_archive_tables_json_and_the_long_table_agree(tree):
    assert list(find_faults(tree)) == []
    found = probabilities(tree)
    assert found["event_condition"].values.tolist() == [
        "depth < 60 cm and width < 0.5 m",
        "depth > 60 cm or width > 0.5 m",
        "depth > 0.7 m and rest > 0.7 m",
    ]
    reported = archive_json(tree)["designs"]["mc"]["joint_probabilities"]
    assert reported["safe"]["estimate"] == float(found[0, 0])
    assert reported["unsafe"]["condition"] == "depth > 60 cm or width > 0.5 m"
    assert (reported["unsafe"]["verdict"], reported["never"]["verdict"]) == ("not met", "met")
    table = next(each for each in output_tables(tree) if each.title == "joint probabilities")
    rows = dict(table.rows)
    assert table.columns == ["mc", "sobol"]
    assert rows["accepted: at most 10 %"] == ["not met", "not met"]
    assert "depth < 60 cm and width < 0.5 m" in table.notes
    frame = long_table(tree).query("source == 'mc' and statistic == 'joint_probability'")
    assert frame["estimate"].tolist() == found.values[:, 0].tolist()
    assert frame["event"].tolist() == ["safe", "unsafe", "never"]


def test_the_page_has_a_sentence_of_each(tree, conditional):
    page, other = (
        str(list(answer(ArchiveView(each, "")))).replace("\\xa0", " ")
        for each in (tree, conditional)
    )
    said = "In 46.8 % of cases (37.5 % to 56.6 %, 95 % interval)."
    assert f"head='Depth < 60 cm and width < 0.5 m', text='{said}'" in page
    assert "(without an interval: no completed run meets the condition: width > 2 m)." in other
    assert "The limit of the study, at most 10 %, is not met: the whole interval lies" in page


@pytest.mark.parametrize(
    ("written", "place", "found", "expected"),
    [
        (["depth <= 60 cm"], "safe[0]", '"depth <= 60 cm"', 'such as "depth < 60 cm"'),
        (["dept < 60 cm"], "safe[0]", '"dept"', 'did you mean "depth"'),
        (["depth < 60 kg"], "safe[0]", '"60 kg"', "a length"),
        ([], "safe", "an empty list", 'such as "depth < 60 cm"'),
        ("depth < 60 cm", "safe", '"depth < 60 cm"', "a list of limits"),
        ({"at_most": 0.1}, "safe", "neither all nor any", "a list of limits"),
        ({"any": ["depth > 1 m"], "most": 1}, "safe.most", "an unknown key", "at_most"),
        ({"any": [3]}, "safe.any[0]", "3", 'such as "depth < 60 cm"'),
    ],
)
def test_a_mistake_is_reported_with_its_place(written, place, found, expected):
    with pytest.raises(uqpen.StudyError) as caught:
        study({"safe": written})
    for part in (f"joint_probabilities.{place}", found, expected):
        assert part in str(caught.value)
