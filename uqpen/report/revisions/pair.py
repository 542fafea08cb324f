"""Two archives of studies, and what they have in common."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import xarray as xr

from uqpen.archive.read import model_trees
from uqpen.charts.chart import Block
from uqpen.report.blocks import Remarks
from uqpen.report.sections.leading_design import leading_design
from uqpen.results.archive_view import ArchiveView
from uqpen.results.texts import plain_text

__all__ = ["ArchivePair", "ModelPair", "unpaired"]


@dataclass(frozen=True)
class ModelPair:
    """The parts of two archives on a model of the same name.

    Parameters
    ----------
    first, second : ArchiveView
        Of A and of B.
    """

    first: ArchiveView
    second: ArchiveView

    @property
    def outputs(self) -> list[str]:
        """The scalar outputs of both that have the same unit in SI, in the order of A."""
        others = set(self.second.outputs).difference(self.first.fields, self.second.fields)
        return [name for name in self.first.outputs if name in others and self.has_same_unit(name)]

    @property
    def sources(self) -> list[str]:
        """The designs and surrogates of both; first that of A's main results."""
        first, second = self.first.statistics, self.second.statistics
        published = {*first.publications, *second.publications}
        common = [name for name in first.sources if name in second.sources]
        leading = leading_design(self.first)
        return sorted((n for n in common if n not in published), key=lambda name: name != leading)

    def has_same_unit(self, output: str) -> bool:
        """Return whether an output of both has the same unit in SI."""
        units = {str(view.attributes(output).get("units")) for view in (self.first, self.second)}
        return len(units) == 1


@dataclass(frozen=True)
class ArchivePair:
    """Two archives of studies.

    Parameters
    ----------
    first, second : DataTree
        A and B.
    """

    first: xr.DataTree
    second: xr.DataTree

    @cached_property
    def models(self) -> dict[str, ModelPair]:
        """The models of both, by their names; the only model of a study has none."""
        others = model_trees(self.second)
        return {
            name: ModelPair(ArchiveView(self.first, name), ArchiveView(self.second, name))
            for name in model_trees(self.first)
            if name in others
        }


def unpaired(pair: ArchivePair) -> Iterator[Block]:
    """Content that only one of two archives has, or has in another unit."""
    lines = [*_only_in_one("model", model_trees(pair.first), model_trees(pair.second))]
    for model, each in pair.models.items():
        of = f" of {model}" if model else ""
        first, second = each.first, each.second
        lines += _only_in_one(f"output{of}", first.outputs, second.outputs)
        lines += [
            f"output{of} {name}: in another unit, {first.unit(name)} and {second.unit(name)}"
            for name in first.outputs
            if name in second.outputs and not each.has_same_unit(name)
        ]
        lines += _only_in_one(f"source{of}", first.statistics.sources, second.statistics.sources)
    if lines:
        yield Remarks("Not compared:", tuple(plain_text(line, 200) for line in lines))


def _only_in_one(what: str, first: Iterable[str], second: Iterable[str]) -> Iterator[str]:
    one, other = list(first), list(second)
    for label, these, those in (("A", one, other), ("B", other, one)):
        for name in these:
            if name not in those:
                yield f"{what} {name or '(the only one)'}: in {label} only"
