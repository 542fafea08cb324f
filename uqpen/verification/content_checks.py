"""Check of an archive against the hashes that it records: groups, the study's text, files."""

from __future__ import annotations

import hashlib

import xarray as xr

from uqpen.archive.files import FILES, archived_files
from uqpen.archive.hashes import group_hashes, recorded_hashes
from uqpen.archive.read import read_group
from uqpen.core.errors import ArchiveError
from uqpen.verification.check_result import CheckOutcome, CheckResult

__all__ = ["check_files", "check_hashes", "check_text"]


def check_hashes(tree: xr.DataTree) -> CheckResult:
    """Check that every group is as it was written."""
    found, written = group_hashes(tree), recorded_hashes(tree)
    if not written:
        return CheckResult("hashes", CheckOutcome.DIFFERENT, "no longer recorded in the archive")
    shared = found.keys() & written.keys()
    details = tuple(
        f"{path} {what}"
        for what, paths in (
            ("is changed", {path for path in shared if found[path] != written[path]}),
            ("is missing", written.keys() - found.keys()),
            ("was added", found.keys() - written.keys()),
        )
        for path in sorted(paths)
    )
    if details:
        return CheckResult("hashes", CheckOutcome.DIFFERENT, "not those of its groups", details)
    return CheckResult("hashes", CheckOutcome.EQUAL, f"those of its {len(found)} groups")


def check_text(tree: xr.DataTree) -> CheckResult:
    """Check that the study's text matches the archived hash."""
    text = str(tree.attrs.get("study_text", ""))
    digest = hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
    if digest == str(tree.attrs.get("study_sha256")):
        message = "its text has the recorded hash"
        return CheckResult("study", CheckOutcome.EQUAL, message)
    message = "its text is changed: it does not have the recorded hash"
    return CheckResult("study", CheckOutcome.DIFFERENT, message)


def check_files(tree: xr.DataTree) -> CheckResult:
    """Check that the archived files match their hashes."""
    files = archived_files(read_group(tree, FILES))
    details = []
    for file in files:
        try:
            _ = file.read() if file.is_whole else b""
        except ArchiveError as error:
            details.append(str(error))
    if details:
        message = "not those of its study"
        return CheckResult("files", CheckOutcome.DIFFERENT, message, tuple(details))
    by_hash = [f"{file.name}: kept by its hash alone" for file in files if not file.is_whole]
    message = f"{len(files)} archived, with the recorded hashes"
    return CheckResult("files", CheckOutcome.EQUAL, message, tuple(by_hash))
