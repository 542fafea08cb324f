"""Analyses of SALib, each with what it lacks: of runs that there are, and of its own designs."""

from __future__ import annotations

import contextlib
import copy
import importlib
import io
import math
import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.errors import Problem
from uqpen.core.labels import (
    BLOCK_NUMBER,
    HARMONICS,
    MOVED_INPUT,
    OUTPUT_SHARE,
    POSITION,
    RUN,
    STATUS,
)
from uqpen.core.lookup import package_version
from uqpen.core.settings import count, validate
from uqpen.core.status import Status
from uqpen.designs.one_at_a_time import moved_input_numbers
from uqpen.statistics import texts
from uqpen.statistics.estimate import Estimate, NamedArrays
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sample import Sample
from uqpen.statistics.sensitivity.input_measures import (
    input_array,
    input_coordinate,
    reason_without_measure,
)

# More values of inputs than these would take SALib's delta minutes.
_MOST_VALUES_FOR_DELTA = 10_000
# The same of its expansion, whose terms are of pairs of inputs: runs times squared inputs.
_MOST_FOR_EXPANSION = 200_000
# It is fitted to halves of the runs. With two runs of a term in all, the shares of single inputs
# came out at 60 % of their values while nothing seemed to be left unexplained.
_RUNS_OF_A_TERM = 4
# An expansion that explains less of the variance does not describe the output.
_LEAST_EXPLAINED = 0.9


def call_salib(
    name: str, /, *arguments: Any, keys: Sequence[str], **settings: Any
) -> dict[str, FloatArray] | str:
    """Call an analysis of SALib, and return what it has under some keys, or why that is of no use.

    It is called twice, as some ignore their seed. It prints nothing, and leaves the filters of
    warnings and the random numbers of the process as they were.
    """
    analyze = importlib.import_module(f"SALib.analyze.{name}").analyze
    found = []
    format_of_warnings, state = warnings.formatwarning, np.random.get_state()  # noqa: NPY002
    try:
        with (
            warnings.catch_warnings(),
            contextlib.redirect_stdout(io.StringIO()),
            contextlib.redirect_stderr(io.StringIO()),
            np.errstate(all="ignore"),
        ):
            warnings.simplefilter("ignore")
            for _ in range(2):
                result = analyze(*copy.deepcopy(arguments), **settings)
                found.append({key: np.asarray(result[key], dtype=np.float64) for key in keys})
    except Exception as error:  # it can raise anything about its arguments
        return texts.SALIB_FAILED.format(method=name, error=" ".join(str(error).split()))
    finally:
        warnings.formatwarning = format_of_warnings
        np.random.set_state(state)  # noqa: NPY002
    if not all(np.array_equal(found[0][key], found[1][key], equal_nan=True) for key in keys):
        return texts.SALIB_DIFFERS.format(method=name)
    return found[0]


def _stated(array: xr.DataArray) -> xr.DataArray:
    """Return an estimate array with the version of SALib that made it."""
    return array.assign_attrs(software=f"SALib {package_version('SALib')}")


def _problem(points: FloatArray) -> dict[str, Any]:
    """Return SALib's description of inputs, whose names do not matter to it."""
    ends = zip(points.min(axis=0).tolist(), points.max(axis=0).tolist(), strict=True)
    names = [f"x{number}" for number in range(points.shape[1])]
    return {"num_vars": len(names), "names": names, "bounds": [list(each) for each in ends]}


# Analyses of runs that there are, which a study names.


