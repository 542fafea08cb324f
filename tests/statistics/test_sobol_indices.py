"""Sobol' indices: exact answers, other people's estimators, and what becomes of lost runs."""

import math
import tracemalloc
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from SALib.analyze import sobol
from scipy import stats

import uqpen
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.model import Input, Output
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.rounds import run_rounds
from uqpen.designs.saltelli import Saltelli
from uqpen.distributions.constraints import parse_constraint
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.distributions.univariate import Uniform
from uqpen.execution import Evaluator, evaluate, join_rounds
from uqpen.models.python_function import PythonFunction
from uqpen.results.source_statistics import SourceStatistics
from uqpen.statistics.analyze import analyze
from uqpen.statistics.intervals import ratio_error, ratio_jackknife_error
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold

STUDIES = Path(__file__).parents[2] / "studies"
UNIT = Uniform(0.0, 1.0)
OUTPUT = Output("y", "1")


def runs_of(function, distributions, design, *, keep="", vectorized=True, seed=1):
    """The runs of a function of x1, x2 and so on."""
    names = [f"x{number + 1}" for number in range(len(distributions))]
    inputs = tuple(Input(name, "1") for name in names)
    unit_of = dict.fromkeys((*names, "y"), "1")
    model = PythonFunction(
        lambda **x: {"y": function(*x.values())},
        "function",
        inputs,
        (OUTPUT,),
        unit_of,
        vectorized=vectorized,
    )
    constraints = (parse_constraint(keep, dict.fromkeys(names, "1")),) if keep else ()
    entries = zip(inputs, distributions, strict=True)
    joint = JointDistribution(tuple(RandomInput(each, of, "1") for each, of in entries), inputs)
    rounds = run_rounds(
        design,
        joint,
        Stream(seed, "designs", "mine"),
        lambda points, _: {"": evaluate(Evaluator(model, constraints), points, {})},
    )
    runs = join_rounds([each[""] for each in rounds])
    return runs.assign_attrs(sampling=str(design.sampling))


def indices(runs, *exceeds):
    thresholds = tuple(Threshold(str(value), value) for value in exceeds)
    return analyze(runs, [QuantityOfInterest(OUTPUT, "1", thresholds=thresholds)])["y"]


def inside(array, exact):
    _, lower, upper = array.values.T
    return bool(((lower <= exact) & (exact <= upper)).all())


def ishigami(x1, x2, x3):
    return np.sin(x1) + 7 * np.sin(x2) ** 2 + 0.1 * x3**4 * np.sin(x1)


def sobol_g(*x):
    weights = (0, 1, 4.5, 9, 99, 99, 99, 99)
    factors = [(abs(4 * each - 2) + a) / (1 + a) for a, each in zip(weights, x, strict=True)]
    return np.prod(factors, axis=0)


EXACT = {
    "ishigami": (
        ishigami,
        [Uniform(-math.pi, math.pi)] * 3,
        (0.31390519114781146, 0.4424111447900409, 0),
        (0.5575888552099592, 0.4424111447900409, 0.24368366406214773),
    ),
    "sobol g": (
        sobol_g,
        [UNIT] * 8,
        (0.716192, 0.179048, 0.023676, 0.007162, *[0.000072] * 4),
        (0.787144, 0.242198, 0.034317, 0.010460, *[0.000105] * 4),
    ),
    "product and sum": (
        lambda x1, x2, x3: x1 * x2 + x3,
        [UNIT] * 3,
        (3 / 19, 3 / 19, 12 / 19),
        (4 / 19, 4 / 19, 12 / 19),
    ),
}


@cache
def of_known(name):
    function, distributions, *_ = EXACT[name]
    return indices(runs_of(function, distributions, Saltelli(16 * 512, second_order=True)))


@pytest.mark.slow
@pytest.mark.parametrize("name", EXACT)
def test_intervals_hold_the_exact_indices(name):
    _, _, first, total = EXACT[name]
    found = of_known(name)
    assert inside(found["first_order"], first)
    assert inside(found["total_order"], total)
    assert set(found["first_order"]["interval_label"].values) == {"nominal"}
    # What takes part in a twentieth of the variance is distinguished from what takes part in none.
    _, lower, upper = found["total_order"].values.T
    assert (upper - lower < 2 * 0.05).all()


