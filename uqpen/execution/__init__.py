"""Execution of a model over points: every run gets a status, and no failed run ends the study."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
        replicate_count,
        run_count,
        status_counts,
        worst_status_runs,
    )

__all__ = [
    "EvaluationOptions",
    "Evaluator",
    "FailurePolicy",
    "Map",
    "Progress",
    "common_runs",
    "evaluate",
    "evaluate_blocks",
    "join_rounds",
    "replicate_count",
    "run_count",
    "status_counts",
    "worst_status_runs",
]

# Imported when they are asked for: a worker process makes runs without datasets.
_HOMES = {
    "uqpen.core.progress": ("Progress",),
    "uqpen.execution.batch": ("Map",),
    "uqpen.execution.evaluation": ("EvaluationOptions", "evaluate", "evaluate_blocks"),
    "uqpen.execution.evaluator": ("Evaluator",),
    "uqpen.execution.failures": ("FailurePolicy",),
    "uqpen.execution.joined_rounds": ("join_rounds",),
    "uqpen.execution.runs": (
        "common_runs",
        "replicate_count",
        "run_count",
        "status_counts",
        "worst_status_runs",
    ),
}

__getattr__ = lazy_attributes(__name__, _HOMES)
