"""A source of statistics: a design or a surrogate, with its estimates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import xarray as xr

from uqpen.archive.estimates import pack
from uqpen.statistics.analyze import OutputStatistics

__all__ = ["Groups", "Source"]

Groups = Iterator[tuple[str, xr.Dataset]]


class Source(NamedTuple):
    """A design or a surrogate: attributes of its group, and its estimate arrays by output."""

    attributes: dict[str, str | int | float]
    outputs: Mapping[str, OutputStatistics]

    def groups(self, path: str, shown: Mapping[str, Mapping[str, str]]) -> Groups:
        """Yield its groups of an archive, below a path, with how each output is shown."""
        yield path, xr.Dataset(attrs=self.attributes)
        for output, statistics in self.outputs.items():
            if statistics:
                yield f"{path}/{output}", pack(statistics).assign_attrs(shown.get(output, {}))
