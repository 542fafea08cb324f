"""Sensitivity along a field: at each place as of a scalar output, and of the field as a whole."""

from dataclasses import replace

import campbell
import numpy as np
import pytest
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS
from uqpen.core.labels import RUN, STATUS
from uqpen.core.model import Dimension, Output
from uqpen.core.status import Status
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.one_at_a_time import Morris, OneAtATime
from uqpen.designs.saltelli import Saltelli
from uqpen.statistics import texts
from uqpen.statistics.analyze import analyze
from uqpen.statistics.quantity_of_interest import QuantityOfInterest

GENERALIZED = "generalized_"
DESIGNS = {
    "monte carlo": MonteCarlo(runs=400),
    "replicates": LatinHypercube(runs=400, replicates=10),
    "one set": LatinHypercube(runs=400, replicates=1),
    "blocks": Saltelli(base=128),
    "trajectories": Morris(12),
    "one at a time": OneAtATime(),
}


def curve(*angles, may_end=False):
    dims = (Dimension("theta", "1", values=angles),)
    return replace(campbell.CURVE, dims=dims, may_end=may_end)


def with_values(runs, output, values):
    bare = runs.drop_dims("theta", errors="ignore")
    return bare.assign({output.name: ((RUN, *(each.name for each in output.dims)), values)})


def sensitivity(runs, output):
    return analyze(runs, [QuantityOfInterest(output, "1")], only=["sensitivity"])[output.name]


@pytest.fixture(scope="module", params=DESIGNS)
def runs(request):
    return campbell.runs_of(DESIGNS[request.param], seed=3)


@pytest.mark.parametrize("ends", [False, True])
def test_a_place_has_the_numbers_and_texts_of_a_scalar_output(runs, ends):
    places = [0, 90, 120, 180]
    values = runs["y"].values[:, places]
    if ends:
        values[5:80:7, 2:] = np.nan
    output = curve(-90.0, 0.0, 30.0, 90.0, may_end=ends)
    found = sensitivity(with_values(runs, output, values), output)
    for position in range(len(places)):
        one = with_values(runs, replace(output, dims=(), may_end=False), values[:, position])
        exists = ~np.isnan(values[:, position])
        lost = np.where(exists, one[STATUS].values, Status.FAILED).astype(np.int8)
        one = one.assign({STATUS: one[STATUS].copy(data=lost)})
        scalar = sensitivity(one, replace(output, dims=(), may_end=False))
        for name in set(found) - {
            f"{GENERALIZED}{order}" for order in ("first_order", "total_order")
        }:
            at_place, alone = found[name].isel(theta=position), scalar[name]
            np.testing.assert_allclose(at_place.values, alone.values, rtol=1e-9, atol=1e-12)
            if exists.all():
                for text in INTERVAL_TEXTS:
                    assert at_place[text].values.tolist() == alone[text].values.tolist()


@pytest.mark.parametrize("name", ["monte carlo", "replicates", "one set", "blocks"])
def test_a_field_of_one_variable_has_its_indices_as_a_whole(name):
    runs = campbell.runs_of(DESIGNS[name], seed=4)
    one = runs["y"].values[:, [120]]
    single = curve(30.0)
    expected = sensitivity(with_values(runs, single, one), single)
    several = curve(-10.0, 0.0, 30.0, 90.0)
    scaled = with_values(runs, several, one * [-1.0, 0.0, 3.0, 0.5] + [0.0, 7.0, 1.0, 1e3])
    found = sensitivity(scaled, several)
    for order in ("first_order", "total_order"):
        if order in expected:
            at_place = expected[order].values[0]
            for statistics in (expected, found):
                whole = statistics[f"{GENERALIZED}{order}"]
                np.testing.assert_allclose(whole.values, at_place, rtol=1e-7, atol=1e-10)
                notes = expected[order]["note"].values[0].tolist()
                assert whole["note"].values.tolist() == notes
            assert np.isnan(found[order].values[1]).all()
            assert set(found[order]["note"].values[1]) == {texts.CONSTANT_OUTPUT}


def test_the_whole_is_the_mean_of_the_places_by_their_variance_and_the_grid():
    # Independent inputs, each alone at its places: shares are those of the areas.
    rng = np.random.default_rng(1)
    x = rng.normal(size=(3000, 2))
    points = {f"x{i}": (RUN, x[:, i], {"role": "input"}) for i in range(2)}
    runs = xr.Dataset(
        {**points, STATUS: (RUN, np.zeros(3000, np.int8))}, attrs={"sampling": "independent"}
    )
    output = Output("y", "1", dims=(Dimension("t", "s", values=(0.0, 1.0, 5.0)),))
    values = np.column_stack([x[:, 0], 2 * x[:, 0], 3 * x[:, 1]])
    whole = sensitivity(with_values(runs, output, values), output)["generalized_first_order"]
    parts = np.array([0.5 * 1 + 2.5 * 4, 2.0 * 9])
    assert whole.values[:, 0] == pytest.approx(parts / parts.sum(), abs=0.03)
    assert (whole.values[:, 1] < parts / parts.sum()).all()
    assert (parts / parts.sum() < whole.values[:, 2]).all()


def test_few_blocks_that_reach_a_place_give_no_index_there():
    runs = campbell.runs_of(DESIGNS["blocks"], seed=5)
    values = runs["y"].values[:, [0, 90, 180]].copy()
    values[:400, 2] = np.nan
    output = curve(-90.0, 0.0, 90.0, may_end=True)
    found = sensitivity(with_values(runs, output, values), output)
    assert set(found["total_order"]["note"].values[2]) == {texts.FEW_BLOCKS_REACH}
    assert np.isfinite(found["total_order"].values[:2]).all()
    two = curve(-90.0, 0.0)
    # Two places have the same part of the grid; among three the second has twice that of the first.
    expected = sensitivity(with_values(runs, two, values[:, :2] * [1.0, 2**0.5]), two)
    np.testing.assert_allclose(
        found["generalized_total_order"].values, expected["generalized_total_order"].values
    )


@pytest.mark.parametrize("name", ["monte carlo", "blocks"])
def test_campbells_curve_has_its_known_indices(name):
    exact, inside = campbell.exact(), []
    larger = {"monte carlo": MonteCarlo(runs=2000), "blocks": Saltelli(base=512)}[name]
    runs = campbell.runs_of(larger, seed=6)
    values = runs["y"].values[:, ::10]
    output = curve(*campbell.CURVE.dims[0].values[::10])
    found = sensitivity(with_values(runs, output, values), output)
    variance = output.dims[0].weights * exact.std[::10] ** 2
    for order in ("first_order", "total_order"):
        if order in found:
            truth = getattr(exact, order)[::10]
            whole = variance @ truth / variance.sum()
            for array, known in ((found[order], truth), (found[f"{GENERALIZED}{order}"], whole)):
                half = np.maximum(array.values[..., 2] - array.values[..., 0], 1e-3)
                inside.append(np.abs(array.values[..., 0] - known) < 2 * half)
    assert all(each.all() for each in inside)