def test_pairs_have_the_indices_of_their_interaction():
    between_1_and_3 = 0.24368366406214773
    found = of_known("ishigami")["second_order"]
    assert found["pair"].values.tolist() == ["x1, x2", "x1, x3", "x2, x3"]
    assert inside(found, (0, between_1_and_3, 0))
    assert inside(of_known("product and sum")["second_order"], (1 / 19, 0, 0))


def test_figures_are_those_of_salib_itself():
    design = Saltelli(256, 4, second_order=True)
    runs = runs_of(ishigami, [Uniform(-math.pi, math.pi)] * 3, design)
    found = indices(runs)
    by_matrix = runs["y"].values.reshape(256, 8)
    # SALib has B last.
    rows = by_matrix[:, [0, 2, 3, 4, 5, 6, 7, 1]].ravel()
    theirs = sobol.analyze({"num_vars": 3, "names": ["x1", "x2", "x3"]}, rows, seed=1)
    ours = {
        name: found[name].sel(bound="estimate").values
        for name in ("first_order", "total_order", "second_order")
    }
    np.testing.assert_allclose(ours["total_order"], theirs["ST"], atol=1e-12)
    # It takes the mean of all rows from them, in place of that of A and B: products of two such
    # differences, each of a few hundredths, are between the two.
    np.testing.assert_allclose(ours["first_order"], theirs["S1"], atol=1e-3)
    pairs = theirs["S2"][np.triu_indices(3, 1)]
    np.testing.assert_allclose(ours["second_order"], pairs, atol=1e-3)


def test_figures_are_those_of_scipy():
    runs = runs_of(ishigami, [Uniform(-math.pi, math.pi)] * 3, Saltelli(256, 4))
    found = indices(runs)
    A, B, *mixed = runs["y"].values.reshape(256, 5).T[:, np.newaxis]
    theirs = stats.sobol_indices(
        func={"f_A": A, "f_B": B, "f_AB": np.stack(mixed)}, n=256, method="saltelli_2010"
    )
    for order in ("first_order", "total_order"):
        ours = found[order].sel(bound="estimate").values
        np.testing.assert_allclose(ours, getattr(theirs, order), atol=1e-12)


def test_neither_unit_nor_offset_nor_order_of_the_rows_matters():
    runs = runs_of(ishigami, [Uniform(-math.pi, math.pi)] * 3, Saltelli(256, 4), keep="x1 > -3")
    plain = indices(runs)
    # SALib by itself says zero of so small a variance.
    tiny = indices(runs.assign(y=runs["y"] * 1e-12))
    shuffled = indices(runs.isel(run=np.random.default_rng(1).permutation(runs.sizes["run"])))
    far = indices(runs.assign(y=runs["y"] + 1e6))
    for order in ("first_order", "total_order"):
        np.testing.assert_allclose(tiny[order], plain[order], atol=1e-9)
        np.testing.assert_allclose(shuffled[order], plain[order], atol=1e-9)
        np.testing.assert_allclose(far[order], plain[order], atol=1e-7)


@pytest.fixture(scope="module")
def concrete():
    study = (STUDIES / "concrete.toml").read_text(encoding="utf-8")
    before, _, _ = study.partition("[designs.")
    text = f'{before}\n[designs.indices]\nkind = "saltelli"\nbase = {16 * 512}\n'
    text = text.replace("seed  = 17", "seed = 2")
    tree = uqpen.run(uqpen.parse_study(text, folder=STUDIES))
    return SourceStatistics(tree)


def indices_of(statistics, output, name):
    array = statistics.get("indices", output, name)
    assert array is not None
    return array


def test_the_concrete_study_has_the_indices_of_admissible_draws(concrete):
    first = indices_of(concrete, "penetration_depth", "first_order")
    total = indices_of(concrete, "penetration_depth", "total_order")
    assert first["input"].values.tolist() == [
        "target_density",
        "target_yield_limit",
        "plasticity_radius",
        "crater_radius",
    ]
    assert inside(first, (0.0013, 0.122, 0.645, 0.160))
    assert inside(total, (0.0022, 0.129, 0.715, 0.227))
    estimand = "indices of the input distribution, conditional on admissible inputs"
    assert first.attrs["estimand"] == estimand
    assert first.attrs["blocks_used"] == 16 * 512
    assert first.attrs["blocks_dropped"] == 0
    assert set(first["interval_label"].values) == {"conservative"}
    assert "heavy tail" in str(first["note"].values[0])


