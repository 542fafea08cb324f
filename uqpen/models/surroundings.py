"""The folder that a model of the user's own lives in, and the modules that lie beside it."""

from __future__ import annotations

import contextlib
import os
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

__all__ = ["Surroundings"]

# Where Python and what is installed lie; a folder around them does not make them the user's.
_INSTALLED = tuple(
    sysconfig.get_path(name) + os.sep for name in ("stdlib", "platstdlib", "purelib", "platlib")
)


class Surroundings:
    """Modules beside a model, which it can import as it would when run from its own folder.

    Two models may lie beside modules of the same name, and the program that calls uqpen may have
    imported yet others: so a model's own are in place only while it is loaded or run.

    Parameters
    ----------
    folder : Path
        Where the study lies.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = str(folder)
        self._modules: dict[str, ModuleType] = {}
        self._imported_elsewhere: frozenset[str] = frozenset()
        # Modules that have been found to lie outside the folder: there are more than a thousand,
        # and every batch comes by here.
        self._outside: dict[str, ModuleType] = {}

    @property
    def folder(self) -> Path:
        """Where the study lies."""
        return Path(self._folder)

    @contextlib.contextmanager
    def entered(self) -> Iterator[None]:
        """While this lasts, an import finds what lies in the folder first."""
        outside = self._taken_out()
        sys.modules.update(self._modules)
        sys.path.insert(0, self._folder)
        try:
            yield
        finally:
            self._modules = self._taken_out()
            sys.modules.update(outside)
            # The model may have rearranged the path itself.
            with contextlib.suppress(ValueError):
                sys.path.remove(self._folder)

    def files(self) -> frozenset[str]:
        """The files of the folder that have been imported as modules, here or elsewhere."""
        here = {str(module.__file__) for module in self._modules.values()}
        return self._imported_elsewhere.union(here)

    def note(self, files: frozenset[str]) -> None:
        """Count files among those that have been imported."""
        self._imported_elsewhere |= files

    def sources(self) -> bytes:
        """The source of every module of the folder that has been imported, in one."""
        files = map(Path, self.files())
        return b"".join(file.read_bytes() for file in sorted(files) if file.is_file())

    def _taken_out(self) -> dict[str, ModuleType]:
        """Imported modules of the folder, which are imported no longer."""
        inside = self._folder + os.sep
        found = {}
        for name, module in list(sys.modules.items()):
            if self._outside.get(name) is module:
                continue
            file = str(getattr(module, "__file__", None) or "")
            is_ours = name == "__main__" or name.partition(".")[0] == "uqpen"
            if file.startswith(inside) and not file.startswith(_INSTALLED) and not is_ours:
                found[name] = sys.modules.pop(name)
            else:
                self._outside[name] = module
        return found
