"""A design that stops at a wanted precision: when, with which runs, and what is refused."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from interrupted_study import Interrupted
from study_text import study_text

import uqpen
from uqpen.archive.estimates import UnpackedStatistics
from uqpen.checkpoints.make_archive import make_archive
from uqpen.core.errors import SettingsError, StudyError
from uqpen.core.lookup import resolve
from uqpen.core.model import Output
from uqpen.core.sampling import Sampling
from uqpen.core.streams import BLOCK, Stream
from uqpen.designs.drawn_points import points_in_memory
from uqpen.designs.feedback import Feedback
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.rounds import no_estimates, run_rounds
from uqpen.designs.stopping import STOPPING_RULES
from uqpen.designs.stopping.precision import Precision
from uqpen.designs.stopping.stopping_rule import doubling_looks
from uqpen.execution import Progress
from uqpen.execution.processes import processes
from uqpen.report.blocks import Remarks
from uqpen.report.sections.comparisons import convergence
from uqpen.results.archive_view import ArchiveView
from uqpen.results.json import archive_json
from uqpen.results.output_tables import statistics_tables
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold
from uqpen.statistics.running_estimates import RunningEstimates
from uqpen.study.summary import design_rows, runs_text
from uqpen.testing import check_design, check_stopping_rule, example_joint_distribution
from uqpen.verification.verify import verify
from uqpen.workflow import run_design

STUDY = study_text(
    "ishigami",
    seed=3,
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": 1},
    constraints={"keep": ["x1 < 2.9"]},
    outputs={"y": {"exceeds": [5], "below": [0]}},
    designs={"one": {"kind": "monte-carlo"}},
)
MARK = "not certified"
UNTIL = 'until = { y = { mean = "4 %", exceeds = { 5 = "4 %" } } }\nat_most = 20_000\n'
EARLY = "until = { y = { mean = 0.4 } }\nat_most = 20_000"
NEVER = "until = { y = { mean = 1e-6 } }\nat_most = 1_500"


def study(settings=UNTIL):
    return uqpen.parse_study(STUDY + settings)


@cache
def made(settings=UNTIL):
    return uqpen.run(study(settings))


def half_width(array):
    _, lower, upper = array.values.ravel()
    return float(upper - lower) / 2


class TestWhenItStops:
    def test_looks_double(self):
        assert list(doubling_looks(5_000)) == [512, 1024, 2048, 4096, 5_000]
        assert list(doubling_looks(2_048)) == [512, 1024, 2048]

    def test_at_the_first_look_that_is_precise_enough(self):
        runs = made()["runs/one"].sizes["run"]
        assert runs in (1024, 2048, 4096)
        for number, is_enough in ((runs // 2, False), (runs, True)):
            found = made(f"runs = {number}")["statistics/one/y"]
            within = half_width(found["mean"]) <= 0.04 * float(found["mean"][0])
            assert (within and half_width(found["exceedance"]) <= 0.04) == is_enough

    def test_the_runs_are_those_of_a_design_of_that_size(self):
        tree = made()
        plain = made(f"runs = {tree['runs/one'].sizes['run']}")
        runs = tree["runs/one"].to_dataset().drop_vars("round")
        rule = ("stopping_rule", "stopping_note", "stopping_at_most", "stopping_statistics")
        assert all(runs.attrs.pop(name) for name in rule)
        assert runs.identical(plain["runs/one"].to_dataset())
        for path in ("statistics/one", "failures/one"):
            assert tree[path].to_dataset().identical(plain[path].to_dataset())
        found, same = (
            UnpackedStatistics(each["statistics/one/y"].to_dataset()) for each in (tree, plain)
        )
        assert found.keys() == same.keys()
        for name, array in same.items():
            assert np.array_equal(found[name].values, array.values, equal_nan=True)

    def test_only_the_intervals_that_decided_are_unmarked(self):
        wanted = (
            'until = { y = { quantile_95 = "9 % of sd", mean = "9 % of sd", '
            'exceeds = { 5 = "5 %" } } }\nat_most = 2_000'
        )
        found = UnpackedStatistics(made(wanted)["statistics/one/y"].to_dataset())
        marked = [MARK in note for note in found["quantile"]["note"].values.tolist()]
        assert marked == [True, True, False]
        for name in ("mean", "exceedance"):
            assert MARK not in str(found[name]["note"].values)
        for name in ("std", "below"):
            assert MARK in str(found[name]["note"].values)
        assert all(MARK in note for note in found["pearson"]["note"].values.tolist())
        assert "not certified" not in str(found["skewness"]["note"].values)  # has no interval

    def test_in_the_end_at_the_largest_number(self):
        rounds = made(NEVER)["runs/one"]["round"].values
        assert np.bincount(rounds).tolist() == [512, 512, 476]

    @pytest.mark.parametrize("x2", [0, 1])  # the output is 0 where both are
    def test_an_output_that_does_not_vary_is_known_at_once(self, x2):
        constant = STUDY.replace("x1 = {", "x1 = 0 #").replace("x2 = {", f"x2 = {x2} #")
        # Where x1 is 0, the last input has no effect.
        constant = constant.replace("x3 = 1", "x3 = { uniform = { lower = -1, upper = 1 } }")
        constant += 'until = { y = { mean = "1 %" } }\nat_most = 20_000\n'
        assert uqpen.run(uqpen.parse_study(constant))["runs/one"].sizes["run"] == 512

    def test_without_an_interval_it_goes_on(self):
        none = study().text.replace("x1 < 2.9", "x1 > 4").replace("20_000", "1_024")
        assert uqpen.run(uqpen.parse_study(none))["runs/one"].sizes["run"] == 1_024

    def test_of_several_models_when_each_is_precise_enough(self):
        # The second varies three times as much as the first.
        two = '[models.calm]\nuse = "ishigami"\n[models.wild]\nuse = "ishigami"\na = 21.0\n'
        text = STUDY.replace('[model]\nuse = "ishigami"\n', two) + EARLY
        runs = uqpen.run(uqpen.parse_study(text))["models/wild/runs/one"].sizes["run"]
        assert runs > made(EARLY)["runs/one"].sizes["run"]

    def test_rounds_join_across_the_blocks_of_the_random_stream(self):
        joint, stream = example_joint_distribution(), Stream(1, "designs", "one")
        most = BLOCK + 40_000

        class Never(Precision):
            def is_satisfied(self, feedback):
                return False

        rounds = run_rounds(
            MonteCarlo(until=Never({"y": {"mean": 1}}), at_most=most),
            joint,
            stream,
            lambda points, _: {"": points_in_memory(points)},
            lambda _: no_estimates,
        )
        (drawn,) = MonteCarlo(most).rounds(joint, stream)
        whole = points_in_memory(drawn)
        for name in ("length", "share"):
            joined = np.concatenate([each[""][name].values for each in rounds])
            assert np.array_equal(joined, whole[name].values)


@pytest.mark.parametrize(
    ("wanted", "statistic", "entry", "largest"),
    [
        ({"mean": 0.1}, "mean", 0, lambda found: 0.1),
        ({"mean": "2 %"}, "mean", 0, lambda found: 0.02 * found["mean"][0]),
        ({"mean": "4 % of sd"}, "mean", 0, lambda found: 0.04 * found["std"][0]),
        ({"standard_deviation": "3 %"}, "std", 0, lambda found: 0.03 * found["std"][0]),
        ({"quantile_05": "4 % of sd"}, "quantile", 0, lambda found: 0.04 * found["std"][0]),
        ({"quantile_95": "1 %"}, "quantile", 2, lambda found: 0.01 * found["quantile"][2, 0]),
        ({"below": {"0": "2 %"}}, "below", 0, lambda found: 0.02),
        ({"exceeds": {"5": "0.03"}}, "exceedance", 0, lambda found: 0.03),
    ],
)
def test_every_kind_of_target_is_met_by_half_the_width_of_its_interval(
    looks, wanted, statistic, entry, largest
):
    decisions = []
    for feedback in looks:
        found = feedback.estimates("", "y", only=["moments", "quantiles", "exceedance"])
        _, lower, upper = found[statistic].values.reshape(-1, 3)[entry]
        is_enough = (upper - lower) / 2 <= float(largest(found))
        assert Precision({"y": wanted}).is_satisfied(feedback) == is_enough
        decisions.append(is_enough)
    assert decisions[-1]
    assert not decisions[0]


@pytest.fixture(scope="module")
def looks():
    wanted = study("runs = 8_192")
    design, stream = wanted.designs["one"], Stream(1, "designs", "one")
    many = run_design(wanted, design, stream, map=map, progress=Progress())[""]
    many = many.drop_vars(["lost_run", "lost_reason"])
    found = []
    for size in (512, 1024, 2048, 4096, 8192):
        runs = {"": many.isel(run=slice(size))}
        quantities = {"": wanted.quantities_of_interest}
        found.append(Feedback(runs, RunningEstimates((runs,), Sampling.INDEPENDENT, quantities)))
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The archive of the study, made without an interruption by one worker."""
    path = tmp_path_factory.mktemp("whole") / "study.nc"
    make_archive(study(), path)
    return path.read_bytes()


