"""Tree of datasets of a benchmark, as in its archive."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.benchmark_layout import (
    BENCHMARK_COORDINATES,
    BENCHMARK_GROUP,
    BENCHMARK_VARIABLES,
    METHOD_VARIABLES,
    ArchiveVariable,
)
from uqpen.archive.estimates import estimate_array, pack
from uqpen.benchmark.record import EstimateRecord
from uqpen.benchmark.statistics import BenchmarkStatistic, Estimates
from uqpen.benchmark.verdicts import Verdict, reference_remark, verdict_sentence
from uqpen.core.labels import (
    BENCHMARK,
    BOUNDS,
    BUDGET,
    INTERVAL,
    INTERVAL_LABEL,
    INTERVAL_LEVEL,
    KIND,
    METHOD_DIMENSION,
    METHODS,
    NOTE,
    REFERENCE,
    REPEAT,
    REPLICATED,
    SINGLE,
    VARIANT,
)
from uqpen.core.statistic_dimensions import PROBABILITY
from uqpen.core.units import DIMENSIONLESS
from uqpen.statistics.estimate import LEVEL
from uqpen.study.study import ValidatedStudy
from uqpen.workflow import root_attributes

__all__ = ["benchmark_tree"]

Values = npt.NDArray[Any]

_VARIANTS = (SINGLE, REPLICATED)

# Methods of the intervals of the variables with bounds.
_INTERVALS = {
    "error": "Student t on the logarithm, jackknife over repeats",
    "slope": "Student t on a line by least squares, jackknife over repeats",
    "lead": "Welch's t on the logarithm, jackknife over repeats",
}
_INTERVAL_NOTE = (
    "none where a few of the repeats decide an error; a tail that none has met cannot show"
)


def benchmark_tree(
    study: ValidatedStudy, record: EstimateRecord, reference: Estimates
) -> xr.DataTree:
    """Return all estimates and their comparison in the layout of an archive.

    The reference's estimate arrays are given by output and statistic.
    """
    attributes = {**root_attributes(study), KIND: BENCHMARK}
    groups = {"/": xr.Dataset(attrs=attributes), f"/{METHODS}": _methods(record)}
    groups |= {f"/{REFERENCE}/{output}": pack(arrays) for output, arrays in reference.items()}
    for statistic in record.reference:
        place, quantity = f"/{BENCHMARK_GROUP}/{statistic.output}", statistic.quantity
        groups[place] = xr.Dataset(
            attrs={
                "long_name": quantity.output.title,
                "units": quantity.output.unit,
                "display_units": quantity.display_unit,
            }
        )
        groups[f"{place}/{statistic.name}"] = _statistic_dataset(record, statistic)
    return xr.DataTree.from_dict(groups)


def _statistic_dataset(record: EstimateRecord, statistic: BenchmarkStatistic) -> xr.Dataset:
    """Return the variables of a statistic, with the coordinates of their dimensions."""
    values = {
        "estimate": record.estimates[statistic][..., 0],
        "error": record.accuracy(statistic).bounds,
        "coverage": record.coverage(statistic),
        "scale": record.scales[statistic],
        "slope": record.slopes(statistic),
        **_verdict_values(record, statistic),
    }
    coordinates = _coordinates(record)
    if statistic.dimension:
        coordinates[statistic.dimension] = _entry_coordinate(statistic)
    return pack(
        {
            name: _array(statistic, variable, values[name], coordinates)
            for name, variable in BENCHMARK_VARIABLES.items()
        }
    )


def _coordinates(record: EstimateRecord) -> dict[str, Any]:
    """Return the coordinates of the dimensions that all statistics share."""
    values = {
        METHOD_DIMENSION: _texts(method.name for method in record.methods),
        VARIANT: _texts(_VARIANTS),
        BUDGET: np.array(record.settings.budgets),
        REPEAT: np.arange(record.settings.repeats),
    }
    return {
        name: (variable.dims, values[name], _described(variable))
        for name, variable in BENCHMARK_COORDINATES.items()
    }


def _described(variable: ArchiveVariable) -> dict[str, str]:
    """Return the attributes of a variable that is no statistic's."""
    units = {} if variable.kind == "text" else {"units": DIMENSIONLESS}
    return {**units, "long_name": variable.long_name}


def _entry_coordinate(statistic: BenchmarkStatistic) -> tuple[str, Any, dict[str, str]]:
    """Return the coordinate that labels the entries of a statistic."""
    if statistic.dimension == PROBABILITY:
        described = {"units": "1", "long_name": "probability of lying below the quantile"}
        return PROBABILITY, np.array(statistic.entries), described
    texts = _texts(map(str, statistic.entries))
    return statistic.dimension, texts, {"long_name": "value exceeded, as written"}


