"""A comparison as the tree of datasets that its archive holds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.benchmark.accuracy import JACKKNIFE
from uqpen.benchmark.record import EstimateRecord
from uqpen.benchmark.statistics import BenchmarkStatistic
from uqpen.benchmark.verdicts import Verdict, reference_remark, verdict_sentence
from uqpen.core.labels import (
    BENCHMARK,
    BOUND,
    BOUNDS,
    BUDGET,
    ENTRIES,
    ERRORS,
    ESTIMATES,
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
    SLOPES,
    VARIANT,
    VERDICTS,
)
from uqpen.core.units import DIMENSIONLESS
from uqpen.statistics.estimate import LEVEL
from uqpen.study.study import Study
from uqpen.workflow import root_attributes

__all__ = ["benchmark_tree"]

Variables = Iterator[tuple[str, xr.DataArray]]
Texts = npt.NDArray[np.object_]

_VARIANTS = (SINGLE, REPLICATED)

_INTERVAL_ATTRIBUTES = {
    INTERVAL: JACKKNIFE,
    INTERVAL_LABEL: "nominal",
    INTERVAL_LEVEL: LEVEL,
    NOTE: "none where a few of the repeats decide an error; a tail that none has met cannot show",
}


def benchmark_tree(
    study: Study, record: EstimateRecord, reference: Mapping[str, xr.Dataset]
) -> xr.DataTree:
    """All that was seen and found.

    Parameters
    ----------
    study : Study
        Of which the methods are.
    record : EstimateRecord
        Every estimate.
    reference : mapping of str to Dataset
        What the reference's analyses answered, by group.
    """
    attributes = {**root_attributes(study), KIND: BENCHMARK}
    groups = {"/": xr.Dataset(attrs=attributes), f"/{METHODS}": _methods(record)}
    groups |= {f"/{REFERENCE}/{name}": dataset for name, dataset in reference.items()}
    by_output: dict[str, list[BenchmarkStatistic]] = {}
    for statistic in record.reference:
        by_output.setdefault(statistic.output, []).append(statistic)
    for group, variables in (
        (ESTIMATES, _estimates),
        (ERRORS, _errors),
        (SLOPES, _slopes),
        (VERDICTS, _verdicts),
    ):
        for output, statistics in by_output.items():
            groups[f"/{group}/{output}"] = _dataset(record, statistics, variables)
    return xr.DataTree.from_dict(groups)


def _dataset(
    record: EstimateRecord,
    statistics: list[BenchmarkStatistic],
    variables: Callable[[EstimateRecord, BenchmarkStatistic], Variables],
) -> xr.Dataset:
    """The variables of an output's statistics, with what lies along their dimensions."""
    found = {name: array for each in statistics for name, array in variables(record, each)}
    dataset = xr.Dataset(found)
    coordinates: dict[str, Any] = dict(_coordinates(record))
    for each in statistics:
        if each.dimension:
            coordinates[each.dimension] = _entry_coordinate(each)
    return dataset.assign_coords(
        {name: along for name, along in coordinates.items() if name in dataset.dims}
    )


def _coordinates(record: EstimateRecord) -> Iterator[tuple[str, Any]]:
    repeats = np.arange(record.settings.repeats)
    budgets = np.array(record.settings.budgets)
    yield (
        METHOD_DIMENSION,
        (METHOD_DIMENSION, _texts(m.name for m in record.methods), {"long_name": "method"}),
    )
    yield VARIANT, (VARIANT, _texts(_VARIANTS), {"long_name": "how the points are taken"})
    yield BUDGET, (BUDGET, budgets, {"units": "1", "long_name": "runs that a method may make"})
    yield REPEAT, (REPEAT, repeats, {"units": "1", "long_name": "number of the repeat"})
    yield BOUND, (BOUND, list(BOUNDS))


def _entry_coordinate(statistic: BenchmarkStatistic) -> tuple[str, Any, dict[str, str]]:
    """What tells the entries of a statistic apart."""
    if statistic.dimension == ENTRIES["quantile"]:
        described = {"units": "1", "long_name": "probability of lying below the quantile"}
        return statistic.dimension, np.array(statistic.entries), described
    described = {"long_name": "value exceeded, as written"}
    return statistic.dimension, _texts(map(str, statistic.entries)), described


def _methods(record: EstimateRecord) -> xr.Dataset:
    """What every method does with every budget."""
    spent = [[m.cost(budget) for budget in record.settings.budgets] for m in record.methods]
    described = {
        "runs": ([[each.runs for each in row] for row in spent], "runs that are made"),
        "replicates": ([[each.replicates for each in row] for row in spent], "replicates"),
    }
    dataset = xr.Dataset(
        {
            name: (
                (METHOD_DIMENSION, BUDGET),
                np.array(values),
                {"units": "1", "long_name": long_name},
            )
            for name, (values, long_name) in described.items()
        },
        attrs={"repeats": record.settings.repeats, "reference_runs": record.reference_runs},
    )
    sources = _texts(method.source for method in record.methods)
    variants = _texts(" ".join(method.variants) for method in record.methods)
    dataset["source"] = (METHOD_DIMENSION, sources, {"long_name": "the study's name of the method"})
    dataset["contests"] = (METHOD_DIMENSION, variants, {"long_name": "variants that it stands for"})
    along = dict(_coordinates(record))
    return dataset.assign_coords({name: along[name] for name in (METHOD_DIMENSION, BUDGET)})


