"""The work that each package is given: the Ishigami function, tasks by name, and their answers.

A script ``with_<package>.py`` has a function for each task that its package can do. The function
takes a number of runs and a seed, and returns figures by name; `main` prints them as JSON.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Sequence
from importlib import metadata
from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Figures = dict[str, Any]
Task = Callable[[int, int], Figures]

NAMES = ("x1", "x2", "x3")
DIMENSION = len(NAMES)
LOWER, UPPER = -math.pi, math.pi
PROBABILITIES = (0.05, 0.5, 0.95)

_A, _B = 7.0, 0.1
_OF_X1 = (1 + _B * math.pi**4 / 5) ** 2 / 2
_OF_X2 = _A**2 / 8
_OF_BOTH = _B**2 * math.pi**8 * (1 / 18 - 1 / 50)
VARIANCE = _OF_X1 + _OF_X2 + _OF_BOTH
MEAN = _A / 2
FIRST_ORDER = (_OF_X1 / VARIANCE, _OF_X2 / VARIANCE, 0.0)
TOTAL_ORDER = ((_OF_X1 + _OF_BOTH) / VARIANCE, _OF_X2 / VARIANCE, _OF_BOTH / VARIANCE)


def function(points: FloatArray) -> FloatArray:
    """Return the values of the Ishigami function at points `(run, input)`."""
    x1, x2, x3 = np.asarray(points).T
    return np.sin(x1) + _A * np.sin(x2) ** 2 + _B * x3**4 * np.sin(x1)


def one_run(x1: float, x2: float, x3: float) -> float:
    """Return one value of the function; it takes a fraction of a microsecond."""
    sine = math.sin(x1)
    return sine + _A * math.sin(x2) ** 2 + _B * x3**4 * sine


def moments(values: FloatArray) -> Figures:
    """Return mean, standard deviation and quantiles by NumPy."""
    return {
        "mean": float(np.mean(values)),
        "std": float(np.std(values, ddof=1)),
        "quantiles": np.quantile(values, PROBABILITIES).tolist(),
    }


def fresh_points() -> FloatArray:
    """Return points that no surrogate has seen."""
    return np.random.default_rng(20_000).uniform(LOWER, UPPER, (5_000, DIMENSION))


def unexplained(predicted: FloatArray) -> Figures:
    """Return the mean square error of predictions at fresh points over the variance."""
    truth = function(fresh_points())
    return {"unexplained": float(np.mean((np.ravel(predicted) - truth) ** 2) / VARIANCE)}


def main(package: str, start: Task, *others: Task, arguments: Sequence[str] = ()) -> None:
    """Do the task that the command line names, and print its figures; without one, list tasks.

    A task has the name of its function; the first one also measures the start of a process.
    """
    tasks = {each.__name__.replace("_", "-"): each for each in (start, *others)} | {"start": start}
    given = arguments or sys.argv[1:]
    if not given:
        print(json.dumps({"version": metadata.version(package), "tasks": sorted(tasks)}))
        return
    task, runs, seed = given
    print(json.dumps(tasks[task](int(runs), int(seed))))
