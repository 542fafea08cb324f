"""Folder of a user's model, and the modules beside it."""

from __future__ import annotations

import contextlib
import hashlib
import operator
import os
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

from uqpen.core.files import FileSnapshot
from uqpen.models.reasons import changed_file_error

__all__ = ["ModelFolder"]

# Folders of Python and installed packages; a folder around them does not make them the user's.
_INSTALLED = tuple(
    sysconfig.get_path(name) + os.sep for name in ("stdlib", "platstdlib", "purelib", "platlib")
)

# Text between a hash and the name of its file, as sha256sum writes it.
_BETWEEN = "  "


class ModelFolder:
    """Modules beside a model, which it can import as if run from its own folder.

    Two models may lie beside modules of the same name, and the program that calls uqpen may have
    imported yet others. So a model's modules are in place only while it is loaded or run. Their
    files are read as soon as they have been imported: an edit during the study has no effect.

    Parameters
    ----------
    folder : Path
        Folder of the study.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._modules: dict[str, ModuleType] = {}
        self._contents: dict[str, bytes] = {}
        self.imported: frozenset[str] = frozenset()
        """Files imported as modules, in the form of `Results.files`."""
        # Modules known to lie outside the folder, in their order: more than a thousand, checked at
        # every batch.
        self._outside: dict[str, ModuleType] = {}
        # Number of modules, and the last one, when none of them was of the folder.
        self._checked: tuple[int, tuple[str, ModuleType] | None] = (0, None)

    @contextlib.contextmanager
    def on_import_path(self) -> Iterator[None]:
        """Put the folder first on the import path within this context."""
        outside = self._remove_modules()
        sys.modules.update(self._modules)
        sys.path.insert(0, str(self.folder))
        try:
            yield
        finally:
            self._modules = self._remove_modules()
            for module in self._modules.values():
                self.read(str(module.__file__))
            sys.modules.update(outside)
            # The model may have rearranged the path itself.
            with contextlib.suppress(ValueError):
                sys.path.remove(str(self.folder))

    def read(self, file: str) -> None:
        """Read an imported file, unless it has been read before."""
        path = Path(file)
        if file not in self._contents and path.is_file():
            self._contents[file] = path.read_bytes()
            sha256 = hashlib.sha256(self._contents[file]).hexdigest()
            name = path.relative_to(self.folder) if path.is_relative_to(self.folder) else path
            self.imported |= {f"{sha256}{_BETWEEN}{name}"}

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

    def add_imported(self, imported: frozenset[str]) -> None:
        """Add files that any process has imported; ModelError if one differs from that here."""
        for record in sorted(imported - self.imported):
            name = record.partition(_BETWEEN)[2]
            self.read(str(self.folder / name))
            if record not in self.imported:
                raise changed_file_error(name)

    def files(self) -> tuple[FileSnapshot, ...]:
        """Return snapshots of the imported files."""
        return tuple(FileSnapshot.from_content(path, content) for path, content in self._sorted())

    def sources(self) -> bytes:
        """Return the joined source of all imported modules."""
        return b"".join(content for _, content in self._sorted())

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
        for name, module in imported:
            file = _file_of(module)
            is_ours = name in ("__main__", "__mp_main__") or name.partition(".")[0] == "uqpen"
            if self._is_inside(file) and not is_ours:
                found[name] = sys.modules.pop(name)
            else:
                self._outside[name] = module
        self._checked = _extent()
        return found

    def _is_inside(self, file: str) -> bool:
        return file.startswith(f"{self.folder}{os.sep}") and not file.startswith(_INSTALLED)


def _file_of(module: object) -> str:
    """Return the file of a module; empty for none."""
    try:
        return str(getattr(module, "__file__", None) or "")
    except Exception:  # any object can stand among the modules, and raise anything
        return ""


def _extent() -> tuple[int, tuple[str, ModuleType] | None]:
    """Return the number of imported modules, and the last one: an import changes them."""
    return len(sys.modules), next(reversed(sys.modules.items()), None)
