"""Integration rules: nodes with weights, exact for polynomials of the inputs."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.errors import Problem
from uqpen.core.labels import QUADRATURE_WEIGHT
from uqpen.core.sampling import Sampling
from uqpen.core.settings import choice, count
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Rounds
from uqpen.designs.grids import tensor_grid, too_many_nodes
from uqpen.distributions.joint_distribution import JointDistribution, points_dataset
from uqpen.distributions.orthogonal_polynomials import Recurrence, recurrence

__all__ = ["WEIGHT_ATTRIBUTES", "Quadrature"]


WEIGHT_ATTRIBUTES = {"units": "1", "long_name": "weight of the run in an integral over the inputs"}

# At higher orders, weights of the outer nodes are too small to matter.
_HIGHEST_ORDER = 100

# Nodes of two rules that lie closer than this, relative to the spread of the nodes, are the same:
# the middle of a symmetric distribution.
_SAME_NODE = 1e-10


@dataclass(frozen=True)
class Quadrature(Design):
    """Gauss quadrature: the rules of the inputs' distributions, combined over independent inputs.

    Parameters
    ----------
    order : int
        The rule is exact for polynomials up to degree 2 `order` + 1: in each input by itself on a
        tensor grid, in all of them together on a sparse one.
    grid : str
        ``"tensor"`` takes every combination of `order` + 1 nodes of each input; ``"sparse"`` far
        fewer of them where there are many inputs (Smolyak's construction); some nodes then have
        a negative weight.

    References
    ----------
    Golub, G. H. & Welsch, J. H. (1969). Math. Comput. 23, 221-230.
    Smolyak, S. A. (1963). Dokl. Akad. Nauk SSSR 148, 1042-1045.
    """

    sampling = Sampling.QUADRATURE
    assumes_independence = True
    independence_reason = "its nodes are those of inputs that vary independently"

    order: int = count()
    grid: str = choice("tensor", "sparse", default="tensor")

    def check_settings(self) -> Iterator[Problem]:
        if self.order > _HIGHEST_ORDER:
            yield Problem(("order",), str(self.order), f"at most {_HIGHEST_ORDER}")

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        inputs = len(joint.random)
        nodes = (self.order + 1) ** inputs if self.grid == "tensor" else self._most_nodes(inputs)
        yield from too_many_nodes("order", self.order, nodes, inputs)
        for entry in joint.random:
            if not recurrence(entry.distribution, self.order).is_finite:
                found = f"{self.order}, of which {entry.variable.name} has no polynomials"
                yield Problem(
                    ("order",), found, "a lower one: the law has too few values or moments"
                )

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        columns, weights = self._rule(joint)
        values = {
            entry.variable.name: column for entry, column in zip(joint.random, columns, strict=True)
        }
        points = points_dataset(joint, values, {QUADRATURE_WEIGHT: weights}, runs=len(weights))
        points[QUADRATURE_WEIGHT].attrs = WEIGHT_ATTRIBUTES
        yield points

    def run_count(self, joint: JointDistribution) -> int:
        if self.grid == "tensor":
            return int((self.order + 1) ** len(joint.random))
        return len(self._rule(joint)[1])

    def _most_nodes(self, inputs: int) -> int:
        """Count the nodes of all the grids that a sparse one combines; some coincide."""
        # Nodes of the grids of total level k: the coefficient of x^k in (1 - x)^(-2 inputs).
        levels = range(max(self.order - inputs + 1, 0), self.order + 1)
        return sum(math.comb(level + 2 * inputs - 1, level) for level in levels)

    def _rule(self, joint: JointDistribution) -> tuple[list[FloatArray], FloatArray]:
        """Return the nodes' values, input by input, and their weights."""
        recurrences = [recurrence(entry.distribution, self.order) for entry in joint.random]
        if self.grid == "sparse":
            return _smolyak(recurrences, self.order)
        rules = [found.gauss(self.order + 1) for found in recurrences]
        weights: FloatArray = np.prod(tensor_grid([weights for _, weights in rules]), axis=0)
        return tensor_grid([values for values, _ in rules]), weights


def _smolyak(recurrences: list[Recurrence], order: int) -> tuple[list[FloatArray], FloatArray]:
    """Combine small tensor grids by Smolyak's construction.

    Wasilkowski, G. W. & Woźniakowski, H. (1995). J. Complexity 11, 1-56.
    """
    inputs = len(recurrences)
    nodes, labels, weights = zip(*(_levels(found, order) for found in recurrences), strict=True)
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
    places, where = np.unique(np.concatenate(labelled), axis=0, return_inverse=True)
    total: FloatArray = np.zeros(len(places))
    np.add.at(total, where.ravel(), np.concatenate(weighed))
    return [node[column] for node, column in zip(nodes, places.T, strict=True)], total


def _levels(found: Recurrence, order: int) -> tuple[FloatArray, list[IntArray], list[FloatArray]]:
    """Compute one input's rules of 1, 2, … nodes: all nodes, those of each rule, and weights."""
    rules = [found.gauss(level + 1) for level in range(order + 1)]
    values = np.concatenate([values for values, _ in rules])
    ascending = np.argsort(values, kind="stable")
    is_new = np.diff(values[ascending], prepend=-np.inf) > _SAME_NODE * np.ptp(values)
    label = np.empty(len(values), dtype=np.int64)
    label[ascending] = np.cumsum(is_new) - 1
    ends = np.cumsum([level + 1 for level in range(order)])
    return values[ascending][is_new], np.split(label, ends), [weights for _, weights in rules]


def _multi_indices(inputs: int, order: int) -> Iterator[tuple[int, ...]]:
    """Yield the levels of each input; their sum is the order, or less by fewer than the inputs."""
    for total in range(max(order - inputs + 1, 0), order + 1):
        # Bars between stars: every way to share out the total.
        for bars in itertools.combinations(range(total + inputs - 1), inputs - 1):
            ends = (-1, *bars, total + inputs - 1)
            yield tuple(after - before - 1 for before, after in itertools.pairwise(ends))
