"""Distribution functions and quantiles ascend, and bounds contain their estimates."""

import numpy as np
import pytest
from drawn_samples import runs_of_values
from hypothesis import given, settings
from hypothesis import strategies as st

import uqpen
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import BOUND, SOURCE_KIND, STATISTICS_GROUP
from uqpen.core.model import Output
from uqpen.statistics.distribution_function.cdfs import cdf
from uqpen.statistics.intervals import ascending
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.run_samples import sample_of

PROBABILITIES = ("exceedance", "below", "share", "cdf", "cdf_band", "reached", "probability")
# By statistic, the coordinate along which its estimates ascend (1) or descend (-1).
ALONG = {
    "cdf_value": ("rank", 1),
    "cdf": ("rank", 1),
    "cdf_band": ("rank", 1),
    "quantile": ("probability", 1),
    "quantile_band": ("probability", 1),
    "percentile": ("percent", 1),
    "exceedance": ("threshold_value", -1),
    "below": ("lower_threshold_value", 1),
    "tolerance_limit": ("content", 1),
    "expected_shortfall": ("shortfall_level", 1),
    "return_level": ("return_period", 1),
}
# Their bounds ascend, too; those of others are of one request each.
WITH_BOUNDS = ("cdf", "cdf_band")

TIMES = np.linspace(0.0, 1.0, 4)
LEVELS = (0.01, 0.1, 0.25, 0.4, 0.6, 0.75, 0.9, 0.99)
REQUESTS = {"quantiles": LEVELS, "exceeds": ["1", "2", "3", "5", "8"], "below": ["1", "2", "4"]}
FAR_OUT = {"hold": [0.5, 0.8, 0.9], "expected_shortfall": [0.5, 0.8], "return_periods": [20, 500]}
QUANTITY = QuantityOfInterest(Output("y", "1"), "1")


def _model(x, z):
    """A jump, a heavy side, equal values, and failures in a corner."""
    if x > 0.93 and z > 0:
        raise ValueError("beyond what it can do")
    y = np.exp(2 * x) + z + 2 * (x + 0.2 * z > 0.6)
    return {"y": y, "steps": np.round(y), "curve": y * TIMES + z * TIMES**2}


def _mixed():
    """An archive with designs of each kind of interval, and a surrogate of two of them."""
    field = {"time": {"unit": "s", "from": 0, "to": 1, "size": len(TIMES)}}
    study = uqpen.Study(
        model=_model,
        inputs={"x": uqpen.Uniform(0.0, 1.0), "z": uqpen.Normal(0.0, 1.0)},
        outputs={
            "y": uqpen.OutputSpec("1", **REQUESTS, **FAR_OUT),
            "steps": uqpen.OutputSpec("1", **REQUESTS, **FAR_OUT),
            "curve": uqpen.OutputSpec("1", along=field, **REQUESTS),
        },
        designs={
            "independent": uqpen.MonteCarlo(runs=100),
            "replicated": uqpen.LatinHypercube(runs=200, replicates=10),
            "blocks": uqpen.Saltelli(base=16, replicates=8),
        },
        surrogates={
            "checked": uqpen.PolynomialChaos(design="replicated", check="independent", order=2)
        },
        seed=3,
    )
    return uqpen.run(study)


@pytest.fixture(
    scope="module", params=[pytest.param("mixed", marks=pytest.mark.slow), "rods", "beam"]
)
def archive(request, archives, made_once):
    return made_once("mixed", _mixed) if request.param == "mixed" else archives[request.param]


def estimates(tree):
    """Yield path, whether the source is a surrogate, and the array of each statistic."""
    for group in (node for node in tree.subtree if node.name == STATISTICS_GROUP):
        for source in group.children.values():
            is_surrogate = source.attrs.get(SOURCE_KIND) == "surrogate"
            for node in source.subtree:
                for name, array in node.data_vars.items():
                    if name in CATALOGUE:
                        yield f"{node.path}/{name}", is_surrogate, array


