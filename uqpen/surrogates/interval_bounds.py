"""Bounds over intervals: a polynomial of few runs, its optimum over the box, and runs there."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from uqpen.core.arrays import Arrays, BoolArray, FloatArray
from uqpen.core.errors import Problem, QuantityError, toml_text
from uqpen.core.labels import (
    BOUND_END,
    BOUND_SEARCH,
    BOUNDED_EVENTS,
    BOUNDED_MEANS,
    BOUNDED_QUANTILES,
    BOUNDED_QUANTITY,
    INTERVAL_ENDS,
    PREDICTED_DISTANCE,
    RUN,
    STATUS,
)
from uqpen.core.lookup import choices
from uqpen.core.processors import one_blas_thread
from uqpen.core.sampling import Sampling
from uqpen.core.settings import Context, count, probability_lists, setting
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.design import Design, Rounds
from uqpen.designs.latin_hypercube import hypercube
from uqpen.designs.rare_events.limit_state import LimitState, parse_limit_state
from uqpen.designs.stopping.stopping_rule import RequestedOutput
from uqpen.distributions.joint_distribution import JointDistribution, points_dataset
from uqpen.surrogates.chaos.basis import ProductBasis
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos
from uqpen.surrogates.chaos.term_selection import HIGHEST_ORDER, FitPoints, Terms, chosen_terms

if TYPE_CHECKING:
    import xarray as xr

# What has bounds: the probability of an event, the mean of an output, or a quantile of it.

LOWER, UPPER = -1, 1
# Points of the box from which the way to the nearest run is measured.
_PLACES = 5000
_JOINED = "; "


@dataclass(frozen=True)
class BoundedQuantity:
    """Probability of an event, mean or quantile of an output, which has bounds over a box."""

    outputs: tuple[str, ...]  # the outputs that it concerns
    event: LimitState | None = None  # None for a mean or a quantile
    probability: float | None = None  # that of lying below the quantile; None for no quantile

    def distances(self, runs: xr.Dataset, deviations: Mapping[str, float]) -> FloatArray:
        """Return how far each run is beyond the limit of the event, or the output itself.

        Parameters
        ----------
        runs : Dataset
            Runs of the model, or predictions in their form.
        deviations : mapping of str to float
            The unit of the distances: the standard deviation of each output.

        Returns
        -------
        ndarray, shape (run,)
            NaN for a run without it.
        """
        if self.event is None:
            (output,) = self.outputs
            values = runs[output].values / deviations[output]
            return np.where(runs[STATUS].values == Status.OK, values, np.nan)
        scales = np.array([deviations[limit.output] for limit in self.event.limits])
        found = self.event.performance(self.event.outcomes(runs), scales)
        return np.where(np.isfinite(found), found, np.nan)

    def objective(self, distances: FloatArray) -> FloatArray:
        """Return what is searched for its least and largest value, from runs along the last axis.

        Of an event it is a mean in which each run counts by a smooth step, half a standard
        deviation wide: the share of runs in the event does not change with the box where the event
        is rare.
        """
        if self.probability is not None:
            return np.asarray(np.quantile(distances, self.probability, axis=-1))
        found: FloatArray = (
            distances if self.event is None else scipy.special.ndtr(2 * distances)
        ).mean(axis=-1)
        return found


def bounded_in(described: Mapping[Any, Any]) -> list[BoundedQuantity]:
    """Return what has bounds by the attributes of the runs of a design, as the runs number it."""
    events, means, quantiles = (
        [*filter(None, str(described.get(key, "")).split(_JOINED))]
        for key in (BOUNDED_EVENTS, BOUNDED_MEANS, BOUNDED_QUANTILES)
    )
    states = map(parse_limit_state, events)
    pairs = (each.split() for each in quantiles)
    return [
        *(BoundedQuantity(tuple(sorted(each.outputs)), each) for each in states),
        *(BoundedQuantity((output,)) for output in means),
        *(BoundedQuantity((output,), probability=float(each)) for output, each in pairs),
    ]


def output_deviations(runs: xr.Dataset, outputs: Collection[str]) -> dict[str, float]:
    """Return the standard deviation of each output over the runs before the first search."""
    used = (runs[BOUND_SEARCH].values == 0) & (runs[STATUS].values == Status.OK)
    return {name: float(np.std(runs[name].values[used])) if used.any() else 0.0 for name in outputs}


def dispersion(runs: xr.Dataset) -> float:
    """Return the side of the widest cube without a run before the first search.

    It is a share of the sides of the box, by the distances from points all over it.
    """
    first = runs.isel({RUN: runs[BOUND_SEARCH].values == 0})
    columns = []
    for variable in first.data_vars.values():
        if INTERVAL_ENDS in variable.attrs:
            lower, upper = variable.attrs[INTERVAL_ENDS]
            columns.append((variable.values - lower) / (upper - lower))
    # The answer depends on the runs alone.
    spread = np.random.default_rng(0).random((_PLACES, len(columns)))
    distances, _ = scipy.spatial.KDTree(np.column_stack(columns)).query(spread, p=np.inf)
    return min(2 * float(distances.max()), 1.0)


# Polynomials of the outputs in the random inputs and the box, and their optimum over the box.

# Draws of the random inputs that the objective is a mean over.
_DRAWS = 1000
# Points of the box that a search begins with, beside its corners: all of them up to some sides.
_BEGINNING, _MOST_SIDES = 512, 8
# Of the best points, so many are improved in so many steps, each among further random points.
_STARTS, _STEPS, _FURTHER = 3, 12, 16
_FIRST_STEP = 0.25


@dataclass(frozen=True, eq=False)
class _Polynomial:
    """Polynomial of an output: sums of products of polynomials of draws and of points of a box."""

    basis: ProductBasis
    terms: Terms  # of the standardised output
    mean: float
    deviation: float
    of_draws: FloatArray  # (draw, term): the factors that follow from the random inputs
    of_box: BoolArray  # (input,): whether an input is one of the box

    def values(self, inputs: Arrays) -> FloatArray:
        """Return values at points, shape (run,)."""
        matrix = self.basis.matrix(inputs, self.terms.indices)
        return np.asarray(self.mean + self.deviation * (matrix @ self.terms.coefficients))

    def values_of_draws(self, box: Arrays) -> FloatArray:
        """Return values of all draws at each of some points of the box, shape (point, draw)."""
        factors = self.basis.matrix(box, np.where(self.of_box, self.terms.indices, 0))
        found = (factors * self.terms.coefficients) @ self.of_draws.T
        return np.asarray(self.mean + self.deviation * found)


class _Search:
    """Search of a box for the least and the largest values of a quantity by polynomials."""

    def __init__(
        self, joint: JointDistribution, runs: xr.Dataset, outputs: Collection[str], stream: Stream
    ) -> None:
        self._joint = joint
        self._ends = np.array([[each.lower, each.upper] for each in joint.intervals])
        self._names = [each.variable.name for each in joint.intervals]
        self._deviations = output_deviations(runs, outputs)
        self._attributes = {name: runs[name].attrs for name in outputs}
        basis = ProductBasis.from_distribution(joint.over_box(), HIGHEST_ORDER)
        unit = stream.generator("draws").random((_DRAWS, len(joint.random)))
        draws = joint.ppf(joint.conditional_probabilities(unit, {}))
        self._first_draw = {name: values[:1] for name, values in draws.items()}
        draws |= self._repeated(self._box_points(np.zeros((1, len(self._names)))), _DRAWS)
        of_box = np.isin(basis.names, self._names)
        used = runs[STATUS].values == Status.OK
        inputs = {name: runs[name].values[used] for name in basis.names}
        self._polynomials: dict[str, _Polynomial] = {}
        for name in outputs:
            values = runs[name].values[used].astype(np.float64)
            if not len(values) or not 0 < values.std() < np.inf:
                continue
            mean, deviation = float(values.mean()), float(values.std())
            points, standard = FitPoints(basis, inputs, 1.0), (values - mean) / deviation
            terms = chosen_terms(points, standard, None, stream.generator("fit", name))
            if isinstance(terms, Terms):
                of_draws = basis.matrix(draws, np.where(of_box, 0, terms.indices))
                self._polynomials[name] = _Polynomial(
                    basis, terms, mean, deviation, of_draws, of_box
                )

    def can_answer(self, quantity: BoundedQuantity) -> bool:
        """Return True if each output of a quantity has a polynomial."""
        return self._polynomials.keys() >= {*quantity.outputs}

    def _box_points(self, unit: FloatArray) -> dict[str, FloatArray]:
        """Return the intervals' values at points of the unit cube, shape (point, interval)."""
        lower, upper = self._ends.T
        return dict(zip(self._names, (lower + (upper - lower) * unit).T, strict=True))

    def runs_at_bound(
        self, quantity: BoundedQuantity, end: int, size: int, stream: Stream
    ) -> tuple[dict[str, FloatArray], FloatArray]:
        """Return the inputs of the runs at a bound, and their predicted distances."""
        at = self._box_points(self._optimum(quantity, end, stream)[np.newaxis])
        unit = stream.generator("runs").random((size, len(self._joint.random)))
        values = self._joint.ppf(self._joint.conditional_probabilities(unit, {}))
        values |= self._repeated(at, size)
        predicted = {name: self._polynomials[name].values(values) for name in quantity.outputs}
        return values, self._distances(quantity, predicted)

    def _optimum(self, quantity: BoundedQuantity, end: int, stream: Stream) -> FloatArray:
        """Return the point of the unit cube where a quantity is least or largest.

        The best of many points are improved step by step: along each axis and at random around.
        """
        sides, rng = len(self._names), stream.generator("search")
        corners = np.array([*product([0.0, 1.0], repeat=min(sides, _MOST_SIDES))])
        if sides > _MOST_SIDES:
            corners = rng.integers(0, 2, (len(corners), sides)).astype(np.float64)
        points = np.concatenate([corners, hypercube(rng, _BEGINNING, sides)])
        values = self._values(quantity, end, points)
        best = np.argsort(-values, kind="stable")[:_STARTS]
        points, values = points[best], values[best]
        steps, every = np.full(_STARTS, _FIRST_STEP), np.arange(_STARTS)
        axes = np.concatenate([np.eye(sides), -np.eye(sides)])
        for _ in range(_STEPS):
            around = np.concatenate([axes, rng.uniform(-1, 1, (_FURTHER, sides))])
            tried = np.clip(points[:, np.newaxis] + steps[:, None, None] * around, 0, 1)
            found = self._values(quantity, end, tried.reshape(-1, sides)).reshape(_STARTS, -1)
            place = found.argmax(axis=1)
            is_better = found[every, place] > values
            points = np.where(is_better[:, np.newaxis], tried[every, place], points)
            values = np.where(is_better, found[every, place], values)
            steps = np.where(is_better, steps, steps / 2)
        return points[values.argmax()]

    def _values(self, quantity: BoundedQuantity, end: int, unit: FloatArray) -> FloatArray:
        """Return what is largest at a bound, at points of the unit cube, shape (point,)."""
        # Polynomials of degree 0 do not depend on their inputs, so any values of the others do.
        box = self._box_points(unit) | self._repeated(self._first_draw, len(unit))
        predicted = {
            name: self._polynomials[name].values_of_draws(box).ravel() for name in quantity.outputs
        }
        distances = self._distances(quantity, predicted).reshape(len(unit), _DRAWS)
        return np.nan_to_num(end * quantity.objective(distances), nan=-np.inf)

    @staticmethod
    def _repeated(values: Arrays, count: int) -> dict[str, FloatArray]:
        return {name: np.repeat(each, count) for name, each in values.items()}

    def _distances(self, quantity: BoundedQuantity, predicted: Arrays) -> FloatArray:
        import xarray as xr

        variables: dict[str, Any] = {
            name: (RUN, values, self._attributes[name]) for name, values in predicted.items()
        }
        size = len(next(iter(predicted.values())))
        variables[STATUS] = (RUN, np.full(size, int(Status.OK), dtype=np.int8))
        return quantity.distances(xr.Dataset(variables), self._deviations)