def test_the_logarithm_and_the_limit_have_indices_of_their_own(concrete):
    log = indices_of(concrete, "penetration_depth", "log_first_order")
    assert inside(log, (0.00174, 0.18319, 0.5671, 0.2376))
    exceedance = indices_of(concrete, "penetration_depth", "exceedance_total_order")
    assert exceedance.dims == ("threshold", "input", "bound")
    assert exceedance["threshold"].values.tolist() == ["60 cm"]
    assert inside(exceedance[0], (0.0482, 0.3993, 0.8124, 0.458))
    kinds = indices_of(concrete, "termination", "category_first_order")
    assert kinds.dims == ("category", "input", "bound")


def test_every_index_is_in_the_catalogue():
    found = indices(runs_of(sobol_g, [UNIT] * 8, Saltelli(64, 4, second_order=True)), 1.0)
    assert "exceedance_first_order" in found
    assert set(found) <= set(CATALOGUE)


TRIANGLE = Saltelli(16 * 512, second_order=True)


@cache
def triangle(function):
    """Indices under the law of three uniform inputs, given that the first exceeds the second."""
    return indices(runs_of(function, [UNIT] * 3, TRIANGLE, keep="x1 > x2"))


def of_sum(x1, x2, x3):
    return x1 + x2 + x3


def of_first(x1, x2, x3):
    return x1 + 0 * x2


@pytest.mark.slow
def test_redraws_give_the_indices_of_the_conditional_law():
    # Given x1, x2 is uniform below it: E[x1 + x2 | x1] = 3/2 x1 with a variance of 9/4 · 1/18, out
    # of 1/6 + 1/12; given x2, x1 varies by E[(1 - x2)²] / 12 = 1/24.
    found = triangle(of_sum)
    assert inside(found["first_order"], (1 / 2, 1 / 2, 1 / 3))
    assert inside(found["total_order"], (1 / 6, 1 / 6, 1 / 3))
    # x1 and x2 together explain 2/3, which is less than the sum of what each does.
    assert inside(found["second_order"], (-1 / 3, 0, 0))
    assert "conditional on admissible inputs" in found["first_order"].attrs["estimand"]


@pytest.mark.slow
def test_what_an_output_does_not_depend_on_may_still_tell_of_it():
    found = triangle(of_first)
    # E[x1 | x2] = (1 + x2) / 2; the variances are 1/4 · 1/18 out of 1/18. Of x1 itself, x2 leaves
    # 1/24. Of x1, nothing is left once it is known.
    first, total = found["first_order"], found["total_order"]
    assert inside(first[:2], (1, 1 / 4))
    assert inside(total[:1], (3 / 4,))
    assert total.values[1, 0] == 0
    assert "fewer than ten blocks" in str(found["total_order"]["note"].values[1])
    assert np.isnan(total.values[1, 1:]).all()


def test_one_run_of_each_fate_is_counted_and_spoils_nothing():
    fates = {100: "inadmissible", 200: "nan", 300: "exception"}
    clean = runs_of(ishigami, [Uniform(-math.pi, math.pi)] * 3, Saltelli(256, 4))
    spoilt = {fate: float(clean["x1"][run]) for run, fate in fates.items()}

    def function(x1, x2, x3):
        if x1 == spoilt["exception"]:
            raise RuntimeError("no such luck")
        return math.nan if x1 == spoilt["nan"] else float(ishigami(*np.array([x1, x2, x3])))

    runs = runs_of(
        function,
        [Uniform(-math.pi, math.pi)] * 3,
        Saltelli(256, 4),
        keep=f"(x1 - {spoilt['inadmissible']!r})**2 > 0",
        vectorized=False,
    )
    found = indices(runs)
    array = found["first_order"]
    assert np.isfinite(array).all()
    assert array.attrs["blocks_dropped"] == 2
    assert array.attrs["blocks_used"] == 254
    assert array.attrs["estimand"] == (
        "indices of the input distribution, conditional on admissible inputs; "
        "blocks with a failed run are left out"
    )
    assert array.attrs["runs_failed"] >= 1
    assert array.attrs["runs_not_finite"] >= 1
    assert array.attrs["runs_inadmissible"] >= 1
    np.testing.assert_allclose(array, indices(clean)["first_order"], atol=0.05)


