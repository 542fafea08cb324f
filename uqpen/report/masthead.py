"""What stands at the head of a page: what it is of, in a few words."""

from __future__ import annotations

from collections.abc import Iterator

import xarray as xr

from uqpen.archive.read import group, models_in, names_in
from uqpen.labels import BUDGET, HEAD_TO_HEAD, KIND, METHODS, RUN, RUNS, SOURCE
from uqpen.report.counting import counted

__all__ = ["facts", "heading"]

# Of a title, or another text at the head.
_LONGEST = 1000


def heading(tree: xr.DataTree) -> str:
    """The title of an archive's page."""
    title = _cut(str(tree.attrs.get("title", "")).strip()) or "A study without a title"
    return f"{title}: methods head to head" if _is_comparison(tree) else title


def facts(tree: xr.DataTree) -> list[str]:
    """Which study, which model, how many runs, and what made them."""
    return [_cut(text) for text in _facts(tree) if text.strip()]


def _facts(tree: xr.DataTree) -> Iterator[str]:
    if name := str(tree.attrs.get("study_name", "")):
        yield f"study {name}"
    yield from _methods(tree) if _is_comparison(tree) else _runs(tree)
    if version := str(tree.attrs.get("version_uqpen", "")):
        yield f"uqpen {version}"


def _runs(tree: xr.DataTree) -> Iterator[str]:
    """The models, and the runs that all designs made of each."""
    models = models_in(tree)
    if len(models) > 1:
        yield f"models {', '.join(models)}"
    elif name := str(tree.attrs.get("model_name", "")):
        yield f"model {name}"
    first = next(iter(models.values()))
    designs = names_in(first, RUNS)
    runs = sum(group(first, RUNS, design).sizes[RUN] for design in designs)
    each = " of each" * (len(models) > 1)
    yield f"{counted(runs, 'run')}{each} by {counted(len(designs), 'design')}"


def _methods(tree: xr.DataTree) -> Iterator[str]:
    """How many methods there are, at how many budgets, how often each."""
    methods = group(tree, METHODS)
    sources = dict.fromkeys(methods[SOURCE].values.tolist())
    budgets = counted(methods.sizes[BUDGET], "budget")
    yield f"{counted(len(sources), 'method')} at {budgets}, {methods.attrs['repeats']} times each"


def _cut(text: str) -> str:
    """A text that a browser can set: of a megabyte it would make minutes of work."""
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


def _is_comparison(tree: xr.DataTree) -> bool:
    return bool(tree.attrs.get(KIND) == HEAD_TO_HEAD)
