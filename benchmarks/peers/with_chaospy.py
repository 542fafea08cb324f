"""The tasks by chaospy. Its indices follow from expansions alone, without intervals."""

from __future__ import annotations

import chaospy
import numpy as np
from shared import (
    DIMENSION,
    LOWER,
    UPPER,
    Figures,
    fresh_points,
    function,
    main,
    one_run,
    unexplained,
)
from shared import moments as figures


def joint() -> chaospy.Distribution:
    return chaospy.Iid(chaospy.Uniform(LOWER, UPPER), DIMENSION)


def moments(runs: int, seed: int) -> Figures:
    return figures(function(joint().sample(runs, seed=seed).T))


def one_by_one(runs: int, seed: int) -> Figures:
    points = joint().sample(runs, seed=seed).T.tolist()
    return figures(np.array([one_run(*point) for point in points]))


def expansion(runs: int, seed: int) -> Figures:
    """Least angle regression of scikit-learn, as chaospy's documentation advises."""
    from sklearn.linear_model import LarsCV

    np.random.seed(seed)  # noqa: NPY002 - Latin hypercubes of chaospy take no other seed
    points = joint().sample(runs, rule="latin_hypercube")
    terms = chaospy.generate_expansion(8, joint(), normed=True)
    fit = LarsCV(fit_intercept=False, max_iter=min(runs // 2, 100))
    fitted = chaospy.fit_regression(terms, points, function(points.T), model=fit)
    return unexplained(fitted(*fresh_points().T))


if __name__ == "__main__":
    main("chaospy", moments, one_by_one, expansion)
