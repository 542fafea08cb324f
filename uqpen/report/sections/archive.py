"""The study's text, and the provenance of the archive."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.archive.files import FILES, archived_files
from uqpen.archive.hashes import recorded_hashes
from uqpen.archive.read import read_group
from uqpen.charts.chart import Block
from uqpen.core.labels import CONTENT
from uqpen.report.blocks import Heading, Listing, Remarks, Table, Text
from uqpen.report.sections.archive_notes import archive_notes
from uqpen.report.sections.archive_tables import (
    designs_table,
    inputs_table,
    model_table,
    provenance_table,
)
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number
from uqpen.results.field_tables import field_lines
from uqpen.results.table import OutputTable
from uqpen.results.texts import plain_text

__all__ = ["archive", "study_blocks"]

# Characters of a text, and files whose texts are shown.
_LONGEST = 20_000
_MOST_FILES = 10

_COMMANDS = """\
# Check the hashes, repeat a sample of the runs, and compute all statistics again:
uqpen verify ARCHIVE
# Repeat the whole study into another archive, and list the differences of the two:
uqpen rerun ARCHIVE -o AGAIN
uqpen diff ARCHIVE AGAIN
"""


def archive(view: ArchiveView) -> Iterator[Block]:
    """The study's text, inputs and designs of each model, and the archive's provenance."""
    yield from study_blocks(view)
    for each in view.model_views:
        if each.model:
            yield Heading(each.model)
            yield Table(model_table(each))
        yield Table(inputs_table(each))
        yield Table(designs_table(each))
    if fields := tuple(map(plain_text, field_lines(view.archive))):
        yield Remarks("Outputs with dimensions, run by run in the archive", fields)
    if view.model:
        yield Heading("The archive of all models")
    if found := archive_notes(view.archive):
        yield Remarks("Notes in this archive, and the number of estimates with each", found)
    yield Table(provenance_table(view))
    yield Text(
        "These commands check the archive of this page, and repeat it. A model or an analysis of "
        "its author's own is executed only with --trust."
    )
    yield Listing("Commands", _COMMANDS)
    if recorded_hashes(view.archive):
        title = "SHA-256 of the content of each of the archive's groups"
        yield _listing(title, str(view.archive.attrs[CONTENT]), is_folded=True)


def study_blocks(view: ArchiveView) -> Iterator[Block]:
    """The study as its author wrote it, and the files that it names."""
    attributes = view.archive.attrs
    yield _listing(
        f"The study: {plain_text(str(attributes.get('study_name', '')))}",
        str(attributes["study_text"]),
    )
    files = archived_files(read_group(view.archive, FILES))
    if files:
        table = OutputTable("Files that the study names", ["bytes", "content", "SHA-256"])
        for file in files:
            kept = "in the archive" if file.is_whole else "not in the archive"
            cells = [grouped_number(file.size), kept, file.sha256]
            table.rows.append((plain_text(file.name), cells))
        yield Table(table)
    shown = [file for file in files if file.encoding == "utf-8"]
    for file in shown[:_MOST_FILES]:
        yield _listing(plain_text(file.name), file.content, is_folded=True)
    if len(shown) > _MOST_FILES:
        more = len(shown) - _MOST_FILES
        yield Text(f"The archive has the texts of {more} more files, which are not shown here.")


def _listing(title: str, text: str, *, is_folded: bool = False) -> Listing:
    """A text, cut where it is too long for a page."""
    if len(text) > _LONGEST:
        cut = f"the first {grouped_number(_LONGEST)} of {grouped_number(len(text))} characters"
        title = f"{title} ({cut})"
    return Listing(title, text[:_LONGEST], is_folded)
