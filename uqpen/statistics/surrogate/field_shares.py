"""Shares of the variance of a field that its inputs have, from its scores.

The variance at a place is a quadratic form of the components there, and so is the part of it that a
set of inputs explains. The components are orthonormal, so the mean of such a form over the field is
its trace. A share of that mean is a generalized index.

References
----------
Lamboni, M., Monod, H. & Makowski, D. (2011). Reliab. Eng. Syst. Saf. 96, 450-459.
Gamboa, F., Janon, A., Klein, T. & Lagnoux, A. (2014). Electron. J. Stat. 8, 575-603.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.statistics.surrogate.pick_freeze_pairs import PickFreezePairs, VarianceShares
from uqpen.surrogates.closed_forms import shapley_effects, sobol_indices

__all__ = ["FieldShares", "closed_form_shares", "sampled_shares"]


@dataclass(frozen=True, eq=False)
class FieldShares:
    """Shares of the variance at each place, and of its mean over the field.

    Parameters
    ----------
    first, total, shapley : ndarray, shape (place, input)
        NaN at a place without variance; NaN as a whole where there are none.
    generalized_first, generalized_total : ndarray, shape (input,)
    """

    first: FloatArray
    total: FloatArray
    shapley: FloatArray
    generalized_first: FloatArray
    generalized_total: FloatArray


def closed_form_shares(
    indices: IntArray, coefficients: FloatArray, components: FloatArray
) -> FieldShares:
    """Compute the shares from orthonormal terms.

    Parameters
    ----------
    indices : ndarray of int, shape (term, input)
        The degrees of the terms.
    coefficients : ndarray, shape (term, component)
        Of each score.
    components : ndarray, shape (component, place)
    """
    at_places = [coefficients @ place for place in components.T]
    whole = sobol_indices(indices, np.sqrt((coefficients**2).sum(axis=1)))
    found = [sobol_indices(indices, each) for each in at_places]
    return FieldShares(
        np.array([each.first for each in found]),
        np.array([each.total for each in found]),
        np.array([shapley_effects(indices, each) for each in at_places]),
        whole.first,
        whole.total,
    )


def sampled_shares(
    pairs: PickFreezePairs, scores: Sequence[str], components: FloatArray
) -> FieldShares:
    """Estimate the shares from pairs of draws of the scores.

    Parameters
    ----------
    pairs : PickFreezePairs
    scores : sequence of str
        Their names as outputs.
    components : ndarray, shape (component, place)
    """
    first, second = (
        _column(pairs.first, scores),
        {subset: _column(found, scores) for subset, found in pairs.second.items()},
    )
    usable = np.isfinite(first).all(axis=1)
    for values in second.values():
        usable &= np.isfinite(values).all(axis=1)
    first, second = first[usable], {subset: each[usable] for subset, each in second.items()}
    centred = first - first.mean(axis=0)
    unrelated = second.pop(0)
    variance = _forms(centred.T @ centred / len(first), components)
    explained = {0: np.zeros(len(variance)), (1 << pairs.dimension) - 1: np.ones(len(variance))}
    with np.errstate(invalid="ignore", divide="ignore"):
        for subset, values in second.items():
            # As for a scalar output: the one errs little where little is explained, the other
            # where little is left.
            share = _forms(centred.T @ (values - unrelated) / len(first), components) / variance
            change = first - values
            rest = _forms(change.T @ change / (2 * len(first)), components) / variance
            explained[subset] = np.where(share < rest, share, 1 - rest)
    rows = [
        VarianceShares(pairs.dimension, {subset: each[row] for subset, each in explained.items()})
        for row in range(len(variance))
    ]
    *places, whole = rows
    none = [np.nan] * pairs.dimension
    return FieldShares(
        np.array([each.first_order for each in places]),
        np.array([each.total_order for each in places]),
        np.array([each.shapley or none for each in places]),
        np.array(whole.first_order),
        np.array(whole.total_order),
    )


def _column(values: Mapping[str, FloatArray], scores: Sequence[str]) -> FloatArray:
    return np.column_stack([values[name] for name in scores])


def _forms(matrix: FloatArray, components: FloatArray) -> FloatArray:
    """Return the quadratic form at each place, and at the end its mean over the field."""
    return np.append(((matrix @ components) * components).sum(axis=0), np.trace(matrix))
