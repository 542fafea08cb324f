"""The page of two archives side by side, and what they have in common."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import xarray as xr

from uqpen.archive.read import is_benchmark, model_trees
from uqpen.core.errors import ReportError
from uqpen.core.lookup import resolve
from uqpen.figures.page import check_archive
from uqpen.report.page import FilledSection, PageHead, render_page, write_page
from uqpen.report.revisions import REVISION_SECTIONS
from uqpen.results.archive_view import ArchiveView

__all__ = ["ArchivePair", "ModelPair", "revision_page", "write_revision_report"]


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
        leading = self.first.leading_design
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


def write_revision_report(
    first: xr.DataTree,
    second: xr.DataTree,
    path: str | Path,
    *,
    names: tuple[str, str] = ("", ""),
) -> None:
    """Write the page of two archives side by side to a file, which a browser opens offline.

    An existing file is replaced in one step.

    Parameters
    ----------
    first, second : DataTree
        Archives of studies, as `run` returns them, or `open_archive` reads them. The page calls
        them A and B.
    path : str or Path
        A file that ends in .html or .htm.
    names : tuple of str
        Names of the two, such as those of their files, for the head of the page.

    Raises
    ------
    ReportError
        If the name has another ending than .html or .htm, or the file cannot be written; or if
        one of them is the archive of a benchmark of methods.
    ArchiveError
        If an archive lacks what the report goes by.
    """
    write_page(path, lambda: revision_page(first, second, names=names))


def revision_page(
    first: xr.DataTree, second: xr.DataTree, *, names: tuple[str, str] = ("", "")
) -> str:
    """Return the page of two archives as HTML; see `write_revision_report`."""
    for tree in (first, second):
        if is_benchmark(tree):
            raise ReportError("only archives of studies are shown side by side, no benchmarks")
        check_archive(tree)
    pair = ArchivePair(first, second)
    every = [
        FilledSection(name, section, tuple(resolve(section.function)(pair)))
        for name, section in REVISION_SECTIONS.items()
    ]
    lacks = [filled.section.absence_note for filled in every if not filled.blocks]
    filled = [each for each in every if each.blocks]
    return render_page(_head(pair, names), filled, list(filter(None, lacks)))


def _head(pair: ArchivePair, names: tuple[str, str]) -> PageHead:
    heads = [PageHead.of_archive(each) for each in (pair.first, pair.second)]
    facts = [
        f"{label}: {', '.join(filter(None, [name, *head.facts]))}"
        for label, name, head in zip("AB", names, heads, strict=True)
    ]
    return PageHead(
        f"{' and '.join(dict.fromkeys(head.title for head in heads))}: A and B",
        facts,
        "_".join(dict.fromkeys(head.study for head in heads)),
        "; ".join(f"{label}: {head.reference}" for label, head in zip("AB", heads, strict=True)),
    )
