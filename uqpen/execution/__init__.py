"""Execution of a model over points: every run gets a status, and no failed run ends the study."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from uqpen.core.lazy_attributes import lazy_attributes

if TYPE_CHECKING:
    from uqpen.core.progress import Progress
    from uqpen.execution.batch import Map
    from uqpen.execution.evaluation import EvaluationOptions, evaluate, evaluate_blocks
    from uqpen.execution.evaluator import Evaluator
    from uqpen.execution.failures import FailurePolicy
    from uqpen.execution.joined_rounds import join_rounds
    from uqpen.execution.runs import (
        common_runs,
        first_repeats,
        mean_repeats,
        repeats_of,
        replicate_count,
        run_count,
        status_counts,
        worst_status_runs,
    )

__all__ = [
    "EXECUTORS",
    "EvaluationOptions",
    "Evaluator",
    "Executor",
    "ExecutorDetail",
    "FailurePolicy",
    "Map",
    "Progress",
    "common_runs",
    "evaluate",
    "evaluate_blocks",
    "first_repeats",
    "join_rounds",
    "mean_repeats",
    "repeats_of",
    "replicate_count",
    "run_count",
    "status_counts",
    "worst_status_runs",
]


class ExecutorDetail(NamedTuple):
    """Further option of the command line, which an executor takes as a text; empty by default."""

    name: str
    metavar: str
    help: str


class Executor(NamedTuple):
    """Way to make runs, which an option of the command line asks for."""

    # Reference. It takes the value of the option, then the text of its `detail` if it has one, then
    # a function that shows a message if it `reports`. It returns a context manager with a `Map` for
    # the runs.
    function: str
    metavar: str  # of the option
    help: str  # of the option
    step: str  # preparation before the first run in words, with braces for the value
    is_count: bool = False  # true if the value is a whole number, 1 or more; a text otherwise
    in_this_process: int | None = None  # the value with which this process makes the runs itself
    detail: ExecutorDetail | None = None  # A further option
    reports: bool = False  # true if it shows messages


# By the names of their options, of which a command takes one.
EXECUTORS = {
    "workers": Executor(
        "uqpen.execution.processes:processes",
        "N",
        "Make the runs on N processes; the archive is the same.  [default: 1]",
        "starting {} worker processes",
        is_count=True,
        in_this_process=1,
    ),
    "scheduler": Executor(
        "uqpen.execution.cluster:cluster",
        "ADDRESS|FILE",
        "Make the runs on the Dask cluster with this scheduler; the archive is the same.",
        "connecting to the Dask cluster",
        reports=True,
    ),
    "slurm": Executor(
        "uqpen.execution.slurm:slurm",
        "JOBS",
        "Make the runs in this number of jobs of SLURM at a time; the archive is the same.",
        "submitting {} jobs to SLURM",
        is_count=True,
        detail=ExecutorDetail(
            "sbatch",
            "OPTIONS",
            'Options of these jobs, such as "--time=2:00:00 --cpus-per-task=4".',
        ),
        reports=True,
    ),
}

# Imported when they are asked for: a worker process makes runs without datasets.
_HOMES = {
    "uqpen.core.progress": ("Progress",),
    "uqpen.execution.batch": ("Map",),
    "uqpen.execution.evaluation": (
        "EvaluationOptions",
        "evaluate",
        "evaluate_blocks",
    ),
    "uqpen.execution.evaluator": ("Evaluator",),
    "uqpen.execution.failures": ("FailurePolicy",),
    "uqpen.execution.joined_rounds": ("join_rounds",),
    "uqpen.execution.runs": (
        "common_runs",
        "first_repeats",
        "mean_repeats",
        "repeats_of",
        "replicate_count",
        "run_count",
        "status_counts",
        "worst_status_runs",
    ),
}

__getattr__ = lazy_attributes(__name__, _HOMES)
