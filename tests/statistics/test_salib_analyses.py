"""Analyses and designs of SALib: its own numbers, and what they lack."""

import contextlib
import io
import sys
import types
import warnings

import numpy as np
import pytest
from SALib.analyze import dgsm, fast, ff, pawn, rbd_fast

from uqpen.archive.estimates import interval_text, unpack
from uqpen.charts.measures import part_charts, salib_charts
from uqpen.core.errors import StudyError
from uqpen.results.archive_view import ArchiveView
from uqpen.statistics import texts
from uqpen.statistics.sensitivity.salib_analyses import call_salib
from uqpen.study.load import parse_study
from uqpen.workflow import run

ISHIGAMI = "np.sin(x1) + 7 * np.sin(x2) ** 2 + 0.1 * x3**4 * np.sin(x1)"
INPUTS = """\
[inputs]
x1 = { uniform = { lower = -3.14159265, upper = 3.14159265 } }
x2 = { uniform = { lower = -3.14159265, upper = 3.14159265 } }
x3 = { uniform = { lower = -3.14159265, upper = 3.14159265 } }
"""
MONTE_CARLO = '[designs.mc]\nkind = "monte-carlo"\nruns = 500\n'


def study(tmp_path, analyses, designs=MONTE_CARLO, *, formula=ISHIGAMI, inputs=INPUTS, rest=""):
    code = f"import numpy as np\ndef f(x1, x2, x3):\n    return {{'y': {formula}}}\n"
    (tmp_path / "model.py").write_text(code)
    text = f"""\
seed = 3
analyses = {analyses}
[model]
python = "model.py:f"
[model.inputs]
x1 = "1"
x2 = "1"
x3 = "1"
[model.outputs]
y = "1"
{inputs}{rest}{designs}"""
    return parse_study(text, folder=tmp_path)


def statistics(archive, design="mc"):
    return archive[f"statistics/{design}/y"].dataset


def inputs_and_output(archive, design):
    runs = archive[f"runs/{design}"].dataset
    points = np.column_stack([runs[name].values for name in ("x1", "x2", "x3")])
    return points, runs["y"].values


def problem():
    names = ["x1", "x2", "x3"]
    return {"num_vars": 3, "names": names, "bounds": [[-np.pi, np.pi]] * 3}


def refusals(error):
    return [(".".join(map(str, each.path)), each.found, each.expected) for each in error.problems]


