"""Record of a benchmark: every estimate of every repeat and the reference, and their archive."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, estimate_array, pack
from uqpen.benchmark.accuracy import (
    Accuracy,
    convergence_slope,
    find_verdict,
    reference_remark,
    root_mean_square_errors,
    verdict_sentence,
)
from uqpen.benchmark.methods import BenchmarkMethod, MethodCost, SurrogateMethod
from uqpen.benchmark.settings import BenchmarkSettings
from uqpen.benchmark.statistics import BenchmarkStatistic, Estimates
from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import COMPARISON_STATISTICS, METHOD_STATISTICS
from uqpen.core.labels import (
    BOUNDS,
    BUDGET,
    COMPARISON_GROUP,
    INTERVAL,
    INTERVAL_LABEL,
    INTERVAL_LEVEL,
    NOTE,
    REFERENCE,
    REPEAT,
    REPLICATED,
    REPLICATES_OF_BUDGET,
    RUNS_OF_BUDGET,
    RUNS_SPENT,
    SINGLE,
    SOURCE,
    SOURCE_KIND,
    STATISTICS_GROUP,
    VARIANT,
    VARIANTS,
)
from uqpen.core.statistic import Statistic, UnitRule
from uqpen.core.units import DIMENSIONLESS
from uqpen.statistics.estimate import LEVEL

__all__ = ["EstimateRecord"]

_VARIANTS = (SINGLE, REPLICATED)

# Methods of the intervals.
_INTERVALS = {
    "error": "Student t on the logarithm, jackknife over repeats",
    "slope": "Student t on a line by least squares, jackknife over repeats",
    "lead": "Welch's t on the logarithm, jackknife over repeats",
}
_INTERVAL_NOTE = (
    "none where a few of the repeats decide an error; a tail that none has met cannot show"
)


class EstimateRecord:
    """Estimates along method, budget, repeat, entry and bound; NaN where there is none.

    Parameters
    ----------
    methods : tuple of BenchmarkMethod
        In the order of the first axis.
    settings : BenchmarkSettings
        Budgets and repeats.
    statistics : sequence of BenchmarkStatistic
        Those that methods are compared by, output by output.
    truth : mapping of str to mapping
        The reference's estimate arrays, by output and statistic.
    """

    def __init__(
        self,
        methods: tuple[BenchmarkMethod, ...],
        settings: BenchmarkSettings,
        statistics: Sequence[BenchmarkStatistic],
        truth: Estimates,
    ) -> None:
        self._methods, self._settings, self._truth = methods, settings, truth
        # Along entry and bound, and the scales of the relative errors along entry.
        self._reference = {each: each.estimates(truth) for each in statistics}
        self._scales = {
            each: each.error_scale(values[:, 0], float(truth[each.output]["std"].values[0]))
            for each, values in self._reference.items()
        }
        shape = (len(methods), len(settings.budgets), settings.repeats)
        self._estimates = {
            each: np.full((*shape, *values.shape), np.nan)
            for each, values in self._reference.items()
        }

    def add(self, method: int, budget: int, repeat: int, estimates: Estimates) -> None:
        """Take the estimates of a method from one repeat, all given by their positions."""
        for statistic, found in self._estimates.items():
            found[method, budget, repeat] = statistic.estimates(estimates)

    def accuracy(self, statistic: BenchmarkStatistic) -> Accuracy:
        """Return the relative errors, of shape (method, budget, entry)."""
        values = np.moveaxis(self._estimates[statistic][..., 0], 2, -1)
        truth = self._reference[statistic][:, :1]
        return root_mean_square_errors((values - truth) / self._scales[statistic][:, np.newaxis])

    def coverage(self, statistic: BenchmarkStatistic) -> FloatArray:
        """Return the share of the intervals that contain the reference; NaN for no intervals.

        Its shape is (method, budget, entry).
        """
        lower, upper = np.moveaxis(self._estimates[statistic][..., 1:], -1, 0)
        truth = self._reference[statistic][:, 0]
        has_interval = ~(np.isnan(lower) | np.isnan(upper))
        held = (has_interval & (lower <= truth) & (truth <= upper)).sum(axis=2)
        with np.errstate(invalid="ignore"):
            share: FloatArray = held / has_interval.sum(axis=2)
        return share

    def slopes(self, statistic: BenchmarkStatistic) -> FloatArray:
        """Return convergence rates over the usable budgets, of shape (method, entry, bound)."""
        errors = self.accuracy(statistic)
        slopes = []
        for position in range(len(self._methods)):
            runs = np.array([cost.runs for cost in self._costs(position)])
            used = errors[position, runs > 0]
            runs = runs[runs > 0].astype(np.float64)
            error = used.reliable_error
            slopes.append(convergence_slope(used.logarithm, error, runs, errors.repeats))
        return np.stack(slopes)

    def groups(self, reference_runs: int) -> Iterator[tuple[str, xr.Dataset]]:
        """Yield the groups of an archive: the reference and each method, then the verdicts."""
        by_output = {
            output: list(found)
            for output, found in groupby(self._reference, lambda statistic: statistic.output)
        }
        of_methods = {
            statistic: {
                statistic.name: self._estimates[statistic][..., 0],
                f"{statistic.name}_error": self.accuracy(statistic).bounds,
                f"{statistic.name}_coverage": self.coverage(statistic),
                f"{statistic.name}_slope": self.slopes(statistic),
            }
            for statistic in self._reference
        }
        taken = {method.source for method in self._methods}
        place = f"/{STATISTICS_GROUP}/{_free_name(REFERENCE, taken)}"
        yield place, xr.Dataset(attrs={SOURCE_KIND: REFERENCE, RUNS_SPENT: reference_runs})
        for output, arrays in self._truth.items():
            yield f"{place}/{output}", pack(arrays)
        for position, method in enumerate(self._methods):
            runs = sum(cost.runs for cost in self._costs(position)) * self._settings.repeats
            name = method.source
            if SINGLE not in method.variants:
                name = _free_name(f"{name}_{REPLICATED}", taken)
            attributes = {
                SOURCE_KIND: "surrogate" if isinstance(method, SurrogateMethod) else "design",
                SOURCE: method.source,
                VARIANTS: " ".join(method.variants),
                RUNS_SPENT: runs,
            }
            yield f"/{STATISTICS_GROUP}/{name}", xr.Dataset(attrs=attributes)
            for output, statistics in by_output.items():
                arrays = {
                    key: self._method_array(position, each, key, values[position])
                    for each in statistics
                    for key, values in of_methods[each].items()
                }
                yield f"/{STATISTICS_GROUP}/{name}/{output}", pack(arrays)
        for output, statistics in by_output.items():
            arrays = dict(pair for each in statistics for pair in self._comparison_arrays(each))
            quantity = statistics[0].quantity
            described = {
                "long_name": quantity.output.title,
                "units": quantity.output.unit,
                "display_units": quantity.display_unit,
            }
            yield f"/{COMPARISON_GROUP}/{output}", pack(arrays).assign_attrs(described)

    def _costs(self, method: int) -> list[MethodCost]:
        return [self._methods[method].cost(budget) for budget in self._settings.budgets]

    def _method_array(
        self, method: int, statistic: BenchmarkStatistic, name: str, values: FloatArray
    ) -> xr.DataArray:
        runs, replicates = zip(*self._costs(method), strict=True)
        beside = {
            RUNS_OF_BUDGET: (BUDGET, np.array(runs), "runs that are made"),
            REPLICATES_OF_BUDGET: (BUDGET, np.array(replicates), "replicates"),
        }
        return self._array(METHOD_STATISTICS[name], statistic, values, beside)

    def _comparison_arrays(
        self, statistic: BenchmarkStatistic
    ) -> Iterator[tuple[str, xr.DataArray]]:
        """Yield what errors are relative to, and the verdicts along variant, budget and entry."""
        errors, budgets = self.accuracy(statistic), self._settings.budgets
        shape = (len(_VARIANTS), len(budgets), len(statistic.entries))
        found: dict[str, Any] = {
            name: np.full(shape, "", dtype=object)
            for name in ("winner", "runner_up", "level", "verdict", "remark")
        }
        found["lead"] = np.full((*shape, len(BOUNDS)), np.nan)
        for at in np.ndindex(shape):
            variant, budget, entry = at
            inside = [
                i for i, each in enumerate(self._methods) if _VARIANTS[variant] in each.variants
            ]
            compared = errors[inside, budget, entry]
            _, lower, upper = self._reference[statistic][entry]
            own = float((upper - lower) / 2 / self._scales[statistic][entry])
            verdict = find_verdict([self._methods[i].source for i in inside], compared, own)
            found["verdict"][at] = verdict_sentence(verdict, budgets[budget])
            if verdict is None:
                continue
            found["winner"][at], found["runner_up"][at] = verdict.winner, verdict.runner_up
            found["level"][at] = " ".join(verdict.level)
            found["lead"][at] = verdict.lead.factor, verdict.lead.lower, verdict.lead.upper
            if not verdict.doubt:
                least = float(np.nanmin(compared.bounds[:, 0]))
                found["remark"][at] = reference_remark(least, own)
        for said, values in {"scale": self._scales[statistic], **found}.items():
            name = f"{statistic.name}_{said}"
            yield name, self._array(COMPARISON_STATISTICS[name], statistic, values, {})

    def _array(
        self,
        described: Statistic,
        statistic: BenchmarkStatistic,
        values: Any,
        beside: Mapping[str, tuple[str, Any, str]],
    ) -> xr.DataArray:
        """Return a variable of a statistic with its coordinates.

        The values lie along its dimensions, the statistic's entries being the last, and the bounds.
        """
        if not statistic.dimension:  # a single entry has no dimension in the archive
            values = np.take(values, 0, axis=len(described.dims))
        known = {
            VARIANT: (VARIANT, np.array(_VARIANTS, dtype=object), "how the points are taken"),
            BUDGET: (BUDGET, np.array(self._settings.budgets), "runs that a method may make"),
            REPEAT: (REPEAT, np.arange(self._settings.repeats), "number of the repeat"),
        }
        along = {name: known[name] for name in described.dims if name in known}
        along |= beside if BUDGET in described.dims else {}
        coordinates: dict[str, Any] = {name: _coordinate(*each) for name, each in along.items()}
        # The labels of the entries are those that the reference has.
        coordinates |= {
            str(name): coordinate.variable
            for name, coordinate in self._truth[statistic.output][statistic.name].coords.items()
            if coordinate.dims == (statistic.dimension,) and name not in INTERVAL_TEXTS
        }
        attributes = {"long_name": f"{described.title} of {statistic.quantity.output.title}"}
        if described.kind != "text":
            has_unit = described.unit is not UnitRule.NONE
            attributes["units"] = statistic.units if has_unit else DIMENSIONLESS
        if not described.has_bounds:
            return xr.DataArray(values, coordinates, described.dims, attrs=attributes)
        return estimate_array(
            values,
            dict(zip(described.dims, values.shape[:-1], strict=True)),
            {
                INTERVAL: _INTERVALS[described.name.rpartition("_")[2]],
                INTERVAL_LABEL: "nominal",
                NOTE: _INTERVAL_NOTE,
            },
            **attributes,
            attributes={INTERVAL_LEVEL: LEVEL},
            coordinates=coordinates,
        )


def _free_name(name: str, taken: set[str]) -> str:
    """Return a name that is not yet taken, which it is from then on."""
    while name in taken:
        name += "_"
    taken.add(name)
    return name


def _coordinate(dimension: str, labels: Any, long_name: str) -> tuple[str, Any, dict[str, str]]:
    units = {} if labels.dtype == object else {"units": DIMENSIONLESS}
    return dimension, labels, {**units, "long_name": long_name}
