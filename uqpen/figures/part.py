"""The part of an archive that a figure is asked of, and its names and units."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from uqpen.analyses.sample import sample_of_law
from uqpen.archive.read import group, models_in, names_in
from uqpen.errors import UnknownNameError
from uqpen.figures.style import Look, look
from uqpen.figures.texts import with_unit
from uqpen.labels import (
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
from uqpen.lookup import choices
from uqpen.summary.table import output_names
from uqpen.units import DIMENSIONLESS, Scale, scale

__all__ = ["Part", "part_of"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Part:
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
        return models_in(self.archive)[self.model]

    @property
    def others(self) -> list[Part]:
        """The same of each of the models."""
        return [replace(self, model=name) for name in models_in(self.archive)]

    @property
    def designs(self) -> list[str]:
        """Those that runs were made of."""
        return names_in(self.tree, RUNS)

    @property
    def sources(self) -> list[str]:
        """Designs, then surrogates, then publications."""
        kinds = (RUNS, SURROGATES, MOMENTS, SENSITIVITY, SHARES)
        return list(dict.fromkeys(name for kind in kinds for name in names_in(self.tree, kind)))

    @property
    def samples(self) -> list[str]:
        """The designs whose runs are a sample of the input law, the one asked for alone if any."""
        return [
            name
            for name in self.designs
            if self.source in (None, name) and self.sampling(name).is_sample
        ]

    def look(self, source: str) -> Look:
        """How what a source tells is drawn, in every figure of the archive."""
        return look(self.sources.index(source))

    def told(self, kind: str) -> Iterator[tuple[str, xr.Dataset]]:
        """What each source tells in a group, of the one asked for alone if any."""
        for source in self.sources:
            if self.source in (None, source) and source in names_in(self.tree, kind):
                yield source, group(self.tree, kind, source)

    @property
    def numbers(self) -> list[str]:
        """The outputs that are numbers, the one asked for alone if any."""
        return [name for name in self._outputs if "flag_meanings" not in self.described(name)]

    @property
    def kinds(self) -> list[str]:
        """The outputs that have kinds, likewise."""
        return [name for name in self._outputs if "flag_meanings" in self.described(name)]

    @property
    def _outputs(self) -> list[str]:
        every = output_names(group(self.tree, RUNS, self.designs[0]))
        return [name for name in every if self.output in (None, name)]

    def described(self, name: str) -> dict[Any, Any]:
        """The attributes of an input or output."""
        return dict(group(self.tree, RUNS, self.designs[0])[name].attrs)

    def unit(self, name: str) -> str:
        """The unit that an input or output is shown in."""
        return str(self.described(name).get("display_units", DIMENSIONLESS))

    def measure(self, name: str) -> Scale:
        """From the unit that it is shown in to its SI unit."""
        return scale(self.unit(name))

    def axis(self, name: str) -> str:
        """What an axis of an input or output says."""
        return with_unit(str(self.described(name).get("long_name", name)), self.unit(name))

    def titled(self, text: str) -> str:
        """A panel's title, with the model where there are several."""
        return f"{self.model}: {text}" if self.model else text

    def runs(self, design: str) -> xr.Dataset:
        """The runs of a design that are a sample of the input law, lost ones among them."""
        return sample_of_law(group(self.tree, RUNS, design))

    def came_back(self, design: str) -> bool:
        """Whether any of those did."""
        return bool((self.runs(design)[STATUS].values == Status.OK).any())

    def random_inputs(self, design: str) -> list[str]:
        """The inputs that are not the same in all runs."""
        runs = group(self.tree, RUNS, design)
        named = [str(name) for name, v in runs.data_vars.items() if v.attrs.get(ROLE) == "input"]
        return [name for name in named if runs[name].dims]

    def is_plain(self, source: str) -> bool:
        """Whether a source is a design that was made for no question in particular."""
        if source not in self.designs:
            return False
        sampling = self.sampling(source)
        return sampling.is_sample and sampling is not Sampling.PICK_FREEZE

    def sampling(self, design: str) -> Sampling:
        """How the points of a design were chosen."""
        return Sampling(group(self.tree, RUNS, design).attrs[SAMPLING])


def part_of(tree: xr.DataTree, output: str | None, source: str | None, model: str | None) -> Part:
    """What is asked for of an archive.

    Raises
    ------
    UnknownNameError
        If the archive has no such output, source or model; the message lists those it has.
    """
    models = models_in(tree)
    _held("model", model, [name for name in models if name])
    part = Part(tree, model or next(iter(models)))
    _held("output", output, output_names(group(part.tree, RUNS, part.designs[0])))
    _held("source", source, part.sources)
    return replace(part, output=output, source=source)


def _held(what: str, name: str | None, known: Iterable[str]) -> None:
    names = list(known)
    if name is not None and name not in names:
        raise UnknownNameError(f'the archive has no {what} "{name}"; {choices(name, names)}')
