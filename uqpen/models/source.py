"""Source of the built-in models, which identifies their version."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
from collections.abc import Iterator
from pathlib import Path

from uqpen.core.model import Model
from uqpen.core.settings import declared_settings

_PACKAGE = "uqpen.models"
_FOLDER = Path(__file__).parent

# This module: all of them import it, and none of their numbers depends on it.
_APART = Path(__file__).stem


class BuiltInModel(Model):
    """A model that comes with uqpen, identified by its settings, version and source."""

    def identity(self) -> dict[str, str]:
        """Return its name and settings, uqpen's version, and the hash of the model's source."""
        settings = {
            field.name: repr(getattr(self, field.name)) for field, _ in declared_settings(self)
        }
        return {
            "name": self.name,
            **settings,
            "version": importlib.metadata.version("uqpen"),
            "source_sha256": source_sha256(type(self).__module__),
        }


@functools.cache
def source_sha256(module: str) -> str:
    """Return the SHA-256 of the sources of a built-in model.

    They are the module that defines the model, all modules of this package that it imports, and
    those that these import. They follow from import statements alone.
    """
    sources: dict[str, bytes] = {}
    found = [module.removeprefix(f"{_PACKAGE}.")]
    while found:
        name = found.pop()
        if name != _APART and name not in sources:
            # A checkout on Windows has other ends of lines.
            sources[name] = _path(name).read_bytes().replace(b"\r\n", b"\n")
            found += _imported_modules(sources[name])
    digest = hashlib.sha256()
    for name, source in sorted(sources.items()):
        # With its length, so that no two sequences of sources look alike.
        digest.update(f"{name} {len(source)}\n".encode() + source)
    return digest.hexdigest()


def _imported_modules(source: bytes) -> Iterator[str]:
    """Yield the modules of this package that a source imports anywhere."""
    from uqpen.models.installed import imported_names

    for name in imported_names(source, _PACKAGE):
        stem = name.removeprefix(f"{_PACKAGE}.")
        if stem != name and _path(stem).is_file():
            yield stem


def _path(name: str) -> Path:
    return _FOLDER.joinpath(*name.split(".")).with_suffix(".py")
