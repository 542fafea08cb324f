"""Integration rules: nodes with weights, exact for polynomials of the inputs."""

from __future__ import annotations

import functools
import importlib
import itertools
import math
import operator
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
import scipy

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.errors import Problem, SettingsError
from uqpen.core.labels import QUADRATURE_WEIGHT
from uqpen.core.sampling import Sampling
from uqpen.core.settings import choice, count
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Rounds
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.input_group import SampleDistribution
from uqpen.distributions.joint_distribution import JointDistribution, points_dataset
from uqpen.distributions.orthogonal_polynomials import Recurrence, recurrence
from uqpen.distributions.univariate import Beta, Gamma, Normal, Uniform

# Grids over the inputs: every combination of some values of each.


Number = TypeVar("Number", np.float64, np.int64)

# Most nodes of a grid, which doubles or trebles with every input: a mistake goes far beyond.
_MOST_NODES = 10_000_000


def tensor_grid(columns: Sequence[npt.NDArray[Number]]) -> list[npt.NDArray[Number]]:
    """Return every combination of the entries of some columns; the last column varies fastest."""
    before, after = 1, math.prod(map(len, columns))
    grid = []
    for column in columns:  # not by `meshgrid`, which takes no more than 32 columns
        after //= len(column)
        grid.append(np.tile(np.repeat(column, after), before))
        before *= len(column)
    return grid


def too_many_nodes(setting: str, value: int, nodes: int, inputs: int) -> Iterator[Problem]:
    """Yield a problem with a setting and its value if its grid over the inputs is too large."""
    if nodes > _MOST_NODES:
        found = f"{value}, which over {inputs} random inputs takes {nodes:.3g} runs"
        expected = f"a grid of at most {_MOST_NODES:_} runs: fewer nodes, or fewer random inputs"
        yield Problem((setting,), found, expected)


# Integration rules of one input: Gauss's, and nested ones whose nodes chaospy computes.
#
# The weights of a nested rule are the integrals of Lagrange's polynomials on its nodes over the
# input's own distribution. So the rule is exact for polynomials of the input, of a degree below the
# number of nodes at least. A transformation of probabilities would not be: it is exact for
# polynomials of the probability.

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
    """Sequence of rules of one input; the nodes of each are among those of the next."""

    sizes: Sequence[int]  # numbers of nodes, ascending
    # Degree of exactness, from a number of nodes and whether the distribution is symmetric about
    # the middle of its range.
    degree: Callable[[int, bool], int]
    accepts: Callable[[Distribution], bool]  # whether the rule is defined for a distribution
    expected: str  # the accepted distributions in words, for a message
    # Nodes in the standard variable, from their number and the distribution.
    nodes: Callable[[int, Distribution], FloatArray]
    # True if the standard variable runs from 0 to 1 over the distribution's range; otherwise it is
    # that of the distribution's `Recurrence`.
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