def _methods(record: EstimateRecord) -> xr.Dataset:
    """Return the settings of every method at every budget."""
    costs = [[m.cost(budget) for budget in record.settings.budgets] for m in record.methods]
    values = {
        "runs": np.array([[each.runs for each in row] for row in costs]),
        "replicates": np.array([[each.replicates for each in row] for row in costs]),
        "source": _texts(method.source for method in record.methods),
        "contests": _texts(" ".join(method.variants) for method in record.methods),
    }
    along = _coordinates(record)
    return xr.Dataset(
        {
            name: (variable.dims, values[name], _described(variable))
            for name, variable in METHOD_VARIABLES.items()
        },
        {name: along[name] for name in (METHOD_DIMENSION, BUDGET)},
        {"repeats": record.settings.repeats, "reference_runs": record.reference_runs},
    )


def _verdict_values(record: EstimateRecord, statistic: BenchmarkStatistic) -> dict[str, Values]:
    """Return the verdicts of the comparisons, along variant, budget and entry."""
    budgets = record.settings.budgets
    shape = (len(_VARIANTS), len(budgets), len(statistic.entries))
    verdicts: dict[tuple[int, ...], Verdict | None] = {
        at: record.verdict(statistic, _VARIANTS[at[0]], at[1], at[2]) for at in np.ndindex(shape)
    }

    def texts(text_of: Callable[[Verdict], str]) -> Values:
        return _texts(text_of(v) if v else "" for v in verdicts.values()).reshape(shape)

    leads = [
        (v.lead.factor, v.lead.lower, v.lead.upper) if v else (np.nan,) * len(BOUNDS)
        for v in verdicts.values()
    ]
    sentences = (verdict_sentence(v, budgets[at[1]]) for at, v in verdicts.items())
    remarks = (_remark(record, statistic, at, v) for at, v in verdicts.items())
    return {
        "winner": texts(lambda verdict: verdict.winner),
        "runner_up": texts(lambda verdict: verdict.runner_up),
        "level": texts(lambda verdict: " ".join(verdict.level)),
        "verdict": _texts(sentences).reshape(shape),
        "remark": _texts(remarks).reshape(shape),
        "lead": np.array(leads).reshape(*shape, len(BOUNDS)),
    }


def _remark(
    record: EstimateRecord,
    statistic: BenchmarkStatistic,
    at: tuple[int, ...],
    verdict: Verdict | None,
) -> str:
    """Return the meaning of the reference's own error for a verdict that does not say so itself."""
    if verdict is None or verdict.doubt:
        return ""
    variant, budget, entry = at
    inside = record.contestants(_VARIANTS[variant])
    errors = record.accuracy(statistic)[inside, budget, entry].bounds[:, 0]
    return reference_remark(float(np.nanmin(errors)), record.reference_error(statistic, entry))


def _array(
    statistic: BenchmarkStatistic,
    variable: ArchiveVariable,
    values: Values,
    coordinates: Mapping[str, Any],
) -> xr.DataArray:
    """Return a variable of a statistic with its coordinates.

    The values lie along the variable's dimensions, the statistic's entries and the bounds, if it
    has these.
    """
    if not statistic.dimension:  # a single entry has no dimension in the archive
        values = np.take(values, 0, axis=len(variable.dims))
    dims = variable.dims_of(statistic.name)
    attributes = {"long_name": variable.long_name.format(statistic.long_name)}
    if variable.kind != "text":
        attributes["units"] = statistic.units if variable.has_unit else DIMENSIONLESS
    if variable.name == "estimate":
        attributes["display_units"] = statistic.display_units
    along = {name: coordinates[name] for name in dims if name in coordinates}
    if not variable.has_bounds:
        return xr.DataArray(values, along, dims, variable.name, attributes)
    array = estimate_array(
        values,
        dict(zip(dims[:-1], values.shape[:-1], strict=True)),
        {INTERVAL: _INTERVALS[variable.name], INTERVAL_LABEL: "nominal", NOTE: _INTERVAL_NOTE},
        units=attributes["units"],
        long_name=attributes["long_name"],
        attributes={INTERVAL_LEVEL: LEVEL},
        coordinates=along,
    )
    return array.rename(variable.name)


def _texts(texts: Iterable[str]) -> Values:
    return np.array(list(texts), dtype=object)