@pytest.mark.slow
class TestOfGivenRuns:
    def test_numbers_are_those_of_salib(self, tmp_path):
        archive = run(study(tmp_path, '["salib:rbd_fast", { salib = "pawn", S = 8 }]'))
        points, y = inputs_and_output(archive, "mc")
        found = statistics(archive)
        own = rbd_fast.analyze(problem(), points, y, seed=1)
        assert found["salib_rbd_fast"].sel(bound="estimate").values == pytest.approx(own["S1"])
        own = pawn.analyze(problem(), points, y, S=8)
        assert found["salib_pawn"].sel(bound="estimate").values == pytest.approx(own["median"])

    def test_an_inert_input_lies_at_the_floor_of_pawn_and_says_so(self, tmp_path):
        formula = "np.sin(x1) + 7 * np.sin(x2) ** 2"
        found = statistics(run(study(tmp_path, '["salib:pawn"]', formula=formula)))
        index = found["salib_pawn"].sel(bound="estimate").values
        floor = found["salib_pawn_floor"].sel(bound="estimate").values
        assert index[2] > 0.05, "an inert input has no 0 by PAWN"
        assert index[2] <= floor.max() < index[1]
        array = estimate_of(found, "salib_pawn")
        notes = array["note"].values
        assert texts.PAWN_FLOOR in notes[2]
        assert texts.PAWN_FLOOR not in notes[1]

    def test_an_interval_is_called_what_it_is(self, tmp_path):
        found = statistics(run(study(tmp_path, '["salib:rbd_fast"]')))
        array = estimate_of(found, "salib_rbd_fast")
        assert interval_text(array[0], "interval") == texts.SALIB_BOOTSTRAP
        assert set(array["interval_label"].values) == {"conservative"}
        estimate, lower, upper = array.values.T
        assert upper - estimate == pytest.approx(estimate - lower)

    def test_an_expansion_of_low_order_is_not_usable(self, tmp_path):
        low = statistics(run(study(tmp_path, '["salib:enhanced_hdmr"]')))
        assert np.isnan(low["salib_hdmr"]).all()
        assert float(low["salib_hdmr_unexplained"].sel(bound="estimate")) > 0.1
        assert "not usable" in str(estimate_of(low, "salib_hdmr")["note"].values[0])
        analyses = '[{ salib = "enhanced_hdmr", poly_order = 8 }]'
        few = statistics(run(study(tmp_path, analyses)))
        assert "216 terms" in str(estimate_of(few, "salib_hdmr")["note"].values[0])
        designs = MONTE_CARLO.replace("500", "1000")
        high = statistics(run(study(tmp_path, analyses, designs)))
        # The indices are 0.314, 0.442 and 0; each has a standard deviation of about 0.02.
        assert high["salib_hdmr"].sel(bound="estimate").values == pytest.approx(
            [0.314, 0.442, 0], abs=0.07
        )

    def test_regional_sensitivity_is_a_curve_over_the_parts_of_the_output(self, tmp_path):
        formula = "x1 + 0.001 * x2"
        found = statistics(run(study(tmp_path, '[{ salib = "rsa", bins = 5 }]', formula=formula)))
        curve = found["salib_rsa"].sel(bound="estimate")
        assert curve["output_share"].values == pytest.approx([0.1, 0.3, 0.5, 0.7, 0.9])
        first, second, _ = curve.transpose("input", "output_share").values
        assert (first > 3 * second).all()
        assert first[0] > first[2], "extreme values of the output tell most of the input"

    def test_the_page_and_figures_have_a_chart_of_each_and_the_curves(self, tmp_path):
        analyses = '["salib:rbd_fast", "salib:pawn", { salib = "rsa", bins = 5 }]'
        view = ArchiveView(run(study(tmp_path, analyses)), "")
        charts = list(salib_charts(view, "y"))
        assert [chart.title for chart in charts] == [
            "First-order index by RBD-FAST, by SALib",
            "PAWN index, by SALib",
        ]
        (curves,) = part_charts(view, "y")
        assert [mark.name for mark in curves.marks] == ["x2", "x1", "x3"], "in the page's order"
        assert "quantile" in curves.summary

    def test_delta_alone_has_no_interval_and_no_first_order(self, tmp_path):
        designs = MONTE_CARLO.replace("500", "200")
        found = statistics(run(study(tmp_path, '["salib:delta"]', designs)))
        named = {name for name in found.data_vars if str(name).startswith("salib")}
        assert {name for name in named if not name.endswith("_interval")} == {"salib_delta"}
        assert np.isnan(found["salib_delta"].sel(bound="lower")).all()
        assert (found["salib_delta"].sel(bound="estimate") > 0).all()

    def test_failed_runs_are_left_out(self, tmp_path):
        lossy = f"np.where(x3 > 2.5, np.nan, {ISHIGAMI})"
        archive = run(study(tmp_path, '["salib:rbd_fast", "salib:pawn"]', formula=lossy))
        points, y = inputs_and_output(archive, "mc")
        is_used = np.isfinite(y)
        own = rbd_fast.analyze(problem(), points[is_used], y[is_used], seed=1)
        array = statistics(archive)["salib_rbd_fast"]
        assert array.sel(bound="estimate").values == pytest.approx(own["S1"])
        assert array.attrs["runs_used"] == is_used.sum() < 500

    def test_constraints_may_make_inputs_depend_on_each_other(self, tmp_path):
        constraints = '[constraints]\nkeep = ["x1 > x2"]\n'
        archive = run(study(tmp_path, '["salib:rbd_fast", "salib:pawn"]', rest=constraints))
        found = statistics(archive)
        assert set(estimate_of(found, "salib_rbd_fast")["note"].values) == {texts.SALIB_CUT}
        assert texts.SALIB_CUT not in estimate_of(found, "salib_pawn")["note"].values

    @pytest.mark.parametrize(
        ("formula", "runs", "reason"),
        [("0 * x1 + 1", 500, "does not vary"), (ISHIGAMI, 50, "runs")],
    )
    def test_without_an_estimate_there_is_the_reason(self, tmp_path, formula, runs, reason):
        designs = MONTE_CARLO.replace("500", str(runs))
        analyses = '["salib:rbd_fast", "salib:pawn", "salib:rsa", "salib:delta"]'
        found = statistics(run(study(tmp_path, analyses, designs, formula=formula)))
        for name in ("salib_rbd_fast", "salib_pawn", "salib_rsa", "salib_delta"):
            assert np.isnan(found[name]).all(), name
            assert reason in str(np.ravel(estimate_of(found, name)["note"].values)[0]), name


