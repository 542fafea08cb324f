"""Contract tests of a design, of its extension and of a stopping rule."""

from __future__ import annotations

import pickle
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.blocks import join_blocks
from uqpen.core.labels import RUN, STATUS, WEIGHT
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.design import Design
from uqpen.designs.drawn_points import points_in_memory, points_of
from uqpen.designs.feedback import Feedback
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.rounds import first_round, run_rounds
from uqpen.designs.stopping.stopping_rule import StoppingRule
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.running_estimates import RunningEstimates
from uqpen.statistics.weights import effective_sizes
from uqpen.testing.contracts import EXAMPLE_OUTPUT, example_joint_distribution, sum_runs

# Contract test of a design.

# Number of standard errors within which a mean of draws is expected: 1 of 16 000 is outside.
_ERRORS = 4.0

# A multiple of the numbers that the vector instructions of a processor take at once.
_ALIGNED = 64


def check_design(design: Design, joint: JointDistribution | None = None) -> None:
    """Check the contract of a design.

    The same stream gives the same points; it makes no more runs than it states; a point has all
    inputs, along ``run`` or as scalars; points that are a sample follow the joint distribution. An
    adaptive design is sent runs without failures of one model, ``""``, with one output ``y``: the
    sum of the random inputs. A part of `DrawnPoints` is the same drawn alone, after later ones, and
    as a part of the whole. `Design.extension` says that the design keeps all points of its own.

    Parameters
    ----------
    design : Design
        With any settings.
    joint : JointDistribution, optional
        The inputs; by default `example_joint_distribution`.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    joint = joint or example_joint_distribution()
    assert isinstance(design.sampling, Sampling)
    assert not list(design.check_inputs(joint)), "the design takes these inputs"
    rounds, again = (_points(design, joint, Stream(1, "designs", "one")) for _ in range(2))
    assert len(rounds) == len(again)
    for one, other in zip(rounds, again, strict=True):
        assert one.identical(other), "the same stream gives the same points"
    runs = sum(points.sizes[RUN] for points in rounds)
    assert 0 < runs <= design.run_count(joint), "run_count is the number of runs, or the largest"
    for points in rounds:
        for entry in joint.inputs:
            assert entry.variable.name in points, f"a point has {entry.variable.name}"
        for entry in joint.random:
            assert points[entry.variable.name].dims == (RUN,), "a random input is along run"
            assert np.isfinite(points[entry.variable.name]).all(), "points are finite"
    assert design.extension(design, joint).kept == design.run_count(joint), "it keeps its own"
    _check_parts(design, joint)
    if design.sampling.is_sample and design.sampling is not Sampling.GIVEN:
        for entry in joint.random:
            values = np.concatenate([points[entry.variable.name].values for points in rounds])
            weights = np.concatenate([_weights(points) for points in rounds])
            share = float((weights * (entry.distribution.cdf(values) < 0.5)).sum() / weights.sum())
            error = 0.5 / np.sqrt(effective_sizes(weights))
            found = f"{share:.3f} of the points of {entry.variable.name} lie below its median"
            assert abs(share - 0.5) <= _ERRORS * error, found


def _check_parts(design: Design, joint: JointDistribution) -> None:
    """Check that points that are drawn by blocks are the same in any part, drawn in any order."""
    # By the design itself, as a check of the points would hide what it checks.
    points = points_of(next(design.rounds(joint, Stream(1, "designs", "one"))))
    if isinstance(points, xr.Dataset):
        return
    # Where arrays are divided otherwise, a function may round other last bits in their last rows.
    middle = points.runs // 2 // _ALIGNED * _ALIGNED
    ranges = [(0, middle), (middle, points.runs)] if middle else [(0, points.runs)]
    whole = points.read(0, points.runs)
    for start, stop in reversed(ranges):
        part = points.read(start, stop)
        same = whole.isel({RUN: slice(start, stop)})
        assert part.identical(same), f"points {start} to {stop} are the same drawn alone"
    parts = (points.read(start, stop) for start, stop in ranges)
    assert join_blocks(parts, points.runs).identical(whole), "joined parts are the whole"


def _points(design: Design, joint: JointDistribution, stream: Stream) -> list[xr.Dataset]:
    """Return the points of all rounds; every run succeeds."""
    rounds = run_rounds(
        design,
        joint,
        stream,
        lambda points, _: {
            "": sum_runs(points_in_memory(points_of(points)), joint, EXAMPLE_OUTPUT.output.name)
        },
        lambda made: RunningEstimates(made, design.sampling, {"": [EXAMPLE_OUTPUT]}),
    )
    return [each[""].drop_vars([STATUS, EXAMPLE_OUTPUT.output.name]) for each in rounds]


def _weights(points: xr.Dataset) -> FloatArray:
    """Return the relative weights of points."""
    if WEIGHT not in points.coords:
        return np.ones(points.sizes[RUN])
    return points[WEIGHT].values.astype(np.float64)


# Contract test of the extension of a design.


def check_extension(
    design: Design, earlier: Design, joint: JointDistribution | None = None
) -> None:
    """Check what `Design.extension` says of a design and an earlier one.

    As many of the earlier points as it says are among the new ones, to the bit. With the settings
    that it names as nearest, all of them are. The first round is looked at, of the same stream.

    Parameters
    ----------
    design, earlier : Design
        With any settings. Of one that decides its own number of runs, nothing is checked.
    joint : JointDistribution, optional
        The inputs; by default `example_joint_distribution`.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    if design.ends_early or earlier.ends_early:
        return
    joint = joint or example_joint_distribution()
    found = design.extension(earlier, joint)
    before = _extended_points(earlier, joint)
    if found.kept is not None:
        common = (before & _extended_points(design, joint)).total()
        assert common >= found.kept, f"{found.kept} points are kept, found {common}"
    if found.nearest:
        new: Any = design  # a dataclass, as each design with settings is
        nearest = replace(new, **found.nearest)
        assert nearest.extension(earlier, joint).kept == before.total(), "the nearest keeps all"
        assert before <= _extended_points(nearest, joint), "the nearest has all points"


