"""The part of an archive that a figure shows, and its names and units."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.core.arrays import FloatArray, rows_by_weight
from uqpen.core.errors import UnknownNameError
from uqpen.core.labels import ABSENT, ROLE, RUN, RUNS, SAMPLING, STATUS, WEIGHT
from uqpen.core.limits import RUNS_IN_MEMORY
from uqpen.core.lookup import choices
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.core.units import DIMENSIONLESS, Scale, scale
from uqpen.execution import status_counts
from uqpen.execution.omitted_runs import are_omitted
from uqpen.results.best_sources import is_sample_design
from uqpen.results.digits import grouped_number
from uqpen.results.source_slots import source_slots
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.source_style import SourceStyle, source_style
from uqpen.results.table import Conversion, conversion, field_names, first_runs, output_names
from uqpen.results.texts import title_with_unit
from uqpen.statistics.convergence import reason_without_parts
from uqpen.statistics.sample import input_sample

__all__ = ["ArchiveView", "select_view"]


@dataclass(frozen=True)
class ArchiveView:
    """The part of an archive that is drawn.

    Parameters
    ----------
    archive : DataTree
        The whole.
    model : str
        Which of several models; empty of a single one.
    output, source : str or None
        The selected ones; None for those that suit the figure.
    """

    archive: xr.DataTree
    model: str
    output: str | None = None
    source: str | None = None

    @cached_property
    def tree(self) -> xr.DataTree:
        """The groups of the model."""
        return model_trees(self.archive)[self.model]

    @property
    def model_views(self) -> list[ArchiveView]:
        """One view of each model, with the same output and source."""
        return [replace(self, model=name) for name in model_trees(self.archive)]

    @property
    def designs(self) -> list[str]:
        """The designs of the runs."""
        return group_names(self.tree, RUNS)

    @cached_property
    def statistics(self) -> SourceStatistics:
        """The statistics of the model, each taken out of its group once."""
        return SourceStatistics(self.tree)

    @property
    def sources(self) -> list[str]:
        """Designs, then surrogates, then publications."""
        return self.statistics.sources

    @property
    def sample_designs(self) -> list[str]:
        """The designs that sample the input distribution; only the selected one, if any."""
        return [
            name
            for name in self.designs
            if self.source in (None, name) and self.sampling(name).is_sample
        ]

    @cached_property
    def _slots(self) -> dict[str, int]:
        return source_slots(str(self.archive.attrs.get("study_text", "")), self.sources)

    def series(self, source: str) -> int:
        """Return the place of a source among colours and markers, by its kind."""
        return self._slots[source]

    def look(self, source: str) -> SourceStyle:
        """Return the style of a source, in every figure of its study."""
        return source_style(self.series(source))

    def estimates(self, output: str, statistic: str) -> dict[str, xr.DataArray]:
        """Return a statistic by source; only that of the selected one, if any."""
        sources = None if self.source is None else [self.source]
        return self.statistics.by_source(output, statistic, sources)

    def conversion(self, output: str, statistic: str) -> Conversion:
        """Return the conversion of a statistic from SI to the unit that is shown."""
        return conversion(statistic, self.scale(output))

    @cached_property
    def _first_runs(self) -> xr.Dataset:
        return first_runs(self.tree)

    @cached_property
    def outputs(self) -> list[str]:
        """The outputs of the model."""
        return output_names(self._first_runs)

    @cached_property
    def numeric_outputs(self) -> list[str]:
        """The outputs that are numbers; only the selected one, if any.

        A derived one is not among them if no run of some design has a value of it.
        """
        return [
            name
            for name in self._selected
            if "flag_meanings" not in self.attributes(name)
            and name not in self.fields
            and not self._lacks_values(name)
        ]

    @cached_property
    def categorical_outputs(self) -> list[str]:
        """The categorical outputs; only the selected one, if any."""
        return [name for name in self._selected if "flag_meanings" in self.attributes(name)]

    def _lacks_values(self, name: str) -> bool:
        """Check for a design that has completed runs, but none with a value of an output."""
        if ABSENT not in self.attributes(name):
            return False
        completed = [design for design in self.designs if self.has_shown_runs(design)]
        return any(not self.completed_values(design, name).size for design in completed)

    @cached_property
    def fields(self) -> list[str]:
        """The outputs with dimensions; only the selected one, if any."""
        known = field_names(self._first_runs)
        return [name for name in known if self.output in (None, name)]

    @property
    def _selected(self) -> list[str]:
        return [name for name in self.outputs if self.output in (None, name)]

    def attributes(self, name: str) -> dict[Any, Any]:
        """Return the attributes of an input or output."""
        return dict(self._first_runs.variables[name].attrs)

    def unit(self, name: str) -> str:
        """The unit that an input or output is shown in."""
        return str(self.attributes(name).get("display_units", DIMENSIONLESS))

    def scale(self, name: str) -> Scale:
        """From the unit that it is shown in to its SI unit."""
        return scale(self.unit(name))

    def axis_label(self, name: str) -> str:
        """The label of an axis of an input or output."""
        return title_with_unit(str(self.attributes(name).get("long_name", name)), self.unit(name))

    def title(self, text: str) -> str:
        """A panel's title, with the model where there are several."""
        return f"{self.model}: {text}" if self.model else text

    def runs(self, design: str) -> xr.Dataset:
        """Return the runs of a design that sample the input distribution, failed ones too."""
        return input_sample(read_group(self.tree, RUNS, design))

    def shown_runs(self, design: str) -> xr.Dataset:
        """Return the runs that figures show: those of `runs`, in memory, the first of very many."""
        if design not in self._shown_runs:
            self._shown_runs[design] = self.runs(design).isel({RUN: slice(RUNS_IN_MEMORY)}).load()
        return self._shown_runs[design]

    @cached_property
    def _shown_runs(self) -> dict[str, xr.Dataset]:
        return {}  # each has a column for every output, and is asked for by every output

    def part(self, design: str) -> str:
        """Return what figures say before the name of a design if they show only a part of it."""
        if self.runs(design).sizes[RUN] <= RUNS_IN_MEMORY:
            return ""
        return f"the first {grouped_number(RUNS_IN_MEMORY)} runs of "

    def has_completed_runs(self, design: str) -> bool:
        """Return whether a run of a design completed."""
        return bool(status_counts(self.runs(design))[Status.OK])

    def keeps_runs(self, design: str) -> bool:
        """Return whether the archive has the runs of a design, and not only their statistics."""
        return not are_omitted(read_group(self.tree, RUNS, design))

    def shows_all_runs(self, design: str) -> bool:
        """Return whether the runs that figures show are all of a design."""
        return self.keeps_runs(design) and self.runs(design).sizes[RUN] <= RUNS_IN_MEMORY

    def has_shown_runs(self, design: str) -> bool:
        """Return whether there are completed runs of a design to draw."""
        return self.keeps_runs(design) and self.has_completed_runs(design)

    def completed_values(self, design: str, output: str) -> FloatArray:
        """Return an output of the completed ones of the shown runs of a design, in SI units.

        Runs without a value of a derived output are left out. Of weighted runs, as many values as
        there are runs, each as often as its weight says.
        """
        runs = self.shown_runs(design)
        is_ok = runs[STATUS].values == Status.OK
        # A field has a value where some of its places do.
        values = runs[output].values
        is_ok &= ~np.isnan(values).all(axis=tuple(range(1, values.ndim)))
        values = np.asarray(values[is_ok], dtype=np.float64)
        if WEIGHT not in runs.coords or not values.size:
            return values
        weights = np.asarray(runs[WEIGHT].values[is_ok], dtype=np.float64)
        return values[rows_by_weight(weights, (np.arange(len(values)) + 0.5) / len(values))]

    def shown_values(self, design: str, output: str) -> FloatArray:
        """Return the values that a chart of an output shows, in SI units.

        They are those of the completed runs. Of a design with more runs than figures show, or with
        statistics alone, they are the quantiles at the equally spaced ranks of its distribution
        function: the first runs have not the band of all.
        """
        if self.shows_all_runs(design):
            return self.completed_values(design, output)
        values = self.statistics.get(design, output, "cdf_value")
        return np.empty(0) if values is None else np.asarray(values.values, dtype=np.float64)

    @cached_property
    def input_titles(self) -> dict[str, str]:
        """The titles of the inputs of the model, by their names."""
        return {
            str(name): str(variable.attrs.get("long_name", name))
            for name, variable in self._first_runs.variables.items()
            if variable.attrs.get(ROLE) == "input"
        }

    def reason_without_convergence(self, design: str) -> str:
        """Return why no part of a design's runs is a smaller sample; empty where some are."""
        return reason_without_parts(read_group(self.tree, RUNS, design))

    def random_inputs(self, design: str) -> list[str]:
        """The inputs that are not the same in all runs."""
        variables = read_group(self.tree, RUNS, design).variables
        named = [str(name) for name, v in variables.items() if v.attrs.get(ROLE) == "input"]
        return [name for name in named if variables[name].dims]

    def is_sample_design(self, source: str) -> bool:
        """Return whether a source is a design for no quantity of interest in particular."""
        return is_sample_design(self.tree, source)

    def sampling(self, design: str) -> Sampling:
        """Return the way in which the points of a design were chosen."""
        return Sampling(read_group(self.tree, RUNS, design).attrs[SAMPLING])


def select_view(
    tree: xr.DataTree, output: str | None, source: str | None, model: str | None
) -> ArchiveView:
    """Return a part of an archive; an `UnknownNameError` lists the names that it has."""
    models = model_trees(tree)
    _check_name("model", model, [name for name in models if name])
    view = ArchiveView(tree, model or next(iter(models)))
    _check_name("output", output, view.outputs)
    _check_name("source", source, view.sources)
    return replace(view, output=output, source=source)


def _check_name(what: str, name: str | None, known: Iterable[str]) -> None:
    names = list(known)
    if name is not None and name not in names:
        raise UnknownNameError(f'the archive has no {what} "{name}"; {choices(name, names)}')
