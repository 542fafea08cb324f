"""The statistics of an archive by source, output and name, as tables and figures read them."""

from __future__ import annotations

from dataclasses import dataclass

import xarray as xr

from uqpen.archive.read import group_names, read_group
from uqpen.archive.schema_2 import GROUPS, read_failures, read_statistic
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import DIFFERENCES, RUNS, SURROGATES

__all__ = ["SourceStatistics"]


@dataclass(frozen=True)
class SourceStatistics:
    """The statistics of one model, or of the difference of two.

    Parameters
    ----------
    tree : DataTree
        What an archive has of the model, or of the pair.
    is_difference : bool
        Whether it is of a pair.
    """

    tree: xr.DataTree
    is_difference: bool = False

    @classmethod
    def of_differences(cls, archive: xr.DataTree, model: str) -> SourceStatistics:
        """Return those of the difference of a model from the first."""
        return cls(archive.children[DIFFERENCES].children[model], is_difference=True)

    @property
    def sources(self) -> list[str]:
        """Designs, then surrogates, then publications."""
        kinds = (*(() if self.is_difference else (RUNS, SURROGATES)), *GROUPS)
        return list(dict.fromkeys(name for kind in kinds for name in group_names(self.tree, kind)))

    @property
    def publications(self) -> list[str]:
        """The sources that are neither designs nor surrogates."""
        own = {*group_names(self.tree, RUNS), *group_names(self.tree, SURROGATES)}
        return [name for name in self.sources if name not in own]

    def get(self, source: str, output: str, statistic: str) -> xr.DataArray | None:
        """Return an estimate array; None where the source does not have it.

        Parameters
        ----------
        source, output, statistic : str
            The names of a design, surrogate or publication; of an output; of a statistic.

        Returns
        -------
        DataArray or None
            Along the statistic's dimensions (``probability``, ``content``, ``threshold``,
            ``category``, ``rank``, ``input``, ``pair``) and ``bound``. Coordinates: those of the
            dimensions with their companions, and ``interval``, ``interval_label`` and ``note`` of
            each entry. Attributes: ``units``, ``long_name``, ``interval_level``, ``estimator``, the
            counts of runs, ``conditional_on``, ``missing``.
        """
        return read_statistic(self.tree, source, output, statistic)

    def statistics(self, source: str, output: str) -> dict[str, xr.DataArray]:
        """Return all that a source has of an output, in the order of the catalogue."""
        found = {name: self.get(source, output, name) for name in CATALOGUE}
        return {name: array for name, array in found.items() if array is not None}

    def sources_of(self, output: str, statistic: str) -> list[str]:
        """Return the sources that have a statistic of an output."""
        return [name for name in self.sources if self.get(name, output, statistic) is not None]

    def largest_contribution(self, publication: str, output: str) -> str:
        """Return the input that a publication calls the largest contribution; empty for none."""
        attributes = read_group(self.tree, "sensitivity", publication).attrs
        return str(attributes.get(f"{output}_largest_contribution", ""))

    def citation(self, publication: str) -> str:
        """Return where the estimates of a publication stand."""
        groups = (read_group(self.tree, kind, publication).attrs for kind in GROUPS)
        return next((str(each["source"]) for each in groups if "source" in each), "")

    def failures(self, design: str) -> dict[str, xr.DataArray]:
        """Return what the archive says of a design's runs that did not complete.

        Returns
        -------
        dict of str to DataArray
            ``probability`` along ``status`` and ``bound``, each status by its meaning; ``larger``
            and ``further_out`` along ``input`` and ``bound``; ``lowest`` and ``highest`` along
            ``input``. Empty for a design that is no sample and lost no run. The attributes of
            ``probability`` say ``runs``, ``runs_used``, ``conditional_on`` and ``missing``.
        """
        return read_failures(self.tree, design)