@dataclass(frozen=True)
class SalibAnalysis(ABC):
    """Analysis of a sample's completed runs; its settings have the names that SALib gives them."""

    method: ClassVar[str]
    independence_reason: ClassVar[str] = ""
    """Reason why inputs must not depend on each other, for a message; empty where they may."""

    seed: int  # of SALib's random numbers, above 0: it takes 0 for none

    @property
    @abstractmethod
    def fewest(self) -> int:
        """Fewest runs."""

    def __post_init__(self) -> None:
        validate(self, self.check_settings())

    def check_settings(self) -> Iterator[Problem]:
        """Yield the problems between settings that are valid by themselves."""
        yield from ()

    def __call__(self, sample: Sample, quantity: QuantityOfInterest) -> NamedArrays:
        """Yield its statistics; inputs without an estimate have the reason."""
        if quantity.output.categories or not sample.inputs:
            return
        columns = range(len(sample.inputs))
        reasons = [
            reason_without_measure(sample, column, self.fewest, needs_order=True)
            for column in columns
        ]
        used = [column for column in columns if not reasons[column]]
        refusal = self.refusal(sample, len(used))
        if self.independence_reason and sample.dependence:
            refusal = texts.SALIB_INDEPENDENCE.format(method=self.method)
        found: Mapping[str, list[Estimate]] | str = refusal or texts.CONSTANT_INPUT
        if used and not refusal:
            points = sample.points[sample.used][:, used]
            found = self.estimate(points, np.array(sample.values), sample.level)
        absent = found if isinstance(found, str) else next(filter(None, reasons), "")
        empty = np.full([len(each) for each in self.along.values()], math.nan)
        is_cut = sample.size + sample.missing.size < len(sample.points)
        is_cut = is_cut and bool(self.independence_reason)
        for name in self.statistics:
            every = [Estimate.without_bounds(empty, reason or absent) for reason in reasons]
            if not isinstance(found, str):
                for column, each in zip(used, found[name], strict=True):
                    every[column] = each
            every = [each.with_note(texts.SALIB_CUT * is_cut) for each in every]
            meaning = f"{CATALOGUE[name].title}, of {quantity.output.title}"
            if sample.dependence:
                meaning = f"{meaning}, {texts.INCLUDES_CORRELATION}"
            along = {**self.along, **input_coordinate(sample.inputs)}
            array = Estimate.stacked(every).to_array(
                *along, units="1", long_name=meaning, coordinates=along, level=sample.level
            )
            yield name, _stated(array)
        for name in self.of_all_inputs:
            whole = Estimate.without_bounds(math.nan, absent)
            if not isinstance(found, str):
                (whole,) = found[name]
            title = CATALOGUE[name].title
            yield name, _stated(whole.to_array(units="1", long_name=title, level=sample.level))

    statistics: ClassVar[tuple[str, ...]]
    """Statistics along the inputs, by their names in the catalogue."""

    of_all_inputs: ClassVar[tuple[str, ...]] = ()
    """Those of all inputs together."""

    @property
    def along(self) -> Mapping[str, FloatArray]:
        """Dimensions of its statistics before the inputs, with their coordinates."""
        return {}

    def refusal(self, sample: Sample, inputs: int) -> str:
        """Return why it is not computed for a sample; empty where it is."""
        return ""

    @abstractmethod
    def estimate(
        self, points: FloatArray, values: FloatArray, level: float
    ) -> Mapping[str, list[Estimate]] | str:
        """Return its statistics of runs, an estimate for each input, or why there are none."""


def _estimates(method: str, values: FloatArray, reason: str) -> list[Estimate]:
    """Return estimates without bounds, or why SALib has given none."""
    lacking = texts.SALIB_NO_NUMBER.format(method=method)
    every = values.tolist()
    return [Estimate.without_bounds(x, reason if math.isfinite(x) else lacking) for x in every]


@dataclass(frozen=True)
class RbdFast(SalibAnalysis):
    """First-order indices by a random balance design (Tarantola et al., 2006)."""

    method = "rbd_fast"
    independence_reason = "its indices are those of inputs that vary independently"
    statistics = ("salib_rbd_fast",)

    M: int = count(maximum=100, default=10)
    num_resamples: int = count(minimum=10, maximum=10_000, default=100)

    @property
    def fewest(self) -> int:
        return max(100, 8 * self.M)  # its bootstrap takes half of them, and 2 M must be few

    def estimate(
        self, points: FloatArray, values: FloatArray, level: float
    ) -> Mapping[str, list[Estimate]] | str:
        settings = {"M": self.M, "num_resamples": self.num_resamples, "seed": self.seed}
        keys, problem = ("S1", "S1_conf"), _problem(points)
        found = call_salib(
            self.method, problem, points, values, keys=keys, conf_level=level, **settings
        )
        if isinstance(found, str):
            return found
        every = _estimates(self.method, found["S1"], texts.NO_INTERVAL)
        intervals = [
            Estimate(x, x - half, x + half, texts.SALIB_BOOTSTRAP, "conservative")
            if math.isfinite(x + half)
            else each
            for each, x, half in zip(every, found["S1"], found["S1_conf"], strict=True)
        ]
        return {"salib_rbd_fast": intervals}


