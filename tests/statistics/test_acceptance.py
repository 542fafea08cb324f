"""Acceptance limits of probabilities, and whether the runs meet them."""

import json

import numpy as np
import pytest

import uqpen
from uqpen.archive.estimates import estimate_array
from uqpen.archive.structure import find_faults
from uqpen.core.statistic import AcceptanceVerdict
from uqpen.report.sections.answer import answer
from uqpen.results.acceptance import Acceptance
from uqpen.results.archive_view import ArchiveView
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.statistics.quantity_of_interest import AcceptanceLimits
from uqpen.study.summary import output_rows

NAN = float("nan")


def probability(lower, upper, **limits):
    texts = dict.fromkeys(("interval", "interval_label", "note"), "")
    values = [(lower + upper) / 2, lower, upper]
    own = {f"threshold_{name}": limit for name, limit in limits.items()}
    return estimate_array(values, {}, texts, units="1", long_name="p", coordinates=own)


@pytest.mark.parametrize(
    ("bounds", "limits", "verdict"),
    [
        ((0.1, 0.2), {"at_most": 0.2}, AcceptanceVerdict.MET),
        ((0.1, 0.2), {"at_most": 0.15}, AcceptanceVerdict.NOT_DECIDED),
        ((0.1, 0.2), {"at_most": 0.05}, AcceptanceVerdict.NOT_MET),
        ((0.1, 0.2), {"at_least": 0.1}, AcceptanceVerdict.MET),
        ((0.1, 0.2), {"at_least": 0.11}, AcceptanceVerdict.NOT_DECIDED),
        ((0.1, 0.2), {"at_least": 0.3}, AcceptanceVerdict.NOT_MET),
        ((0.1, 0.2), {"at_least": 0.05, "at_most": 0.3}, AcceptanceVerdict.MET),
        ((0.1, 0.2), {"at_least": 0.12, "at_most": 0.18}, AcceptanceVerdict.NOT_DECIDED),
        ((NAN, NAN), {"at_most": 0.2}, AcceptanceVerdict.NOT_DECIDED),
        ((0.0, 0.0), {"at_most": 0.0}, AcceptanceVerdict.MET),
    ],
)
def test_the_verdict_is_that_of_the_whole_interval(bounds, limits, verdict):
    found = Acceptance.from_array(probability(*bounds, **limits))
    assert found is not None
    assert found.verdict is verdict


def test_without_limits_there_is_no_verdict():
    assert Acceptance.from_array(probability(0.1, 0.2)) is None
    assert Acceptance.from_array(probability(0.1, 0.2, at_most=NAN)) is None


def test_limits_are_reported_in_per_cent():
    for limits, text in (
        ({"at_most": 0.2}, "at most 20 %"),
        ({"at_least": 0.999}, "at least 99.9 %"),
        ({"at_least": 0.1, "at_most": 0.2}, "at least 10 % and at most 20 %"),
        ({"at_most": 1.0}, "at most 100 %"),
    ):
        assert str(Acceptance.from_array(probability(0.1, 0.2, **limits))) == text


@pytest.fixture(scope="module")
def tree():
    study = uqpen.Study(
        uqpen.PythonModel(lambda a, b: {"y": a + b}, {"a": "m", "b": "m"}, {"y": "m"}, True),
        {"a": uqpen.Uniform("0 m", "1 m"), "b": uqpen.Uniform("0 m", "1 m")},
        {
            "y": uqpen.OutputSpec(
                "m",
                # One half; the others are far from their limits.
                exceeds={"1 m": {"at_most": "50 %"}, "1.5 m": {"at_most": 0.4}, "1.9 m": {}},
                below={"1.5 m": {"at_least": 0.95}},
            )
        },
        {"mc": uqpen.MonteCarlo(runs=400), "lhs": uqpen.LatinHypercube(runs=100)},
        surrogates={"pce": uqpen.PolynomialChaos(design="lhs")},
        seed=1,
    )
    return uqpen.run(study)


def test_the_archive_keeps_the_limits(tree):
    assert list(find_faults(tree)) == []
    statistics = tree["statistics/mc/y"]
    np.testing.assert_array_equal(statistics["threshold_at_most"], [0.5, 0.4, np.nan])
    assert "threshold_at_least" not in statistics.coords
    np.testing.assert_array_equal(statistics["lower_threshold_at_least"], [0.95])


def test_tables_and_json_have_the_verdicts(tree):
    rows = dict(row for table in output_tables(tree) for row in table.rows)
    assert rows["accepted: at most 50 %"][0] == "not decided"
    assert rows["accepted: at most 40 %"] == ["met", "met", "met"]
    assert rows["accepted: at least 95 %"][0] == "not met"
    reported = json.loads(json.dumps(archive_json(tree)))["designs"]["mc"]["outputs"]["y"]
    assert (
        reported["exceedance"]["1.5 m"]["at_most"],
        reported["exceedance"]["1.5 m"]["verdict"],
    ) == (0.4, "met")
    assert "verdict" not in reported["exceedance"]["1.9 m"]
    assert reported["below"]["1.5 m"]["verdict"] == "not met"


def test_the_page_says_whether_they_are_met(tree):
    page = str(list(answer(ArchiveView(tree, "")))).replace("\\xa0", " ").replace("\u00a0", " ")
    assert (
        "These runs do not decide whether the limit of the study, at most 50 %, is met: the "
        "interval contains it." in page
    )
    assert "The limit of the study, at most 40 %, is met: the whole interval lies within" in page


def test_the_study_states_them_in_its_text_and_its_summary(study_of):
    text = '[outputs.y]\nexceeds = { "0.5" = { at_most = "5 %" }, "2" = {} }'
    study = study_of("a", text, a=(0, 1))
    assert dict(output_rows(study))["y"].endswith("P(> 0.5), at most 0.05; P(> 2)")
    first, other = study.quantities_of_interest[0].thresholds
    assert (first.text, first.accepted) == ("0.5", AcceptanceLimits(at_most=0.05))
    assert other.accepted == AcceptanceLimits()


@pytest.mark.parametrize(
    ("written", "place", "found", "expected"),
    [
        ('{ "0.5" = 0.1 }', "exceeds.0.5", "0.1", "a table such as { at_most = 0.05 }"),
        ('{ "0.5" = { at_most = 5 } }', "at_most", "5", 'such as 0.05 or "5 %"'),
        ('{ "0.5" = { at_most = "5 m" } }', "at_most", '"5 m"', "a plain number"),
        ('{ "0.5" = { most = 0.5 } }', "most", "an unknown key", "at_most or at_least"),
        ('{ "2 m" = {} }', "exceeds.2 m", '"2 m"', "a plain number"),
        (
            '{ "0.5" = { at_most = 0.1, at_least = 0.2 } }',
            "at_most",
            "0.1, less than at_least",
            "at least that of at_least",
        ),
        ('{ "0.5" = {}, " 0.5" = {} }', "exceeds. 0.5", "a second time", "each threshold once"),
    ],
)
def test_a_mistake_is_reported_with_its_place(study_of, written, place, found, expected):
    with pytest.raises(uqpen.StudyError) as caught:
        study_of("a", f"[outputs.y]\nexceeds = {written}", a=(0, 1))
    for part in (place, found, expected, "study.toml:12"):
        assert part in str(caught.value)
