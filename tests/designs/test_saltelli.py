"""Pick-freeze blocks: what shares what with what, and what is drawn again."""

import math
from functools import cache

import numpy as np
import pytest
from scipy import special

from uqpen.core.errors import SettingsError
from uqpen.core.model import Input
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.rounds import run_rounds
from uqpen.designs.saltelli import MOST_ROUNDS, BlockLayout, Saltelli
from uqpen.distributions.joint_distribution import FixedInput, JointDistribution, RandomInput
from uqpen.distributions.univariate import Normal, Uniform
from uqpen.execution import join_rounds

LENGTH, MASS, SHARE, WIDTH = (Input(name, "1") for name in ("length", "mass", "share", "width"))
LAW = JointDistribution(
    (
        RandomInput(LENGTH, Uniform(1.0, 3.0), "1"),
        FixedInput(MASS, 5.0, "1"),
        RandomInput(SHARE, Normal(0.0, 1.0), "1"),
        RandomInput(WIDTH, Uniform(0.0, 1.0), "1"),
    ),
    (LENGTH, MASS, SHARE, WIDTH),
)
NAMES = ("length", "share", "width")

# What becomes of points, distinguished from their values.


def everything_is_fine(length, share, width):
    return np.zeros(len(length))


@cache
def made(design, fate=everything_is_fine, seed=1):
    """All runs of a design whose model does nothing."""

    def runs(points, number):
        status = fate(*(points[name].values for name in NAMES)).astype(np.int8)
        return {"": points.assign(status=("run", status))}

    rounds = run_rounds(design, LAW, Stream(seed, "designs", "mine"), runs)
    return join_rounds([each[""] for each in rounds])


def values(runs, rows):
    return np.stack([runs[name].values[rows] for name in NAMES], axis=-1)


def inadmissible(condition):
    return np.where(condition, Status.INADMISSIBLE, Status.OK)


DESIGNS = [
    Saltelli(64, 4),
    Saltelli(64, 4, second_order=True),
    Saltelli(64, 4, second_order=True, noise=True),
]


@pytest.mark.parametrize("design", DESIGNS, ids=str)
def test_the_first_round_is_the_size_that_is_given(design):
    runs = made(design)
    assert (
        runs.sizes["run"]
        == design.run_count(LAW)
        == 64 * ((8 if design.second_order else 5) + design.noise)
    )
    assert "round" not in runs.coords
    assert float(runs["mass"]) == 5.0


@pytest.mark.parametrize("design", DESIGNS, ids=str)
def test_mixed_rows_are_a_matrix_with_one_column_of_the_other(design):
    runs = made(design)
    rows = {
        matrix: values(runs, np.flatnonzero(runs["matrix"].values == matrix))
        for matrix in np.unique(runs["matrix"].values)
    }
    A, B = rows[0], rows[1]
    assert not np.isin(A, B).any()
    for i in range(3):
        column = np.arange(3) == i
        np.testing.assert_array_equal(rows[2 + i], np.where(column, B, A))
        if design.second_order:
            np.testing.assert_array_equal(rows[5 + i], np.where(column, A, B))
    if design.noise:
        np.testing.assert_array_equal(rows[8], A)


@pytest.mark.parametrize("matrix", [0, 1])
def test_every_replicate_of_both_matrices_is_balanced(matrix):
    runs = made(Saltelli(256, 4))
    for replicate in range(4):
        inside = (runs["replicate"].values == replicate) & (runs["matrix"].values == matrix)
        length, share, width = values(runs, inside).T
        for unit in ((length - 1) / 2, special.ndtr(share), width):
            assert sorted(np.floor(unit * 64).astype(int)) == list(range(64))