@dataclass(frozen=True)
class Pawn(SalibAnalysis):
    """Distances between distribution functions (Pianosi and Wagener, 2018), with their floor.

    An input without any effect has a distance above 0. So each input's distance stands beside that
    of the same values in a random order.
    """

    method = "pawn"
    statistics = ("salib_pawn", "salib_pawn_floor")

    S: int = count(minimum=2, maximum=100, default=10)

    def check_settings(self) -> Iterator[Problem]:
        if np.arange(0, 1 + 1 / self.S, 1 / self.S).max() > 1:  # by rounding
            yield Problem(("S",), str(self.S), "another number: with this one, SALib fails")

    @property
    def fewest(self) -> int:
        return 10 * self.S

    def estimate(
        self, points: FloatArray, values: FloatArray, level: float
    ) -> Mapping[str, list[Estimate]] | str:
        permuted = np.random.default_rng(self.seed).permuted(points, axis=0)
        both = np.hstack([points, permuted])
        keys = ("median",)
        found = call_salib(self.method, _problem(both), both, values, keys=keys, S=self.S)
        if isinstance(found, str):
            return found
        index, floor = np.split(found["median"], 2)
        every = _estimates(self.method, index, texts.SALIB_NO_INTERVAL)
        largest = float(np.nanmax(floor, initial=0.0))
        every = [each.with_note(texts.PAWN_FLOOR * (each.value <= largest)) for each in every]
        floors = _estimates(self.method, floor, texts.SALIB_NO_INTERVAL)
        return {"salib_pawn": every, "salib_pawn_floor": floors}


@dataclass(frozen=True)
class Delta(SalibAnalysis):
    """SALib's estimate of the moment-independent delta (Plischke et al., 2013)."""

    method = "delta"
    statistics = ("salib_delta",)

    num_resamples: int = count(minimum=2, maximum=1_000, default=20)

    @property
    def fewest(self) -> int:
        return 100

    def refusal(self, sample: Sample, inputs: int) -> str:
        is_too_large = sample.size * inputs > _MOST_VALUES_FOR_DELTA
        return texts.SALIB_TOO_LARGE.format(method=self.method) if is_too_large else ""

    def estimate(
        self, points: FloatArray, values: FloatArray, level: float
    ) -> Mapping[str, list[Estimate]] | str:
        # Since 1.6, it has three kinds; this is the former one.
        is_former = package_version("SALib").startswith("1.5.")
        key = "delta" if is_former else "delta_raw"
        settings = {"num_resamples": self.num_resamples, "seed": self.seed, "method": "delta"}
        found = call_salib(self.method, _problem(points), points, values, keys=(key,), **settings)
        if isinstance(found, str):
            return found
        return {"salib_delta": _estimates(self.method, found[key], texts.SALIB_DELTA)}


@dataclass(frozen=True)
class EnhancedHdmr(SalibAnalysis):
    """First-order shares of an expansion in polynomials (Gao et al., 2023)."""

    method = "enhanced_hdmr"
    independence_reason = "its shares are those of inputs that vary independently"
    statistics = ("salib_hdmr",)
    of_all_inputs = ("salib_hdmr_unexplained",)

    max_order: int = count(maximum=3, default=2)
    poly_order: int = count(maximum=10, default=3)

    @property
    def fewest(self) -> int:
        return 300

    def refusal(self, sample: Sample, inputs: int) -> str:
        if inputs == 1:
            return texts.SALIB_ONE_INPUT
        orders = range(1, min(self.max_order, inputs) + 1)
        terms = sum(math.comb(inputs, order) * self.poly_order**order for order in orders)
        if sample.size < _RUNS_OF_A_TERM * terms:
            return texts.HDMR_TERMS.format(terms=terms, runs=_RUNS_OF_A_TERM * terms)
        is_too_large = sample.size * inputs**2 > _MOST_FOR_EXPANSION
        return texts.SALIB_TOO_LARGE.format(method=self.method) if is_too_large else ""

    def estimate(
        self, points: FloatArray, values: FloatArray, level: float
    ) -> Mapping[str, list[Estimate]] | str:
        settings = {"max_order": self.max_order, "poly_order": self.poly_order, "seed": self.seed}
        found = call_salib(self.method, _problem(points), points, values, keys=("S",), **settings)
        if isinstance(found, str):
            return found
        every = _estimates(self.method, found["S"][: points.shape[1]], texts.SALIB_HALVES)
        unexplained = 1 - float(found["S"].sum())
        if not unexplained <= 1 - _LEAST_EXPLAINED:
            reason = texts.HDMR_UNUSABLE.format(share=100 * unexplained)
            every = [Estimate.without_bounds(math.nan, reason) for _ in every]
        share = Estimate.without_bounds(unexplained, texts.SALIB_NO_INTERVAL)
        return {"salib_hdmr": every, "salib_hdmr_unexplained": [share]}


