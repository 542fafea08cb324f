"""The part of an archive that a figure shows, and its names and units."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, model_trees
from uqpen.core.arrays import FloatArray
from uqpen.core.errors import UnknownNameError
from uqpen.core.labels import ABSENT, ROLE, RUNS
from uqpen.core.lookup import choices
from uqpen.core.units import DIMENSIONLESS, Scale, scale
from uqpen.results.best_sources import is_sample_design
from uqpen.results.design_view import DesignView
from uqpen.results.logarithmic_scale import is_logarithmic, linear_scale_note
from uqpen.results.source_slots import source_slots
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.source_style import SourceStyle, source_style
from uqpen.results.table import Conversion, conversion, field_names, first_runs, output_names
from uqpen.results.texts import title_with_name, title_with_unit

__all__ = ["ArchiveView", "output_heading", "output_title", "select_view"]


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
            if self.source in (None, name) and self.design(name).sampling.is_sample
        ]

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
        completed = [design for design in self.designs if self.design(design).has_shown_runs]
        return any(not self.design(design).completed_values(name).size for design in completed)

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
        """Return the unit that an input or output is shown in."""
        return str(self.attributes(name).get("display_units", DIMENSIONLESS))

    def scale(self, name: str) -> Scale:
        """Return the conversion between the shown unit of an input or output and its SI unit."""
        return scale(self.unit(name))

    def is_logarithmic(self, output: str) -> bool:
        """Check if an output is shown by its logarithm: asked for, and every run has one."""
        return is_logarithmic(self.statistics, output)

    def linear_scale_note(self, output: str) -> str:
        """Return why an output is not shown by its logarithm, as its study asks; else empty."""
        return linear_scale_note(self.statistics, output, self.scale(output), self.unit(output))

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
            for name, variable in self._first_runs.variables.items()
            if variable.attrs.get(ROLE) == "input"
        }

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