def estimate_of(dataset, name):
    return unpack(dataset, name)


class TestMistakes:
    @pytest.mark.parametrize(
        ("analyses", "found", "expected"),
        [
            ('["salib:pwn"]', '"pwn"', 'did you mean "pawn"?'),
            ('["salib:sobol"]', '"sobol"', 'kind = "saltelli"'),
            ('["salib:dgsm"]', '"dgsm"', 'kind = "salib:finite_diff"'),
            ('["salib:hdmr"]', '"hdmr"', "ignores its seed"),
            ('[{ salib = "pawn", s = 10 }]', "an unknown key", "known: salib, S"),
            ('[{ salib = "pawn", S = "ten" }]', '"ten"', "a whole number"),
            ('[{ salib = "pawn", S = 1 }]', "1", "a whole number"),
            ('["salib:pawn", { salib = "pawn", S = 5 }]', '"salib:pawn" again', "once"),
            ("[{ S = 10 }]", "nothing", "an analysis of SALib"),
        ],
    )
    def test_are_met_before_any_run(self, tmp_path, analyses, found, expected):
        with pytest.raises(StudyError) as caught:
            study(tmp_path, analyses)
        (_, what, instead), *others = refusals(caught.value)
        assert not others
        assert found in what
        assert expected in instead

    @pytest.mark.parametrize("name", ["rbd_fast", "enhanced_hdmr"])
    def test_inputs_that_depend_on_each_other_are_refused_where_indices_need_it(
        self, tmp_path, name
    ):
        dependence = """
[dependence]
copula = "gaussian"
of = "ranks"
pairs = [{ inputs = ["x1", "x2"], correlation = 0.5 }]
"""
        with pytest.raises(StudyError) as caught:
            study(tmp_path, f'["salib:pawn", {{ salib = "{name}" }}]', rest=dependence)
        ((path, what, _),) = refusals(caught.value)
        assert path == "analyses.1"
        assert f'"salib:{name}" with inputs that depend' in what
        study(tmp_path, '["salib:pawn", "salib:delta", "salib:rsa"]', rest=dependence)


class TestCalls:
    @pytest.fixture
    def fake(self, monkeypatch):
        def put(analyze):
            module = types.ModuleType("SALib.analyze.fake")
            module.analyze = analyze
            monkeypatch.setitem(sys.modules, "SALib.analyze.fake", module)

        return put

    def test_a_result_that_ignores_its_seed_is_refused(self, fake):
        numbers = iter(range(9))
        fake(lambda seed: {"S": [next(numbers)]})
        assert call_salib("fake", keys=("S",), seed=1) == texts.SALIB_DIFFERS.format(method="fake")

    def test_the_process_is_as_before(self, fake):
        def analyze():
            np.random.seed(1)  # noqa: NPY002
            warnings.formatwarning = None
            warnings.simplefilter("ignore")
            warnings.warn("a warning", stacklevel=1)
            print("a line")  # noqa: T201
            print("a line", file=sys.stderr)  # noqa: T201
            return {"S": [1.0]}

        fake(analyze)
        before = warnings.formatwarning, np.random.get_state()[1].tolist()  # noqa: NPY002
        screen = io.StringIO()
        with contextlib.redirect_stdout(screen), contextlib.redirect_stderr(screen):
            call_salib("fake", keys=("S",))
        assert screen.getvalue() == ""
        assert (warnings.formatwarning, np.random.get_state()[1].tolist()) == before  # noqa: NPY002

    def test_an_error_is_a_reason(self, fake):
        def analyze():
            raise RuntimeError("too few")

        fake(analyze)
        assert "too few" in call_salib("fake", keys=("S",))

    def test_seeds_follow_from_the_study(self, tmp_path):
        seeds = set()
        for seed in range(5):
            text = study(tmp_path, '["salib:pawn", "salib:delta"]').text
            made = parse_study(text.replace("seed = 3", f"seed = {seed}"), folder=tmp_path)
            seeds |= {analysis.function.seed for analysis in made.analyses}
        assert len(seeds) == 10
        assert min(seeds) > 0, "to SALib a seed of 0 is none"


FAST = '[designs.curves]\nkind = "salib:fast_sampler"\nN = 129\n'
STEPS = '[designs.steps]\nkind = "salib:finite_diff"\nN = 64\n'
TWO = '[designs.two]\nkind = "salib:ff"\n'


