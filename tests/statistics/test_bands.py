"""Bands over all places of a field, and ranked curves."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from drawn_samples import sample_of_values

from uqpen.core.labels import BOUND, INTERVAL, INTERVAL_LABEL, LEFT_OUT, NOTE
from uqpen.core.model import Dimension, Output
from uqpen.core.sampling import Sampling
from uqpen.statistics.fields.field_sample import FieldSample, moments_at_places, quantiles_at_places
from uqpen.statistics.fields.ranked_curves import band_depth, ranked_curves
from uqpen.statistics.fields.simultaneous_bands import (
    mean_band,
    quantile_band,
    simultaneous_level,
    tolerance_band,
)
from uqpen.statistics.quantity_of_interest import QuantityOfInterest


def field(values, replicates=0, *, may_end=False):
    curves = np.array(values, dtype=np.float64)
    places = tuple(np.arange(curves.shape[1]) / 100)
    sample = sample_of_values(curves, replicates=replicates)
    dimension = Dimension("depth", "m", values=places, display_unit="cm")
    return FieldSample(sample, Output("v", "m/s", dims=(dimension,), may_end=may_end))


def quantity(sample, contents=()):
    return QuantityOfInterest(sample.output, "m/s", tolerance_interval_contents=contents)


def only(arrays):
    ((_, array),) = arrays
    return array


def smooth_curves(seed, runs, places=20):
    """Sums of a few waves with random heights: their true mean is 0 everywhere."""
    heights = np.random.default_rng(seed).normal(size=(runs, 4))
    waves = np.linspace(0, 1, places) * np.pi * np.arange(1, 5)[:, None]
    return heights @ np.cos(waves)


ONE = field(smooth_curves(1, 100))


class TestSimultaneousBands:
    @pytest.mark.parametrize("replicates", [0, 10])
    def test_contain_the_interval_at_each_place(self, replicates):
        sample = field(smooth_curves(1, 200), replicates)
        request = quantity(sample)
        pairs = [
            (only(mean_band(sample, request)), dict(moments_at_places(sample, request))["mean"]),
            (
                only(quantile_band(sample, request)),
                dict(quantiles_at_places(sample, request))["quantile"],
            ),
        ]
        for band, pointwise in pairs:
            assert (band.sel(bound="estimate") == pointwise.sel(bound="estimate")).all()
            assert not (band.sel(bound="lower") > pointwise.sel(bound="lower")).any()
            assert not (band.sel(bound="upper") < pointwise.sel(bound="upper")).any()
            assert (np.asarray(band.attrs["pointwise_level"]) > 0.95).all()

    def test_of_independent_places_is_that_of_their_product(self):
        runs = np.random.default_rng(3).normal(size=(1000, 30))
        level = simultaneous_level(field(runs).runs, [runs - runs.mean(axis=0)])
        assert level == pytest.approx(0.95 ** (1 / 30), abs=8e-4)  # 1.5 % of 999 draws, over 30

    def test_do_not_depend_on_the_scale_of_a_place(self):
        curves = smooth_curves(4, 100)
        scale = np.geomspace(1e-6, 1e6, 20)
        bands = [
            only(mean_band(each, quantity(each))) for each in map(field, (curves, curves * scale))
        ]
        assert bands[1].values / scale[:, None] == pytest.approx(bands[0].values, rel=1e-9)

    @pytest.mark.parametrize("replicates", [0, 10])
    def test_cover_the_whole_curve(self, replicates):
        """In 95 % of seeds, with a tolerance of three standard errors of such a count."""
        covered = 0
        for seed in range(40):
            sample = field(smooth_curves(seed, 60, 8), replicates)
            _, lower, upper = only(mean_band(sample, quantity(sample))).values.T
            covered += bool(((lower <= 0) & (upper >= 0)).all())
        assert covered >= 40 * 0.95 - 3 * 1.4


def pulses(seed, runs):
    """Travelling pulses of height 1 at 61 places from 0 to 6, and their true mean."""
    time = np.linspace(0, 6, 61)
    centre = 3 + 0.6 * np.random.default_rng(seed).normal(size=(runs, 1))
    # A normal density of variance 0.15² at a normal place of variance 0.6².
    variance = 0.15**2 + 0.6**2
    mean = 0.15 / np.sqrt(variance) * np.exp(-((time - 3) ** 2) / (2 * variance))
    return np.exp(-((time - centre) ** 2) / (2 * 0.15**2)), mean


class TestPlacesThatFewRunsDecide:
    def test_are_left_out_of_the_band_of_the_mean_which_covers_elsewhere(self):
        """In 95 % of seeds, with a tolerance of three standard errors of such a count."""
        covered = 0
        for seed in range(40):
            curves, mean = pulses(seed, 100)
            sample = field(curves)
            _, lower, upper = only(mean_band(sample, quantity(sample))).values.T
            assert np.isfinite(lower[28:33]).all()
            covered += not ((mean < lower) | (mean > upper)).any()
        assert covered >= 40 * 0.95 - 3 * 1.4

    def test_are_named_with_the_reason(self):
        sample = field(pulses(1, 400)[0])
        band = only(mean_band(sample, quantity(sample)))
        reason = "fewer than 10 effective runs decide the mean at this place"
        assert band.attrs[LEFT_OUT] == f"36 of 61 places: {reason}, depth 0 to 17, 43 to 60 cm"
        assert str(band.coords[NOTE].values[0]) == reason
        assert str(band.coords[INTERVAL_LABEL].values[0]) == "none"

    def test_many_stretches_of_them_are_named_by_their_ends(self):
        curves = smooth_curves(1, 100)
        curves[:, 2:14:2] = 7.0
        sample = field(curves)
        left_out = only(mean_band(sample, quantity(sample))).attrs[LEFT_OUT]
        assert left_out.endswith("does not vary, depth between 2 and 12 cm")

    def test_are_those_beside_jumps_where_strata_hide_jumps_that_no_run_has_met(self):
        """The scatter of 10 hypercubes misses steps that come in one of 500 runs."""
        time = np.linspace(0, 6, 61)
        normal = np.random.default_rng(1).normal(size=(200, 2))
        steps = np.where(time > 3 + 0.6 * normal[:, :1], normal[:, 1:], 0.0)
        smooth = smooth_curves(1, 200, 61)
        smooth[:, 40:45] = smooth[:, [39]]  # No change at all, so the next one counts.
        covered = {}
        for name, sample in (
            ("steps", field(steps, 10)),
            ("independent steps", field(steps)),
            ("smooth", field(smooth, 10)),
        ):
            band = only(mean_band(sample, quantity(sample)))
            covered[name] = np.isfinite(band.values[:, 1:]).all(axis=1).sum()
            if name == "steps":
                assert "curves may jump at this place" in band.attrs[LEFT_OUT]
        assert covered["steps"] == 0
        assert covered["independent steps"] > 30
        assert covered["smooth"] == 61

    def test_of_curves_that_are_nearly_all_zero_are_all_places(self):
        curves = np.zeros((100, 20))
        curves[:4] = smooth_curves(1, 4)
        sample = field(curves)
        band = only(mean_band(sample, quantity(sample)))
        assert np.isnan(band.values[:, 1:]).all()
        assert band.attrs[LEFT_OUT].startswith("20 of 20 places: fewer than 10 effective runs")

    @pytest.mark.parametrize("seed", range(2))
    def test_have_a_tolerance_band_as_high_as_elsewhere(self, seed):
        """The highest of 500 such bands is 14 times as high as a pulse; once it was 10¹²."""
        sample = field(pulses(seed, 100)[0])
        band = only(tolerance_band(sample, quantity(sample))).isel(band_content=0)
        assert np.isfinite(band.values).all()
        assert 1 < band.values[:, 2].max() < 14
        assert "few runs decide the spread at this place" in str(band.coords[NOTE].values[0])
        signed = field(-pulses(seed, 100)[0])
        mirrored = only(tolerance_band(signed, quantity(signed))).isel(band_content=0)
        assert -14 < mirrored.values[:, 1].min() < -1


class TestPlacesLeftOut:
    def test_are_those_without_scatter_and_those_reached_by_few(self):
        curves = smooth_curves(1, 100)
        curves[:, 0] = 7.0
        curves[19:, 18:] = np.nan
        sample = field(curves, may_end=True)
        band = only(mean_band(sample, quantity(sample)))
        assert np.isnan(band.values[[0, 18, 19], 1:]).all()
        assert np.isfinite(band.values[1:18]).all()
        assert band.values[0, 0] == 7.0
        assert band.attrs[LEFT_OUT] == (
            "1 of 20 places: the output does not vary, depth 0 cm; 2 of 20 places: fewer than 20 "
            "runs reach this place, or not all replicates do, depth 18 to 19 cm"
        )
        assert band.coords[NOTE].values[0] == "the output does not vary"

    @pytest.mark.parametrize(
        ("sample", "reason"),
        [
            (field(smooth_curves(1, 19)), "the runs are too few"),
            (
                field(smooth_curves(1, 100), 5),
                "fewer than 8 replicates are too few for a simultaneous band",
            ),
            (
                replace(ONE, runs=replace(ONE.runs, sampling=Sampling.STRATIFIED)),
                "no simultaneous band is known for one stratified set",
            ),
            (
                replace(ONE, runs=replace(ONE.runs, weights=np.ones(100))),
                "weights: no simultaneous band is known",
            ),
        ],
    )
    def test_are_all_for_a_reason_of_the_design(self, sample, reason):
        for analysis in (mean_band, quantile_band):
            band = only(analysis(sample, quantity(sample)))
            assert np.isnan(band.sel(bound=["lower", "upper"])).all()
            assert np.isfinite(band.sel(bound="estimate")).all()
            assert set(band.coords[NOTE].values.flat) == {reason}


class TestToleranceBand:
    def test_holds_the_highest_score_of_the_runs_that_did_not_make_it(self):
        curves = smooth_curves(1, 89)
        band = only(tolerance_band(sample := field(curves), quantity(sample)))
        low, median, high = np.quantile(
            curves[::3], (0.01, 0.5, 0.99), axis=0, method="median_unbiased"
        )
        assert band.values[:, 0, 0] == pytest.approx(median)
        others = np.delete(curves, np.s_[::3], axis=0)
        below, above = (median - others) / (median - low), (others - median) / (high - median)
        # Of 59 runs, the furthest makes a band of content 95 % with a confidence of 95 %.
        multiple = np.maximum(below, above).max()
        assert band.values[:, 0, 1] == pytest.approx(median - multiple * (median - low))
        assert band.values[:, 0, 2] == pytest.approx(median + multiple * (high - median))
        assert band.coords[INTERVAL_LABEL].values[0, 0] == "discrete"

    def test_says_how_many_runs_it_needs(self):
        sample = field(smooth_curves(1, 88))
        request = quantity(sample, (0.5, 0.99))
        band = only(tolerance_band(sample, request))
        assert band["band_content"].values.tolist() == [0.5, 0.95, 0.99]
        assert band["band_content_runs_needed"].values.tolist() == [8, 89, 449]
        assert np.isfinite(band.sel(band_content=0.5)).all()
        assert band.coords[NOTE].values[0, 1] == "a tolerance band needs at least 89 runs"

    def test_takes_replicates_whole(self):
        curves = smooth_curves(1, 200)
        band = only(tolerance_band(sample := field(curves, 10), quantity(sample)))
        middle = curves.reshape(10, 20, -1)[::3].reshape(80, -1)
        assert band.values[:, 0, 0] == pytest.approx(np.median(middle, axis=0))
        assert band.coords[INTERVAL_LABEL].values[0, 0] == "conservative"

    @pytest.mark.parametrize("runs", [100, 1000])
    def test_of_positive_curves_is_positive(self, runs):
        curves = np.exp(smooth_curves(1, runs))
        band = only(tolerance_band(sample := field(curves), quantity(sample)))
        assert (band.values > 0).all()

    def test_of_curves_that_cross_zero_grows_with_their_unit(self):
        curves = smooth_curves(1, 200)
        one, thousand = (
            only(tolerance_band(each, quantity(each)))
            for each in map(field, (curves, 1e3 * curves))
        )
        assert thousand.values == pytest.approx(1e3 * one.values)

    def test_of_curves_that_end_is_hardly_wider_than_their_range(self):
        """Where few runs are left, too, as long as the band has the place."""
        curves = 10 + smooth_curves(1, 300)
        ends = np.random.default_rng(2).integers(5, 25, 300)
        curves[np.arange(20) >= ends[:, None]] = np.nan
        band = only(tolerance_band(sample := field(curves, may_end=True), quantity(sample)))
        _, lower, upper = band.values[:, 0].T
        has_band = np.isfinite(upper)
        assert has_band[:15].all()
        assert (np.isfinite(curves[::3, has_band]).sum(axis=0) >= 20).all()
        widths = (upper - lower) / (np.nanmax(curves, axis=0) - np.nanmin(curves, axis=0))
        assert (widths[has_band] < 2).all()

    def test_has_ends_where_nearly_all_values_coincide(self):
        curves = smooth_curves(1, 300)
        curves[1:, 3] = 0.0
        curves[0, 3] = 1.0
        band = only(tolerance_band(sample := field(curves), quantity(sample)))
        assert np.isfinite(band.values).all()

    def test_holds_a_curve_as_far_as_it_goes(self):
        curves = smooth_curves(1, 300)
        curves[1, 10:] = 1e6
        ended = curves.copy()
        ended[1, 10:] = np.nan
        far, near = (
            only(tolerance_band(each, quantity(each, (0.98,))))
            for each in (field(curves), field(ended, may_end=True))
        )
        width = [float(each.isel(depth=0, band_content=1).diff(BOUND)[1]) for each in (near, far)]
        assert abs(width[0]) < abs(width[1])


def depth_by_definition(curves, among):
    """The mean share of a curve's places that a pair of curves encloses, over all pairs."""
    shares = [
        np.mean(
            (np.minimum(a, b) <= curves[among]) & (curves[among] <= np.maximum(a, b)), dtype=float
        )
        for a, b in combinations(curves, 2)
    ]
    return float(np.mean(shares))


