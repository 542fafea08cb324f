"""Integration rules: nodes with weights, exact for polynomials of the inputs."""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.errors import Problem, SettingsError
from uqpen.core.labels import QUADRATURE_WEIGHT
from uqpen.core.sampling import Sampling
from uqpen.core.settings import choice, count
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Rounds
from uqpen.designs.grids import tensor_grid, too_many_nodes
from uqpen.designs.univariate_rules import (
    NESTED_RULES,
    Rule,
    is_exact,
    node_counts,
    rule_recurrence,
    univariate_rules,
)
from uqpen.distributions.joint_distribution import JointDistribution, points_dataset

__all__ = ["WEIGHT_ATTRIBUTES", "Quadrature"]


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
        degree. The others, one of `uqpen.designs.univariate_rules.NESTED_RULES`, are nested: the
        nodes of a lower order are among those of a higher one. Each has the fewest nodes of its
        sequence that are exact to the same degree (Petras 2003); weights can be negative. Their
        nodes are chaospy's.

    References
    ----------
    Golub, G. H. & Welsch, J. H. (1969). Math. Comput. 23, 221-230.
    Smolyak, S. A. (1963). Dokl. Akad. Nauk SSSR 148, 1042-1045.
    Petras, K. (2003). Numer. Math. 93, 729-753.
    """

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