@pytest.mark.processor
class TestSameBytes:
    def test_for_two_workers(self, tmp_path, whole):
        with processes(2) as workers:
            make_archive(study(), tmp_path / "study.nc", map=workers)
        assert (tmp_path / "study.nc").read_bytes() == whole

    @pytest.mark.parametrize("rounds", [1, 3])
    def test_after_an_interruption_in_any_round(self, tmp_path, whole, rounds):
        with pytest.raises(KeyboardInterrupt):
            make_archive(study(), tmp_path / "study.nc", progress=Interrupted(rounds))
        again = Interrupted(0)
        make_archive(study(), tmp_path / "study.nc", progress=again)
        assert again.restored == 512 * 2 ** (rounds - 1)
        assert (tmp_path / "study.nc").read_bytes() == whole

    def test_it_is_verified_as_any_other(self, tmp_path, whole):
        (tmp_path / "study.nc").write_bytes(whole)
        checks = verify(tmp_path / "study.nc", runs=None)
        assert {check.verdict.name for check in checks} == {"EQUAL"}

    def test_a_study_in_python_is_the_same(self, tmp_path):
        rule = Precision({"y": {"mean": "4 %", "exceeds": {"5": "4 %"}}})
        written = uqpen.Study(
            seed=3,
            model=uqpen.Ishigami(),
            inputs={"x1": uqpen.Uniform(-3, 3), "x2": uqpen.Uniform(-3, 3), "x3": 1},
            constraints=["x1 < 2.9"],
            outputs={"y": {"exceeds": [5], "below": [0]}},
            designs={"one": uqpen.MonteCarlo(until=rule, at_most=20_000)},
        )
        tree = uqpen.run(written)
        assert tree["runs/one"].to_dataset().identical(made()["runs/one"].to_dataset())
        assert 'mean = "4 %"' in written.to_toml()


