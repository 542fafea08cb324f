"""A design that decides a claim on a probability: the test, when it ends, and what is reported."""

import itertools
import math
import re
from functools import cache

import numpy as np
import pytest
import xarray as xr
from interrupted_study import Interrupted
from study_text import study_text

import uqpen
from uqpen.archive.estimates import UnpackedStatistics, unpack
from uqpen.checkpoints.make_archive import make_archive
from uqpen.core.errors import QuantityError, SettingsError, StudyError
from uqpen.core.status import Status
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.stopping.acceptance_claim import (
    ClaimVerdict,
    decide,
    deciding_looks,
    log_evidence_below,
    parse_claim,
)
from uqpen.execution.processes import processes
from uqpen.report.sections.sentences import decision_findings
from uqpen.results.archive_view import ArchiveView
from uqpen.results.json import archive_json
from uqpen.results.long_table import long_table
from uqpen.results.output_tables import statistics_tables
from uqpen.statistics.stopped_runs import anytime_interval, decision_attributes, mark_uncertified
from uqpen.testing import check_design
from uqpen.verification.verify import verify

STUDY = study_text(
    "ishigami",
    seed=3,
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": 1},
    constraints={"keep": ["x1 < 2.9"]},
    designs={"one": {"kind": "monte-carlo"}},
)
# The probability is about 0.35.
HELD = 'accept = "P(y > 5) < 0.5"\nat_most = 5_000\n'
NEVER = 'accept = "P(y > 5) < 0.35"\nat_most = 300\n'


def study(settings=HELD):
    return uqpen.parse_study(STUDY + settings)


@cache
def tree(settings=HELD):
    return uqpen.run(study(settings))


def attributes(settings=HELD):
    return dict(tree(settings)["statistics/one"].attrs)


def boolean(values):
    return np.array(values, dtype=bool)


class TestLikelihoodRatio:
    @pytest.mark.parametrize("limit", [0.02, 0.2, 0.7])
    def test_nothing_can_be_won_against_a_true_answer(self, limit):
        # Of all sequences of runs: the wealth is a martingale at the limit, and falls above it.
        sequences = boolean(list(itertools.product([0, 1], repeat=9)))
        wealth = np.exp([log_evidence_below(each, limit)[-1] for each in sequences])
        events = sequences.sum(axis=1)
        for p, largest in ((limit, 1 + 1e-12), (limit + 0.1, 1 + 1e-12), (limit + 0.25, 1 + 1e-12)):
            weights = p**events * (1 - p) ** (9 - events)
            assert float(weights @ wealth) <= largest
        weights = limit**events * (1 - limit) ** (9 - events)
        assert float(weights @ wealth) == pytest.approx(1, abs=1e-12)

    def test_runs_without_an_event_decide_after_21(self):
        none = boolean(np.zeros(100))
        assert decide(none, none, 0.2, is_below=True) == (ClaimVerdict.HELD, 21)
        assert decide(none, none, 0.2, is_below=False) == (ClaimVerdict.NOT_HELD, 21)
        assert decide(none[:20], none[:20], 0.2, is_below=True) == (ClaimVerdict.UNDECIDED, 20)

    def test_missing_runs_count_against_either_answer(self):
        all_missing, none = boolean(np.ones(3_000)), boolean(np.zeros(3_000))
        for is_below in (True, False):
            found = decide(none, all_missing, 0.5, is_below=is_below)
            assert found.verdict is ClaimVerdict.UNDECIDED
        # Of runs without an event, three in ten are missing: below 0.2 is not known, below 0.6 is.
        some = np.arange(3_000) % 10 < 3
        assert decide(none, some, 0.2, is_below=True).verdict is ClaimVerdict.UNDECIDED
        assert decide(none, some, 0.6, is_below=True).verdict is ClaimVerdict.HELD

    def test_an_interval_for_any_time_has_the_limits_that_are_not_excluded(self):
        lower, upper = anytime_interval(30, 0, 200)
        assert 0.07 < lower < 0.15 < upper < 0.25
        assert anytime_interval(30, 20, 200) == (lower, anytime_interval(50, 0, 200)[1])
        assert anytime_interval(0, 5, 5) == (0, 1) == anytime_interval(0, 0, 0)
        # Without an event, the likelihood is (1 - p)^n; 19!! / 20!! is the mixture's of ten runs.
        mixture = math.prod((2 * i + 1) / (2 * i + 2) for i in range(10))
        assert anytime_interval(0, 0, 10) == (0, pytest.approx(1 - (mixture / 20) ** 0.1))


