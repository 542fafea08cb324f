"""Agreement of the study's other designs with the leading one, in a sentence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from uqpen.report.sections.quoted_statistics import QuotedStatistic, other_design_estimates
from uqpen.results.digits import count_text

__all__ = ["agreement_text"]

# Quantities that are compared.
_MOST = 3


def agreement_text(quantities: Sequence[QuotedStatistic], design: str) -> str:
    """Return whether other designs agree on the first quantities; empty if there are none.

    Two agree if their intervals overlap.
    """
    parts: list[str] = []
    apart: dict[str, list[str]] = {}
    by: set[str] = set()
    output = ""
    for quantity in quantities[:_MOST]:
        own, others = quantity.leading_estimate(design), other_design_estimates(quantity, design)
        if own is None or not others:
            continue
        label = quantity.label if quantity.output == output else quantity.heading
        output, by = quantity.output, by | set(others)
        parts.append(f"{label}: {_range_text(quantity, own, others)}")
        if far := [name for name, each in others.items() if not _overlap(own, each)]:
            apart[label] = far
    if not parts:
        return ""
    few = count_text(len(by), "other design")
    verdict = f"Yes, {few} within their intervals" if not apart else "Not in all"
    lines = [f"{verdict}. {'; '.join(parts)}."]
    lines += [
        f"{label}: the interval of {', '.join(far)} lies apart." for label, far in apart.items()
    ]
    return " ".join(lines)


def _overlap(one: xr.DataArray, other: xr.DataArray) -> bool:
    """Return whether two intervals overlap, as far as they have ends."""
    (_, low, high), (_, lower, upper) = one.values.tolist(), other.values.tolist()
    return not (low > upper or lower > high)


def _range_text(
    quantity: QuotedStatistic, own: xr.DataArray, others: dict[str, xr.DataArray]
) -> str:
    """Return the smallest and the largest estimate, in the digits of the leading design's."""
    values = [float(quantity.bounds(array)[0]) for array in (own, *others.values())]
    *_, lowest, highest = quantity.texts(own, float(np.min(values)), float(np.max(values)))
    return lowest if lowest == highest else f"{lowest} to {highest}"
