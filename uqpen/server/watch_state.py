"""Content of the page of a running study, as texts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import xarray as xr

from uqpen.core.labels import RUN
from uqpen.core.status import STATUS_TEXT
from uqpen.results.digits import grouped_number
from uqpen.results.failed_runs import failure_causes
from uqpen.results.output_tables import statistics_tables
from uqpen.results.progress_texts import duration_text, runs_text, step_text
from uqpen.results.table import OutputTable
from uqpen.workflow.running_results import RunningResults

__all__ = ["watch_state"]

# Causes that are shown; the archive has them all.
_MOST_CAUSES = 20


def watch_state(running: RunningResults) -> dict[str, Any]:
    """Return the state of a running study, for its page.

    Returns
    -------
    dict
        Lists and dicts of texts and whole numbers, which JSON can hold: ``title``, ``step``,
        ``runs``, ``done`` of ``total``, ``designs``, ``tables``, ``causes``.
    """
    progress, results = running.state, running.results
    rate = progress.runs_per_second
    runs = runs_text(progress)
    if rate and not progress.step:
        runs += f"; {_rate_text(rate)}"
    finished = [each for runs in results.finished.values() for each in runs]
    causes = failure_causes(finished)
    return {
        "title": str(results.tree.attrs["title"]),
        "step": step_text(progress),
        "runs": runs,
        "done": max(progress.step_number - 1, 0) if progress.step else progress.done,
        "total": progress.steps if progress.step else progress.runs,
        "designs": list(_design_rows(results.finished, results.reasons)),
        "tables": [_table(each) for each in statistics_tables(results.tree)],
        "causes": [
            {
                "text": cause.reason,
                "runs": grouped_number(cause.runs),
                "status": STATUS_TEXT[cause.status],
                "example": cause.example or cause.reason,
            }
            for cause in causes[:_MOST_CAUSES]
        ],
    }


def _design_rows(
    finished: Mapping[str, Sequence[xr.Dataset]], reasons: Mapping[str, str]
) -> Iterator[tuple[str, str, str]]:
    """Yield the name of each design, its finished runs, and why it has no estimates yet."""
    for name, runs in finished.items():
        count = sum(each.sizes[RUN] for each in runs)
        why = f"none: {reasons[name]}" if name in reasons else "below"
        yield name, grouped_number(count), why


def _table(table: OutputTable) -> dict[str, Any]:
    return {
        "title": table.title,
        "columns": table.columns,
        "rows": [[label, *cells] for label, cells in table.rows],
        "notes": table.notes,
    }


def _rate_text(rate: float) -> str:
    """Return a rate of runs in words.

    >>> _rate_text(345.6), _rate_text(3.14159), _rate_text(0.01)
    ('346 runs a second', '3.1 runs a second', 'a run takes about 100 s')
    """
    if rate < 1:
        return f"a run takes about {duration_text(1 / rate)}"
    shown = grouped_number(round(rate)) if rate >= 10 else f"{rate:.1f}"
    return f"{shown} runs a second"