class TestClaims:
    @pytest.mark.parametrize("text", ["P(y > 5) < 0.2", " P ( y>5 )<20 % ", "P(y > 5.0) < 0.2"])
    def test_a_claim_is_read(self, text):
        claim = parse_claim(text)
        assert (claim.output, float(claim.value), claim.limit) == ("y", 5.0, 0.2)
        assert claim.is_above
        assert claim.is_less
        assert parse_claim(str(claim)) == claim

    @pytest.mark.parametrize(
        "text",
        ["", "y > 5", "P(y > 5)", "P(y >= 5) < 0.2", "P(y > 5) < 0", "P(y > 5) > 1", "P() < 1"],
    )
    def test_any_other_text_is_none(self, text):
        with pytest.raises(QuantityError):
            parse_claim(text)

    def test_inadmissible_runs_are_numbered_and_do_not_count(self):
        runs = xr.Dataset(
            {
                "y": ("run", [math.nan, *[1.0] * 30], {"units": "m"}),
                "status": ("run", [Status.INADMISSIBLE, *[Status.OK] * 30]),
            }
        )
        assert parse_claim("P(y > 200 cm) < 0.2").decide(runs) == (ClaimVerdict.HELD, 22)
        assert parse_claim("P(y < 200 cm) < 0.2").decide(runs).verdict is ClaimVerdict.NOT_HELD


class TestWhenItEnds:
    def test_a_round_adds_an_eighth(self):
        looks = list(deciding_looks(1_000))
        assert looks[:9] == [32, 64, 96, 128, 160, 192, 224, 256, 288]
        assert looks[-1] == 1_000
        assert max(np.diff(looks) / looks[:-1]) <= 1
        assert list(deciding_looks(10)) == [10]

    def test_in_the_round_of_the_decision(self):
        found = attributes()
        assert found["decision"] == "held"
        made = tree()["runs/one"].sizes["run"]
        assert made - 32 < found["decision_runs"] <= made
        assert found["decision_lower"] < 0.35 < found["decision_upper"] < 0.5

    @pytest.mark.parametrize(
        ("claim", "verdict"),
        [
            ("P(y > 5) > 0.5", "not held"),
            ("P(y < 5) > 0.5", "held"),
            ("P(y < 5) < 0.5", "not held"),
        ],
    )
    def test_the_same_runs_decide_each_form_of_the_question(self, claim, verdict):
        found = attributes(HELD.replace("P(y > 5) < 0.5", claim))
        assert (found["decision"], found["decision_runs"]) == (
            verdict,
            attributes()["decision_runs"],
        )

    def test_the_decision_does_not_depend_on_later_runs(self):
        runs = tree("runs = 500")["runs/one"].to_dataset()
        claim = parse_claim("P(y > 5) < 0.5")
        found = claim.decide(runs)
        assert found.runs == attributes()["decision_runs"]
        assert claim.decide(runs.isel(run=slice(found.runs))) == found
        assert claim.decide(runs.isel(run=slice(found.runs - 1))).verdict is ClaimVerdict.UNDECIDED

    def test_several_models_each_have_their_decision(self):
        two = '[models.calm]\nuse = "ishigami"\n[models.wild]\nuse = "ishigami"\na = 21.0\n'
        text = STUDY.replace('[model]\nuse = "ishigami"\n', two) + HELD
        made = uqpen.run(uqpen.parse_study(text))
        calm, wild = (made[f"models/{name}/statistics/one"].attrs for name in ("calm", "wild"))
        assert (calm["decision"], wild["decision"]) == ("held", "not held")
        assert calm["runs_spent"] == wild["runs_spent"]

    def test_the_design_meets_the_contract_of_designs(self):
        check_design(MonteCarlo(accept="P(y > 5) < 0.2", at_most=1_000))


@pytest.mark.processor
class TestSameBytes:
    def test_for_three_workers_and_after_an_interruption(self, tmp_path):
        alone, several, again = (tmp_path / f"{name}.nc" for name in ("alone", "several", "again"))
        make_archive(study(), alone)
        with processes(3) as workers:
            make_archive(study(), several, map=workers)
        with pytest.raises(KeyboardInterrupt):
            make_archive(study(), again, progress=Interrupted(2))
        make_archive(study(), again)
        assert alone.read_bytes() == several.read_bytes() == again.read_bytes()
        assert {check.verdict.name for check in verify(alone, runs=None)} == {"EQUAL"}


