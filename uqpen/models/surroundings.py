"""Folder of a user's model, and the modules beside it."""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import operator
import os
import sys
from collections.abc import Collection, Iterator
from pathlib import Path
from types import ModuleType

from uqpen.core.dependency import IMPORTED, MODULE, Dependency
from uqpen.core.files import FileSnapshot
from uqpen.models.dependencies import Dependencies
from uqpen.models.installed import (
    installed_modules,
    is_installed,
    is_of_no_model,
    loaded_own_modules,
    module_file,
    module_sha256,
    reachable_modules,
)
from uqpen.models.observation import relative_name
from uqpen.models.user_code import changed_file_error

# Begins the names of modules that are loaded from a file that the study names.
MODEL_MODULE = "uqpen_study_"


class ModelFolder(Dependencies):
    """Modules beside a model, which it can import as if run from its own folder.

    Two models may lie beside modules of the same name, and the program that calls uqpen may have
    imported yet others. So a model's modules are in place only while it is loaded or run. Their
    files are read as soon as they have been imported: an edit during the study has no effect.
    Modules that lie elsewhere stay imported. Those of no installed package are known by their
    hashes.

    Parameters
    ----------
    folder : Path
        Folder of the study.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._modules: dict[str, ModuleType] = {}
        self._contents: dict[str, bytes] = {}
        self._imported: frozenset[Dependency] = frozenset()
        self._reported: frozenset[str] = frozenset()
        # Modules known to lie outside the folder, in their order: more than a thousand, checked at
        # every batch.
        self._outside: dict[str, ModuleType] = {}
        # Number of modules, and the last one, when none of them was of the folder.
        self._checked: tuple[int, tuple[str, ModuleType] | None] = (0, None)

    @property
    def imported(self) -> frozenset[str]:
        """Modules that it has imported, in the form of `Results.files`."""
        return frozenset(each.line for each in self._imported)

    @property
    def lines(self) -> frozenset[str]:
        """All that its runs depend on, as far as it is known, in the same form."""
        return self.imported | super().lines

    @property
    def lines_of_runs(self) -> frozenset[str]:
        """Dependencies that runs report: modules, and those seen in the observed run."""
        return self.imported | super().lines_of_runs

    @contextlib.contextmanager
    def loading(self) -> Iterator[None]:
        """Put the folder on the import path, and observe what is loaded within this context."""
        with self.observed_loading():
            with self.on_import_path():
                yield
            self._add_reachable()

    @contextlib.contextmanager
    def on_import_path(self) -> Iterator[None]:
        """Put the folder first on the import path within this context."""
        outside = self._remove_modules()
        sys.modules.update(self._modules)
        sys.path.insert(0, str(self.folder))
        before, count = self._outside, len(self._outside)
        try:
            yield
        finally:
            self._modules = self._remove_modules()
            for module in self._modules.values():
                self.read(module_file(module))
            is_same, size = self._outside is before, len(self._outside)
            further = self._outside.items() if not is_same or size > count else ()
            for name, module in itertools.islice(further, count if is_same else 0, None):
                if is_same or before.get(name) is not module:
                    self._add_module(name, module)
            sys.modules.update(outside)
            # The model may have rearranged the path itself.
            with contextlib.suppress(ValueError):
                sys.path.remove(str(self.folder))

    def read(self, file: str) -> None:
        """Read an imported file, unless it has been read before."""
        path = Path(file)
        if file not in self._contents and path.is_file():
            self._contents[file] = path.read_bytes()
            self.imported_files.add(file)
            sha256 = hashlib.sha256(self._contents[file]).hexdigest()
            self._imported |= {Dependency(IMPORTED, relative_name(file, str(self.folder)), sha256)}

    def add_reported(self, lines: Collection[str]) -> None:
        """Add what runs in any process have reported.

        ModelError if something of it differs from that here.
        """
        if lines == self._reported:
            return
        self._reported = frozenset(lines)
        reported = {Dependency.from_line(line) for line in self._reported - self.lines}
        for each in sorted(reported):
            if each.role == IMPORTED:
                self.read(str(self.folder / each.name))
                if each not in self._imported:
                    raise changed_file_error(each.name)
            elif each.role == MODULE:
                if any(each.name == own.name and own.role == MODULE for own in self._imported):
                    raise changed_file_error(each.name)
                self._imported |= {each}
        others = (each.line for each in reported if each.role not in (IMPORTED, MODULE))
        super().add_reported([*others])

    def module_content(self, file: str) -> bytes | None:
        """Return the content of a module of the folder as it was imported; None for another file.

        The file of the model belongs to the folder wherever it lies.
        """
        if file in self._contents:
            return self._contents[file]
        if not self._is_inside(file):
            return None
        try:
            return Path(file).read_bytes()
        except OSError:  # it has been removed since, or is the name of code without a file
            return None

    def files(self) -> tuple[FileSnapshot, ...]:
        """Return snapshots of the imported files, and of those that were opened."""
        own = (FileSnapshot.from_content(path, content) for path, content in self._sorted())
        return (*own, *super().files())

    def sources(self) -> bytes:
        """Return the joined source of all imported modules."""
        return b"".join(content for _, content in self._sorted())

    @property
    def text(self) -> str:
        """The joined source of all imported modules as a text."""
        return self.sources().decode("utf-8", "replace")

    def _sorted(self) -> list[tuple[Path, bytes]]:
        return sorted((Path(file), content) for file, content in self._contents.items())

    def _remove_modules(self) -> dict[str, ModuleType]:
        """Remove the modules of the folder from the imported ones, and return them."""
        found = {
            name: sys.modules.pop(name)
            for name, module in self._modules.items()
            if sys.modules.get(name) is module
        }
        if self._checked == _extent():
            return found
        imported = list(sys.modules.items())
        # What is imported later stands after what has been looked at, unless it was replaced.
        known = len(self._outside)
        names_stay = list(sys.modules)[:known] == list(self._outside)
        if names_stay and all(map(operator.is_, sys.modules.values(), self._outside.values())):
            imported = imported[known:]
        else:
            self._outside = {}
        installed = installed_modules()
        for name, module in imported:
            is_other = installed.get(name) is module or is_of_no_model(name)
            if not is_other and self._is_inside(module_file(module)):
                found[name] = sys.modules.pop(name)
            else:
                self._outside[name] = module
        self._checked = _extent()
        return found

    def _add_module(self, name: str, module: ModuleType) -> None:
        """Add a module that lies elsewhere, unless it is installed."""
        file = module_file(module)
        if not file or is_of_no_model(name) or name.startswith(MODEL_MODULE) or is_installed(file):
            return
        self.imported_files.add(file)
        self._imported |= {Dependency(MODULE, name, module_sha256(name, module))}

    def _add_reachable(self) -> None:
        """Add modules that were imported before by others, and that those of the model import."""
        candidates = {
            name: module
            for name, module in loaded_own_modules().items()
            if not self._is_inside(module_file(module))
            and module_file(module) not in self.imported_files
        }
        packages = {module_file(each): each.__package__ or "" for each in self._modules.values()}
        sources = [(packages.get(file, ""), content) for file, content in self._contents.items()]
        for name, module in reachable_modules(sources, candidates).items():
            self._add_module(name, module)

    def _is_inside(self, file: str) -> bool:
        return file.startswith(f"{self.folder}{os.sep}") and not is_installed(file)


def _extent() -> tuple[int, tuple[str, ModuleType] | None]:
    """Return the number of imported modules, and the last one: an import changes them."""
    return len(sys.modules), next(reversed(sys.modules.items()), None)
