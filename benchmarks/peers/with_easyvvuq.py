"""The tasks by EasyVVUQ: campaigns of runs in a database. Each run is one call of a function."""

from __future__ import annotations

import tempfile

import chaospy
import easyvvuq
import numpy as np
from shared import DIMENSION, LOWER, NAMES, UPPER, Figures, fresh_points, main, one_run, unexplained
from shared import moments as figures

VARIED = {name: chaospy.Uniform(LOWER, UPPER) for name in NAMES}
PARAMETERS = {name: {"type": "float", "default": 0.0} for name in NAMES}


def simulate(given: dict[str, float]) -> dict[str, float]:
    return {"y": one_run(*(given[name] for name in NAMES))}


def campaign(sampler: easyvvuq.sampling.BaseSamplingElement, runs: int = 0) -> easyvvuq.Campaign:
    """Make the runs of a sampler: all, or so many of an endless one."""
    actions = easyvvuq.actions.Actions(easyvvuq.actions.ExecutePython(simulate))
    made = easyvvuq.Campaign("ishigami", PARAMETERS, actions, work_dir=tempfile.mkdtemp())
    made.set_sampler(sampler)
    made.execute(nsamples=runs, sequential=True).collate()
    return made


def one_by_one(runs: int, seed: int) -> Figures:
    np.random.seed(seed)  # noqa: NPY002 - its samplers take no other seed
    made = campaign(easyvvuq.sampling.RandomSampler(VARIED), runs)
    return figures(made.get_collation_result()["y"].to_numpy(float).ravel())


def sobol(runs: int, seed: int) -> Figures:
    np.random.seed(seed)  # noqa: NPY002
    sampler = easyvvuq.sampling.QMCSampler(VARIED, n_mc_samples=runs // (DIMENSION + 2))
    made = campaign(sampler)
    result = made.analyse(qoi_cols=["y"])
    raw = result.raw_data
    return {
        "first_order": [float(np.ravel(raw["sobols_first"]["y"][name])[0]) for name in NAMES],
        "first_order_bounds": [
            [
                float(np.ravel(raw["conf_sobols_first"]["y"][name][end])[0])
                for end in ("low", "high")
            ]
            for name in NAMES
        ],
        "total_order": [float(np.ravel(raw["sobols_total"]["y"][name])[0]) for name in NAMES],
    }


def expansion(runs: int, seed: int) -> Figures:
    """Least squares of total degree: its expansions are not sparse, and take two runs a term."""
    np.random.seed(seed)  # noqa: NPY002
    order = max(order for order in range(1, 13) if 2 * terms(order) <= max(runs, 2 * terms(1)))
    made = campaign(easyvvuq.sampling.PCESampler(VARIED, polynomial_order=order, regression=True))
    predict = made.analyse(qoi_cols=["y"]).surrogate()
    points = fresh_points()
    given = {name: points[:, place] for place, name in enumerate(NAMES)}
    return unexplained(np.asarray(predict(given)["y"]))


def terms(order: int) -> int:
    return (order + 1) * (order + 2) * (order + 3) // 6


if __name__ == "__main__":
    main("easyvvuq", one_by_one, sobol, expansion)
