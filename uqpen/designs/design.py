"""Interface of a design of experiments."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from typing import ClassVar, TypeAlias

from uqpen.core.errors import Problem
from uqpen.core.files import FileSnapshot
from uqpen.core.model import Results
from uqpen.core.sampling import Sampling
from uqpen.core.settings import validate
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import Points
from uqpen.designs.extension import Extension
from uqpen.designs.feedback import Feedback
from uqpen.designs.keep import RUNS
from uqpen.designs.round import Round
from uqpen.designs.stopping.stopping_rule import RequestedOutput
from uqpen.distributions.joint_distribution import JointDistribution

__all__ = ["Design", "ModelRounds", "Rounds"]

# It yields the points of a round, and is sent what became of them.
Rounds: TypeAlias = "Generator[Points, Feedback, None]"
# The same of a design that may leave a round to some of the models.
ModelRounds: TypeAlias = "Generator[Points | Round, Feedback, None]"


class Design(ABC):
    """Design of experiments: frozen settings that determine the points to run."""

    assumes_independence: ClassVar[bool] = False
    """True if its results have a meaning for independent inputs only."""

    independence_reason: ClassVar[str] = (
        "its indices split the variance among inputs that vary independently"
    )
    """The reason, for a message."""

    keep: str = RUNS
    """What an archive has of it: ``"runs"``, or ``"statistics"`` without them."""

    @property
    @abstractmethod
    def sampling(self) -> Sampling:
        """Relation between its points; it determines the error bars of estimates."""

    def __post_init__(self) -> None:
        validate(self, self.check_settings())

    def check_settings(self) -> Iterator[Problem]:
        """Yield the problems between settings that are valid by themselves."""
        yield from ()

    @abstractmethod
    def rounds(self, joint: JointDistribution, stream: Stream) -> ModelRounds:
        """Generate the points to run, round by round.

        A plain design yields once. An adaptive one is sent the `Feedback` of each round, its runs
        and the estimates from all rounds so far, and yields the next.

        Parameters
        ----------
        joint : JointDistribution
            The inputs of the study.
        stream : Stream
            Source of the design's random numbers.

        Yields
        ------
        Dataset, DrawnPoints or Round
            A variable for each input (SI values; along ``run``, or a scalar), and coordinates that
            an analysis needs. `DrawnPoints` are drawn by blocks, while runs are made. A `Round`
            names the models that run its points; without one, all do.
        """

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        """Yield the problems between its settings and the inputs of a study."""
        yield from ()

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        """Yield the problems between its settings and the outputs of a study.

        Parameters
        ----------
        requested : sequence of RequestedOutput
            One for each output of the study's first model.
        """
        yield from ()

    def check_models(
        self, models: Collection[str], costs: Mapping[str, float]
    ) -> Iterator[Problem]:
        """Yield the problems between its settings and the models of a study.

        Parameters
        ----------
        models : collection of str
            The names of all models.
        costs : mapping of str to float
            Cost of a run of the first model and of each that stands for it, relative to the first.
        """
        yield from ()

    def samples_inputs(self, joint: JointDistribution) -> bool:
        """Check that its points, or some of them, are a sample of a joint distribution."""
        return self.sampling.is_sample

    @property
    def replicate_count(self) -> int:
        """Number of independent replicates."""
        return 1

    @property
    def results(self) -> Results | None:
        """Results of its runs, in the order of its points; None where a model makes them."""
        return None

    @property
    def ends_early(self) -> bool:
        """True if its runs decide their own number, `run_count` at most."""
        return False

    @abstractmethod
    def run_count(self, joint: JointDistribution) -> int:
        """Return the number of its runs, or the largest possible number."""

    def total_runs(self, joint: JointDistribution, costs: Mapping[str, float]) -> int:
        """Return the number of its runs by all models, or the largest possible number.

        Parameters
        ----------
        joint : JointDistribution
            The inputs of the study.
        costs : mapping of str to float
            Cost of a run of each model, relative to the first.
        """
        return self.run_count(joint) * len(costs)

    def files(self) -> tuple[FileSnapshot, ...]:
        """Return snapshots of the files that contain its points."""
        return ()

    def extension(self, earlier: Design, joint: JointDistribution) -> Extension:
        """Return which points of an earlier design are among its own, to the bit.

        Both have the same inputs and the same stream. Points count by value, wherever they stand.

        Parameters
        ----------
        earlier : Design
            A design of any class; of another one than its own, nothing is known.
        joint : JointDistribution
            The inputs of the study.
        """
        return Extension(earlier.run_count(joint) if earlier == self else None)

    def scaled(self, joint: JointDistribution, runs: int, *, replicated: bool) -> Design | None:
        """Return this design with another number of runs, for a comparison at equal budgets.

        Parameters
        ----------
        joint : JointDistribution
            The inputs of the study.
        runs : int
            Largest number of runs; the design makes as many of them as it can.
        replicated : bool
            In about as many replicates as this one has; otherwise as one set of points.

        Returns
        -------
        Design or None
            None where it has no scale, needs more runs, or has no replicates.
        """
        return None