def _extended_points(design: Design, joint: JointDistribution) -> Counter[bytes]:
    """Return how often each point is in the first round of a design."""
    points = points_in_memory(first_round(design, joint, Stream(1, "designs", "one")))
    columns = [points[entry.variable.name].values for entry in joint.random]
    return Counter(row.tobytes() for row in np.column_stack(columns))


# Contract test of a stopping rule.


def check_stopping_rule(rule: StoppingRule, requested: QuantityOfInterest | None = None) -> None:
    """Check the contract of a stopping rule.

    It describes itself in one line, takes the output, decides the same at the same estimates, as a
    pickled copy does, and is never satisfied where there is no interval.

    Parameters
    ----------
    rule : StoppingRule
        With any settings.
    requested : QuantityOfInterest, optional
        The output that it looks at, here the sum of the inputs of `example_joint_distribution`; by
        default ``y``, a plain number.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    requested = requested or EXAMPLE_OUTPUT
    assert len(str(rule).splitlines()) == 1, "str of a rule is one line"
    assert not list(rule.check_outputs([requested])), "the rule takes this output"
    again = pickle.loads(pickle.dumps(rule))
    for runs in (1, 512, 2048):
        joint = example_joint_distribution()
        points = first_round(MonteCarlo(runs), joint, Stream(1, "designs", "one"))
        made = {"": sum_runs(points_in_memory(points), joint, requested.output.name)}
        feedback = Feedback(
            made, RunningEstimates((made,), Sampling.INDEPENDENT, {"": [requested]})
        )
        decisions = [each.is_satisfied(feedback) for each in (rule, rule, again)]
        assert all(type(each) is bool for each in decisions), "a decision is True or False"
        assert len(set(decisions)) == 1, "the same estimates give the same decision"
        assert runs > 1 or not decisions[0], "an estimate without an interval is not precise"