def _on_bounded_range(
    function: str, sizes: Sequence[int], chaospy_order: Callable[[int], int]
) -> NestedRule:
    return NestedRule(
        sizes,
        # The numbers of nodes are odd, and the nodes symmetric about the middle.
        lambda size, is_symmetric: size if is_symmetric else size - 1,
        lambda distribution: bool(np.isfinite(_range(distribution)).all()),
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


WEIGHT_ATTRIBUTES = {"units": "1", "long_name": "weight of the run in an integral over the inputs"}

# At higher orders, weights of the outer nodes are too small to matter.
_HIGHEST_ORDER = 100

# Most univariate rules in all the grids that a sparse one combines: combining them takes some
# 20 seconds. A slip in the order or in the number of inputs goes far beyond.
_MOST_RULES = 300_000

# Nodes of two rules that lie closer than this, relative to the spread of the nodes, are the same:
# the middle of a symmetric distribution.
_SAME_NODE = 1e-10


@dataclass(frozen=True)
class Quadrature(Design):
    """Integration rules of the inputs' distributions, combined over independent inputs.

    Parameters
    ----------
    order : int
        The rule is exact for polynomials up to degree 2 `order` + 1: in each input by itself on a
        tensor grid, in all of them together on a sparse one.
    grid : str
        ``"tensor"`` takes every combination of the nodes of each input (`order` + 1 of Gauss's
        rule); ``"sparse"`` far fewer of them where there are many inputs (Smolyak's
        construction); some nodes then have a negative weight.
    rule : str
        Rule of each input, for its own distribution. ``"gauss"`` has the fewest nodes of its
        degree. The others, one of `uqpen.designs.quadrature.NESTED_RULES`, are nested: the
        nodes of a lower order are among those of a higher one. Each has the fewest nodes of its
        sequence that are exact to the same degree (Petras 2003); weights can be negative. Their
        nodes are chaospy's.

    References
    ----------
    Golub, G. H. & Welsch, J. H. (1969). Math. Comput. 23, 221-230.
    Smolyak, S. A. (1963). Dokl. Akad. Nauk SSSR 148, 1042-1045.
    Petras, K. (2003). Numer. Math. 93, 729-753.
    """

    unordered_reason = "labels have no moments, which its points have in common with the inputs"

    sampling = Sampling.QUADRATURE
    assumes_independence = True
    independence_reason = "its nodes are those of inputs that vary independently"

    order: int = count()
    grid: str = choice("tensor", "sparse", default="tensor")
    rule: str = choice("gauss", *NESTED_RULES, default="gauss")

    def check_settings(self) -> Iterator[Problem]:
        highest, expected = _HIGHEST_ORDER, f"at most {_HIGHEST_ORDER}"
        if self.rule in NESTED_RULES and NESTED_RULES[self.rule].highest_order < highest:
            highest = NESTED_RULES[self.rule].highest_order
            expected = f'at most {highest} with the rule "{self.rule}"'
        if self.order > highest:
            yield Problem(("order",), str(self.order), expected)

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        for name in joint.fitted:
            found = f"quadrature over {name}, whose parameters are uncertain"
            expected = (
                "a sample: the predictive distribution has the tails of Student's, of which higher "
                "moments are infinite, so its polynomials end"
            )
            yield Problem(("kind",), found, expected)
            return
        if problems := list(self._rule_problems(joint)):
            yield from problems
            return
        nodes = math.prod(self._node_counts(joint))
        if self.grid == "sparse":
            nodes = self._most_nodes(joint)
        too_many = list(too_many_nodes("order", self.order, nodes, len(joint.random)))
        if self.grid == "sparse" and not too_many:
            too_many = list(self._too_many_grids(len(joint.random)))
        yield from too_many
        for entry in joint.random:
            if not rule_recurrence(self.rule, entry.distribution, self.order).is_finite:
                found = f"{self.order}, of which {entry.variable.name} has no polynomials"
                yield Problem(
                    ("order",), found, "a lower one: the distribution has too few values or moments"
                )
            elif not is_exact(self.rule, entry.distribution, self.order):
                found = (
                    f'{self.order}, which "{self.rule}" loses to rounding for {entry.variable.name}'
                )
                expected = (
                    'a lower one, or the rule "gauss": the range is far wider than the spread'
                )
                yield Problem(("order",), found, expected)

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        columns, weights = self._nodes(joint)
        values = {
            entry.variable.name: column for entry, column in zip(joint.random, columns, strict=True)
        }
        points = points_dataset(joint, values, {QUADRATURE_WEIGHT: weights}, runs=len(weights))
        points[QUADRATURE_WEIGHT].attrs = WEIGHT_ATTRIBUTES
        yield points

    def run_count(self, joint: JointDistribution) -> int:
        if self.grid == "tensor":
            return math.prod(self._node_counts(joint))
        return len(self._nodes(joint)[1])

    def _rule_problems(self, joint: JointDistribution) -> Iterator[Problem]:
        """Yield the problems between the rule and the inputs."""
        if self.rule not in NESTED_RULES:
            return
        nested = NESTED_RULES[self.rule]
        for entry in joint.random:
            if not nested.accepts(entry.distribution):
                found = f'"{self.rule}" for {entry.variable.name}'
                yield Problem(("rule",), found, f'{nested.expected}, or the rule "gauss"')

    def _too_many_grids(self, inputs: int) -> Iterator[Problem]:
        """Yield a problem if a sparse grid combines too many grids to be made before the runs."""
        levels = range(max(self.order - inputs + 1, 0), self.order + 1)
        grids = sum(math.comb(level + inputs - 1, level) for level in levels)
        if grids * inputs > _MOST_RULES:
            found = f"{self.order}, which over {inputs} random inputs combines {grids:.3g} grids"
            expected = f"at most {_MOST_RULES // inputs} grids: a lower order, or fewer inputs"
            yield Problem(("order",), found, expected)

    def _node_counts(self, joint: JointDistribution) -> list[int]:
        """Return the number of nodes of each input on a tensor grid."""
        return [
            node_counts(self.rule, entry.distribution, [self.order])[0] for entry in joint.random
        ]

    def _most_nodes(self, joint: JointDistribution) -> int:
        """Count the nodes of all the grids that a sparse one combines; some coincide."""
        # Nodes of the grids of total level k: the coefficient of x^k in a product over the inputs.
        coefficients = [1]
        for entry in joint.random:
            counts = node_counts(self.rule, entry.distribution, range(self.order + 1))
            coefficients = [
                sum(map(operator.mul, coefficients[: level + 1], reversed(counts[: level + 1])))
                for level in range(self.order + 1)
            ]
        return sum(coefficients[max(self.order - len(joint.random) + 1, 0) :])

    def _nodes(self, joint: JointDistribution) -> tuple[list[FloatArray], FloatArray]:
        """Return the nodes' values, input by input, and their weights."""
        if problems := list(self._rule_problems(joint)):
            raise SettingsError(problems)
        orders = range(self.order + 1) if self.grid == "sparse" else [self.order]
        levels = [univariate_rules(self.rule, entry.distribution, orders) for entry in joint.random]
        if self.grid == "sparse":
            return _smolyak(levels, self.order)
        rules = [rule for (rule,) in levels]
        weights: FloatArray = np.prod(tensor_grid([weights for _, weights in rules]), axis=0)
        return tensor_grid([values for values, _ in rules]), weights


def _smolyak(rules: list[list[Rule]], order: int) -> tuple[list[FloatArray], FloatArray]:
    """Combine small tensor grids by Smolyak's construction.

    Wasilkowski, G. W. & Woźniakowski, H. (1995). J. Complexity 11, 1-56.
    """
    inputs = len(rules)
    nodes, labels, weights = zip(*map(_merge_levels, rules), strict=True)
    labelled: list[IntArray] = []
    weighed: list[FloatArray] = []
    for levels in _multi_indices(inputs, order):
        missing = order - sum(levels)
        sign = (-1) ** missing * math.comb(inputs - 1, missing)
        chosen = tensor_grid([label[level] for label, level in zip(labels, levels, strict=True)])
        factors = tensor_grid(
            [weight[level] for weight, level in zip(weights, levels, strict=True)]
        )
        labelled.append(np.stack(chosen, axis=1))
        weighed.append(sign * np.prod(factors, axis=0))
    places, where = _distinct_rows(np.concatenate(labelled), [len(node) for node in nodes])
    total: FloatArray = np.zeros(len(places))
    np.add.at(total, where, np.concatenate(weighed))
    return [node[column] for node, column in zip(nodes, places.T, strict=True)], total


def _distinct_rows(rows: IntArray, sizes: list[int]) -> tuple[IntArray, IntArray]:
    """Return the distinct rows in lexicographic order, and the number of each row among them.

    The entries of a column are less than its size.
    """
    if math.prod(sizes) >= 2**63:
        places, where = np.unique(rows, axis=0, return_inverse=True)
        return places, where.ravel()
    # One number for a row is sorted some ten times faster than the row.
    numbers, where = np.unique(np.ravel_multi_index(tuple(rows.T), sizes), return_inverse=True)
    return np.stack(np.unravel_index(numbers, sizes), axis=1), where.ravel()


def _merge_levels(rules: list[Rule]) -> tuple[FloatArray, list[IntArray], list[FloatArray]]:
    """Merge one input's rules, level by level: all nodes, those of each rule, and weights."""
    values = np.concatenate([values for values, _ in rules])
    ascending = np.argsort(values, kind="stable")
    is_new = np.diff(values[ascending], prepend=-np.inf) > _SAME_NODE * np.ptp(values)
    label = np.empty(len(values), dtype=np.int64)
    label[ascending] = np.cumsum(is_new) - 1
    ends = np.cumsum([len(values) for values, _ in rules[:-1]])
    return values[ascending][is_new], np.split(label, ends), [weights for _, weights in rules]


def _multi_indices(inputs: int, order: int) -> Iterator[tuple[int, ...]]:
    """Yield the levels of each input; their sum is the order, or less by fewer than the inputs."""
    for total in range(max(order - inputs + 1, 0), order + 1):
        # Bars between stars: every way to share out the total.
        for bars in itertools.combinations(range(total + inputs - 1), inputs - 1):
            ends = (-1, *bars, total + inputs - 1)
            yield tuple(after - before - 1 for before, after in itertools.pairwise(ends))


# Full factorial design: every combination of a few levels of each input.


@dataclass(frozen=True)
class FullFactorial(Design):
    """Full factorial design over the medians of equally likely strata of each input.

    As an integration rule, it is the midpoint rule over the unit cube of probabilities. An
    independent input of labels, or of at most `levels` single values, has each of them once, with
    its probability as weight.

    Parameters
    ----------
    levels : int
        Number of values of each other random input.
    """

    sampling = Sampling.QUADRATURE

    levels: int = count(minimum=2)

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        for group in joint.groups:
            if isinstance(group, SampleDistribution):
                # Levels of the probability that selects a row are rows of any kind.
                found = f"levels of {', '.join(group.inputs)}, which are rows of a sample"
                yield Problem((), found, "a sample, such as monte-carlo or latin-hypercube")
        runs = self.run_count(joint)
        yield from too_many_nodes("levels", self.levels, runs, len(joint.random))

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        medians, shares = zip(*self._levels(joint), strict=True)
        unit = np.stack(tensor_grid(medians), axis=1)
        weights = np.prod(tensor_grid(shares), axis=0)
        points = joint.points(unit, {QUADRATURE_WEIGHT: weights})
        points[QUADRATURE_WEIGHT].attrs = WEIGHT_ATTRIBUTES
        yield points

    def run_count(self, joint: JointDistribution) -> int:
        return math.prod(len(shares) for _, shares in self._levels(joint))

    def _levels(self, joint: JointDistribution) -> Iterator[tuple[FloatArray, FloatArray]]:
        """Yield for each random input the median and the size of each stratum of probability."""
        joined = {name for group in joint.groups for name in group.inputs}
        joined |= {*(joint.dependence.inputs if joint.dependence else ())}
        for entry in joint.random:
            atoms = None if entry.variable.name in joined else entry.distribution.atoms()
            if atoms is None or (len(atoms[1]) > self.levels and not entry.variable.labels):
                medians = (np.arange(self.levels) + 0.5) / self.levels
                yield medians, np.full(self.levels, 1 / self.levels)
            else:
                yield np.cumsum(atoms[1]) - atoms[1] / 2, atoms[1]
