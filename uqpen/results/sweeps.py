"""Statistics at several values of an input: a study whose models are the values of a sweep."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, model_trees
from uqpen.core.arrays import FloatArray
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import DIFFERENCES, SWEEP
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.core.variables import code_labels
from uqpen.results.digits import number_text
from uqpen.results.source_statistics import SourceStatistics, labelled_entries
from uqpen.results.table import (
    NOTHING,
    Conversion,
    OutputTable,
    conversion,
    label_with_unit,
)

# Statistics that are shown over the values.
_SHOWN = tuple(CATALOGUE[name] for name in ("mean", "exceedance", "below", "quantile"))
# Distinct digits of values that a table of them has.
_DIGITS = 6


class SweptStatistic(NamedTuple):
    """A statistic at each value of a sweep, and its differences from that at the first."""

    label: str  # such as ``P(> 60 cm)``
    unit: str  # that it is shown in; of no unit for a probability
    estimates: Mapping[str, xr.DataArray]  # by model; along ``bound``
    differences: Mapping[str, xr.DataArray]  # of all but the first model
    convert: Conversion  # of an estimate from SI, and of a difference
    convert_difference: Conversion


@dataclass(frozen=True)
class Sweep:
    """Inputs with several values, and the model of each combination of them."""

    inputs: tuple[str, ...]
    models: Mapping[str, SourceStatistics]  # by name
    differences: Mapping[str, SourceStatistics]  # of all but the first

    @classmethod
    def of_archive(cls, tree: xr.DataTree) -> Sweep | None:
        """Return the sweep of a study; None of one without."""
        swept = [name for name in str(tree.attrs.get(SWEEP, "")).split(", ") if name]
        models = {name: SourceStatistics(each) for name, each in model_trees(tree).items()}
        if not swept or not all(name in each.runs for each in models.values() for name in swept):
            return None
        others = group_names(tree, DIFFERENCES)
        differences = {each: SourceStatistics.of_differences(tree, each) for each in others}
        return cls(tuple(swept), models, differences)

    @property
    def first(self) -> SourceStatistics:
        """The statistics at the first value, which the others are compared with."""
        return next(iter(self.models.values()))

    def values(self, name: str) -> FloatArray:
        """Return the value of an input in each model, in the unit that it is shown in."""
        own = [float(np.ravel(each.runs[name].values)[0]) for each in self.models.values()]
        return np.asarray(scale(self.first.unit(name)).from_si(np.array(own)), dtype=np.float64)

    def texts(self, name: str) -> list[str]:
        """Return the value of an input in each model, without its unit; a label as it is."""
        if labels := code_labels(self.first.runs[name].attrs):
            return [labels[int(value)] for value in self.values(name)]
        return [number_text(value, _DIGITS) for value in self.values(name).tolist()]

    def swept_statistics(self, output: str, design: str) -> Iterator[SweptStatistic]:
        """Yield the statistics of an output by a design, at all values."""
        unit = self.first.unit(output)
        for statistic in _SHOWN:
            is_probability = statistic.name in ("exceedance", "below")
            rules = (
                conversion(statistic, scale(unit), is_difference=each) for each in (False, True)
            )
            converts = tuple(rules)
            name = statistic.name
            own = {key: each.get(design, output, name) for key, each in self.models.items()}
            paired = {
                key: each.change(design, output, name) for key, each in self.differences.items()
            }
            found, differing = (
                dict(labelled_entries(statistic, {k: v for k, v in each.items() if v is not None}))
                for each in (own, paired)
            )
            for label, estimates in found.items():
                own_unit = DIMENSIONLESS if is_probability else unit
                others = differing.get(label, {})
                yield SweptStatistic(label, own_unit, estimates, others, *converts)


def sweep_tables(tree: xr.DataTree) -> Iterator[OutputTable]:
    """Yield a table of each statistic over the values of a sweep, with paired differences."""
    sweep = Sweep.of_archive(tree)
    if sweep is None:
        return
    heads = [label_with_unit(name, sweep.first.unit(name)) for name in sweep.inputs]
    labels = [", ".join(each) for each in zip(*map(sweep.texts, sweep.inputs), strict=True)]
    for output in sweep.first.scalar_outputs:
        for design in sweep.first.sources:
            for statistic in sweep.swept_statistics(output, design):
                title = label_with_unit(f"{output}, {statistic.label}", statistic.unit)
                table = OutputTable(f"{title} over {', '.join(heads)}, {design}", ["at this value"])
                if statistic.differences:
                    table.columns.append(f"minus that at {labels[0]}")
                for label, model in zip(labels, sweep.models, strict=True):
                    cells = [table.cell(statistic.estimates.get(model), statistic.convert)]
                    if statistic.differences:
                        own = statistic.differences.get(model)
                        cells.append(table.cell(own, statistic.convert_difference))
                    table.rows.append((label, cells))
                if any(cells[0] != NOTHING for _, cells in table.rows):
                    yield table
