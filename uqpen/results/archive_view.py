"""An archive as figures and the report see it: names, units, styles, and the runs of designs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
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
from uqpen.core.statistic import Statistic
from uqpen.core.status import Status
from uqpen.core.units import Scale, scale
from uqpen.core.variables import code_labels
from uqpen.execution import status_counts
from uqpen.execution.omitted_runs import are_omitted
from uqpen.results.digits import grouped_number, number_text, percent_text
from uqpen.results.source_statistics import SourceStatistics, is_sample_design
from uqpen.results.source_style import SourceStyle, source_slots, source_style
from uqpen.results.table import Conversion, conversion
from uqpen.results.texts import title_with_name, title_with_unit, unit_suffix
from uqpen.statistics.convergence import reason_without_parts
from uqpen.statistics.run_samples import input_sample


@dataclass(frozen=True)
class DesignView:
    """The runs of one design."""

    tree: xr.DataTree  # the groups of the model
    design: str  # the name of the design

    @property
    def _archived(self) -> xr.Dataset:
        return read_group(self.tree, RUNS, self.design)

    @property
    def sampling(self) -> Sampling:
        """The way in which the points were chosen."""
        return Sampling(self._archived.attrs[SAMPLING])

    @property
    def runs(self) -> xr.Dataset:
        """The runs that sample the input distribution, failed ones too."""
        return input_sample(self._archived)

    @cached_property
    def shown_runs(self) -> xr.Dataset:
        """The runs that figures show: those of `runs`, in memory, the first of very many."""
        return self.runs.isel({RUN: slice(RUNS_IN_MEMORY)}).load()

    @property
    def shown_prefix(self) -> str:
        """Words before the design's name in figures that show only some of its runs."""
        if self.runs.sizes[RUN] <= RUNS_IN_MEMORY:
            return ""
        return f"the first {grouped_number(RUNS_IN_MEMORY)} runs of "

    @property
    def has_completed_runs(self) -> bool:
        """True if a run completed."""
        return bool(status_counts(self.runs)[Status.OK])

    @property
    def keeps_runs(self) -> bool:
        """True if the archive has the runs, and not only their statistics."""
        return not are_omitted(self._archived)

    @property
    def shows_all_runs(self) -> bool:
        """True if the runs that figures show are all of the design."""
        return self.keeps_runs and self.runs.sizes[RUN] <= RUNS_IN_MEMORY

    @property
    def has_shown_runs(self) -> bool:
        """True if there are completed runs to draw."""
        return self.keeps_runs and self.has_completed_runs

    @property
    def random_inputs(self) -> list[str]:
        """The inputs that are not the same in all runs."""
        variables = self._archived.variables
        named = [str(name) for name, v in variables.items() if v.attrs.get(ROLE) == "input"]
        return [name for name in named if variables[name].dims]

    @property
    def reason_without_convergence(self) -> str:
        """Reason why no part of the runs is a smaller sample; empty where some are."""
        return reason_without_parts(self._archived)

    def completed_values(self, output: str) -> FloatArray:
        """Return an output of the completed ones of the shown runs, in SI units.

        Runs without a value of a derived output are left out. Of weighted runs, as many values as
        there are runs, each as often as its weight says.
        """
        runs = self.shown_runs
        is_ok = runs[STATUS].values == Status.OK
        # A field has a value where some of its places do.
        values = runs[output].values
        is_ok &= ~np.isnan(values).all(axis=tuple(range(1, values.ndim)))
        values = np.asarray(values[is_ok], dtype=np.float64)
        if WEIGHT not in runs.coords or not values.size:
            return values
        weights = np.asarray(runs[WEIGHT].values[is_ok], dtype=np.float64)
        return values[rows_by_weight(weights, (np.arange(len(values)) + 0.5) / len(values))]


def is_logarithmic(statistics: SourceStatistics, output: str) -> bool:
    """Check if an output is shown by its logarithm: asked for, and every run has one."""
    if not statistics.wants_logarithm(output):
        return False
    return all(values.min() > 0 for _, values in _completed_values(statistics, output))


def linear_scale_note(statistics: SourceStatistics, output: str) -> str:
    """Return why an output is not shown by its logarithm, as its study asks; else empty."""
    if not statistics.wants_logarithm(output):
        return ""
    unit, parts = statistics.unit(output), []
    for view, values in _completed_values(statistics, output):
        if values.min() <= 0:
            values = view.completed_values(output) if view.shows_all_runs else values
            share = percent_text(float(f"{np.mean(values <= 0):.2g}"))
            smallest = number_text(float(scale(unit).from_si(values.min()))) + unit_suffix(unit)
            runs = f"the completed runs of {view.design}"
            parts.append(f"{share} of {runs} (the smallest is {smallest})")
    if not parts:
        return ""
    return (
        'the scale is linear, though the study asks for scale = "log": values at or below 0 have '
        f"no logarithm, and these are {' and '.join(parts)}"
    )


def _completed_values(
    statistics: SourceStatistics, output: str
) -> Iterator[tuple[DesignView, FloatArray]]:
    """Yield the designs with values of an output, which are runs or equally spaced ranks of them.

    The first rank is the smallest run.
    """
    for design in statistics.sources:
        if statistics.kind(design) != "design":
            continue
        ranks = statistics.get(design, output, "cdf_value")
        view = DesignView(statistics.tree, design)
        if ranks is None and view.keeps_runs:
            values = view.completed_values(output)
        else:
            values = np.empty(0) if ranks is None else np.asarray(ranks.values)
        known = values[np.isfinite(values)]
        if known.size:
            yield view, known


