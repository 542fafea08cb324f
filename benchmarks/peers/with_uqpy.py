"""The tasks by UQpy. Its models are functions in files, so `shared` is one of them."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

import numpy as np
import shared
from UQpy.distributions import JointIndependent, Uniform
from UQpy.run_model import PythonModel, RunModel
from UQpy.sampling import LatinHypercubeSampling, MonteCarloSampling
from UQpy.sensitivity import SobolSensitivity
from UQpy.surrogates import (
    LeastAngleRegression,
    LeastSquareRegression,
    PolynomialChaosExpansion,
    TotalDegreeBasis,
)

INPUTS = [Uniform(shared.LOWER, shared.UPPER - shared.LOWER)] * shared.DIMENSION


def model() -> RunModel:
    """The function one run after the other; UQpy imports its file by name."""
    folder = tempfile.mkdtemp()
    (Path(folder) / "ishigami.py").write_text(Path(__file__).with_name("shared.py").read_text())
    sys.path.insert(0, folder)
    os.chdir(folder)
    return RunModel(PythonModel("ishigami.py", "function", delete_files=True))


def moments(runs: int, seed: int) -> shared.Figures:
    points = MonteCarloSampling(INPUTS, nsamples=runs, random_state=seed).samples
    return shared.moments(shared.function(points))


def one_by_one(runs: int, seed: int) -> shared.Figures:
    points = MonteCarloSampling(INPUTS, nsamples=runs, random_state=seed).samples
    runner = model()
    runner.run(samples=points)
    return shared.moments(np.ravel(runner.qoi_list))


def sobol(runs: int, seed: int) -> shared.Figures:
    # A number would seed each input alike, and all three inputs of a point would be equal.
    stream = np.random.RandomState(seed)
    analysis = SobolSensitivity(model(), JointIndependent(INPUTS), random_state=stream)
    analysis.run(
        n_samples=runs // (shared.DIMENSION + 2), n_bootstrap_samples=100, confidence_level=0.95
    )
    return {
        "first_order": np.ravel(analysis.first_order_indices).tolist(),
        "first_order_bounds": bounds(analysis.first_order_confidence_interval),
        "total_order": np.ravel(analysis.total_order_indices).tolist(),
        "total_order_bounds": bounds(analysis.total_order_confidence_interval),
    }


def bounds(found: shared.FloatArray) -> list[list[float]]:
    return np.reshape(found, (shared.DIMENSION, 2)).tolist()


def expansion(runs: int, seed: int) -> shared.Figures:
    """Least angle regression, of total degree 12, by its own selection of terms."""
    points = LatinHypercubeSampling(INPUTS, nsamples=runs, random_state=seed).samples
    basis = TotalDegreeBasis(JointIndependent(INPUTS), 12)
    chaos = PolynomialChaosExpansion(basis, LeastSquareRegression())
    chaos.fit(points, shared.function(points))
    chosen = LeastAngleRegression.model_selection(chaos)
    return shared.unexplained(chosen.predict(shared.fresh_points()))


if __name__ == "__main__":
    shared.main("UQpy", moments, one_by_one, sobol, expansion)