@dataclass(frozen=True)
class Rsa(SalibAnalysis):
    """Regional sensitivity analysis (Hornberger and Spear, 1981): a curve for each input.

    At each part of the output's distribution, it is the Cramér-von Mises distance between the
    input's values in the runs of this part and in all others.
    """

    method = "rsa"
    statistics = ("salib_rsa",)

    bins: int = count(minimum=2, maximum=100, default=10)

    @property
    def fewest(self) -> int:
        return 10 * self.bins

    def estimate(
        self, points: FloatArray, values: FloatArray, level: float
    ) -> Mapping[str, list[Estimate]] | str:
        problem = _problem(points)
        names = problem["names"]
        found = call_salib(
            self.method, problem, points, values, keys=names, bins=self.bins, target="Y"
        )
        if isinstance(found, str):
            return found
        curves = [_estimates(self.method, found[each], texts.SALIB_NO_INTERVAL) for each in names]
        return {"salib_rsa": [Estimate.stacked(curve) for curve in curves]}

    @property
    def along(self) -> Mapping[str, FloatArray]:
        return {OUTPUT_SHARE: (np.arange(self.bins) + 0.5) / self.bins}


# Analyses of the runs of SALib's own designs.


def _values(runs: xr.Dataset, name: str) -> tuple[xr.Dataset, FloatArray]:
    """Return runs in the order of a design, and an output; NaN for a failed run."""
    ordered = runs.isel({RUN: np.lexsort((runs[POSITION].values, runs[BLOCK_NUMBER].values))})
    values = np.where(ordered[STATUS].values == Status.OK, ordered[name].values, np.nan)
    return ordered, values


def _single(made: dict[str, FloatArray] | str, key: str, reason: str) -> Estimate:
    """Return the one number under a key without bounds, or none where there is no result."""
    if isinstance(made, str):
        return Estimate.without_bounds(math.nan, made)
    return Estimate.without_bounds(float(made[key][0]), reason)


def search_curves(runs: xr.Dataset, quantity: QuantityOfInterest) -> NamedArrays:
    """First-order and total indices by FAST: each input has a curve through the inputs' space.

    A curve with a failed run has no index, as its frequencies need all places in their order.
    SALib's bootstrap draws places of a curve at random, so it has no meaning and is left out.

    References
    ----------
    Saltelli, A., Tarantola, S. & Chan, K. P.-S. (1999). Technometrics 41, 39-56.
    """
    if quantity.output.categories:
        return
    ordered, values = _values(runs, quantity.output.name)
    harmonics, inputs = int(ordered[POSITION].attrs[HARMONICS]), moved_input_numbers(runs)
    first: list[Estimate] = []
    total: list[Estimate] = []
    for number in inputs.values():
        curve = values[ordered[MOVED_INPUT].values == number]
        lost = int(np.isnan(curve).sum())
        made: dict[str, FloatArray] | str = texts.LOST_ON_CURVE.format(lost=lost, runs=curve.size)
        if not lost and not np.ptp(curve) > 0:
            made = texts.CONSTANT_OUTPUT
        elif not lost:
            problem = {"num_vars": 1, "names": ["x0"]}
            settings = {"M": harmonics, "num_resamples": 2, "seed": 1}
            made = call_salib("fast", problem, curve, keys=("S1", "ST"), **settings)
        for estimates, key in ((first, "S1"), (total, "ST")):
            estimates.append(_single(made, key, texts.ONE_CURVE))
    title = quantity.output.title
    yield (
        "salib_fast_first",
        _stated(input_array(first, [*inputs], f"first-order index of {title} by FAST")),
    )
    yield (
        "salib_fast_total",
        _stated(input_array(total, [*inputs], f"total index of {title} by FAST")),
    )


