"""The main results: sentences with the archive's numbers, their design, their caveats."""

import pytest

import uqpen
from uqpen.archive.read import read_group
from uqpen.report.blocks import Alerts, Columns, Findings, Fold, Quote, Table, Text
from uqpen.report.sections.answer import answer
from uqpen.results.archive_view import ArchiveView

pytestmark = pytest.mark.slow

DESIGNS = {
    "morris": 'kind = "morris"\ntrajectories = 4',
    "quadrature": 'kind = "quadrature"\norder = 3',
    "saltelli": 'kind = "saltelli"\nbase = 64',
    "monte_carlo": 'kind = "monte-carlo"\nruns = 5',
}


def _texts(blocks):
    """All sentences, with plain spaces."""
    found = []
    for block in blocks:
        match block:
            case Quote(sentences):
                found += sentences
            case Text(text):
                found.append(text)
            case Findings(entries):
                found += [f"{entry.head}: {entry.text}" for entry in entries]
            case Alerts(alerts):
                found += [" ".join(alert) for alert in alerts]
            case Columns(columns):
                found += _texts(columns)
            case Fold(title, folded):
                found += [title, *_texts(folded)]
    return [text.replace("\u00a0", " ").replace("\u202f", " ") for text in found]


def _reported(tree, model=""):
    return _texts(answer(ArchiveView(tree, model)))


def _reported_of_sum(study_of, text):
    """What is said of a + b."""
    return _reported(uqpen.run(study_of("a + b", text, a=(0.0, 1.0), b=(0.0, 2.0))))


def _alerts(tree):
    """The kinds of the alerts, in their order."""
    (found,) = (each for each in answer(ArchiveView(tree, "")) if isinstance(each, Alerts))
    assert all(each.remedy.endswith(".") for each in found.alerts)
    return [each.about for each in found.alerts]


def test_the_first_screen_answers_one_question_after_the_other(archives):
    tree = archives["schema_1"]
    assert _reported(tree)[:8] == [
        "y above 10: In 2.0 % of cases (0.4 % to 7.7 %, 95 % interval, as from 130 plain runs).",
        "y is at most 11.5 in 80 of 100 cases. Best estimate 5.9; the 11.5 allow for the finite "
        "number of runs (95 % confidence).",
        "The median of y is 3.09 (2.53 to 3.70, 95 % interval, as from 430 plain runs): half of "
        "all cases lie below.",
        "By monte_carlo, the first sample of the inputs in the study: 19 of 20 runs of the model "
        "ishigami 0.1.0 completed. Figures “as from plain runs” are by chaos, corrected by 60 "
        "runs.",
        "What drives it?: x1 causes about nine tenths of the variance of y by itself (0.8861 by "
        "blocks, without an interval). Next: x2 (0.6170).",
        "Did all runs succeed?: All 19 runs at admissible points completed. 1 point of 20 was "
        "inadmissible.",
        "Does it agree with published values?: Against a report, its value first. y: mean agrees "
        "(3.5, 3.7 (2.0 … 5.5)); standard deviation uncertain (3.7, 2.995 without an interval).",
        "Do the other methods agree?: Yes, 2 other designs within their intervals. y, limit for "
        "80 % of cases: 5.5 to 6.9; P(> 10): 2.0 % to 6.2 %; median: 2.59 to 3.09.",
    ]
    held = read_group(tree, "statistics", "monte_carlo", "y")["tolerance_limit"].values[0]
    assert (f"{held[0]:.1f}", f"{held[2]:.1f}") == ("5.9", "11.5")
    exceeded = read_group(tree, "statistics", "chaos", "y")["exceedance"].values[0]
    assert [f"{100 * bound:.1f}" for bound in exceeded] == ["2.0", "0.4", "7.7"]
    assert _alerts(tree) == ["Precision", "Inadmissible", "Scope"]


def test_failed_runs_are_counted_once_and_for_the_inputs_that_go_with_them(archives):
    said = _reported(archives["beam"])
    assert said[:2] == [
        "Deflection above 2 mm: In all 98 completed runs: at least 73 % of cases (95 % interval).",
        "The median of deflection is 3.66 mm (3.52 mm to 3.91 mm, 95 % interval): half of all "
        "cases lie below.",
    ]
    assert said[4] == (
        "Did all runs succeed?: 22 of 120 runs failed, mainly where load is high. Intervals of "
        "probabilities hold even if all of these were beyond a limit, or none; all other numbers "
        "describe the 98 completed runs."
    )
    assert _alerts(archives["beam"]) == ["Failed runs", "Precision", "Scope"]


