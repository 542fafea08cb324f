"""Stand-in for a user-defined design whose code is not executed."""

from __future__ import annotations

from dataclasses import dataclass

from uqpen.core.errors import ModelError
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Rounds
from uqpen.distributions.joint_distribution import JointDistribution

__all__ = ["UnloadedDesign"]


@dataclass(frozen=True)
class UnloadedDesign(Design):
    """Design of an archive that has made its runs, but cannot draw its points here.

    Parameters
    ----------
    name : str
        The reference or the object that the study names.
    sampling : Sampling
        The sampling that the archive records with its runs.
    runs : int
        Number of archived runs.
    """

    name: str
    sampling: Sampling = Sampling.GIVEN
    runs: int = 0

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        raise ModelError(f"{self.name} is not loaded: it draws no points without --trust")

    def run_count(self, joint: JointDistribution) -> int:
        return self.runs
