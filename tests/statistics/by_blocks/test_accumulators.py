"""Accumulators: what they find of pieces is what the whole column has."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from uqpen.statistics.by_blocks.blocked_sample import PowerSums
from uqpen.statistics.by_blocks.cells import CellCounts, OrderedValues, Splitters

LARGE = 1e6
# Some values come often, so that atoms and splitters meet.
NUMBERS = st.one_of(st.integers(-3, 3).map(float), st.floats(-LARGE, LARGE))
COLUMNS = arrays(np.float64, st.integers(4, 60), elements=NUMBERS)
CUTS = st.lists(st.integers(0, 60), min_size=1, max_size=4)


def pieces(column, cuts):
    return np.split(column, sorted(min(cut, column.size) for cut in cuts))


@given(COLUMNS, CUTS)
@settings(max_examples=60, deadline=None)
def test_power_sums_of_pieces_are_those_of_the_whole(column, cuts):
    parts = pieces(column, cuts)
    found = PowerSums.empty(len(parts))
    for group, part in enumerate(parts):
        found.add(group, part[: part.size // 2])
        found.add(group, part[part.size // 2 :])
    whole, expected = found.whole, PowerSums.of_values(column)
    assert whole.sizes == column.size
    assert whole.smallest == column.min()
    assert whole.largest == column.max()
    scale = max(float(np.abs(column).max()), 1e-300)
    assert whole.means[0] == pytest.approx(expected.means[0], rel=1e-12, abs=1e-12 * scale)
    for power in range(3):
        size = column.size * scale ** (power + 2)
        near = pytest.approx(expected.powers[power, 0], rel=1e-12, abs=1e-12 * size)
        assert whole.powers[power, 0] == near


@given(COLUMNS, COLUMNS, st.integers(1, 12))
@settings(max_examples=60, deadline=None)
def test_a_cell_lies_between_its_splitters_or_at_one(some, column, most):
    splitters = Splitters.from_values(some, most)
    assert splitters.values.size <= max(most, np.unique(some).size if most > some.size else most)
    cells = splitters.locate(np.concatenate([column, some]))
    at = np.searchsorted(splitters.values, np.concatenate([column, some]))
    is_splitter = np.isin(np.concatenate([column, some]), splitters.values)
    assert (cells == 2 * at + is_splitter).all()


@pytest.mark.parametrize("power", [1, 20])
def test_what_lies_beyond_all_splitters_has_the_outer_cells(power):
    # Of the twentieth power, nearly all splitters are in one entry of the table.
    splitters = Splitters.from_values(np.random.default_rng(1).random(5000) ** power, 1000)
    values = splitters.values
    assert splitters.locate(np.array([-np.inf, np.inf])).tolist() == [0, 2 * values.size]
    assert (splitters.locate(values) == 2 * np.arange(values.size) + 1).all()
    assert (splitters.locate(np.nextafter(values, np.inf)) == 2 * np.arange(values.size) + 2).all()


@given(COLUMNS, CUTS, st.integers(1, 12))
@settings(max_examples=60, deadline=None)
def test_order_statistics_are_those_of_the_sorted_values(column, cuts, most):
    parts = pieces(column, cuts)
    counts = CellCounts.empty(Splitters.from_values(column[::2], most), len(parts))
    for group, part in enumerate(parts):
        counts.add(group, counts.splitters.locate(part))
    for groups in range(1, len(parts) + 1):
        expected = np.sort(np.concatenate(parts[:groups]))
        if not expected.size:
            continue
        ordered, everywhere = OrderedValues.of_first(counts, groups), np.arange(expected.size)
        _ = ordered[..., everywhere]
        collector = counts.collector()
        for group, part in enumerate(parts):
            collector.add(group, part, counts.splitters.locate(part))
        if counts.asked:
            collector.finish()
        assert (ordered[..., everywhere] == expected).all()
        for value in (*expected[:3], 0.5):
            below, at_or_below = (
                counts.counts_below(float(value), or_equal=each)[:groups].sum()
                for each in (False, True)
            )
            if not counts.asked:
                assert (below, at_or_below) == ((expected < value).sum(), (expected <= value).sum())
            counts.asked.clear()
