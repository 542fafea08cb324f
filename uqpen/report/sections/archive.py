"""The study's text, and what made the archive."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.archive.content import recorded
from uqpen.archive.files import FILES, KeptFile, kept_files
from uqpen.archive.read import group
from uqpen.figures.part import Part
from uqpen.figures.texts import plain
from uqpen.labels import CONTENT
from uqpen.report.blocks import Block, Heading, Listing, Remarks, Table, Text
from uqpen.report.sections.archive_tables import designs_of, inputs_of, model_of, provenance_of
from uqpen.report.sections.doubts import doubts
from uqpen.summary.digits import grouped
from uqpen.summary.table import OutputTable

__all__ = ["archive", "study_of"]

# Characters of a text, and files whose texts are shown.
_LONGEST = 20_000
_MOST_FILES = 10

_COMMANDS = """\
# Hashes, a sample of the runs, and all statistics, worked out again:
uqpen verify ARCHIVE
# The whole study once more, into an archive of its own, and what the two do not share:
uqpen rerun ARCHIVE -o AGAIN
uqpen diff ARCHIVE AGAIN
"""


def archive(part: Part) -> Iterator[Block]:
    """The study's text, inputs and designs of each model, and what made the archive."""
    yield from study_of(part)
    for each in part.others:
        if each.model:
            yield Heading(each.model)
            yield Table(model_of(each))
        yield Table(inputs_of(each))
        yield Table(designs_of(each))
    if part.model:
        yield Heading("The archive of all models")
    if found := doubts(part.archive):
        yield Remarks("Warnings that this archive holds, and how many figures bear each", found)
    yield Table(provenance_of(part))
    yield from _checks(part)


def study_of(part: Part) -> Iterator[Block]:
    """The study as its author wrote it, and the files that it names."""
    attributes = part.archive.attrs
    yield _listing(
        f"The study: {plain(str(attributes.get('study_name', '')))}", str(attributes["study_text"])
    )
    files = kept_files(group(part.archive, FILES))
    if files:
        yield Table(_file_table(files))
    shown = [file for file in files if file.encoding == "utf-8"]
    for file in shown[:_MOST_FILES]:
        yield _listing(plain(file.name), file.content, is_folded=True)
    if len(shown) > _MOST_FILES:
        more = len(shown) - _MOST_FILES
        yield Text(f"The archive has the texts of {more} more files, which are not shown here.")


def _listing(title: str, text: str, *, is_folded: bool = False) -> Listing:
    """A text, cut where it is too long for a page."""
    if len(text) <= _LONGEST:
        return Listing(title, text, is_folded)
    head = f"{title} (the first {grouped(_LONGEST)} of {grouped(len(text))} characters)"
    return Listing(head, text[:_LONGEST], is_folded)


def _file_table(files: list[KeptFile]) -> OutputTable:
    table = OutputTable("Files that the study names", ["bytes", "content", "SHA-256"])
    for file in files:
        kept = "in the archive" if file.is_whole else "not in the archive"
        table.rows.append((plain(file.name), [grouped(file.size), kept, file.sha256]))
    return table


def _checks(part: Part) -> Iterator[Block]:
    """How the archive is checked and repeated."""
    yield Text(
        "With these commands the archive that this page was made of is checked and repeated. A "
        "model of its author's own is executed only if they are given --trust."
    )
    yield Listing("Commands", _COMMANDS)
    if recorded(part.archive):
        text = str(part.archive.attrs[CONTENT])
        yield _listing(
            "SHA-256 of the content of each of the archive's groups", text, is_folded=True
        )