def derivatives(runs: xr.Dataset, quantity: QuantityOfInterest) -> NamedArrays:
    """Mean squared derivative of an output by each input, relative to their variances (DGSM).

    It is ν σ² / Var y, with ν the mean of (∂y/∂x)² and σ the standard deviation of the input: for a
    normal input an upper bound of its total index, for a uniform one the bound divided by 1.22.

    References
    ----------
    Sobol', I. M. & Kucherenko, S. (2009). Math. Comput. Simul. 79, 3009-3017.
    """
    if quantity.output.categories:
        return
    ordered, values = _values(runs, quantity.output.name)
    position = ordered[POSITION].values
    base, estimates, inputs = position == 0, [], moved_input_numbers(runs)
    for name, number in inputs.items():
        moved = ordered[MOVED_INPUT].values == number
        columns = (ordered[name].values, values)
        x, y = (np.column_stack([each[base], each[moved]]) for each in columns)
        is_whole = np.isfinite(y).all(axis=1)
        lost, (x, y) = int((~is_whole).sum()), (x[is_whole], y[is_whole])
        spread, scale = (each[:, 0].std() if len(each) > 1 else 0.0 for each in (x, y))
        note = texts.LOST_PAIRS.format(lost=lost, pairs=is_whole.size) if lost else ""
        if len(x) < 2 or not scale > 0:
            reason = texts.CONSTANT_OUTPUT if len(x) > 1 else ""
            estimates.append(Estimate.without_bounds(math.nan, reason, note))
            continue
        # In units in which SALib's factor is 1, and its measure the mean square itself.
        problem = {"num_vars": 1, "names": ["x0"], "bounds": [[0.0, math.pi]]}
        arguments = (problem, x.reshape(-1, 1) / spread, y.ravel() / scale)
        made = call_salib("dgsm", *arguments, keys=("dgsm",), num_resamples=2, seed=1)
        estimates.append(_single(made, "dgsm", texts.DGSM_INTERVAL).with_note(note))
    long_name = f"derivative-based measure of {quantity.output.title} (DGSM)"
    yield "salib_dgsm", _stated(input_array(estimates, [*inputs], long_name))


def two_levels(runs: xr.Dataset, quantity: QuantityOfInterest) -> NamedArrays:
    """Main effect of each input between two of its levels, by a fractional factorial design.

    The effect is half of the change of the output, as SALib defines it. It includes
    interactions that the design cannot separate from it. All runs make each effect, so there is
    none if a run failed.

    References
    ----------
    Saltelli, A. et al. (2008). Global Sensitivity Analysis: The Primer. Wiley.
    """
    if quantity.output.categories:
        return
    _, values = _values(runs, quantity.output.name)
    inputs, lost = moved_input_numbers(runs), int(np.isnan(values).sum())
    _, *names = str(runs[MOVED_INPUT].attrs["flag_meanings"]).split()
    problem = {"num_vars": len(names), "names": names, "bounds": [[0, 1]] * len(names)}
    made: dict[str, FloatArray] | str = texts.LOST_OF_LEVELS.format(lost=lost, runs=values.size)
    if not lost:
        points = np.zeros((values.size, len(names)))
        made = call_salib("ff", problem, points, values, keys=("ME",))
    if isinstance(made, str):
        estimates = [Estimate.without_bounds(math.nan, made) for _ in inputs]
    else:
        effects, unused = np.split(made["ME"], [len(names)])
        note = texts.UNUSED_COLUMNS.format(largest=np.abs(unused).max()) if unused.size else ""
        estimates = [
            Estimate.without_bounds(float(effects[names.index(name)]), texts.LEVELS_INTERVAL, note)
            for name in inputs
        ]
    long_name = f"half change of {quantity.output.title} between two levels"
    units = quantity.output.unit
    yield "salib_ff", _stated(input_array(estimates, [*inputs], long_name, units=units))