@pytest.mark.parametrize(
    ("settings", "key", "found", "expected"),
    [
        ("until = { z = { mean = 1 } }", "until.z", "an unknown output", "known: y"),
        ('until = { y = { mean = "2 mm" } }', "until.y.mean", '"2 mm"', "a plain number"),
        ('until = { y = { mean = "0 %" } }', "until.y.mean", '"0 %"', "a half-width above 0"),
        ("until = { y = { median = 1 } }", "until.y.median", "an unknown key", '"mean"'),
        ("until = { y = { exceeds = 3 } }", "until.y.exceeds", "3", "a table of thresholds"),
        ("until = { y = { exceeds = {} } }", "until.y.exceeds", "a table", "a table of thresholds"),
        ("until = { y = { exceeds = { 6 = 0.1 } } }", "until.y.exceeds.6", '"6"', "known: 5"),
        ("until = { y = { exceeds = { 5 = 1 } } }", "until.y.exceeds.5", "1", "and below 1"),
        ("until = { y = { below = { 5 = 0.1 } } }", "until.y.below.5", '"5"', "known: 0"),
        ("until = { y = { quantile_5 = 1 } }", "until.y.quantile_5", "an unknown key", "two at"),
        ("until = { y = { quantile_99 = 1 } }", "until.y.quantile_99", "0.99", "known: 0.05, 0.5"),
        ('until = { y = { mean = "0 % of sd" } }', "until.y.mean", '"0 % of sd"', "5 % of sd"),
        ('until = { y = { mean = "5 of sd" } }', "until.y.mean", '"of sd", which', "of sd"),
        ("until = { y = { standard_deviation = 0 } }", "until.y.standard_deviation", "0", "above"),
        ("until = { y = 3 }", "until.y", "3", 'such as { mean = "1 %" }'),
        ("until = {}", "until", "no output", "a table of outputs"),
        ("until = 3", "until", "3", "a table of outputs"),
    ],
)
def test_a_target_that_makes_no_sense_is_reported_before_any_run(settings, key, found, expected):
    with pytest.raises(StudyError) as caught:
        study(f"{settings}\nat_most = 2_000")
    (problem,) = caught.value.problems
    assert problem.key == f"designs.one.{key}"
    assert problem.found.startswith(found)
    assert expected in problem.expected
    assert re.search(r"study\.toml:15 ", str(caught.value))


@pytest.mark.parametrize("wanted", [{"mean": "1 %"}, {"exceeds": {"1 m": 0.1}}])
def test_a_field_has_no_precision(wanted):
    height = uqpen.OutputSpec("m", along={"time": {"unit": "s", "values": [0, 1]}})
    with pytest.raises(StudyError) as caught:
        uqpen.Study(
            model=lambda speed: {"height": [speed, 2 * speed]},
            inputs={"speed": uqpen.Normal(mean="2 m/s", std="1 m/s")},
            outputs={"height": height},
            designs={"one": uqpen.MonteCarlo(until=Precision({"height": wanted}), at_most=2_000)},
            seed=1,
        )
    (problem,) = caught.value.problems
    assert problem.key.endswith("until.height")
    assert problem.found == "an output with dimensions"
    assert problem.expected == "an output that is a number"


