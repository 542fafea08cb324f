"""Archive in memory, for a user of the library."""

from __future__ import annotations

from html import escape
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

from uqpen.archive.read import is_benchmark, model_trees
from uqpen.archive.read import open_archive as open_tree
from uqpen.core.html import html_table
from uqpen.core.labels import RUNS
from uqpen.core.lookup import resolve
from uqpen.results.field_tables import field_lines
from uqpen.results.long_table import long_table, runs_table
from uqpen.results.output_tables import statistics_tables

if TYPE_CHECKING:
    import pandas as pd

    from uqpen.surrogates.archived_surrogate import ArchivedSurrogate
    from uqpen.surrogates.surrogate import Surrogate

# More outputs and names of groups than these are counted.
_MOST_OUTPUTS = 6
_MOST_NAMES = 8
# What shows an archive stands above it, and is loaded when it is asked for.
_SUMMARY = "uqpen.report.sections.summary:summary_lines"
_PLOTS = "uqpen.figures.page:ArchivePlots"


class Archive(xr.DataTree):  # type: ignore[no-untyped-call]
    """Content of an archive: a tree of datasets, one for each group.

    See ``docs/archive.md`` for its groups and variables.

    Examples
    --------
    >>> archive = uqpen.open_archive("archives/concrete.nc")  # doctest: +SKIP
    >>> archive["statistics/monte_carlo/penetration_depth"]["mean"]  # doctest: +SKIP
    >>> archive.to_frame().query("statistic == 'mean'")  # doctest: +SKIP
    """

    __slots__ = ()

    @classmethod
    def of(cls, tree: xr.DataTree) -> Archive:
        """Return a tree as an archive; its groups move there, and leave the tree empty."""
        archive = cls(tree.to_dataset(inherit=False))
        # As arguments of the constructor, they would all be copied once for each level above them.
        archive.children = tree.children  # type: ignore[assignment] # they need not be archives
        return archive

    def to_frame(self, *, functions: bool = False) -> pd.DataFrame:
        """Return all estimates as one long table, a row for each.

        Parameters
        ----------
        functions : bool
            True to list distribution functions as well, which have a row for each run.

        Returns
        -------
        DataFrame
            Its columns are the model, the source, the output, the statistic and its coordinates,
            then the estimate, the ends of its interval, and the note on it.
        """
        return long_table(self, functions=functions)

    def runs_to_frame(self, *, si: bool = False) -> pd.DataFrame:
        """Return all runs as one table, a row for each.

        Parameters
        ----------
        si : bool
            True for SI units; else values are in the units of the study.

        Returns
        -------
        DataFrame
            Its columns are the design, the number of the run, the inputs and the outputs under
            headings ``name [unit]``, the status, and the reason of a failure.
        """
        return runs_table(self, si=si)

    def surrogate(self, name: str, *, kind: type[Surrogate] | None = None) -> ArchivedSurrogate:
        """Return a surrogate, to predict with; nothing that the archive names is executed.

        Parameters
        ----------
        name : str
            Its name in the study; of several models ``<model>/<name>``.
        kind : type, optional
            Its class, where that is user-defined.

        Raises
        ------
        UnknownNameError
            If the archive has no surrogate of this name.
        ModelError
            If its class is user-defined, and is not given; or if it predicts no output.
        """
        from uqpen.surrogates.archived_surrogate import archived_surrogate

        return archived_surrogate(self, name, kind=kind)

    def summary(self) -> str:
        """Return the main results, a line each, as `uqpen study` ends with them.

        Verdicts on the limits of the study, the requested statistics with their intervals, the
        inputs that drive each output, and what to mind.
        """
        return "\n".join(resolve(_SUMMARY)(self)).replace("\u00a0", " ")

    @property
    def plot(self) -> Any:
        """Figures of this archive as methods, such as ``archive.plot.cdf("depth")``."""
        return resolve(_PLOTS)(self)

    def __repr__(self) -> str:  # type: ignore[override] # a node takes an argument for its own use
        lines = [f"<uqpen.Archive {str(self.attrs.get('title', ''))[:100]!r}>"]
        for group, node in self.children.items():
            names = list(node.children)
            more = f", … ({len(names)})" if len(names) > _MOST_NAMES else ""
            named = f": {', '.join(names[:_MOST_NAMES])}{more}" if names else ""
            lines.append(f"  /{group}{named}")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return archive_html(self)


def open_archive(path: str | Path) -> Archive:
    """Read an archive into memory.

    Parameters
    ----------
    path : str or Path
        A file that `uqpen study` or `make_archive` has written.

    Raises
    ------
    ArchiveError
        If it cannot be read, is no archive, or has another schema.
    """
    return Archive.of(open_tree(path))


def archive_html(tree: xr.DataTree) -> str:
    """Return the title of an archive and a table for each of its first outputs.

    Nothing that the archive contains is taken as HTML.
    """
    title = f"<p><b>{escape(str(tree.attrs.get('title', '')))}</b></p>"
    if is_benchmark(tree) or not any(
        RUNS in model.children for model in model_trees(tree).values()
    ):
        groups = ", ".join(map(str, tree.children))
        return f"{title}<p>{escape(f'groups: {groups}')}</p>"
    tables = list(statistics_tables(tree))
    shown = [
        html_table(
            [table.title, *table.columns],
            ([label, *cells] for label, cells in table.rows),
            table.notes,
        )
        for table in islice(tables, _MOST_OUTPUTS)
    ]
    more = len(tables) - len(shown)
    lines = [*([f"and {more} more outputs"] if more else []), *map(escape, field_lines(tree))]
    return "\n".join([title, *shown, *(f"<p>{line}</p>" for line in lines)])
