"""Failed runs of a design in a sentence: how many, and for which inputs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.charts.marks import has_interval
from uqpen.core.labels import INPUT
from uqpen.core.status import Status
from uqpen.execution import run_count, status_counts
from uqpen.report.counting import count_text
from uqpen.report.sections.drivers import input_label
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import grouped_number

__all__ = ["missing_count", "missing_run_sentences"]

# An input is named if it is so in a failed run with this probability more than one half.
_CLEAR = 0.25
# Inputs that are named, at the most.
_MOST = 2


def missing_count(view: ArchiveView, design: str) -> int:
    """Return the number of runs without a result at an admissible point."""
    counts = status_counts(view.design(design).runs)
    done = counts[Status.OK] + counts[Status.INADMISSIBLE]
    return int(run_count(view.design(design).runs) - done)


def missing_run_sentences(view: ArchiveView, design: str) -> Iterator[str]:
    """Yield the number of failed and of inadmissible runs, and the inputs of the failed."""
    runs = run_count(view.design(design).runs)
    counts = status_counts(view.design(design).runs)
    missing, excluded = missing_count(view, design), counts[Status.INADMISSIBLE]
    if not missing:
        every = "The only run" if runs == 1 else f"All {grouped_number(runs - excluded)} runs"
        admissible = " at admissible points" * bool(excluded)
        yield f"{every}{admissible} completed."
    else:
        inputs = _associated_inputs(view, design)
        share = f"{grouped_number(missing)} of {grouped_number(runs)}"
        yield f"{share} runs failed{', mainly where ' * bool(inputs)}{inputs}."
        yield (
            "Intervals of probabilities hold even if all of these were beyond a limit, or none; "
            f"all other numbers describe the {count_text(counts[Status.OK], 'completed run')}."
        )
    if excluded:
        were = "was" if excluded == 1 else "were"
        yield f"{count_text(excluded, 'point')} of {grouped_number(runs)} {were} inadmissible."


def _associated_inputs(view: ArchiveView, design: str) -> str:
    """Return the inputs that go with failure, in words; empty if none clearly does."""
    found = view.statistics.failures(design)
    clear = {
        **_associations(found.get("further_out"), "far from its median", ""),
        **_associations(found.get("larger"), "high", "low"),
    }
    strongest = sorted(clear, key=lambda name: -clear[name][0])[:_MOST]
    return " and ".join(f"{input_label(view, name)} is {clear[name][1]}" for name in strongest)


def _associations(
    array: xr.DataArray | None, above: str, below: str
) -> dict[str, tuple[float, str]]:
    """Return the strength and the word of each clear association, by input."""
    found = {}
    for chance in () if array is None else array:
        strength = float(chance.values[0]) - 0.5
        word = above if strength > 0 else below
        if word and abs(strength) >= _CLEAR and _is_known(chance):
            found[str(chance[INPUT].item())] = abs(strength), word
    return found


def _is_known(chance: xr.DataArray) -> bool:
    """Return whether the interval excludes one half; without one, all failed runs lie apart."""
    if not has_interval(chance.values):
        return bool(np.isclose(abs(chance.values[0] - 0.5), 0.5))
    return not chance.values[1] <= 0.5 <= chance.values[2]
