"""A model over points: every run ends with a status, and none ends the study."""

from __future__ import annotations

from uqpen.evaluation.evaluator import Evaluator
from uqpen.evaluation.failures import Failures
from uqpen.evaluation.over_points import evaluate
from uqpen.evaluation.progress import Progress
from uqpen.evaluation.runs import join, status_counts, worst
from uqpen.executors.work import Map

__all__ = ["Evaluator", "Failures", "Map", "Progress", "evaluate", "join", "status_counts", "worst"]
