"""Bounds over intervals: a polynomial of few runs, its optimum over the box, and runs there."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from uqpen.core.arrays import Arrays, FloatArray
from uqpen.core.errors import Problem, QuantityError, toml_text
from uqpen.core.labels import (
    BOUND_END,
    BOUND_SEARCH,
    BOUNDED_EVENTS,
    BOUNDED_MEANS,
    BOUNDED_QUANTITY,
    INTERVAL_ENDS,
    PREDICTED_DISTANCE,
    RUN,
    STATUS,
)
from uqpen.core.lookup import choices
from uqpen.core.processors import one_blas_thread
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count, setting
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

# What has bounds: the probability of an event, or the mean of an output.

LOWER, UPPER = -1, 1
# Points of the box from which the way to the nearest run is measured.
_PLACES = 5000
_JOINED = "; "


@dataclass(frozen=True)
class BoundedQuantity:
    """Probability of an event, or mean of an output, whose bounds over a box are wanted."""

    outputs: tuple[str, ...]  # the outputs that it concerns
    event: LimitState | None = None  # None for the mean of the output

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
        """Return the mean over the last axis that is searched for its least and largest value.

        Of an event each run counts by a smooth step, half a standard deviation wide: the share of
        runs in the event does not change with the box where the event is rare.
        """
        found: FloatArray = (
            distances if self.event is None else scipy.special.ndtr(2 * distances)
        ).mean(axis=-1)
        return found


def bounded_quantities(events: Sequence[str], means: Sequence[str]) -> list[BoundedQuantity]:
    """Return what has bounds, events before means, as runs number it."""
    states = map(parse_limit_state, events)
    return [
        *(BoundedQuantity(tuple(sorted(each.outputs)), each) for each in states),
        *(BoundedQuantity((output,)) for output in means),
    ]


def bounded_in(runs: xr.Dataset) -> list[BoundedQuantity]:
    """Return what has bounds by the runs of a design."""
    parts = (str(runs.attrs.get(key, "")) for key in (BOUNDED_EVENTS, BOUNDED_MEANS))
    return bounded_quantities(*([*filter(None, each.split(_JOINED))] for each in parts))


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
    is_of_box: FloatArray  # (input,): 1 for an input of the box, 0 for a random one

    def part(self, inputs: Arrays, *, of_box: bool) -> FloatArray:
        """Return the factors of the terms that follow from the random inputs or from the box."""
        kept = self.is_of_box if of_box else 1 - self.is_of_box
        return self.basis.matrix(inputs, (self.terms.indices * kept).astype(np.int64))

    def values(self, of_draws: FloatArray, of_box: FloatArray) -> FloatArray:
        """Return values at all pairs, shape (point, draw)."""
        found = (of_box * self.terms.coefficients) @ of_draws.T
        return self.mean + self.deviation * found


class _Search:
    """Search of a box for the least and the largest values of a quantity by polynomials."""

    def __init__(
        self, joint: JointDistribution, runs: xr.Dataset, outputs: Collection[str], stream: Stream
    ) -> None:
        self.joint, self.box = joint, joint.over_box()
        self._ends = np.array([[each.lower, each.upper] for each in joint.intervals])
        self._names = [each.variable.name for each in joint.intervals]
        self.deviations = output_deviations(runs, outputs)
        self._attributes = {name: runs[name].attrs for name in outputs}
        self._polynomials = self._fitted(runs, outputs, stream)
        unit = stream.generator("draws").random((_DRAWS, len(joint.random)))
        self._draws = joint.ppf(joint.conditional_probabilities(unit, {}))

    def _fitted(
        self, runs: xr.Dataset, outputs: Collection[str], stream: Stream
    ) -> dict[str, _Polynomial]:
        """Return the polynomial of each output that has one."""
        basis = ProductBasis.from_distribution(self.box, HIGHEST_ORDER)
        of_box = np.isin(basis.names, self._names).astype(np.float64)
        used = runs[STATUS].values == Status.OK
        inputs = {name: runs[name].values[used] for name in basis.names}
        found: dict[str, _Polynomial] = {}
        for name in outputs:
            values = runs[name].values[used].astype(np.float64)
            mean, deviation = (
                float(each(values)) if used.any() else 0.0 for each in (np.mean, np.std)
            )
            if not deviation > 0 or not np.isfinite(deviation):
                continue
            points = FitPoints(basis, inputs, 1.0)
            standard = (values - mean) / deviation
            terms = chosen_terms(points, standard, None, stream.generator("fit", name))
            if isinstance(terms, Terms):
                found[name] = _Polynomial(basis, terms, mean, deviation, of_box)
        return found

    def can_answer(self, quantity: BoundedQuantity) -> bool:
        """Return True if each output of a quantity has a polynomial."""
        return self._polynomials.keys() >= {*quantity.outputs}

    def box_point(self, unit: FloatArray) -> dict[str, FloatArray]:
        """Return inputs at points of the unit cube, shape (point, interval)."""
        lower, upper = self._ends.T
        return dict(zip(self._names, (lower + (upper - lower) * unit).T, strict=True))

    def predictions(self, quantity: BoundedQuantity, inputs: Arrays) -> FloatArray:
        """Return the predicted distances at points, shape (run,)."""
        predicted = {}
        for name in quantity.outputs:
            of_output = self._polynomials[name]
            matrix = of_output.basis.matrix(inputs, of_output.terms.indices)
            predicted[name] = of_output.mean + of_output.deviation * (
                matrix @ of_output.terms.coefficients
            )
        return self._distances(quantity, predicted)

    def optimum(self, quantity: BoundedQuantity, end: int, stream: Stream) -> FloatArray:
        """Return the point of the unit cube where a quantity is least or largest.

        The best of many points are improved step by step: along each axis and at random around.
        """
        sides = len(self._names)
        rng = stream.generator("search")
        corners = np.array([*product([0.0, 1.0], repeat=min(sides, _MOST_SIDES))])
        if sides > _MOST_SIDES:
            corners = rng.integers(0, 2, (len(corners), sides)).astype(np.float64)
        spread = hypercube(rng, _BEGINNING, sides)
        points = np.concatenate([corners, spread])
        values = end * self._objective(quantity, points)
        best = np.argsort(-values, kind="stable")[:_STARTS]
        points, values = points[best], values[best]
        steps = np.full(len(points), _FIRST_STEP)
        axes = np.concatenate([np.eye(sides), -np.eye(sides)])
        for _ in range(_STEPS):
            around = np.concatenate([axes, rng.uniform(-1, 1, (_FURTHER, sides))])
            tried = np.clip(points[:, np.newaxis] + steps[:, None, None] * around, 0, 1)
            found = end * self._objective(quantity, tried.reshape(-1, sides)).reshape(
                len(points), -1
            )
            place = found.argmax(axis=1)
            every = np.arange(len(points))
            is_better = found[every, place] > values
            points = np.where(is_better[:, np.newaxis], tried[every, place], points)
            values = np.where(is_better, found[every, place], values)
            steps = np.where(is_better, steps, steps / 2)
        return points[values.argmax()]

    def _objective(self, quantity: BoundedQuantity, unit: FloatArray) -> FloatArray:
        """Return the objective at points of the unit cube, shape (point,)."""
        box = self.box_point(unit)
        # Polynomials of degree 0 do not depend on their inputs, so any values of the others do.
        for_draws = {
            **self._draws,
            **{name: np.full(_DRAWS, each[0]) for name, each in box.items()},
        }
        for_box = {
            **box,
            **{name: np.full(len(unit), each[0]) for name, each in self._draws.items()},
        }
        predicted = {
            name: self._polynomials[name]
            .values(
                self._polynomials[name].part(for_draws, of_box=False),
                self._polynomials[name].part(for_box, of_box=True),
            )
            .ravel()
            for name in quantity.outputs
        }
        return quantity.objective(self._distances(quantity, predicted).reshape(len(unit), _DRAWS))

    def _distances(self, quantity: BoundedQuantity, predicted: Arrays) -> FloatArray:
        import xarray as xr

        variables: dict[str, Any] = {
            name: (RUN, values, self._attributes[name]) for name, values in predicted.items()
        }
        size = len(next(iter(predicted.values())))
        variables[STATUS] = (RUN, np.full(size, int(Status.OK), dtype=np.int8))
        return quantity.distances(xr.Dataset(variables), self.deviations)


# The design.


def _is_texts(value: object) -> bool:
    return isinstance(value, tuple) and all(isinstance(each, str) for each in value)


def _texts(name: str, expected: str) -> Any:
    return setting(
        name,
        expected,
        _is_texts,
        lambda written, _: tuple(written) if isinstance(written, list) else written,
        default=(),
    )


@dataclass(frozen=True)
class IntervalBounds(Design):
    """Bounds of probabilities and means over all values of the inputs that are intervals.

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
    takes_intervals = True

    events: tuple[str, ...] = _texts("events", 'events in a list, such as ["depth > 3 m"]')
    means: tuple[str, ...] = _texts("means", 'outputs in a list, such as ["depth"]')
    pilot: int = count(minimum=50, maximum=100_000, default=400)
    runs: int = count(minimum=30, maximum=100_000, default=300)
    searches: int = count(maximum=5, default=1)

    def __post_init__(self) -> None:
        for key in ("events", "means"):
            if isinstance(written := getattr(self, key), list):  # of a program
                object.__setattr__(self, key, tuple(written))
        super().__post_init__()

    def check_settings(self) -> Iterator[Problem]:
        if not self.events and not self.means:
            expected = 'events = ["depth > 3 m"] or means = ["depth"]'
            yield Problem((), "nothing that has bounds", expected)
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
        for position, output in enumerate(self.means):
            if output not in known:
                expected = f"an output that is a number; {choices(output, known)}"
                yield Problem(("means", position), toml_text(output), expected)

    def check_models(
        self, models: Collection[str], costs: Mapping[str, float]
    ) -> Iterator[Problem]:
        if len(models) > 1:
            found = f"a study of {len(models)} models"
            expected = "a study of one model: its results decide where the next runs are"
            yield Problem(("kind",), found, expected)

    def remarks(self, joint: JointDistribution) -> Iterator[str]:
        wanted = ", ".join(
            [*(f"P({each})" for each in self.events), *map("mean of {}".format, self.means)]
        )
        named = ", ".join(each.variable.name for each in joint.intervals)
        bounds = 2 * (len(self.events) + len(self.means))
        yield (
            f"bounds of {wanted} over all values of {named}: {self.pilot} runs over inputs and "
            + f"intervals, then {' and '.join(map(str, self._sizes))} at each of {bounds} bounds "
            + "that a search finds"
        )

    @property
    def _sizes(self) -> list[int]:
        """Number of runs at each bound, by search."""
        return [self.runs // 3] * (self.searches - 1) + [self.runs]

    def run_count(self, joint: JointDistribution) -> int:
        return self.pilot + 2 * (len(self.events) + len(self.means)) * sum(self._sizes)

    def rounds(self, joint: JointDistribution, stream: Stream) -> Rounds:
        import xarray as xr

        quantities = bounded_quantities(self.events, self.means)
        outputs = sorted({name for each in quantities for name in each.outputs})
        attributes = {
            BOUNDED_EVENTS: _JOINED.join(self.events),
            BOUNDED_MEANS: _JOINED.join(self.means),
        }
        box = joint.over_box()
        rng = stream.generator("pilot")
        unit = hypercube(rng, self.pilot, len(box.random))
        unit = box.conditional_probabilities(unit, {})
        first = _labels(self.pilot, 0, -1, 0, np.full(self.pilot, np.nan))
        points = points_dataset(joint, box.ppf(unit), first, runs=self.pilot)
        made = []
        feedback = yield points.assign_attrs(attributes)
        for number, size in enumerate(self._sizes, 1):
            runs = next(iter(feedback.runs.values()))
            names = [*(each.variable.name for each in box.random), *outputs, STATUS, BOUND_SEARCH]
            made.append(runs[names])
            search = _Search(joint, xr.concat(made, RUN), outputs, stream.child("search", number))
            with one_blas_thread():
                parts = [
                    self._at_bound(search, quantity, place, end, size, number, stream)
                    for place, quantity in enumerate(quantities)
                    for end in (LOWER, UPPER)
                    if search.can_answer(quantity)
                ]
            if not parts:
                return
            values = _joined([each for each, _ in parts])
            labels = _joined([each for _, each in parts])
            runs_of_all = len(labels[BOUND_END])
            points = points_dataset(joint, values, labels, runs=runs_of_all)
            feedback = yield points.assign_attrs(attributes)

    @staticmethod
    def _at_bound(
        search: _Search,
        quantity: BoundedQuantity,
        place: int,
        end: int,
        size: int,
        number: int,
        stream: Stream,
    ) -> tuple[dict[str, FloatArray], dict[str, Any]]:
        """Return the inputs and the labels of the runs at a bound that a search finds."""
        own = stream.child("bound", number, place, end)
        at = search.box_point(search.optimum(quantity, end, own)[np.newaxis])
        joint = search.joint
        unit = own.generator("runs").random((size, len(joint.random)))
        values = joint.ppf(joint.conditional_probabilities(unit, {}))
        values |= {name: np.repeat(each, size) for name, each in at.items()}
        predicted = search.predictions(quantity, values)
        return values, _labels(size, number, place, end, predicted)


def _labels(size: int, search: int, place: int, end: int, predicted: FloatArray) -> dict[str, Any]:
    whole = {BOUND_SEARCH: search, BOUNDED_QUANTITY: place, BOUND_END: end}
    return {key: np.full(size, each) for key, each in whole.items()} | {
        PREDICTED_DISTANCE: predicted
    }


def _joined(parts: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    return {name: np.concatenate([each[name] for each in parts]) for name in parts[0]}
