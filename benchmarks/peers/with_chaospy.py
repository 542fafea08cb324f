"""The tasks by chaospy. Its indices follow from expansions alone, without intervals."""

from __future__ import annotations

import chaospy
import numpy as np
import shared


def joint() -> chaospy.Distribution:
    return chaospy.Iid(chaospy.Uniform(shared.LOWER, shared.UPPER), shared.DIMENSION)


def moments(runs: int, seed: int) -> shared.Figures:
    return shared.moments(shared.function(joint().sample(runs, seed=seed).T))


def one_by_one(runs: int, seed: int) -> shared.Figures:
    points = joint().sample(runs, seed=seed).T.tolist()
    return shared.moments(np.array([shared.one_run(*point) for point in points]))


def expansion(runs: int, seed: int) -> shared.Figures:
    """Least angle regression of scikit-learn, as chaospy's documentation advises."""
    from sklearn.linear_model import LarsCV

    np.random.seed(seed)  # noqa: NPY002 - Latin hypercubes of chaospy take no other seed
    points = joint().sample(runs, rule="latin_hypercube")
    terms = chaospy.generate_expansion(8, joint(), normed=True)
    fit = LarsCV(fit_intercept=False, max_iter=min(runs // 2, 100))
    fitted = chaospy.fit_regression(terms, points, shared.function(points.T), model=fit)
    return shared.unexplained(fitted(*shared.fresh_points().T))


if __name__ == "__main__":
    shared.main("chaospy", moments, one_by_one, expansion)