def test_the_picture_has_the_limits_of_the_study(archives):
    (columns, *_) = answer(ArchiveView(archives["schema_1"], ""))
    assert isinstance(columns, Columns)
    assert columns.picture.title == "y: 19 runs of monte_carlo"
    ends = columns.picture.x.ends
    assert ends is not None
    is_shown = ends[0] <= 10 <= ends[1]
    assert ("limit 10" in [key.text for key in columns.picture.keys]) == is_shown


def test_a_picture_of_runs_says_so_beside_the_sentences_of_a_surrogate(concrete, archives):
    reported = {}
    for name, tree in (("concrete", concrete), ("beam", archives["beam"])):
        (columns, *_) = answer(ArchiveView(tree, ""))
        assert isinstance(columns, Columns)
        reported[name] = " ".join(columns.picture.notes)
    assert "intervals of the marked estimates, of these runs alone." in reported["concrete"]
    assert "alone" not in reported["beam"]


def test_the_largest_part_that_a_publication_names_is_compared(concrete):
    reported = " ".join(_reported(concrete))
    assert "Outer radius of plastic flow in the target causes about " in reported
    assert "of the variance of depth of penetration by itself (" in reported
    assert "the largest contribution differs (target yield limit, which has " in reported
    assert "Depth of penetration: mean agrees (0.493 m, " in reported
    assert len(_alerts(concrete)) <= 5


@pytest.mark.parametrize(("runs", "times"), [(1500, 1), (2500, 0)])
def test_what_all_means_of_few_runs_have_in_common_is_said_once(study_of, runs, times):
    text = f'[designs.some]\nkind = "monte-carlo"\nruns = {runs}'
    tree = uqpen.run(study_of("a + b", text, a=(0.0, 1.0), b=(0.0, 2.0)))
    assert _alerts(tree) == ["Scope"]
    assert (
        " ".join(_reported(tree)).count("extreme values are more frequent than in these") == times
    )


def test_a_single_run_is_reported_in_the_singular(study_of):
    text = '[designs.some]\nkind = "monte-carlo"\nruns = 1'
    reported = _reported_of_sum(study_of, text)
    assert reported[1].endswith("in the study: a single run of the model line.py:f.")
    assert "Did all runs succeed?: The only run completed." in reported
    assert "Events rarer" not in reported[-1]


def test_an_output_that_is_the_same_in_all_runs_has_no_interval_to_read(study_of):
    text = "".join(
        f'[designs.{name}]\nkind = "monte-carlo"\nruns = 10\n' for name in ("some", "other")
    )
    reported = _reported(uqpen.run(study_of("0 * a + 2", text, a=(0.0, 1.0))))
    assert reported[0] == "y is 2 in every run."
    said = "Yes, 1 other design within their intervals. y, median: 2."
    assert f"Do the other methods agree?: {said}" in reported


def test_where_no_run_came_back_there_is_no_answer(archives):
    (block,) = answer(ArchiveView(archives["lost"], ""))
    assert block == Text(
        "No run completed, so there are no estimates. All 120 runs failed. The reason: "
        '“ValueError: too heavy (beam.py, line 4: raise ValueError("too heavy"))” '
        "(failed, 120 runs). Mend the model, raise its time limit, or "
        "change the inputs to values that it allows; then run the study again. The archive has "
        "the inputs of every failed run, so you can try a single one."
    )