class TestRankedCurves:
    @pytest.mark.parametrize("count", [2, 3, 4, 5])
    def test_depth_is_that_of_the_definition(self, count):
        # Small whole numbers have many ties.
        curves = np.random.default_rng(count).integers(0, 4, (count, 6)).astype(float)
        expected = [depth_by_definition(curves, among) for among in range(count)]
        assert band_depth(field(curves)) == pytest.approx(expected)

    def test_depth_of_curves_that_end_is_by_the_shares_that_reach_their_places(self):
        curves = np.array([[0.0, 0.0], [1.0, np.nan], [2.0, 1.0], [3.0, 2.0]])
        first = [depth_by_definition(curves[:, :1], among) for among in range(4)]
        second = [depth_by_definition(curves[[0, 2, 3], 1:], among) for among in range(3)]
        expected = (first[2] + 0.75 * second[1]) / 1.75
        depth = band_depth(field(curves, may_end=True))
        assert depth[[1, 2]] == pytest.approx([first[1], expected])

    def test_fields_of_two_dimensions_are_ranked_by_all_their_places(self):
        curves = smooth_curves(1, 30)
        flat = field(curves)
        dims = tuple(Dimension(n, "m", values=tuple(range(s))) for n, s in (("x", 4), ("y", 5)))
        plane = FieldSample(
            replace(flat.runs, values=curves.reshape(30, 4, 5)), replace(flat.output, dims=dims)
        )
        assert band_depth(plane) == pytest.approx(band_depth(flat))
        assert dict(ranked_curves(plane, quantity(plane)))["envelope"].dims == ("x", "y", "bound")

    def test_median_region_and_outlying_curve(self):
        curves = np.linspace(-1, 1, 21)[:, None] + np.zeros(8)
        curves[4, 5] = 40.0
        sample = field(curves)
        sample = replace(sample, runs=replace(sample.runs, used=np.arange(100, 121)))
        found = dict(ranked_curves(sample, quantity(sample)))
        assert found["central_region"].attrs["median_run"] == 110
        assert found["central_region"].values[0] == pytest.approx([0.0, -0.5, 0.5], abs=1e-12)
        outlying = found["outlying"]
        assert outlying["curve"].values[outlying.values == 1].tolist() == [104]
        assert found["envelope"].values[5] == pytest.approx([0.0, -1.0, 1.0], abs=1e-12)
        assert found["band_depth"]["curve"].values.tolist() == list(range(100, 121))
        assert set(found["envelope"].coords[INTERVAL].values) == {"none"}

    def test_a_curve_is_not_outlying_as_it_goes_on_where_others_end(self):
        curves = np.linspace(-1, 1, 21)[:, None] + np.zeros(8)
        curves[:-1, 4:] = np.nan
        curves[-1, 4:] = 50.0
        sample = field(curves, may_end=True)
        found = dict(ranked_curves(sample, quantity(sample)))
        assert not found["outlying"].values.any()
        assert np.isnan(found["central_region"].values[4:, 1:]).all()


def test_bands_take_the_level_of_the_study():
    sample = field(smooth_curves(1, 200))
    wide = replace(sample, runs=replace(sample.runs, level=0.99))
    bands = [only(mean_band(each, quantity(each))) for each in (sample, wide)]
    assert bands[1].attrs["interval_level"] == 0.99
    widths = [band.sel(bound="upper") - band.sel(bound="lower") for band in bands]
    assert (widths[1] > widths[0]).all()