@pytest.mark.parametrize(
    ("make", "key", "expected"),
    [
        (lambda: MonteCarlo(), "runs", "at most 1_000_000_000_000; or until with"),
        (lambda: MonteCarlo(at_most=5_000), "at_most", "until beside it"),
        (lambda: MonteCarlo(10, at_most=5_000), "at_most", "until beside it"),
        (lambda: MonteCarlo(10, Precision({"y": {"mean": 1}})), "runs", "at_most, beside until"),
        (lambda: MonteCarlo(until=Precision({"y": {"mean": 1}})), "at_most", "the largest number"),
        (lambda: MonteCarlo(until="1 %", at_most=5_000), "until", "a table of outputs"),  # type: ignore[arg-type]
    ],
)
def test_the_number_of_runs_is_given_in_one_way(make, key, expected):
    with pytest.raises(SettingsError) as caught:
        make()
    (problem,) = caught.value.problems
    assert problem.key == key
    assert expected in problem.expected


SETTINGS = {"until": {"y": {"mean": "10 cm", "quantile_95": "3 %", "exceeds": {"2 m": "3 %"}}}}


class TestContracts:
    def test_rules_meet_theirs(self):
        assert SETTINGS.keys() == STOPPING_RULES.keys()
        thresholds = (Threshold("2 m", 2.0),)
        requested = QuantityOfInterest(Output("y", "m"), "m", thresholds=thresholds)
        for name, reference in STOPPING_RULES.items():
            check_stopping_rule(resolve(reference)(SETTINGS[name]), requested)

    def test_a_design_with_a_rule_meets_its_own(self):
        check_design(MonteCarlo(until=Precision({"y": {"mean": 0.05}}), at_most=10_000))

    def test_a_rule_that_never_asks_for_an_interval_is_reported(self):
        with pytest.raises(AssertionError, match="without an interval"):
            check_stopping_rule(_Content({"y": {"mean": 1}}))


class _Content(Precision):
    """Satisfied with anything."""

    def is_satisfied(self, feedback):
        return True


def test_other_designs_take_no_rule():
    with pytest.raises(StudyError) as caught:
        uqpen.parse_study(STUDY.replace("monte-carlo", "saltelli") + "base = 64\n" + UNTIL)
    (problem,) = caught.value.problems
    assert (problem.key, problem.found) == ("designs.one.until", 'until with kind = "saltelli"')
    assert '"sobol-sequence" or "halton": intervals of other designs' in problem.expected


def test_it_is_scaled_as_a_plain_design_is():
    design = MonteCarlo(until=Precision({"y": {"mean": 1}}), at_most=5_000)
    joint = example_joint_distribution()
    assert design.run_count(joint) == 5_000
    assert design.scaled(joint, 300, replicated=False) == MonteCarlo(300)
    assert replace(design, at_most=2_000).run_count(joint) == 2_000


def test_the_summary_of_a_study_says_that_it_may_end_earlier():
    assert design_rows(study()) == [("one", "monte-carlo", "at most 20000")]
    assert runs_text(study()) == "at most 20000 runs"
    assert runs_text(study("runs = 300")) == "300 runs"


class TestShown:
    """What a reader is shown of a rule: in the tables, in JSON and on the page."""

    @pytest.mark.parametrize(
        ("settings", "note"),
        [
            (
                EARLY,
                "until the mean of y within 0.4; at most 20000 runs; no rule can exclude a "
                "part of the output that fewer than 3 in 505 runs (0.59 %) meet",
            ),
            (
                NEVER,
                "until the mean of y within 1e-06; at most 1500 runs; that number ended it, so the "
                "precision may not be reached; no rule can exclude a part of the output that "
                "fewer than 3 in 1 473 runs (0.2 %) meet",
            ),
        ],
    )
    def test_the_number_of_runs_has_a_note(self, settings, note):
        (table,) = statistics_tables(made(settings))
        name, (cell,) = table.rows[0]
        assert name == "runs"
        assert cell.endswith(" ¹")
        assert " ".join(table.notes[0].split()) == note

    def test_in_json(self):
        found = archive_json(made(NEVER))["designs"]["one"]
        assert found["stopping_rule"].startswith("until the mean of y within 1e-06")
        assert found["stopping_at_most"] == found["runs"] == 1_500
        assert "as looks double from 512 runs" in found["stopping_note"]

    def test_the_page_does_not_say_that_such_intervals_cover_less_often(self):
        blocks = convergence(ArchiveView(made(EARLY), ""))
        (remarks,) = (block for block in blocks if isinstance(block, Remarks))
        assert not any("a number of runs that is fixed" in text for text in remarks.lines)
        assert any(text.startswith("The runs decided their own number") for text in remarks.lines)
        assert any(
            text.startswith("No rule can exclude a part") and "3 in" in text
            for text in remarks.lines
        )
