"""Record of what a model's runs depend on: seen while it is loaded and in its first run."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Collection, Iterator, Sequence
from importlib.machinery import PathFinder
from importlib.util import find_spec
from pathlib import Path

from uqpen.core.dependency import (
    CHANGED,
    ENVIRONMENT,
    LIBRARY,
    MODULE,
    OBSERVED,
    OPENED,
    Dependency,
    file_sha256,
    value_sha256,
)
from uqpen.core.files import LARGEST, FileSnapshot
from uqpen.models.observation import Observation
from uqpen.models.user_code import changed_file_error, changed_variable_error


class Dependencies:
    """Record of the files, variables, programs and hosts that user-defined code has used.

    What is seen while the code is loaded is the same in each process. What is seen in a run is that
    of one run of a study, wherever it is made.

    Parameters
    ----------
    folder : Path
        Folder of the study; names of files are relative to it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        # The files of its modules, which are known by themselves.
        self.imported_files: set[str] = set()
        self._at_loading: set[Dependency] = set()
        self._in_run: set[Dependency] = set()
        self._snapshots: dict[Path, FileSnapshot] = {}
        # The same files are opened again by imports and in later calls.
        self._observation = Observation()

    @property
    def lines(self) -> frozenset[str]:
        """All that was seen, in the form of `Results.files`.

        A file that a run changes has no hash, even if it was read before.
        """
        found = self._at_loading | self._in_run
        return frozenset(
            each.line for each in found if not (each.sha256 and each.name in self._changed)
        )

    @property
    def lines_of_runs(self) -> frozenset[str]:
        """Dependencies that runs report: those seen in the observed run, if there was one."""
        return frozenset(each.line for each in self._in_run)

    @contextlib.contextmanager
    def observed_loading(self) -> Iterator[None]:
        """Observe code that is loaded within this context."""
        try:
            with self._observation.active():
                yield
        finally:
            self._at_loading |= self._seen()

    @contextlib.contextmanager
    def observed_run(self) -> Iterator[None]:
        """Observe a run within this context."""
        try:
            with self._observation.active():
                yield
        finally:
            self._in_run |= self._seen() - self._at_loading
            self._in_run.add(Dependency(OBSERVED, "run"))

    def add_reported(self, lines: Collection[str]) -> None:
        """Add what runs in any process have reported.

        ModelError if a file or variable is another one now.
        """
        for each in sorted({Dependency.from_line(line) for line in lines}):
            if each in self._in_run or each in self._at_loading:
                continue
            if each.sha256 and each.role != MODULE:
                if current_sha256(each, self.folder) != each.sha256:
                    is_variable = each.role == ENVIRONMENT
                    error = changed_variable_error if is_variable else changed_file_error
                    raise error(each.name)
                self._read(each, self.folder / each.name)
            self._in_run.add(each)

    def files(self) -> tuple[FileSnapshot, ...]:
        """Return snapshots of the files in the study's folder that were opened."""
        changed = {self.folder / name for name in self._changed}
        return tuple(self._snapshots[path] for path in sorted(self._snapshots.keys() - changed))

    @property
    def _changed(self) -> set[str]:
        return {each.name for each in self._in_run if each.role == CHANGED}

    def _seen(self) -> set[Dependency]:
        found = set()
        own = {os.path.abspath(file) for file in self.imported_files}
        for each, path in self._observation.dependencies(os.path.abspath(self.folder)):
            if path not in own:
                found.add(each)
                self._read(each, self.folder / each.name)
        return found

    def _read(self, dependency: Dependency, path: Path) -> None:
        """Read a file for the archive, which keeps those in the study's folder."""
        is_inside = dependency.role in (OPENED, LIBRARY) and ".." not in Path(dependency.name).parts
        if not dependency.sha256 or not is_inside or path in self._snapshots:
            return
        try:
            size = path.stat().st_size
            content = path.read_bytes() if size <= LARGEST else None
        except OSError:
            return
        self._snapshots[path] = FileSnapshot(path, dependency.sha256, size, content)


def current_sha256(dependency: Dependency, folder: Path) -> str:
    """Return the hash of a file, a module or a variable as it is now; empty where it is gone."""
    if dependency.role == ENVIRONMENT:
        return value_sha256(dependency.name, os.environ.get(dependency.name))
    if dependency.role != MODULE:
        return file_sha256(folder / dependency.name)
    # The file that the module would be imported from, without importing packages around it.
    locations: Sequence[str] | None = None
    file = ""
    parts = dependency.name.split(".")
    for end in range(1, len(parts) + 1):
        full = ".".join(parts[:end])
        try:
            found = find_spec(full) if end == 1 else PathFinder.find_spec(full, locations)
        except (ImportError, ValueError, OSError):
            return ""
        if found is None:
            return ""
        file = str(getattr(found.loader, "archive", None) or found.origin or "")
        locations = found.submodule_search_locations or []
    return file_sha256(file)