def test_of_several_models_the_differences_stand_first(archives):
    tree = archives["rods"]
    reported = _reported(tree, "original")
    assert reported[0].startswith("smoothed minus original: Mean difference: depth of penetration ")
    assert reported[1].startswith("rigid minus original: Mean difference: depth of penetration ")
    assert reported[2].startswith(
        "How much is model form?: Of the variance of depth of penetration, "
    )
    assert reported[3].startswith("Did all runs succeed?: original: ")
    at = [reported.index(f"By {model} alone") for model in ("original", "smoothed", "rigid")]
    first, other = reported[at[0] : at[1]], reported[at[2] :]
    assert first[1].startswith("Depth of penetration above 60 cm: In 11.0 % of cases (")
    assert other[1].startswith(
        "Depth of penetration above 60 cm: In all 100 completed runs: at least "
    )
    assert any(text.startswith("How erosion ends: “v = u” in 63.0 % of cases") for text in first)
    assert any(text.startswith("How erosion ends: “rigid” in 100.0 % of cases") for text in other)
    blocks = answer(ArchiveView(tree, "original"))
    tables = [each.table for each in blocks if isinstance(each, Table)]
    assert {each.title: [row for row, _ in each.rows] for each in tables} == {
        "Depth of penetration by model, latin": ["P(> 60 cm)", "P(> 90 cm)", "Median [cm]"],
        "Other outputs by model, latin": [
            "Length of projectile left, median [m]",
            "Depth at which erosion ends, median [m]",
        ],
    }
    # Of a length that never changes there is no median to read.
    assert any(
        text.startswith("Length of projectile left is 0.16 m in every run") for text in other
    )


@pytest.mark.parametrize(
    ("design", "said"),
    [
        (
            "morris",
            [
                "No design of this study is a sample of its inputs, so the distributions of the "
                "outputs and all probabilities are unknown. The results of its designs are "
                "further down."
            ],
        ),
        (
            "quadrature",
            [
                "By the integration rule some, the mean of y is 1.5 (without an interval: a "
                "quadrature rule has no scatter, so its error is unknown)."
            ],
        ),
        (
            "saltelli",
            [
                "By some, a design for sensitivity indices; two of its matrices are a sample of "
                "the inputs, and no other sample of the study has a completed run: all of "
            ],
        ),
        (
            "monte_carlo",
            [
                "in 99 of 100 cases, by estimate alone. No bound is known: an upper bound needs at "
                "least 299 runs.",
                # The third limit has no room among the first ones, and stands below them.
                "y above 3: In none of 5 completed runs: at most ",
            ],
        ),
    ],
)
def test_what_a_design_cannot_tell_is_said(study_of, design, said):
    asked = '[outputs.y]\nhold = [0.99]\nexceeds = ["1", "2", "3"]'
    text = f"{asked}\n[designs.some]\n{DESIGNS[design]}"
    reported = " ".join(_reported_of_sum(study_of, text))
    for each in said:
        assert each in reported


def test_every_entry_that_a_study_asks_for_is_stated(study_of):
    asked = (
        "[outputs.y]\nexceeds = [1]\nbelow = [0.1]\nquantiles = [0.9]\nhold = [0.9, 0.95]\n"
        "hold_above = [0.9]\nhold_between = [0.9]\nexpected_shortfall = [0.9]\n"
        "return_periods = [50]"
    )
    text = f'{asked}\n[designs.some]\nkind = "monte-carlo"\nruns = 2000'
    reported = " ".join(_reported_of_sum(study_of, text))
    for said in (
        "y above 1: In ",
        "y below 0.1: In ",
        "The 90 % quantile of y is ",
        "in 90 of 100 cases. Best estimate",
        "in 95 of 100 cases. Best estimate",
        "y is at least ",
        "y is from ",
        "Beyond its 90 % quantile, the mean of y is ",
        "exceeded once in 50 cases: No estimate: the tail ends so abruptly",
    ):
        assert said in reported


def test_only_some_of_many_outputs_have_sentences():
    names = [f"y{number}" for number in range(8)]
    study = uqpen.Study(
        model=lambda x: dict.fromkeys(names, x),
        inputs={"x": uqpen.Uniform(0, 1)},
        outputs={**dict.fromkeys(names, "1"), "y7": uqpen.OutputSpec("1", exceeds=["0.5"])},
        designs={"some": uqpen.MonteCarlo(runs=20)},
        seed=1,
    )
    reported = _reported(uqpen.run(study))
    # What was asked comes first.
    assert reported[0].startswith("y7 above 0.5: In ")
    assert sum(text.startswith("The median of ") for text in reported) == 6
    assert any(text.endswith("Further down: 2 more outputs.") for text in reported)