@pytest.mark.slow
class TestDesigns:
    def test_fast_gives_the_indices_of_salib(self, tmp_path):
        archive = run(study(tmp_path, "[]", FAST))
        _, y = inputs_and_output(archive, "curves")
        assert len(y) == 3 * 129
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            own = fast.analyze(problem(), y, seed=1)
        found = statistics(archive, "curves")
        for name, key in (("salib_fast_first", "S1"), ("salib_fast_total", "ST")):
            assert found[name].sel(bound="estimate").values == pytest.approx(own[key])
            assert np.isnan(found[name].sel(bound="lower")).all()
        assert "mean" not in found, "a curve is no sample"

    def test_a_curve_with_a_failed_run_has_no_index(self, tmp_path):
        archive = run(study(tmp_path, "[]", FAST))
        largest = float(archive["runs/curves"]["x3"][:129].max())
        lossy = f"np.where(x3 >= {largest!r}, np.nan, {ISHIGAMI})"
        found = statistics(run(study(tmp_path, "[]", FAST, formula=lossy)), "curves")
        index = found["salib_fast_first"].sel(bound="estimate").values
        assert np.isnan(index[0])
        note = str(estimate_of(found, "salib_fast_first")["note"].values[0])
        assert "of the 129 runs of its curve gave no value" in note

    def test_squared_derivatives_are_those_of_salib_in_units_of_the_deviations(self, tmp_path):
        archive = run(study(tmp_path, "[]", STEPS))
        points, y = inputs_and_output(archive, "steps")
        own = dgsm.analyze(problem(), points, y, seed=1)
        base = points[::4]
        # SALib's factor of a uniform input is its squared range over π², in place of its variance.
        ratio = base.var(axis=0) / (4 * np.pi**2 / np.pi**2)
        found = statistics(archive, "steps")["salib_dgsm"].sel(bound="estimate").values
        assert found == pytest.approx(own["dgsm"] * ratio, rel=1e-6)

    def test_a_pair_with_a_failed_run_is_left_out_and_counted(self, tmp_path):
        archive = run(study(tmp_path, "[]", STEPS))
        highest = np.sort(np.unique(archive["runs/steps"]["x1"].values))[-1]
        lossy = f"np.where(x1 >= {float(highest)!r}, np.nan, {ISHIGAMI})"
        found = statistics(run(study(tmp_path, "[]", STEPS, formula=lossy)), "steps")
        array = estimate_of(found, "salib_dgsm")
        assert np.isfinite(array.sel(bound="estimate")).all()
        assert "1 of 64 pairs of runs are left out" in str(array["note"].values[0])
        assert "pairs" not in str(array["note"].values[1])

    def test_two_levels_are_quantiles_and_their_effects_those_of_salib(self, tmp_path):
        archive = run(study(tmp_path, "[]", TWO, formula="x1 + 2 * x2 + x1 * x2"))
        points, y = inputs_and_output(archive, "two")
        ends = np.pi * (2 * 0.84 - 1)
        assert np.abs(points) == pytest.approx(np.full((8, 3), ends))
        own = ff.analyze(problem(), points, y)
        found = statistics(archive, "two")["salib_ff"].sel(bound="estimate").values
        assert found == pytest.approx(own["ME"][:3])
        assert found == pytest.approx([ends, 2 * ends, 0], abs=1e-7)

    def test_a_failed_run_takes_the_effects_of_all_inputs(self, tmp_path):
        lossy = "np.where((x1 > 0) & (x2 > 0) & (x3 > 0), np.nan, x1)"
        found = statistics(run(study(tmp_path, "[]", TWO, formula=lossy)), "two")
        assert np.isnan(found["salib_ff"]).all()
        assert "1 of 8 runs gave no value" in str(estimate_of(found, "salib_ff")["note"].values[0])

    @pytest.mark.parametrize(
        ("design", "found", "expected"),
        [
            (FAST.replace("129", "60"), "60", "more than 64, as M is 4"),
            (TWO + "low = 0.9\n", "0.84", "a probability above low"),
            (FAST.replace("fast_sampler", "fast"), '"salib:fast"', "salib:fast_sampler"),
        ],
    )
    def test_mistakes_are_met_before_any_run(self, tmp_path, design, found, expected):
        with pytest.raises(StudyError) as caught:
            study(tmp_path, "[]", design)
        ((_, what, instead),) = refusals(caught.value)
        assert found in what
        assert expected in instead
