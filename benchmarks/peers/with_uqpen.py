"""The tasks by uqpen: studies in Python, which leave out sensitivities where a task has none."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import shared

import uqpen


def by_arrays(
    x1: shared.FloatArray, x2: shared.FloatArray, x3: shared.FloatArray
) -> dict[str, shared.FloatArray]:
    return {"y": shared.function(np.column_stack((x1, x2, x3)))}


def by_numbers(x1: float, x2: float, x3: float) -> dict[str, float]:
    return {"y": shared.one_run(x1, x2, x3)}


def archive_of(
    design: Any, seed: int, *, vectorized: bool = True, sensitivity: bool = False, **surrogates: Any
) -> uqpen.Archive:
    model = uqpen.PythonModel(
        by_arrays if vectorized else by_numbers,
        inputs=dict.fromkeys(shared.NAMES, "1"),
        outputs={"y": "1"},
        vectorized=vectorized,
    )
    study = uqpen.Study(
        model=model,
        inputs=dict.fromkeys(shared.NAMES, uqpen.Uniform(shared.LOWER, shared.UPPER)),
        designs={"design": design},
        surrogates=surrogates,
        seed=seed,
        sensitivity=sensitivity,
        convergence=False,
    )
    return uqpen.run(study)


def figures(archive: uqpen.Archive) -> shared.Figures:
    found = archive["statistics/design/y"]
    given = found["quantile"].sel(bound="estimate").values
    assert np.allclose(found["probability"], shared.PROBABILITIES)
    return {
        "mean": float(found["mean"].sel(bound="estimate")),
        "std": float(found["std"].sel(bound="estimate")),
        "quantiles": given.tolist(),
    }


def indices(archive: uqpen.Archive, *names: str) -> shared.Figures:
    found = archive["statistics/design/y"]
    result = {}
    for name in names:
        result[name] = found[name].sel(bound="estimate").values.tolist()
        bounds = found[name].sel(bound=["lower", "upper"])
        result[f"{name}_bounds"] = bounds.transpose("input", "bound").values.tolist()
    return result


def moments(runs: int, seed: int) -> shared.Figures:
    return figures(archive_of(uqpen.MonteCarlo(runs=runs), seed))


def one_by_one(runs: int, seed: int) -> shared.Figures:
    return figures(archive_of(uqpen.MonteCarlo(runs=runs), seed, vectorized=False))


def given_data(runs: int, seed: int) -> shared.Figures:
    design = uqpen.MonteCarlo(runs=runs)
    return indices(archive_of(design, seed, sensitivity=True), "first_order")


def sobol(runs: int, seed: int) -> shared.Figures:
    design = uqpen.Saltelli(base=runs // (shared.DIMENSION + 2))
    return indices(archive_of(design, seed, sensitivity=True), "first_order", "total_order")


def expansion(runs: int, seed: int) -> shared.Figures:
    chaos = uqpen.PolynomialChaos(design="design")
    archive = archive_of(uqpen.LatinHypercube(runs=runs, replicates=1), seed, chaos=chaos)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", uqpen.ExtrapolationWarning)  # beyond the outermost run
        predicted = archive.surrogate("chaos")(
            **dict(zip(shared.NAMES, shared.fresh_points().T, strict=True))
        )
    return shared.unexplained(predicted["y"].values)


if __name__ == "__main__":
    shared.main("uqpen", moments, one_by_one, given_data, sobol, expansion)