def test_blocks_are_numbered_over_replicates():
    runs = made(Saltelli(64, 4))
    assert np.unique(runs["block"]).tolist() == list(range(64))
    np.testing.assert_array_equal(runs["block"] // 16, runs["replicate"])


def test_what_the_matrices_mean_stands_beside_them():
    attributes = made(Saltelli(8, 2, second_order=True))["matrix"].attrs
    meanings = attributes["flag_meanings"].split()
    assert len(meanings) == len(set(meanings)) == len(attributes["flag_values"])
    mixed = [f"{which}_{name}" for which in ("AB", "BA") for name in NAMES]
    assert meanings[:8] == ["A", "B", *mixed]
    assert meanings[-1] == "redrawn_sharing_share+width"


def test_a_flag_stands_for_one_matrix_only():
    layout = BlockLayout(tuple(f"x{i}" for i in range(20)), second_order=True, noise=True)
    flags = layout.flag_attributes()
    assert len(set(flags["flag_values"].tolist())) == len(flags["flag_meanings"].split())
    assert set(layout.parts) <= set(flags["flag_values"].tolist())


def half_lost(length, share, width):
    return inadmissible(length - 1 < 2 * width)


@pytest.mark.parametrize("design", DESIGNS, ids=str)
def test_what_is_drawn_again_shares_what_it_should(design):
    runs = made(design, half_lost)
    layout = BlockLayout.from_runs(runs)
    rows = layout.run_numbers(runs)
    whole = np.all([(part >= 0) & (runs["status"].values[part] == 0) for part in rows.values()], 0)
    # Of an input that must be larger than a uniform one, few are so small that none was found.
    assert whole.mean() > 0.95
    points = {matrix: values(runs, part[whole]) for matrix, part in rows.items()}
    for matrix, part in layout.parts.items():
        if part.anchor is not None:
            differs = points[matrix] != points[part.anchor]
            assert not differs[:, part.shared].any()
            others = [i for i in range(3) if i not in part.shared]
            assert differs[:, others].all()
    assert (runs["matrix"].values[runs["round"].values > 0] > 1).any()


def test_what_is_not_inadmissible_is_not_drawn_again():
    runs = made(Saltelli(64, 4), half_lost)
    later = runs["round"].values > 0
    last_before = runs["status"].values[~later].reshape(64, 5)
    # A and B are drawn again in just those blocks where they were inadmissible.
    for matrix in (0, 1):
        redrawn = np.unique(runs["block"].values[later & (runs["matrix"].values == matrix)])
        assert redrawn.tolist() == np.flatnonzero(last_before[:, matrix]).tolist()
        # Blocks of a replicate have points of their own.
        drawn = values(runs, later & (runs["matrix"].values == matrix))
        assert len(np.unique(drawn, axis=0)) == len(drawn)


def test_blocks_without_an_inadmissible_draw_cost_nothing_more():
    runs = made(Saltelli(1024, 4), lambda length, share, width: inadmissible(width < 0.002))
    extra = runs.sizes["run"] - 1024 * 5
    touched = len(np.unique(runs["block"].values[runs["round"].values > 0]))
    assert 0 < touched < 40
    # A, B and a part of each kind for each input, at most.
    assert extra <= 8 * touched


@pytest.mark.parametrize("status", [Status.FAILED, Status.NOT_FINITE, Status.CRASHED])
def test_a_run_lost_to_anything_else_is_not_drawn_again(status):
    runs = made(Saltelli(64, 4), lambda length, share, width: np.where(width < 0.1, status, 0))
    assert "round" not in runs.coords


def test_nothing_is_drawn_for_ever():
    runs = made(Saltelli(4, 2), lambda length, share, width: inadmissible(length > 0))
    assert int(runs["round"].max()) == MOST_ROUNDS
    assert (runs["matrix"].values[runs["round"].values > 0] < 2).all()


@pytest.mark.processor
def test_the_same_stream_gives_the_same_redraws():
    one, again = (made.__wrapped__(Saltelli(64, 4), half_lost) for _ in range(2))
    assert one.identical(again)
    assert not np.isin(one["width"], made(Saltelli(64, 4), half_lost, seed=2)["width"]).any()


@pytest.mark.parametrize("pair", [(0, 2), (2, 0)])
def test_points_drawn_given_others_follow_the_conditional_law(pair):
    # Of (length - 1) / 2 and width the first is larger. Given the width, the first is uniform above
    # it; given the first, the width is uniform below it.
    runs = made(Saltelli(16 * 256, 16), half_lost)
    layout = BlockLayout.from_runs(runs)
    rows = layout.run_numbers(runs)
    shared, drawn = pair
    part = layout.part_sharing_one(shared)
    chosen = rows[part.matrix]
    ok = (chosen >= 0) & (runs["status"].values[chosen] == 0)
    scaled = (values(runs, chosen[ok]) - [1, 0, 0]) / [2, 1, 1]
    low, high = (0, scaled[:, 0]) if shared == 0 else (scaled[:, 2], 1)
    position = (scaled[:, drawn] - low) / (high - low)
    # Four standard errors of the mean and the mean square of uniform numbers.
    error = 4 / math.sqrt(len(position))
    assert position.mean() == pytest.approx(1 / 2, abs=error * math.sqrt(1 / 12))
    assert (position**2).mean() == pytest.approx(1 / 3, abs=error * math.sqrt(4 / 45))


@pytest.mark.parametrize(("base", "replicates"), [(1000, 16), (16, 16), (24, 4)])
def test_another_number_of_blocks_is_refused(base, replicates):
    with pytest.raises(SettingsError, match="times a power of two") as caught:
        Saltelli(base, replicates)
    assert "base" in str(caught.value)


def test_a_row_of_the_first_round_does_not_serve_beside_an_anchor_drawn_again():
    # Of several models on the same points another may have lost the run of a B that was drawn
    # again; so no point that shares an input with it was ever made.
    first = made(Saltelli(64, 4))
    lost = float(first["width"].values[1])

    def fate(length, share, width):
        of_round = np.full(len(width), Status.OK if len(width) == 64 * 5 else Status.FAILED)
        return np.where(width == lost, Status.INADMISSIBLE, of_round)

    runs = made(Saltelli(64, 4), fate)
    layout = BlockLayout.from_runs(runs)
    rows = layout.run_numbers(runs)
    assert int(runs["round"].values[rows[1][0]]) == 1
    assert [int(rows[layout.part_sharing_one(i).matrix][0]) for i in range(3)] == [-1, -1, -1]
    assert (rows[layout.part_sharing_one(0).matrix][1:] >= 0).all()
