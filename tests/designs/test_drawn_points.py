"""Points of a round may be drawn by blocks, and are the same as if all were in memory."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.core.labels import RUN
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count
from uqpen.core.streams import BLOCK, Stream
from uqpen.designs.design import Design
from uqpen.designs.drawn_points import DrawnPoints, points_in_memory
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quasi_monte_carlo import Halton, SobolSequence
from uqpen.designs.rounds import draw_rounds
from uqpen.testing import check_design, example_joint_distribution

STREAM = Stream(1, "designs", "mine")
JOINT = example_joint_distribution()
STUDY = """
seed = 1
{model}
[inputs]
x1 = {{ uniform = {{ lower = -3, upper = 3 }} }}
x2 = {{ uniform = {{ lower = -3, upper = 3 }} }}
x3 = 0
[designs.mine]
kind = "monte-carlo"
runs = 10
"""
ONE = '[model]\nuse = "ishigami"'
TWO = '[models.a]\nuse = "ishigami"\n[models.b]\nuse = "ishigami"\nwith = { x3 = 1.5 }'


@dataclass(frozen=True)
class Drawn(Design):
    """Independent draws by blocks, each of them changed by a function."""

    sampling = Sampling.INDEPENDENT

    change: Any = lambda points, start: points
    runs: int = count(default=2 * BLOCK + 100)

    def rounds(self, joint, stream):
        (plain,) = MonteCarlo(self.runs).rounds(joint, stream)
        assert isinstance(plain, DrawnPoints)

        def draw(start, stop):
            return self.change(plain.draw(start, stop), start)

        yield DrawnPoints(self.runs, draw)

    def run_count(self, joint):
        return self.runs


def weighted(weights):
    def change(points, start):
        return points.assign_coords(weight=(RUN, weights(start, points.sizes[RUN])))

    return change


def blocks_of(design):
    points = next(draw_rounds(design, JOINT, STREAM))
    assert isinstance(points, DrawnPoints)
    yield from points.blocks()


class TestBuiltInDesigns:
    @pytest.mark.parametrize(
        "design",
        [
            MonteCarlo(BLOCK + 30_000),
            LatinHypercube(2 * 40_000, replicates=2),
            SobolSequence(3 * 2**15, replicates=3),
            Halton(3 * 30_000, replicates=3),
        ],
        ids=lambda design: type(design).__name__,
    )
    def test_any_block_is_the_same_drawn_alone(self, design):
        (points,) = design.rounds(JOINT, STREAM)
        assert isinstance(points, DrawnPoints)
        assert points.size == design.run_count(JOINT)
        first, second = points.blocks()
        assert points.read(BLOCK, points.size).identical(second)
        assert points.read(0, BLOCK).identical(first)
        assert points.dataset().identical(xr.concat([first, second], RUN, data_vars="minimal"))
        assert points.read(0, points.size).identical(points.dataset())

    def test_a_replicate_is_drawn_once_where_blocks_are_drawn_in_order(self):
        drawn = []

        @dataclass(frozen=True)
        class Noted(LatinHypercube):
            def draw(self, rng, points, dimension):
                drawn.append(points)
                return super().draw(rng, points, dimension)

        blocks = list(blocks_of(Noted(BLOCK + 40_000, replicates=4)))
        assert drawn == [(BLOCK + 40_000) // 4] * 4
        assert sum(each.sizes[RUN] for each in blocks) == BLOCK + 40_000

    def test_points_of_one_block_are_in_memory(self):
        (points,) = MonteCarlo(BLOCK).rounds(JOINT, STREAM)
        found = next(draw_rounds(MonteCarlo(BLOCK), JOINT, STREAM))
        assert isinstance(found, xr.Dataset)
        assert found.identical(points_in_memory(points))


class TestPointsFromOutside:
    def test_they_meet_the_contract(self):
        check_design(Drawn(runs=500))
        check_design(Drawn(weighted(lambda start, runs: np.ones(runs)), runs=500))

    @pytest.mark.parametrize(
        "change",
        [
            lambda points, start: points.assign(length=points["length"] + 1e-9 * start),
            lambda points, start: points.assign(length=points["length"][::-1].drop_vars(RUN)),
        ],
        ids=["by the part", "reversed"],
    )
    def test_points_that_depend_on_the_part_break_it(self, change):
        with pytest.raises(AssertionError, match="are the same drawn alone"):
            check_design(Drawn(change, runs=500))

    def test_they_may_be_changed_block_by_block(self):
        (points,) = MonteCarlo(BLOCK + 10).rounds(JOINT, STREAM)
        assert isinstance(points, DrawnPoints)
        other = points.assign({"mass": 7.0}).assign_attrs({"note": "x"})
        other = other.pipe(lambda part: part.assign_coords(weight=2 * part["length"]))
        found = other.read(BLOCK, BLOCK + 10)
        assert found["mass"] == 7.0
        assert found.attrs["note"] == "x"
        assert np.array_equal(found["weight"], 2 * found["length"])
        assert found[RUN].values.tolist() == list(range(BLOCK, BLOCK + 10))

    @pytest.mark.parametrize(
        ("change", "found"),
        [
            (lambda points, start: 1 if start else points, "an object of class int"),
            (lambda points, start: points.drop_vars("share") if start else points, "lack share"),
            (lambda points, start: points.isel(run=slice(5 if start else None)), "draws 5 points"),
            (
                lambda points, start: (
                    points.assign_coords(replicate=(RUN, points["run"].values)) if start else points
                ),
                "some of its blocks have a replicate, others none",
            ),
            (weighted(lambda start, runs: np.full(runs, -1.0 * bool(start) + 0.5)), "below 0"),
            (weighted(lambda start, runs: np.full(runs, np.inf if start else 1)), "not finite"),
            (lambda points, start: 1 / 0 if start else points, "ZeroDivisionError"),
        ],
        ids=["no dataset", "input", "size", "coordinate", "negative", "infinite", "error"],
    )
    def test_a_fault_of_a_later_block_is_refused_where_it_is_drawn(self, change, found):
        blocks = blocks_of(Drawn(change))
        next(blocks)
        with pytest.raises(uqpen.StudyError, match=f"the design Drawn fails: .*{found}"):
            next(blocks)

    @pytest.mark.parametrize("runs", [100, 2 * BLOCK + 100])
    def test_a_fault_of_the_first_block_is_refused_before_a_run(self, runs):
        study = uqpen.parse_study(STUDY.format(model=ONE))
        design = Drawn(lambda points, start: points.drop_vars("x2"), runs)
        with pytest.raises(uqpen.StudyError, match="its points lack x2"):
            uqpen.run(replace(study, designs={"mine": design}), map=_refuse)

    def test_weights_may_be_0_in_a_block_but_not_in_all(self):
        in_the_last = weighted(lambda start, runs: np.full(runs, float(start > BLOCK)))
        assert len(list(blocks_of(Drawn(in_the_last)))) == 3
        with pytest.raises(uqpen.StudyError, match="0 everywhere"):
            next(blocks_of(Drawn(weighted(lambda start, runs: np.zeros(runs)))))

    def test_no_points_are_refused(self):
        class Empty(Drawn):
            def rounds(self, joint, stream):
                yield DrawnPoints(0, lambda start, stop: joint.points(np.empty((0, 2)), {}))

        with pytest.raises(uqpen.StudyError, match="the design Empty fails: it yields no points"):
            next(blocks_of(Empty()))

    def test_several_models_get_the_same_points(self):
        study = uqpen.parse_study(STUDY.format(model=TWO))
        tree = uqpen.run(replace(study, designs={"mine": Drawn(runs=300)}))
        one, other = (tree[f"models/{name}/runs/mine"] for name in "ab")
        assert np.array_equal(one["x1"].values, other["x1"].values)
        assert (float(one["x3"]), float(other["x3"])) == (0.0, 1.5)


def _refuse(*_):
    raise AssertionError("a run was made")
