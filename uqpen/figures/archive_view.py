"""The part of an archive that a figure is asked of, and its names and units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.archive.read import group_names, model_trees, read_group
from uqpen.core.errors import UnknownNameError
from uqpen.core.labels import (
    MOMENTS,
    ROLE,
    RUNS,
    SAMPLING,
    SENSITIVITY,
    SHARES,
    STATUS,
    SURROGATES,
    Sampling,
    Status,
)
from uqpen.core.lookup import choices
from uqpen.core.units import DIMENSIONLESS, Scale, scale
from uqpen.figures.style import SourceStyle, source_style
from uqpen.figures.texts import title_with_unit
from uqpen.results.table import output_names
from uqpen.statistics.sample import input_sample

__all__ = ["ArchiveView", "select_view"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class ArchiveView:
    """What is drawn of an archive.

    Parameters
    ----------
    archive : DataTree
        The whole.
    model : str
        Which of several models; empty of a single one.
    output, source : str or None
        The only ones that are asked for; None for what suits the figure.
    """

    archive: xr.DataTree
    model: str
    output: str | None = None
    source: str | None = None

    @property
    def tree(self) -> xr.DataTree:
        """What is told of the model."""
        return model_trees(self.archive)[self.model]

    @property
    def model_views(self) -> list[ArchiveView]:
        """The same of each of the models."""
        return [replace(self, model=name) for name in model_trees(self.archive)]

    @property
    def designs(self) -> list[str]:
        """Those that runs were made of."""
        return group_names(self.tree, RUNS)

    @property
    def sources(self) -> list[str]:
        """Designs, then surrogates, then publications."""
        kinds = (RUNS, SURROGATES, MOMENTS, SENSITIVITY, SHARES)
        return list(dict.fromkeys(name for kind in kinds for name in group_names(self.tree, kind)))

    @property
    def sample_designs(self) -> list[str]:
        """The designs whose runs are a sample of the input law, the one asked for alone if any."""
        return [
            name
            for name in self.designs
            if self.source in (None, name) and self.sampling(name).is_sample
        ]

    def look(self, source: str) -> SourceStyle:
        """How what a source tells is drawn, in every figure of the archive."""
        return source_style(self.sources.index(source))

    def source_groups(self, kind: str) -> Iterator[tuple[str, xr.Dataset]]:
        """What each source tells in a group, of the one asked for alone if any."""
        for source in self.sources:
            if self.source in (None, source) and source in group_names(self.tree, kind):
                yield source, read_group(self.tree, kind, source)

    @property
    def numeric_outputs(self) -> list[str]:
        """The outputs that are numbers, the one asked for alone if any."""
        return [name for name in self._outputs if "flag_meanings" not in self.attributes(name)]

    @property
    def categorical_outputs(self) -> list[str]:
        """The outputs that have kinds, likewise."""
        return [name for name in self._outputs if "flag_meanings" in self.attributes(name)]

    @property
    def _outputs(self) -> list[str]:
        every = output_names(read_group(self.tree, RUNS, self.designs[0]))
        return [name for name in every if self.output in (None, name)]

    def attributes(self, name: str) -> dict[Any, Any]:
        """The attributes of an input or output."""
        return dict(read_group(self.tree, RUNS, self.designs[0])[name].attrs)

    def unit(self, name: str) -> str:
        """The unit that an input or output is shown in."""
        return str(self.attributes(name).get("display_units", DIMENSIONLESS))

    def scale(self, name: str) -> Scale:
        """From the unit that it is shown in to its SI unit."""
        return scale(self.unit(name))

    def axis_label(self, name: str) -> str:
        """What an axis of an input or output says."""
        return title_with_unit(str(self.attributes(name).get("long_name", name)), self.unit(name))

    def title(self, text: str) -> str:
        """A panel's title, with the model where there are several."""
        return f"{self.model}: {text}" if self.model else text

    def runs(self, design: str) -> xr.Dataset:
        """The runs of a design that are a sample of the input law, lost ones among them."""
        return input_sample(read_group(self.tree, RUNS, design))

    def has_completed_runs(self, design: str) -> bool:
        """Whether any of those did."""
        return bool((self.runs(design)[STATUS].values == Status.OK).any())

    def random_inputs(self, design: str) -> list[str]:
        """The inputs that are not the same in all runs."""
        runs = read_group(self.tree, RUNS, design)
        named = [str(name) for name, v in runs.data_vars.items() if v.attrs.get(ROLE) == "input"]
        return [name for name in named if runs[name].dims]

    def is_sample_design(self, source: str) -> bool:
        """Whether a source is a design that was made for no question in particular."""
        if source not in self.designs:
            return False
        sampling = self.sampling(source)
        return sampling.is_sample and sampling is not Sampling.PICK_FREEZE

    def sampling(self, design: str) -> Sampling:
        """How the points of a design were chosen."""
        return Sampling(read_group(self.tree, RUNS, design).attrs[SAMPLING])


def select_view(
    tree: xr.DataTree, output: str | None, source: str | None, model: str | None
) -> ArchiveView:
    """What is asked for of an archive.

    Raises
    ------
    UnknownNameError
        If the archive has no such output, source or model; the message lists those it has.
    """
    models = model_trees(tree)
    _check_name("model", model, [name for name in models if name])
    view = ArchiveView(tree, model or next(iter(models)))
    _check_name("output", output, output_names(read_group(view.tree, RUNS, view.designs[0])))
    _check_name("source", source, view.sources)
    return replace(view, output=output, source=source)


def _check_name(what: str, name: str | None, known: Iterable[str]) -> None:
    names = list(known)
    if name is not None and name not in names:
        raise UnknownNameError(f'the archive has no {what} "{name}"; {choices(name, names)}')
