"""The tasks by OpenTURNS."""

from __future__ import annotations

import numpy as np
import openturns as ot
import shared

BOOTSTRAPS = 100


def joint() -> ot.JointDistribution:
    return ot.JointDistribution([ot.Uniform(shared.LOWER, shared.UPPER)] * shared.DIMENSION)


def vectorized() -> ot.PythonFunction:
    def sample(points: ot.Sample) -> object:
        return shared.function(np.asarray(points))[:, None]

    return ot.PythonFunction(shared.DIMENSION, 1, func_sample=sample)


def figures(values: ot.Sample) -> shared.Figures:
    return {
        "mean": values.computeMean()[0],
        "std": values.computeStandardDeviation()[0],
        "quantiles": [values.computeQuantilePerComponent(p)[0] for p in shared.PROBABILITIES],
    }


def moments(runs: int, seed: int) -> shared.Figures:
    ot.RandomGenerator.SetSeed(seed)
    return figures(vectorized()(joint().getSample(runs)))


def one_by_one(runs: int, seed: int) -> shared.Figures:
    ot.RandomGenerator.SetSeed(seed)
    model = ot.PythonFunction(shared.DIMENSION, 1, lambda point: [shared.one_run(*point)])
    return figures(model(joint().getSample(runs)))


def given_data(runs: int, seed: int) -> shared.Figures:
    ot.RandomGenerator.SetSeed(seed)
    points = joint().getSample(runs)
    algorithm = ot.RankSobolSensitivityAlgorithm(points, vectorized()(points))
    algorithm.setBootstrapSize(BOOTSTRAPS)
    return {
        "first_order": list(algorithm.getFirstOrderIndices()),
        "first_order_bounds": bounds(algorithm.getFirstOrderIndicesInterval()),
    }


def sobol(runs: int, seed: int) -> shared.Figures:
    ot.RandomGenerator.SetSeed(seed)
    base = runs // (shared.DIMENSION + 2)
    points = ot.SobolIndicesExperiment(joint(), base).generate()
    algorithm = ot.SaltelliSensitivityAlgorithm(points, vectorized()(points), base)
    return {
        "first_order": list(algorithm.getFirstOrderIndices()),
        "first_order_bounds": bounds(algorithm.getFirstOrderIndicesInterval()),
        "total_order": list(algorithm.getTotalOrderIndices()),
        "total_order_bounds": bounds(algorithm.getTotalOrderIndicesInterval()),
    }


def bounds(interval: ot.Interval) -> list[list[float]]:
    return list(map(list, zip(interval.getLowerBound(), interval.getUpperBound(), strict=True)))


def expansion(runs: int, seed: int) -> shared.Figures:
    """Least angle regression by the corrected leave-one-out error, of total degree 12."""
    ot.RandomGenerator.SetSeed(seed)
    points = ot.LHSExperiment(joint(), runs).generate()
    enumerate_terms = ot.LinearEnumerateFunction(shared.DIMENSION)
    polynomials = [
        ot.StandardDistributionPolynomialFactory(ot.Uniform(shared.LOWER, shared.UPPER))
    ] * shared.DIMENSION
    basis = ot.OrthogonalProductPolynomialFactory(polynomials, enumerate_terms)
    selection = ot.LeastSquaresMetaModelSelectionFactory(ot.LARS(), ot.CorrectedLeaveOneOut())
    algorithm = ot.FunctionalChaosAlgorithm(
        points,
        vectorized()(points),
        joint(),
        ot.FixedStrategy(basis, enumerate_terms.getStrataCumulatedCardinal(12)),
        ot.LeastSquaresStrategy(selection),
    )
    algorithm.run()
    return shared.unexplained(
        np.asarray(algorithm.getResult().getMetaModel()(shared.fresh_points()))
    )


if __name__ == "__main__":
    shared.main("openturns", moments, one_by_one, given_data, sobol, expansion)
