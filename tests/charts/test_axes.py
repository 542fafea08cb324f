"""Axes of outputs: where they end, their bins, and the thresholds along them."""

import numpy as np
import pytest

from uqpen.charts.axes import ValueAxis, logarithmic_ticks

# y = 1e-3 · 10^(3x) at normal quantiles of x: seventeen tenfolds.
RANKS = (np.arange(200) + 0.5) / 200
TENFOLDS = 1e-3 * 10 ** (3 * np.sqrt(2) * np.sort(np.log(RANKS / (1 - RANKS)) / 1.7))


class TestTheEnds:
    @pytest.mark.parametrize("values", [np.array([0.001, 1.0]), np.array([0.0, 3.0]), TENFOLDS])
    def test_no_bin_of_positive_values_begins_below_zero(self, values):
        axis = ValueAxis.of_values([values])
        _, edges = axis.bins(values)
        assert axis.lower == edges[0] == 0
        assert edges[-1] == axis.upper

    def test_negative_values_end_at_zero(self):
        assert ValueAxis.of_values([np.array([-3.0, -0.001])]).upper == 0

    def test_values_of_both_signs_have_room_at_either_end(self):
        axis = ValueAxis.of_values([np.array([-1.0, 1.0])])
        assert axis.ends == pytest.approx((-1.06, 1.06))

    @pytest.mark.parametrize("value", [0.0, 5.0, -2.0])
    def test_equal_values_lie_within(self, value):
        axis = ValueAxis.of_values([np.full(3, value)])
        assert axis.lower < value < axis.upper

    def test_a_logarithmic_axis_has_all_tenfolds(self):
        axis = ValueAxis.of_values([TENFOLDS], is_logarithmic=True)
        assert not axis.is_cut
        assert 0 < axis.lower < TENFOLDS[0] < TENFOLDS[-1] < axis.upper
        counts, edges = axis.bins(TENFOLDS)
        assert counts.sum() == TENFOLDS.size
        np.testing.assert_allclose(np.diff(np.log(edges)), np.log(edges[1] / edges[0]))
        assert counts.max() < 0.3 * TENFOLDS.size

    def test_what_has_no_logarithm_lies_beyond_its_end(self):
        axis = ValueAxis.of_values([np.array([-1.0, 1.0, 10.0])], is_logarithmic=True)
        assert axis.is_cut
        assert axis.lower == pytest.approx(10**-0.03)

    def test_the_largest_numbers_have_one(self):
        axis = ValueAxis.of_values([np.array([1e-300, 1e307])], is_logarithmic=True)
        assert np.isfinite(axis.ends).all()
        assert axis.lower > 0

    def test_a_share_of_the_axis_is_a_value_and_back(self):
        for is_logarithmic in (False, True):
            axis = ValueAxis(0.01, 100.0, is_logarithmic=is_logarithmic)
            assert axis.share(axis.value(0.3)) == pytest.approx(0.3)
        assert axis.value(0.5) == pytest.approx(1.0)


class TestThresholds:
    def test_they_are_round_and_include_those_of_the_study(self):
        values = np.linspace(2.0, 7.0, 100)
        axis = ValueAxis.of_values([values])
        found = axis.thresholds(values, [np.pi])
        assert np.pi in found
        others = found[found != np.pi]
        np.testing.assert_allclose(np.diff(others), 0.02)

    def test_a_limit_takes_the_place_of_the_step_that_it_equals_but_for_rounding(self):
        values, limit = np.linspace(0.0, 1.0, 100), 0.1 + 0.2
        found = ValueAxis.of_values([values]).thresholds(values, [limit])
        assert found[np.isclose(found, 0.3)].tolist() == [limit]

    @pytest.mark.parametrize("is_logarithmic", [False, True])
    def test_those_over_tenfolds_follow_the_data(self, is_logarithmic):
        axis = ValueAxis.of_values([TENFOLDS], is_logarithmic=is_logarithmic)
        found = axis.thresholds(TENFOLDS, [0.01])
        shares = np.searchsorted(TENFOLDS, found, side="right") / TENFOLDS.size
        # No step leaps over more than a tenth of the values on the axis.
        assert np.diff(shares).max() <= 0.1
        assert shares[found == 0.01] == np.mean(TENFOLDS <= 0.01)

    def test_equal_values_are_no_crowd(self):
        values = np.repeat([0.0, 1.0, 2.0], 30)
        found = ValueAxis.of_values([values]).thresholds(values)
        assert np.unique(np.diff(found).round(9)).size == 1


def test_ticks_are_few_and_written_out_where_they_are_short():
    assert [text for _, text in logarithmic_ticks(-2.1, 2.1)] == ["0.01", "0.1", "1", "10", "100"]
    far = [text for _, text in logarithmic_ticks(-11.0, 7.0)]
    assert far[0] == "10⁻¹¹"
    assert len(far) <= 6
