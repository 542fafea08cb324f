"""The tasks by SALib, which has sensitivity analysis alone."""

from __future__ import annotations

import numpy as np
from SALib.analyze import rbd_fast
from SALib.analyze import sobol as sobol_analysis
from SALib.sample import latin
from SALib.sample import sobol as sobol_sample
from shared import DIMENSION, LOWER, NAMES, UPPER, Figures, function, main, one_run

PROBLEM = {"num_vars": DIMENSION, "names": list(NAMES), "bounds": [[LOWER, UPPER]] * DIMENSION}


def with_bounds(found: dict[str, object], **names: str) -> Figures:
    result = {}
    for name, key in names.items():
        estimate, half = np.asarray(found[key]), np.asarray(found[f"{key}_conf"])
        result[name] = estimate.tolist()
        result[f"{name}_bounds"] = np.column_stack((estimate - half, estimate + half)).tolist()
    return result


def given_data(runs: int, seed: int) -> Figures:
    points = latin.sample(PROBLEM, runs, seed=seed)
    return with_bounds(
        rbd_fast.analyze(PROBLEM, points, function(points), num_resamples=100, seed=seed),
        first_order="S1",
    )


def one_by_one(runs: int, seed: int) -> Figures:
    points = latin.sample(PROBLEM, runs, seed=seed)
    values = np.array([one_run(*point) for point in points.tolist()])
    return with_bounds(
        rbd_fast.analyze(PROBLEM, points, values, num_resamples=100, seed=seed), first_order="S1"
    )


def sobol(runs: int, seed: int) -> Figures:
    base = runs // (DIMENSION + 2)
    points = sobol_sample.sample(PROBLEM, base, calc_second_order=False, seed=seed)
    found = sobol_analysis.analyze(
        PROBLEM, function(points), calc_second_order=False, num_resamples=100, seed=seed
    )
    return with_bounds(found, first_order="S1", total_order="ST")


if __name__ == "__main__":
    main("SALib", given_data, one_by_one, sobol)
