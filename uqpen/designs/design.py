"""Interface of a design of experiments: its settings and its extension."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, TypeAlias

from uqpen.core.errors import ModelError, Problem, toml_text
from uqpen.core.files import FileSnapshot
from uqpen.core.model import Results
from uqpen.core.sampling import Sampling
from uqpen.core.settings import choice, validate
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import Points, Round
from uqpen.designs.feedback import Feedback
from uqpen.designs.stopping.stopping_rule import RequestedOutput
from uqpen.distributions.joint_distribution import JointDistribution

# Extension of a design: which points of an earlier one it keeps.


@dataclass(frozen=True)
class Extension:
    """Points of an earlier design that are among those of a new one."""

    kept: int | None  # number of them; None where it is not known
    # Settings of the new design, nearest to its own, with which it keeps all. Empty where none are
    # known.
    nearest: Mapping[str, object] = field(default_factory=dict)
    reason: str = ""  # the property by which it does, such as ``"replicates of 20 points"``

    def text(self, earlier_runs: int, runs: int) -> str:
        """Return what becomes of earlier runs that are not used; empty if all are.

        Parameters
        ----------
        earlier_runs, runs : int
            Number of runs of the earlier design, and of the new one.
        """
        if self.kept is None:
            return f"it is not known how many of its {earlier_runs} earlier runs it uses"
        if self.kept >= earlier_runs:
            return ""
        text = f"{earlier_runs - self.kept} of its {earlier_runs} earlier runs are not used"
        if self.kept == runs or not self.nearest:
            return text
        settings = ", ".join(f"{name} = {toml_text(value)}" for name, value in self.nearest.items())
        return f"{text}; to use all of them: {settings} ({self.reason})"


# Setting ``keep``: whether the archive of a study has the runs of a design.

# The runs with their statistics, or these alone.
RUNS, STATISTICS = "runs", "statistics"


def keep_setting() -> Any:
    """Declare the setting ``keep`` of a design whose points do not depend on its runs."""
    return choice(RUNS, STATISTICS, default=RUNS)


def keep_problems(keep: str, rule: str) -> Iterator[Problem]:
    """Yield the problem of keeping no runs that decide their own number.

    Parameters
    ----------
    keep : str
        The setting.
    rule : str
        The key of the rule that ends the design; empty where the number of its runs is fixed.
    """
    if keep == STATISTICS and rule:
        expected = f'"{RUNS}" beside {rule}, as the end of such a design is verified by its runs'
        yield Problem(("keep",), f'"{keep}"', expected)


# Interface of a design of experiments.

# It yields the points of a round, and is sent what became of them.
Rounds: TypeAlias = "Generator[Points, Feedback, None]"
# The same of a design that may leave a round to some of the models.
ModelRounds: TypeAlias = "Generator[Points | Round, Feedback, None]"


NO_STEP_BETWEEN_LABELS = "no step leads from one label to another"


def steps_of_single_values(joint: JointDistribution) -> Iterator[Problem]:
    """Yield a problem for each input in which no small step can be made."""
    for entry in joint.random:
        if entry.distribution.is_discrete:
            found = f"steps of {entry.variable.name}, which has single values"
            yield Problem((), found, "inputs with a continuous distribution")


class Design(ABC):
    """Design of experiments: frozen settings that determine the points to run."""

    assumes_independence: ClassVar[bool] = False
    """True if its results have a meaning for independent inputs only."""

    independence_reason: ClassVar[str] = (
        "its indices split the variance among inputs that vary independently"
    )
    """The reason, for a message."""

    unordered_reason: ClassVar[str] = ""
    """Reason why its inputs cannot be labels, which have no order; empty if they can."""

    takes_intervals: ClassVar[bool] = False
    """True if it gives inputs that are intervals their values."""

    takes_boxes: ClassVar[bool] = False
    """True if distributions may have parameters that are intervals: its points are independent."""

    needs_numbers: ClassVar[bool] = False
    """True if its points follow numbers that every completed run must have."""

    needs_one_model: ClassVar[bool] = False
    """True if its next points follow from the results of one model."""

    keep: str = RUNS
    """Part of it that an archive has: ``"runs"``, or ``"statistics"`` without them."""

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
        if self.needs_one_model and len(models) > 1:
            found = f"a study of {len(models)} models"
            expected = "a study of one model: its results decide where the next runs are"
            yield Problem(("kind",), found, expected)

    def gives_quantile(self, output: str, probability: float) -> bool:
        """Check if its runs give a quantile of an output, or bounds of it, though no sample."""
        return False

    def remarks(self, joint: JointDistribution) -> Iterator[str]:
        """Yield what the summary of a study says of it, in a line each."""
        yield from ()

    def samples_inputs(self, joint: JointDistribution) -> bool:
        """Check that its points, or some of them, are a sample of a joint distribution."""
        return self.sampling.is_sample

    def sampling_of(self, joint: JointDistribution) -> Sampling:
        """Return the relation between its points, where a joint distribution may have boxes."""
        is_over_box = joint.boxes and self.takes_boxes
        return Sampling.OVER_BOX if is_over_box else self.sampling

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


# Stand-in for a user-defined design whose code is not executed.


@dataclass(frozen=True)
class UnloadedDesign(Design):
    """Design of an archive that has made its runs, but cannot draw its points here."""

    name: str  # the reference or the object that the study names
    sampling: Sampling = Sampling.GIVEN  # the sampling that the archive records with its runs
    runs: int = 0  # number of archived runs

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        raise ModelError(f"{self.name} is not loaded: it draws no points without --trust")

    def run_count(self, joint: JointDistribution) -> int:
        return self.runs