def _estimates(record: EstimateRecord, statistic: BenchmarkStatistic) -> Variables:
    values = record.estimates[statistic][..., 0]
    attributes = {
        "units": statistic.units,
        "long_name": statistic.long_name,
        "display_units": statistic.display_units,
    }
    yield statistic.name, _array(statistic, values, (METHOD_DIMENSION, BUDGET, REPEAT), attributes)


def _errors(record: EstimateRecord, statistic: BenchmarkStatistic) -> Variables:
    what = statistic.long_name
    attributes: dict[str, Any] = {
        "units": DIMENSIONLESS,
        "long_name": f"root mean square of the relative errors of the {what}",
        **_INTERVAL_ATTRIBUTES,
    }
    errors = record.accuracy(statistic).bounds
    yield statistic.name, _array(statistic, errors, (METHOD_DIMENSION, BUDGET), attributes, BOUND)
    attributes = {
        "units": DIMENSIONLESS,
        "long_name": f"share of the intervals of the {what} that held the reference",
    }
    covered = record.coverage(statistic)
    yield (
        f"{statistic.name}_coverage",
        _array(statistic, covered, (METHOD_DIMENSION, BUDGET), attributes),
    )
    attributes = {
        "units": statistic.units,
        "long_name": f"what errors of the {what} are relative to",
    }
    yield f"{statistic.name}_scale", _array(statistic, record.scales[statistic], (), attributes)


def _slopes(record: EstimateRecord, statistic: BenchmarkStatistic) -> Variables:
    attributes: dict[str, Any] = {
        "units": DIMENSIONLESS,
        "long_name": f"slope of log error of the {statistic.long_name} over log runs",
        **_INTERVAL_ATTRIBUTES,
        INTERVAL: f"Student t on a line by least squares, {JACKKNIFE.partition(', ')[2]}",
    }
    yield (
        statistic.name,
        _array(statistic, record.slopes(statistic), (METHOD_DIMENSION,), attributes, BOUND),
    )


def _verdicts(record: EstimateRecord, statistic: BenchmarkStatistic) -> Variables:
    shape = (len(_VARIANTS), len(record.settings.budgets), len(statistic.entries))
    verdicts: dict[tuple[int, ...], Verdict | None] = {
        at: record.verdict(statistic, _VARIANTS[at[0]], at[1], at[2]) for at in np.ndindex(shape)
    }
    what = statistic.long_name

    def texts(text_of: Callable[[tuple[int, ...], Verdict | None], str], long_name: str) -> Any:
        values = _texts(text_of(at, verdict) for at, verdict in verdicts.items()).reshape(shape)
        return _array(statistic, values, (VARIANT, BUDGET), {"long_name": f"{long_name}: {what}"})

    name, budgets = statistic.name, record.settings.budgets
    yield f"{name}_winner", texts(lambda _, v: v.winner if v else "", "method with least error")
    yield f"{name}_runner_up", texts(lambda _, v: v.runner_up if v else "", "next method")
    yield f"{name}_level", texts(lambda _, v: " ".join(v.level) if v else "", "level methods")
    yield f"{name}_verdict", texts(lambda at, v: verdict_sentence(v, budgets[at[1]]), "verdict")
    yield f"{name}_note", texts(lambda at, v: _verdict_note(record, statistic, at, v), "remark")
    leads = [
        (v.lead.factor, v.lead.lower, v.lead.upper) if v else (np.nan,) * len(BOUNDS)
        for v in verdicts.values()
    ]
    attributes: dict[str, Any] = {
        "units": DIMENSIONLESS,
        "long_name": f"error of the next method over the least: {what}",
        **_INTERVAL_ATTRIBUTES,
        INTERVAL: f"Welch's t on the logarithm, {JACKKNIFE.partition(', ')[2]}",
    }
    values = np.array(leads).reshape(*shape, len(BOUNDS))
    yield f"{name}_lead", _array(statistic, values, (VARIANT, BUDGET), attributes, BOUND)


def _verdict_note(
    record: EstimateRecord,
    statistic: BenchmarkStatistic,
    at: tuple[int, ...],
    verdict: Verdict | None,
) -> str:
    """What the reference's own error means for a verdict that does not say so itself."""
    if verdict is None or verdict.doubt:
        return ""
    variant, budget, entry = at
    inside = [i for i, m in enumerate(record.methods) if _VARIANTS[variant] in m.variants]
    errors = record.accuracy(statistic).bounds[inside, budget, entry, 0]
    return reference_remark(float(np.nanmin(errors)), record.reference_error(statistic, entry))


def _array(
    statistic: BenchmarkStatistic,
    values: npt.NDArray[Any],
    dimensions: tuple[str, ...],
    attributes: Mapping[str, Any],
    last: str = "",
) -> xr.DataArray:
    """Values along dimensions, the statistic's own and a last one; a single entry has no own."""
    after = (last,) if last else ()
    if statistic.dimension:
        return xr.DataArray(
            values, dims=(*dimensions, statistic.dimension, *after), attrs=attributes
        )
    single = np.take(values, 0, axis=len(dimensions))
    return xr.DataArray(single, dims=(*dimensions, *after), attrs=attributes)


def _texts(texts: Any) -> Texts:
    return np.array(list(texts), dtype=object)