def columns(array):
    """Return estimate, lower and upper bound; without one of a value, it is infinite."""
    if BOUND not in array.dims:
        return (np.asarray(array.values),) * 3
    value, lower, upper = np.moveaxis(array.values, array.get_axis_num(BOUND), 0)
    return (
        value,
        np.where(np.isnan(lower), -np.inf, lower),
        np.where(np.isnan(upper), np.inf, upper),
    )


def in_order(array, coordinate, sign):
    """Return an array in the order in which its estimates ascend."""
    (dimension,) = array.coords[coordinate].dims
    order = np.argsort(sign * array.coords[coordinate].values, kind="stable")
    return array.isel({dimension: order}).transpose(dimension, ...)


def test_bounds_contain_their_estimate(archive):
    for path, _, array in estimates(archive):
        value, lower, upper = columns(array)
        is_known = ~np.isnan(value)
        assert (lower <= value)[is_known].all(), path
        assert (value <= upper)[is_known].all(), path


def test_probabilities_are_from_0_to_1(archive):
    for path, _, array in estimates(archive):
        if path.rpartition("/")[2] in PROBABILITIES:
            known = array.values[~np.isnan(array.values)]
            assert (known >= 0).all(), path
            assert (known <= 1).all(), path


def test_what_ought_to_ascend_does(archive):
    for path, is_surrogate, array in estimates(archive):
        name = path.rpartition("/")[2]
        if name not in ALONG:
            continue
        value, *bounds = columns(in_order(array, *ALONG[name]))
        checked = [value, *bounds] if is_surrogate or name in WITH_BOUNDS else [value]
        for ends in checked:
            one, other = ends[:-1], ends[1:]
            assert ((one <= other) | np.isnan(one) | np.isnan(other)).all(), path


def test_all_probabilities_of_a_surrogate_are_of_one_function(archive):
    for path, is_surrogate, array in estimates(archive):
        if not (is_surrogate and path.endswith("/exceedance")) or "rank" in array.dims:
            continue
        source = archive[path.rpartition("/")[0]]
        if "cdf" not in source:
            continue
        values = source["cdf_value"].values
        for limit, estimate in zip(array["threshold_value"].values, array.values, strict=True):
            place = np.searchsorted(values, limit, side="right")
            low = source["cdf"].values[place - 1] if place else np.zeros(3)
            high = source["cdf"].values[place] if place < len(values) else np.ones(3)
            below = 1 - estimate[[0, 2, 1]]
            assert (below[~np.isnan(low)] >= low[~np.isnan(low)] - 1e-12).all(), path
            assert (below[~np.isnan(high)] <= high[~np.isnan(high)] + 1e-12).all(), path


@settings(max_examples=20)
@given(st.integers(0, 10**6), st.sampled_from([1, 4, 20]), st.booleans(), st.booleans())
def test_bounds_of_distribution_functions_ascend(seed, replicates, is_rounded, is_weighted):
    rng = np.random.default_rng(seed)
    values = rng.standard_t(2, 80)
    weights = rng.lognormal(sigma=2, size=80) if is_weighted else None
    sample = _sample(np.round(values) if is_rounded else values, replicates, weights)
    for name, array in cdf(sample, QUANTITY):
        for ends in columns(array):
            assert (ends[:-1] <= ends[1:]).all(), name
        value, lower, upper = columns(array)
        assert (lower <= value).all()
        assert (value <= upper).all()


def _sample(values, replicates, weights):
    """Return draws, with weights if there are any, or else points of some hypercubes."""
    if replicates > 1 and weights is None:
        return sample_of(runs_of_values(values, "stratified", replicates=replicates), "y")
    return sample_of(runs_of_values(values, weights=weights), "y")


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=30))
def test_the_nearest_ascending_function_is_no_farther_from_one_that_ascends(values):
    given_values = np.array(values)
    found, other = ascending(given_values), np.sort(given_values)
    assert (found[:-1] <= found[1:]).all()
    assert np.abs(found - other).max() <= np.abs(given_values - other).max() * (1 + 1e-12)
    np.testing.assert_array_equal(ascending(other), other)
