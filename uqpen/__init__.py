"""uqpen: uncertainty quantification for any model, with error bars that are true.

>>> import uqpen
>>> study = uqpen.load_study("studies/ishigami.toml")  # doctest: +SKIP
>>> tree = uqpen.run(study)  # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from uqpen.archive.read import open_archive
    from uqpen.archive.write import write
    from uqpen.benchmark.compare import compare
    from uqpen.checkpoints.make_archive import make_archive
    from uqpen.core.errors import UqpenError
    from uqpen.figures.page import figure
    from uqpen.report.page import write_report
    from uqpen.study.load import load_study, parse_study
    from uqpen.study.study import Study
    from uqpen.workflow import run

__all__ = [
    "Study",
    "UqpenError",
    "compare",
    "figure",
    "load_study",
    "make_archive",
    "open_archive",
    "parse_study",
    "run",
    "write",
    "write_report",
]

__version__ = "0.1.0"

# Imported when they are asked for, so that the command line starts at once.
_HOMES = {
    "Study": "uqpen.study.study",
    "UqpenError": "uqpen.core.errors",
    "compare": "uqpen.benchmark.compare",
    "figure": "uqpen.figures.page",
    "load_study": "uqpen.study.load",
    "make_archive": "uqpen.checkpoints.make_archive",
    "open_archive": "uqpen.archive.read",
    "parse_study": "uqpen.study.load",
    "run": "uqpen.workflow",
    "write": "uqpen.archive.write",
    "write_report": "uqpen.report.page",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import importlib

    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
