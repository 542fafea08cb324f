"""Integration rules of one input: Gauss's, and nested ones whose nodes chaospy computes.

The weights of a nested rule are the integrals of Lagrange's polynomials on its nodes over the
input's own distribution. So the rule is exact for polynomials of the input, of a degree below the
number of nodes at least. A transformation of probabilities would not be: it is exact for
polynomials of the probability.
"""

from __future__ import annotations

import functools
import importlib
import itertools
import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from uqpen.core.arrays import FloatArray
from uqpen.distributions.continuous import Beta, Gamma, Normal, Uniform
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.orthogonal_polynomials import Recurrence, recurrence

__all__ = [
    "NESTED_RULES",
    "NestedRule",
    "Rule",
    "is_exact",
    "node_counts",
    "rule_recurrence",
    "univariate_rules",
]

# Values of the input, and their weights.
Rule = tuple[FloatArray, FloatArray]

# Deviation from symmetry about the middle, relative to the spread of the input: rounding.
_ROUNDING = 1e-10

# Integral of an orthonormal polynomial, which should be 0, that shows a rule to be none.
_INEXACT = 1e-8

# A higher one takes chaospy more than some seconds.
_HIGHEST_ORDER_OF_LEJA = 12

# Degrees of the Genz–Keister rules by their number of nodes, and the numbers in each sequence.
_GENZ_KEISTER_DEGREES = dict(
    zip((1, 3, 7, 9, 17, 19, 31, 37, 41, 43), (1, 5, 7, 15, 17, 29, 31, 55, 63, 67), strict=True)
)
_GENZ_KEISTER_SIZES = {
    "16": (1, 3, 7, 9, 17, 19, 31),
    "18": (1, 3, 9, 19, 37),
    "22": (1, 3, 9, 19, 41),
    "24": (1, 3, 9, 19, 43),
}


@dataclass(frozen=True)
class NestedRule:
    """Sequence of rules of one input; the nodes of each are among those of the next.

    Parameters
    ----------
    sizes : sequence of int
        Numbers of nodes, ascending.
    degree : callable
        Degree of exactness, from a number of nodes and whether the distribution is symmetric about
        the middle of its range.
    accepts : callable
        Whether the rule is defined for a distribution.
    expected : str
        The accepted distributions in words, for a message.
    nodes : callable
        Nodes in the standard variable, from their number and the distribution.
    on_range : bool
        True if the standard variable runs from 0 to 1 over the distribution's range; otherwise it
        is that of the distribution's `Recurrence`.
    """

    sizes: Sequence[int]
    degree: Callable[[int, bool], int]
    accepts: Callable[[Distribution], bool]
    expected: str
    nodes: Callable[[int, Distribution], FloatArray]
    on_range: bool = True

    @property
    def highest_order(self) -> int:
        """Highest order that a rule of this sequence has for each accepted distribution."""
        return (self.degree(self.sizes[-1], False) - 1) // 2


def node_counts(rule: str, distribution: Distribution, orders: Sequence[int]) -> list[int]:
    """Return the number of nodes of one input's rules; see `univariate_rules`."""
    if rule not in NESTED_RULES:
        return [order + 1 for order in orders]
    nested, is_symmetric = NESTED_RULES[rule], _is_symmetric(distribution, orders[-1])
    degrees = [(size, nested.degree(size, is_symmetric)) for size in nested.sizes]
    return [next(size for size, degree in degrees if degree > 2 * order) for order in orders]