def test_memory_does_not_grow_with_thresholds():
    runs, peaks = runs_of(lambda x1, x2: x1 + x2, [UNIT, UNIT], Saltelli(1024)), []
    for number in (2, 2, 40):  # the first imports
        tracemalloc.start()
        indices(runs, *np.linspace(0.2, 1.8, number).tolist())
        peaks.append(tracemalloc.get_traced_memory()[1] / runs.sizes["run"] / 8)
        tracemalloc.stop()
    # In columns of floats, of which each threshold would keep one or more.
    assert peaks[2] - peaks[1] < 20


def test_a_block_that_no_draw_completes_is_dropped_and_said_so():
    found = indices(runs_of(of_sum, [UNIT] * 3, Saltelli(64, 4), keep="x1 > x2 + 0.97"))
    attributes = found["first_order"].attrs
    assert attributes["blocks_dropped"] > 0
    assert "blocks without an admissible draw are left out" in attributes["estimand"]


@pytest.mark.parametrize(
    ("function", "keep", "reason"),
    [
        (lambda x1, x2: 2.0 + 0 * x1, "", "the output does not vary"),
        (lambda x1, x2: x1, "x1 > 2", "no block is complete"),
        (lambda x1, x2: np.where(x1 > 2, x1, np.nan), "", "no block is complete"),
    ],
)
def test_what_has_no_indices_says_why(function, keep, reason):
    found = indices(runs_of(function, [UNIT] * 2, Saltelli(64, 4), keep=keep), 0.5)
    for order in ("first_order", "total_order"):
        assert np.isnan(found[order]).all()
        assert set(found[order]["note"].values) == {reason}
    assert set(found["exceedance_first_order"]["interval_label"].values.ravel()) == {"none"}


def test_one_replicate_alone_tells_no_error():
    runs = runs_of(of_sum, [UNIT] * 3, Saltelli(64, 2))
    lost = runs["replicate"].values == 1
    runs["status"].values[lost] = Status.FAILED
    runs["y"].values[lost] = np.nan
    found = indices(runs)["first_order"]
    assert np.isfinite(found.sel(bound="estimate")).all()
    assert np.isnan(found.sel(bound="lower")).all()
    assert "one replicate" in str(found["note"].values[0])


def test_few_blocks_say_that_they_cover_less():
    found = indices(runs_of(of_sum, [UNIT] * 3, Saltelli(16, 8)))
    assert "only 16 blocks" in str(found["total_order"]["note"].values[0])
    assert set(found["total_order"]["interval_label"].values) == {"conservative"}


def test_an_event_that_few_runs_met_has_no_interval():
    found = indices(runs_of(of_sum, [UNIT] * 3, Saltelli(256, 4)), 2.6, 1.5, 4.0)
    rare, often, never = found["exceedance_total_order"].values
    notes = found["exceedance_total_order"]["note"].values[:, 0]
    assert np.isnan(rare[:, 1]).all()
    assert np.isfinite(often).all()
    assert np.isnan(never).all()
    assert "fewer than ten" in notes[0]
    assert notes[2] == "the event occurs in all runs or in none"


def test_a_value_below_zero_has_no_logarithm():
    assert "log_first_order" not in of_known("ishigami")
    assert "log_first_order" in of_known("product and sum")


def test_strata_that_leave_no_scatter_tell_no_error():
    runs = runs_of(lambda x1, x2: 1.0 * (np.asarray(x1) > 0.5), [UNIT] * 2, Saltelli(256, 4))
    found = indices(runs)
    assert found["first_order"].values[0, 0] == pytest.approx(1)
    assert np.isnan(found["first_order"].values[0, 1:]).all()
    assert "no scatter" in str(found["first_order"]["note"].values[0])


def test_the_jackknife_of_a_mean_is_its_error_over_replicates():
    rng = np.random.default_rng(1)
    values, group = rng.random(60), np.repeat(np.arange(6), 10)
    jackknife = ratio_jackknife_error(values, np.ones(60), group, 6)
    assert jackknife == pytest.approx(ratio_error(values, group, 6))


def test_the_jackknife_of_a_ratio_is_the_textbooks():
    rng = np.random.default_rng(1)
    above, below, group = rng.random(60), 1 + rng.random(60), np.repeat(np.arange(6), 10)
    without = np.array([above[group != g].sum() / below[group != g].sum() for g in range(6)])
    expected = math.sqrt(5 / 6 * ((without - without.mean()) ** 2).sum())
    assert ratio_jackknife_error(above, below, group, 6) == pytest.approx((expected, 5))