@dataclass(frozen=True)
class ArchiveView:
    """The part of an archive that is drawn."""

    archive: xr.DataTree  # the whole
    model: str  # which of several models; empty of a single one
    output: str | None = None  # the selected one; None for those that suit the figure
    source: str | None = None  # the selected one; None for those that suit the figure

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
            if self.source in (None, name) and self.design(name).sampling.is_sample
        ]

    @property
    def leading_design(self) -> str | None:
        """The design of the main results; None where no run of a sample completed.

        It is the first design of the study whose runs are a sample. So its place decides, not its
        results. A design that is made for another purpose is chosen only where there is no other.
        """
        found = [name for name in self.sample_designs if self.design(name).has_completed_runs]
        plain = [name for name in found if self.is_sample_design(name)]
        return next(iter((*plain, *found)), None)

    @cached_property
    def _slots(self) -> dict[str, int]:
        return source_slots(str(self.archive.attrs.get("study_text", "")), self.sources)

    def series(self, source: str) -> int:
        """Return the number of the colour and marker of a source, by its kind."""
        return self._slots[source]

    def look(self, source: str) -> SourceStyle:
        """Return the style of a source, in every figure of its study."""
        return source_style(self.series(source))

    def estimates(self, output: str, statistic: str) -> dict[str, xr.DataArray]:
        """Return a statistic by source; only that of the selected one, if any."""
        sources = None if self.source is None else [self.source]
        return self.statistics.by_source(output, statistic, sources)

    def conversion(self, output: str, statistic: Statistic) -> Conversion:
        """Return the conversion of a statistic from SI to the unit that is shown."""
        return conversion(statistic, self.scale(output))

    @cached_property
    def outputs(self) -> list[str]:
        """The outputs of the model."""
        return self.statistics.outputs

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
        completed = [design for design in self.designs if self.design(design).has_shown_runs]
        return any(not self.design(design).completed_values(name).size for design in completed)

    @cached_property
    def fields(self) -> list[str]:
        """The outputs with dimensions; only the selected one, if any."""
        return [name for name in self.statistics.fields if self.output in (None, name)]

    @property
    def _selected(self) -> list[str]:
        return [name for name in self.outputs if self.output in (None, name)]

    def attributes(self, name: str) -> dict[Any, Any]:
        """Return the attributes of an input or output."""
        return self.statistics.attributes(name)

    def unit(self, name: str) -> str:
        """Return the unit that an input or output is shown in."""
        return self.statistics.unit(name)

    def scale(self, name: str) -> Scale:
        """Return the conversion between the shown unit of an input or output and its SI unit."""
        return scale(self.unit(name))

    def is_logarithmic(self, output: str) -> bool:
        """Check if an output is shown by its logarithm: asked for, and every run has one."""
        return is_logarithmic(self.statistics, output)

    def linear_scale_note(self, output: str) -> str:
        """Return why an output is not shown by its logarithm, as its study asks; else empty."""
        return linear_scale_note(self.statistics, output)

    def axis_label(self, name: str) -> str:
        """Return the label of an axis of an input or output."""
        return title_with_unit(str(self.attributes(name).get("long_name", name)), self.unit(name))

    def title(self, text: str) -> str:
        """Return a panel's title, with the model where there are several."""
        return f"{self.model}: {text}" if self.model else text

    def design(self, name: str) -> DesignView:
        """Return the view of a design, whose runs are taken out of the archive once."""
        if name not in self._designs:
            self._designs[name] = DesignView(self.tree, name)
        return self._designs[name]

    @cached_property
    def _designs(self) -> dict[str, DesignView]:
        return {}

    def shown_values(self, design: str, output: str) -> FloatArray:
        """Return the values that a chart of an output shows, in SI units.

        They are those of the completed runs. Of a design with more runs than figures show, or with
        statistics alone, they are the quantiles at the equally spaced ranks of its distribution
        function: the first runs have not the band of all.
        """
        if self.design(design).shows_all_runs:
            return self.design(design).completed_values(output)
        values = self.statistics.get(design, output, "cdf_value")
        return np.empty(0) if values is None else np.asarray(values.values, dtype=np.float64)

    @cached_property
    def input_titles(self) -> dict[str, str]:
        """The titles of the inputs of the model, by their names."""
        return {
            str(name): str(variable.attrs.get("long_name", name))
            for name, variable in self.statistics.runs.variables.items()
            if variable.attrs.get(ROLE) == "input"
        }

    def code_labels(self, name: str) -> tuple[str, ...]:
        """The texts that the values of an input stand for; empty of numbers."""
        found = self.statistics.runs.variables.get(name)
        return () if found is None else code_labels(found.attrs)

    def is_sample_design(self, source: str) -> bool:
        """Return whether a source is a design for no quantity of interest in particular."""
        return is_sample_design(self.tree, source)


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


def output_title(view: ArchiveView, output: str) -> str:
    """Return the title of an output, for a reader."""
    return str(view.attributes(output).get("long_name", output))


def output_heading(view: ArchiveView, output: str) -> str:
    """Return the name of an output in a heading."""
    return title_with_name(output_title(view, output), output)