def rule_recurrence(rule: str, distribution: Distribution, order: int) -> Recurrence:
    """Return the recurrence of a distribution with the coefficients that a rule needs."""
    (nodes,) = node_counts(rule, distribution, [order])
    return recurrence(distribution, max(order, (nodes - 1) // 2))


def univariate_rules(rule: str, distribution: Distribution, orders: Sequence[int]) -> list[Rule]:
    """Compute one input's rules of some orders, each exact to degree 2 `order` + 1.

    Parameters
    ----------
    rule : str
        ``"gauss"`` or a name of `NESTED_RULES`.
    distribution : Distribution
        The input's distribution, which the rule accepts.
    orders : sequence of int
        Orders, ascending.

    Returns
    -------
    list of (values, weights)
        Values of the input, ascending, and weights whose sum is 1.
    """
    found = rule_recurrence(rule, distribution, orders[-1])
    if rule not in NESTED_RULES:
        return [found.gauss(order + 1) for order in orders]
    counts = node_counts(rule, distribution, orders)
    # Rules of one order after another are often the same.
    rules = {
        nodes: _nested_rule(NESTED_RULES[rule], distribution, found, nodes) for nodes in set(counts)
    }
    return [rules[nodes] for nodes in counts]


def is_exact(rule: str, distribution: Distribution, order: int) -> bool:
    """Check that rounding leaves one input's rule exact to degree 2 `order` + 1.

    Where a range is far wider than the spread, polynomials are so large at its ends that it does
    not.
    """
    if rule not in NESTED_RULES or not NESTED_RULES[rule].on_range:
        return True
    ((values, weights),) = univariate_rules(rule, distribution, [order])
    found = recurrence(distribution, 2 * order + 1)
    t = (values - found.location) / found.scale
    before, now = np.zeros_like(t), np.ones_like(t)
    with np.errstate(all="ignore"):
        for alpha, beta, following in zip(
            found.alpha[:-1], found.beta[:-1], found.beta[1:], strict=True
        ):
            if not following > 0:
                break  # the distribution has no further polynomials
            before, now = now, ((t - alpha) * now - math.sqrt(beta) * before) / math.sqrt(following)
            if not abs((now * weights).sum()) < _INEXACT:
                return False
    return True


def _nested_rule(
    nested: NestedRule, distribution: Distribution, found: Recurrence, size: int
) -> Rule:
    standard = np.sort(nested.nodes(size, distribution))
    if nested.on_range:
        lower, upper = _range(distribution)
        # Exact at both ends.
        values = lower * (1 - standard) + upper * standard
        low, high = (lower - found.location) / found.scale, (upper - found.location) / found.scale
        t = low * (1 - standard) + high * standard
    else:
        values, t = found.location + found.scale * standard, standard
    return values, _interpolatory_weights(t, replace(found, location=0.0, scale=1.0))


def _interpolatory_weights(t: FloatArray, found: Recurrence) -> FloatArray:
    """Integrate Lagrange's polynomials on the nodes t by Gauss's rule, which is exact for them."""
    points, shares = found.gauss((len(t) + 1) // 2)
    weights = np.empty_like(t)
    for number, node in enumerate(t):
        others = np.delete(t, number)
        polynomial = np.prod((points[:, np.newaxis] - others) / (node - others), axis=1)
        weights[number] = (polynomial * shares).sum()
    return weights / weights.sum()


def _range(distribution: Distribution) -> tuple[float, float]:
    return float(distribution.ppf(np.array(0.0))), float(distribution.isf(np.array(0.0)))


def _is_bounded(distribution: Distribution) -> bool:
    return bool(np.isfinite(_range(distribution)).all())


def _is_symmetric(distribution: Distribution, order: int) -> bool:
    """Check that moments up to degree 2 `order` + 1 are symmetric about the middle of the range."""
    if isinstance(distribution, Normal | Uniform):
        return True
    lower, upper = _range(distribution)
    found = recurrence(distribution, order)
    middle = (lower - found.location) / found.scale + (upper - lower) / (2 * found.scale)
    return bool((np.abs(found.alpha - middle) < _ROUNDING).all())


def _chaospy(function: str, *arguments: Any) -> FloatArray:
    """Return the nodes that a function of ``chaospy.quadrature`` computes."""
    with warnings.catch_warnings():
        # Its libraries use deprecated keywords of NumPy.
        warnings.simplefilter("ignore")
        quadrature: Any = importlib.import_module("chaospy.quadrature")
        nodes, _ = getattr(quadrature, function)(*arguments)
    return np.ravel(nodes).astype(np.float64)


def _on_unit_interval(function: str, chaospy_order: Callable[[int], int]) -> Any:
    """Return a function for nodes from 0 to 1; chaospy's order follows from their number."""
    return lambda size, _: _chaospy(function, chaospy_order(size), (0.0, 1.0))


def _leja_nodes(size: int, distribution: Distribution) -> FloatArray:
    # In the standard variable of the recurrence, as chaospy's search has an absolute tolerance.
    if isinstance(distribution, Gamma):
        shape = (distribution.mean / distribution.std) ** 2
        return (_search_leja_nodes(size, "Gamma", shape) - shape) / math.sqrt(shape)
    if isinstance(distribution, Beta):
        parameters = (distribution.alpha, distribution.beta, -1.0, 1.0)
        return _search_leja_nodes(size, "Beta", *parameters)
    if isinstance(distribution, Uniform):
        return _search_leja_nodes(size, "Uniform", -1.0, 1.0)
    return _search_leja_nodes(size, "Normal", 0.0, 1.0)


@functools.cache
def _search_leja_nodes(size: int, family: str, *parameters: float) -> FloatArray:
    """Return Leja nodes of a distribution of chaospy; each takes a search over the range.

    They are those of `chaospy.quadrature.leja`, which needs a version of NumPy before 2.4.
    """
    chaospy: Any = importlib.import_module("chaospy")
    distribution = getattr(chaospy, family)(*parameters)
    ends = [float(np.ravel(each)[0]) for each in (distribution.lower, distribution.upper)]
    nodes = [float(np.ravel(distribution.ttr([0]))[0])]  # the mean

    def negative(place: float) -> float:
        """Distances to the nodes so far, by the root of the density; times -1."""
        root = math.sqrt(np.ravel(distribution.pdf(place))[0])
        return -root * float(np.prod(np.abs(np.array(nodes) - place)))

    while len(nodes) < size:
        places = [ends[0], *nodes, ends[1]]
        found = [
            scipy.optimize.fminbound(negative, *gap, full_output=True)[:2]
            for gap in itertools.pairwise(places)
        ]
        best = min(range(len(found)), key=lambda gap: found[gap][1])
        nodes.insert(best, float(found[best][0]))
    return np.array(nodes)


def _has_leja_nodes(distribution: Distribution) -> bool:
    if isinstance(distribution, Beta):
        return min(distribution.alpha, distribution.beta) >= 1
    if isinstance(distribution, Gamma):
        return distribution.std <= distribution.mean
    return isinstance(distribution, Normal | Uniform)


def _interpolatory_degree(size: int, is_symmetric: bool) -> int:
    """Return the degree of exactness with an odd number of nodes, symmetric about the middle."""
    return size if is_symmetric else size - 1


def _on_bounded_range(
    function: str, sizes: Sequence[int], chaospy_order: Callable[[int], int]
) -> NestedRule:
    return NestedRule(
        sizes,
        _interpolatory_degree,
        _is_bounded,
        "inputs of bounded range",
        _on_unit_interval(function, chaospy_order),
    )


def _genz_keister(variant: str) -> NestedRule:
    sizes = _GENZ_KEISTER_SIZES[variant]
    return NestedRule(
        sizes,
        lambda size, _: _GENZ_KEISTER_DEGREES[size],
        lambda distribution: isinstance(distribution, Normal),
        "normal inputs",
        lambda size, _: _chaospy(f"genz_keister_{variant}", sizes.index(size)),
        on_range=False,
    )


# Clenshaw, C. W. & Curtis, A. R. (1960). Numer. Math. 2, 197-205.
# Fejér, L. (1933). Math. Z. 37, 287-309.
# Narayan, A. & Jakeman, J. D. (2014). SIAM J. Sci. Comput. 36, A2952-A2983.
# Patterson, T. N. L. (1968). Math. Comput. 22, 847-856.
# Genz, A. & Keister, B. D. (1996). J. Comput. Appl. Math. 71, 299-309.
NESTED_RULES = {
    "clenshaw-curtis": _on_bounded_range(
        "clenshaw_curtis", (1, *(2**k + 1 for k in range(1, 9))), lambda size: size - 1
    ),
    "fejer-1": _on_bounded_range("fejer_1", tuple(3**k for k in range(6)), lambda size: size - 1),
    "fejer-2": _on_bounded_range(
        "fejer_2", tuple(2**k - 1 for k in range(1, 9)), lambda size: size - 1
    ),
    "leja": NestedRule(
        range(1, 2 * _HIGHEST_ORDER_OF_LEJA + 3),
        # The first node is the mean.
        lambda size, _: max(size - 1, 1),
        _has_leja_nodes,
        "normal and uniform inputs, and gamma and beta ones of bounded density",
        _leja_nodes,
        on_range=False,
    ),
    "gauss-patterson": NestedRule(
        tuple(2**k - 1 for k in range(1, 9)),
        lambda size, _: (3 * size + 1) // 2 if size > 1 else 1,
        lambda distribution: isinstance(distribution, Uniform),
        "uniform inputs",
        _on_unit_interval("patterson", lambda size: size.bit_length() - 1),
    ),
    **{f"genz-keister-{variant}": _genz_keister(variant) for variant in _GENZ_KEISTER_SIZES},
}