# The design.


def _texts(name: str, expected: str) -> Any:
    def are_texts(value: object) -> bool:
        return isinstance(value, tuple) and all(isinstance(each, str) for each in value)

    def read(written: Any, _: Context) -> Any:
        return tuple(written) if isinstance(written, list) else written

    return setting(name, expected, are_texts, read, default=())


@dataclass(frozen=True)
class IntervalBounds(Design):
    """Bounds of probabilities, means and quantiles over all values of inputs that are intervals.

    The first runs spread over the random inputs and over the box of the intervals, these as if
    uniform, for the search alone. A polynomial is fitted to them; runs where it is least and
    largest in the box give each bound with its interval. A peak between the runs of the search can
    be missed. Where the polynomial does not predict the runs at its optimum, there are no bounds.

    Parameters
    ----------
    events : sequence of str
        Events whose probabilities have bounds, such as ``"depth > 3 m"``.
    means : sequence of str
        Outputs whose means have bounds.
    quantiles : mapping of str to sequence of float
        Outputs whose quantiles have bounds, each with the probabilities of lying below them.
    pilot : int
        Number of runs before the first search.
    runs : int
        Number of runs at each bound.
    searches : int
        Number of searches. Before the last, a third as many runs are made at each bound, for the
        polynomial.
    """

    sampling = Sampling.TOWARDS_BOUNDS
    needs_numbers = True
    needs_one_model = True
    takes_intervals = True

    events: tuple[str, ...] = _texts("events", 'events in a list, such as ["depth > 3 m"]')
    means: tuple[str, ...] = _texts("means", 'outputs in a list, such as ["depth"]')
    quantiles: Mapping[str, Sequence[float]] = probability_lists()
    pilot: int = count(minimum=50, maximum=20_000, default=400)
    runs: int = count(minimum=30, maximum=100_000, default=300)
    searches: int = count(maximum=5, default=1)

    def __post_init__(self) -> None:
        for key in ("events", "means"):
            if isinstance(written := getattr(self, key), list):  # of a program
                object.__setattr__(self, key, tuple(written))
        super().__post_init__()

    def gives_quantile(self, output: str, probability: float) -> bool:
        return probability in self.quantiles.get(output, ())

    def check_settings(self) -> Iterator[Problem]:
        if not self._described:
            expected = (
                'events = ["depth > 3 m"], means = ["depth"] or quantiles = { depth = [0.95] }'
            )
            yield Problem((), "nothing that has bounds", expected)
        every = [each for lists in self._described.values() for each in lists.split(_JOINED)]
        if twice := sorted({each for each in every if every.count(each) > 1}):
            yield Problem((), f"{twice[0]}, twice", "each event, mean and quantile once")
        for position, event in enumerate(self.events):
            try:
                state = parse_limit_state(event)
            except QuantityError as error:
                for problem in error.problems:
                    yield problem.within(position).within("events")
                continue
            if state.named:
                expected = "limits of numbers: an outcome has no polynomial to search by"
                yield Problem(("events", position), toml_text(event), expected)

    def check_inputs(self, joint: JointDistribution) -> Iterator[Problem]:
        if not joint.intervals:
            expected = 'an input such as length = { interval = ["2 m", "3 m"] }'
            yield Problem(
                (), "a design for bounds over intervals, of which there is none", expected
            )
        for problem in PolynomialChaos(design="pilot").check_inputs(joint):
            yield replace(problem, expected="inputs with polynomials, by which bounds are searched")

    def check_outputs(self, requested: Sequence[RequestedOutput]) -> Iterator[Problem]:
        known = {each.output.name: each.output for each in requested if each.output.is_number}
        for position, event in enumerate(self.events):
            for problem in parse_limit_state(event).check_outputs(requested):
                yield problem.within(position).within("events")
        places: list[tuple[str, str | int, str]] = [
            *(("means", place, output) for place, output in enumerate(self.means)),
            *(("quantiles", output, output) for output in self.quantiles),
        ]
        for key, place, output in places:
            if output not in known:
                expected = f"an output that is a number; {choices(output, known)}"
                yield Problem((key, place), toml_text(output), expected)

    def remarks(self, joint: JointDistribution) -> Iterator[str]:
        quantiles = ((each, p) for each, of_output in self.quantiles.items() for p in of_output)
        wanted = [
            *(f"P({each})" for each in self.events),
            *(f"mean of {each}" for each in self.means),
            *(f"{p:g} quantile of {each}" for each, p in quantiles),
        ]
        named = ", ".join(each.variable.name for each in joint.intervals)
        yield (
            f"bounds of {', '.join(wanted)} over all values of {named}: {self.pilot} runs over "
            f"inputs and intervals, then {' and '.join(map(str, self._sizes))} at each of "
            f"{2 * len(wanted)} bounds that a search finds"
        )

    @property
    def _described(self) -> dict[str, str]:
        """Events, means and quantiles that have bounds, as attributes of the runs."""
        quantiles = (
            f"{output} {each!r}" for output, of_it in self.quantiles.items() for each in of_it
        )
        lists = {
            BOUNDED_EVENTS: self.events,
            BOUNDED_MEANS: self.means,
            BOUNDED_QUANTILES: tuple(quantiles),
        }
        return {key: _JOINED.join(each) for key, each in lists.items() if each}

    @property
    def _sizes(self) -> list[int]:
        """Number of runs at each bound, by search."""
        return [self.runs // 3] * (self.searches - 1) + [self.runs]

    def run_count(self, joint: JointDistribution) -> int:
        return self.pilot + 2 * len(bounded_in(self._described)) * sum(self._sizes)

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        import xarray as xr

        quantities = bounded_in(self._described)
        outputs = sorted({name for each in quantities for name in each.outputs})
        box = joint.over_box()
        unit = hypercube(stream.generator("pilot"), self.pilot, len(box.random))
        values = box.ppf(box.conditional_probabilities(unit, {}))
        labels = _labels(self.pilot, 0, -1, 0, np.full(self.pilot, np.nan))
        names = [*(each.variable.name for each in box.random), *outputs, STATUS, BOUND_SEARCH]
        made = []
        for number, size in enumerate([*self._sizes, 0], 1):
            points = points_dataset(joint, values, labels, runs=len(labels[BOUND_END]))
            feedback = yield points.assign_attrs(self._described)
            if not size:
                return
            made.append(next(iter(feedback.runs.values()))[names])
            with one_blas_thread():
                own = stream.child("search", number)
                search = _Search(joint, xr.concat(made, RUN), outputs, own)
                parts = []
                for (place, quantity), end in product(enumerate(quantities), (LOWER, UPPER)):
                    if search.can_answer(quantity):
                        of_bound = stream.child("bound", number, place, end)
                        drawn, predicted = search.runs_at_bound(quantity, end, size, of_bound)
                        parts.append((drawn, _labels(size, number, place, end, predicted)))
            if not parts:
                return
            values, labels = (
                {name: np.concatenate([each[name] for each in of_all]) for name in of_all[0]}
                for of_all in zip(*parts, strict=True)
            )


def _labels(size: int, search: int, place: int, end: int, predicted: FloatArray) -> dict[str, Any]:
    whole = {BOUND_SEARCH: search, BOUNDED_QUANTITY: place, BOUND_END: end}
    labels = {key: np.full(size, each) for key, each in whole.items()}
    return labels | {PREDICTED_DISTANCE: predicted}
