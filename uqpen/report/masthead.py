"""Head of a page: its title, the facts below it, and the reference that copied texts carry."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

import xarray as xr

from uqpen.archive.read import group_names, is_benchmark, model_trees, read_group
from uqpen.core.labels import CONTENT, RUNS
from uqpen.execution import run_count
from uqpen.results.digits import count_text
from uqpen.results.method_comparison import MethodComparison
from uqpen.results.texts import plain_text
from uqpen.study import SECTIONS

__all__ = ["page_facts", "page_heading", "page_reference"]

# Head of a page: its subject, in a few words.

# Most characters of a title, or of another text at the head.
_LONGEST = 1000


def page_heading(tree: xr.DataTree) -> str:
    """The title of an archive's page."""
    title = _cut_text(str(tree.attrs.get("title", "")).strip()) or "A study without a title"
    return f"{title}: benchmark of methods" if is_benchmark(tree) else title


def page_facts(tree: xr.DataTree) -> list[str]:
    """Study, model, number of runs, and version of uqpen."""
    return [_cut_text(text) for text in _all_facts(tree) if text.strip()]


def _all_facts(tree: xr.DataTree) -> Iterator[str]:
    if name := str(tree.attrs.get("study_name", "")):
        yield f"study {name}"
    yield from _methods(tree) if is_benchmark(tree) else _runs(tree)
    for section in SECTIONS.values():
        if section.fact and (value := str(tree.attrs.get(section.attribute, ""))):
            yield section.fact.replace("{value}", value)
    if version := str(tree.attrs.get("version_uqpen", "")):
        yield f"uqpen {version}"


def _runs(tree: xr.DataTree) -> Iterator[str]:
    models = model_trees(tree)
    if len(models) > 1:
        yield f"models {', '.join(models)}"
    elif name := str(tree.attrs.get("model_name", "")):
        yield f"model {name}"
    first = next(iter(models.values()))
    designs = group_names(first, RUNS)
    runs = sum(run_count(read_group(first, RUNS, design)) for design in designs)
    each = " of each" * (len(models) > 1)
    yield f"{count_text(runs, 'run')}{each} by {count_text(len(designs), 'design')}"


def _methods(tree: xr.DataTree) -> Iterator[str]:
    comparison = MethodComparison.of(tree)
    sources = count_text(len({method.source for method in comparison.methods}), "method")
    budgets = count_text(len(comparison.budgets), "budget")
    yield f"{sources} at {budgets}, {comparison.repeats} times each"


def _cut_text(text: str) -> str:
    """Shorten a text; a browser would need minutes for a megabyte."""
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


# Reference to an archive, which goes along with what is copied from its page.

# Digits of a hash: enough to tell archives apart.
_DIGITS = 16


def page_reference(tree: xr.DataTree) -> str:
    """Title, study, hash of the archive, and version of uqpen.

    The hash is the SHA-256 of the record ``content_sha256``, which has the hash of every group.
    """
    return plain_text("; ".join(_parts(tree)), 400)


def _parts(tree: xr.DataTree) -> Iterator[str]:
    yield page_heading(tree)
    if name := str(tree.attrs.get("study_name", "")):
        yield f"study {name}"
    if record := tree.attrs.get(CONTENT):
        yield f"archive sha256 {hashlib.sha256(str(record).encode()).hexdigest()[:_DIGITS]}"
    if version := str(tree.attrs.get("version_uqpen", "")):
        yield f"uqpen {version}"
