"""Contract test of the extension of a design."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np

from uqpen.core.streams import Stream
from uqpen.designs.design import Design
from uqpen.designs.drawn_points import points_in_memory
from uqpen.designs.round import points_of
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.testing.example import example_joint_distribution

__all__ = ["check_extension"]


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
    before = _points(earlier, joint)
    if found.kept is not None:
        common = (before & _points(design, joint)).total()
        assert common >= found.kept, f"{found.kept} points are kept, found {common}"
    if found.nearest:
        new: Any = design  # a dataclass, as each design with settings is
        nearest = replace(new, **found.nearest)
        assert nearest.extension(earlier, joint).kept == before.total(), "the nearest keeps all"
        assert before <= _points(nearest, joint), "the nearest has all points"


def _points(design: Design, joint: JointDistribution) -> Counter[bytes]:
    """Return how often each point is in the first round of a design."""
    points = points_in_memory(points_of(next(design.rounds(joint, Stream(1, "designs", "one")))))
    columns = [points[entry.variable.name].values for entry in joint.random]
    return Counter(row.tobytes() for row in np.column_stack(columns))
