"""Accumulators: what they find of pieces is what the whole column has."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from uqpen.core.sampling import Sampling
from uqpen.statistics.by_blocks.blocked_sample import BlockedSample, ColumnCounts
from uqpen.statistics.sample import Tally
from uqpen.statistics.standard_errors import extreme_margins

LARGE = 1e6
# Some values come often, so that atoms and splitters meet.
NUMBERS = st.one_of(st.integers(-3, 3).map(float), st.floats(-LARGE, LARGE))
COLUMNS = arrays(np.float64, st.integers(4, 60), elements=NUMBERS)
CUTS = st.lists(st.integers(0, 60), min_size=1, max_size=4)


def pieces(column, cuts):
    return np.split(column, sorted(min(cut, column.size) for cut in cuts))


@given(COLUMNS, CUTS)
@settings(max_examples=60, deadline=None)
def test_moments_of_pieces_are_those_of_the_whole(column, cuts):
    parts = pieces(column, cuts)
    counts = ColumnCounts.empty(column[::2], 3, len(parts))
    for group, part in enumerate(parts):
        counts.add(group, part[: part.size // 2])
        counts.add(group, part[part.size // 2 :])
    found = sample_of(counts, len(parts))
    assert found.size == column.size
    assert (found.smallest, found.largest) == (column.min(), column.max())
    size = max(float(np.abs(column).max()), 1e-300)
    mean = column.mean()
    assert found.shape.mean == pytest.approx(mean, rel=1e-12, abs=1e-12 * size)
    spread = float(np.abs(column - mean).max())
    if spread > 1e-3 * size:
        for power in (2, 3, 4):
            expected = (((column - mean) / spread) ** power).mean()
            assert found.shape.moment(power) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def sample_of(counts, groups):
    return BlockedSample.of_first(groups, counts, Sampling.INDEPENDENT, is_replicated=False)


@given(COLUMNS, COLUMNS, st.integers(1, 12))
@settings(max_examples=60, deadline=None)
def test_a_cell_lies_between_its_splitters_or_at_one(some, column, most):
    counts = ColumnCounts.empty(some, most, 1)
    assert counts.splitters.size <= most
    cells = counts.cells_of(np.concatenate([column, some]))
    at = np.searchsorted(counts.splitters, np.concatenate([column, some]))
    is_splitter = np.isin(np.concatenate([column, some]), counts.splitters)
    assert (cells == 2 * at + is_splitter).all()


def test_what_lies_beyond_all_splitters_has_the_outer_cells():
    counts = ColumnCounts.empty(np.random.default_rng(1).random(5000), 1000, 1)
    values = counts.splitters
    assert counts.cells_of(np.array([-np.inf, np.inf])).tolist() == [0, 2 * values.size]
    assert (counts.cells_of(values) == 2 * np.arange(values.size) + 1).all()
    assert (counts.cells_of(np.nextafter(values, np.inf)) == 2 * np.arange(values.size) + 2).all()


@given(COLUMNS, CUTS, st.integers(1, 12))
@settings(max_examples=60, deadline=None)
def test_order_statistics_are_those_of_the_sorted_values(column, cuts, most):
    parts = pieces(column, cuts)
    counts = ColumnCounts.empty(column[::2], most, len(parts))
    for group, part in enumerate(parts):
        counts.add(group, part)
    for groups in range(1, len(parts) + 1):
        expected = np.sort(np.concatenate(parts[:groups]))
        if not expected.size:
            continue
        sample, everywhere = sample_of(counts, groups), np.arange(expected.size)
        _ = sample.ordered(everywhere)
        if counts.asked:
            counts.learn(
                [(group, counts.values_requested(part)) for group, part in enumerate(parts)]
            )
        assert (sample.ordered(everywhere) == expected).all()
        for value in (*expected[:3], 0.5):
            below, at_or_below = (
                counts.counts_below(float(value), or_equal=each)[:groups].sum()
                for each in (False, True)
            )
            if not counts.asked:
                assert (below, at_or_below) == ((expected < value).sum(), (expected <= value).sum())
            counts.asked.clear()


@pytest.mark.parametrize("events", [0, 3, 9, 12])
def test_a_tally_of_events_has_the_figures_of_their_indicator(events):
    happens = np.arange(12) < events
    found = tally_of(happens)
    assert (found.sum(), found.all()) == (events, happens.all())
    assert found.std(ddof=1) == pytest.approx(happens.std(ddof=1))
    for own, expected in zip(extreme_margins(found), extreme_margins(1.0 * happens), strict=True):
        assert own == pytest.approx(expected)


def test_tallies_of_events_on_both_sides_of_values_are_those_of_both():
    column = np.arange(12)
    for lowest, highest in ((3, 8), (6, 5), (9, 1)):
        sides = column >= lowest, column <= highest
        found, expected = tally_of(sides[0]) & tally_of(sides[1]), tally_of(sides[0] & sides[1])
        np.testing.assert_array_equal(found.sums, expected.sums)


def tally_of(happens):
    """The tally of an indicator over two replicates."""
    parts = happens[::2], happens[1::2]
    return Tally.of_events(*np.array([[part.size, part.sum()] for part in parts]).T)
