"""Compiled loops find what arrays find, and which of them works follows from the numbers alone."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from uqpen.core.model import Output
from uqpen.core.sampling import Sampling
from uqpen.statistics import kernels
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.ordering import Ordering
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold
from uqpen.statistics.sample import Sample
from uqpen.statistics.sensitivity.compiled_pair import ColumnGroup, compiled_pairs
from uqpen.statistics.sensitivity.correlated_pair import PairOfArrays, standardized
from uqpen.statistics.sensitivity.correlations import correlations
from uqpen.statistics.sensitivity.given_data import first_order
from uqpen.statistics.sensitivity.local_regression import RegressionBins, ResidualVariance
from uqpen.statistics.sensitivity.sorted_bins import CompiledVariance, SortedBins

QUANTITY = QuantityOfInterest(Output("y", "m"), "m", (Threshold("1 m", 1.0),))


def sample_of(size=700, *, lost=60, ties=0, replicates=1):
    """A sample with failed runs, whose inputs have equal values if `ties` is their number."""
    generator = np.random.default_rng(size + lost + ties)
    points = generator.random((size, 3))
    if ties:
        points = np.floor(points * ties) / ties
    used = np.sort(generator.permutation(size)[lost:])
    values = np.exp(points[used] @ [1.0, 2.0, 0.0] + 0.1 * generator.random(len(used)))
    return Sample(
        values=values,
        used=used,
        missing=np.setdiff1d(np.arange(size), used),
        columns=InputColumns.from_matrix(("a", "b", "c"), points),
        replicates=np.repeat(np.arange(replicates), size // replicates),
        sampling=Sampling.INDEPENDENT if replicates == 1 else Sampling.STRATIFIED,
    )


SAMPLES = {
    "plain": sample_of(lost=0),
    "failed": sample_of(),
    "ties": sample_of(ties=9),
    "few levels": sample_of(ties=2),
    "replicates": sample_of(replicates=10),
}


@pytest.mark.parametrize("name", SAMPLES)
@pytest.mark.parametrize("halved", [False, True])
def test_residuals_in_bins_are_those_of_arrays(name, halved):
    sample = SAMPLES[name]
    values = standardized(sample.values)
    for column in range(3):
        bins = RegressionBins.from_sample(sample, column, halved=halved)
        arrays = ResidualVariance(bins, values)
        found = CompiledVariance.about(
            SortedBins.from_sample(sample, column, halved=halved), values
        )
        assert found.variance == pytest.approx(arrays.variance, rel=1e-13)
        assert found.pair_noise == pytest.approx(arrays.pair_noise, rel=1e-13)
        np.testing.assert_allclose(found.influence, arrays.influence, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("ties", [0, 5])
@pytest.mark.parametrize("is_ranked", [False, True])
def test_correlations_of_sums_are_those_of_arrays(ties, is_ranked):
    sample = sample_of(1_300, ties=ties)
    raw = [*(sample.run_inputs[i] for i in range(3)), sample.values]
    orderings = [Ordering.of(each) for each in raw]
    columns = np.stack(
        [
            standardized(o.mean_ranks if is_ranked else x)
            for o, x in zip(orderings, raw, strict=True)
        ]
    )
    weights = np.array([[1.0, -0.3, 0.0, 0.0], [-0.2, 0.0, 0.0, 1.0]])
    own = orderings if is_ranked else []
    arrays = PairOfArrays(weights, columns, own)
    (found,) = compiled_pairs(columns, [weights], ColumnGroup.of(own))
    assert found.value == pytest.approx(arrays.value, rel=1e-13)
    np.testing.assert_allclose(found.influence, arrays.influence, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", SAMPLES)
def test_all_estimates_agree_whichever_way(name, monkeypatch):
    def found():
        sample = replace(SAMPLES[name], used=SAMPLES[name].used.copy())  # inputs of its own
        return dict([*first_order(sample, QUANTITY), *correlations(sample, QUANTITY)])

    arrays = found()
    monkeypatch.setattr("uqpen.statistics.input_columns._MANY", 1)
    for statistic, by_loops in found().items():
        np.testing.assert_allclose(
            by_loops.values, arrays[statistic].values, rtol=1e-10, atol=1e-12, err_msg=statistic
        )
        for text in ("interval", "interval_label", "note"):
            assert by_loops[text].values.tolist() == arrays[statistic][text].values.tolist()


def test_loops_add_in_one_order_on_any_number_of_threads():
    """No processor and no number of threads changes a bit, as nothing is reordered or shared."""
    inner = [each for each in vars(kernels).values() if hasattr(each, "targetoptions")]
    assert len(inner) > len(kernels.__all__)
    for each in inner:
        assert not {"parallel", "fastmath"} & each.targetoptions.keys()


def test_loops_refuse_arrays_that_they_would_misread():
    for misread in (np.ones((9, 2), dtype=np.float32), np.ones((2, 9)).T):
        with pytest.raises(TypeError, match="No matching definition"):
            kernels.pair_products(misread)


def test_small_samples_load_no_compiler():
    script = (
        "import sys;"
        "import uqpen.statistics.sensitivity.correlations, uqpen.statistics.sensitivity.given_data;"
        "sys.exit('numba' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0