@pytest.mark.parametrize(
    ("settings", "key", "found", "expected"),
    [
        ('accept = "P(z > 5) < 0.5"\nat_most = 9', "accept", '"z"', "known: y"),
        ('accept = "P(y > 5 m) < 0.5"\nat_most = 9', "accept", '"5 m"', "a plain number"),
        ('accept = "P(y > 5) < 1.5"\nat_most = 9', "accept", '"1.5"', "above 0 and below 1"),
        ('accept = "y > 5"\nat_most = 9', "accept", '"y > 5"', "P(depth > 60 cm) < 0.2"),
        ("accept = 3\nat_most = 9", "accept", "3", "a claim such as"),
        ('accept = "P(y > 5) < 0.5"', "at_most", "nothing", "the largest number of runs"),
        ('accept = "P(y > 5) < 0.5"\nruns = 9', "runs", "9", "at_most, beside accept"),
        (
            "until = { y = { mean = 1 } }\nat_most = 9",
            "at_most",
            "9",
            "at least 1024, beside until",
        ),
    ],
)
def test_a_claim_that_makes_no_sense_is_reported_before_any_run(settings, key, found, expected):
    with pytest.raises(StudyError) as caught:
        study(settings)
    (problem,) = caught.value.problems
    assert (problem.key, problem.found) == (f"designs.one.{key}", found)
    assert expected in problem.expected
    assert re.search(r"study\.toml:1\d ", str(caught.value))


def test_one_rule_at_a_time():
    rule = uqpen.Precision({"y": {"mean": 1}})
    with pytest.raises(SettingsError, match="until or accept, not both"):
        MonteCarlo(until=rule, accept="P(y > 5) < 0.2", at_most=2_000)


@pytest.mark.parametrize("kind", ["latin-hypercube", "sobol-sequence", "halton", "saltelli"])
def test_designs_whose_points_depend_on_each_other_are_refused(kind):
    size = "base = 64" if kind == "saltelli" else "runs = 1600"
    text = (STUDY + HELD).replace("monte-carlo", kind).replace("at_most = 5_000", size)
    with pytest.raises(StudyError) as caught:
        uqpen.parse_study(text)
    problem = next(each for each in caught.value.problems if each.key == "designs.one.accept")
    assert "the test needs independent runs" in problem.expected


class TestShown:
    def test_in_the_tables_with_its_guarantee(self):
        (table,) = statistics_tables(tree())
        made = attributes()["decision_runs"]
        row = dict(table.rows)["P(y > 5) < 0.5"]
        assert row[0].startswith(f"held after {made} runs ")
        assert any("a wrong answer has a probability of at most 5" in note for note in table.notes)

    def test_in_json(self):
        found = archive_json(tree(NEVER))["designs"]["one"]["decision"]
        assert (found["verdict"], found["runs"], found["error"]) == ("undecided", 300, 0.05)
        assert found["lower"] < found["probability"] < found["upper"]

    def test_on_the_page(self):
        (finding,) = decision_findings(ArchiveView(tree(), ""))
        assert finding[0].startswith("P(y > 5) < 0.5")
        assert finding[1].startswith("Held after ")
        assert "an interval that holds whenever one stops" in finding[1]

    def test_in_the_long_table_with_its_own_interval(self):
        asked = STUDY.replace("[constraints]", "[outputs.y]\nexceeds = [5, 6]\n[constraints]")
        made = uqpen.run(uqpen.parse_study(asked + NEVER))
        table = long_table(made).set_index(["statistic", "coordinates"]).sort_index()
        decision = table.loc[("decision", "P(y > 5) < 0.35")]
        assert decision["lower"] < decision["estimate"] < decision["upper"]
        assert decision["note"].startswith("undecided after 300 runs; a wrong answer has ")
        five, six = (table.loc[("exceedance", f"threshold={limit}")] for limit in (5, 6))
        assert five["estimate"] == decision["estimate"]
        assert math.isnan(five["lower"])
        assert math.isnan(five["upper"])
        assert five["note"] == "its interval is that of the decision"
        assert "not certified" in six["note"]
        # Thresholds are numbers beside their labels.
        assert [five["threshold_value"], six["threshold_value"]] == [5.0, 6.0]

    def test_every_interval_for_a_fixed_number_is_marked(self):
        found = UnpackedStatistics(tree()["statistics/one/y"].to_dataset())
        for array in (each for each in found.values() if "interval_label" in each.coords):
            has_interval = np.ravel(array["interval_label"].values) != "none"
            is_marked = ["not certified" in note for note in np.ravel(array["note"].values)]
            assert np.array_equal(is_marked, has_interval)


def test_attributes_that_cannot_be_read_decide_and_certify_nothing():
    runs = tree("runs = 100")["runs/one"].to_dataset()
    assert decision_attributes(runs) == {}
    assert decision_attributes(runs.assign_attrs(stopping_claim="P(")) == {}
    assert decision_attributes(runs.assign_attrs(stopping_claim="P(z > 1) < 0.5")) == {}
    mean = unpack(tree("runs = 100")["statistics/one/y"].to_dataset(), "mean")
    assert mean is not None
    for written in ("[", "3", '[["y"], 3]'):
        marked = mark_uncertified({"y": {"mean": mean}}, {"stopping_statistics": written})
        assert "not certified" in str(marked["y"]["mean"]["note"].values)
