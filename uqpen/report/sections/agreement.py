"""Agreement of a study's estimates with other designs and with published ones, in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from uqpen.report.sections.quoted_statistics import (
    QuotedStatistic,
    moments,
    no_break,
    other_design_estimates,
)
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import count_text, estimate_text, number_text
from uqpen.results.input_measures import input_label, input_ranking
from uqpen.results.texts import capitalized, plain_text

__all__ = ["agreement_sentences", "published_sentences"]

# Quantities that are compared.
_MOST_COMPARED = 3


def published_sentences(view: ArchiveView, design: str) -> Iterator[str]:
    """Yield what agrees and what differs: a sentence on each output of each publication."""
    for publication in view.statistics.publications:
        texts = []
        for output in view.numeric_outputs:
            parts = []
            for quantity in moments(view, output):
                samples = dict.fromkeys((design, *quantity.view.sample_designs))
                found = [each for name in samples if (each := quantity.estimate(name)) is not None]
                bounded = [each for each in found if np.isfinite(each.values).all()]
                there, here = quantity.estimate(publication), next(iter((*bounded, *found)), None)
                if there is not None and here is not None:
                    parts.append(_comparison(quantity, there, here))
            parts += _largest_contribution(view, output, publication)
            if parts:
                texts.append(f"{capitalized(output_title(view, output))}: {'; '.join(parts)}.")
        if texts:
            citation = plain_text(view.statistics.citation(publication) or publication, 80)
            yield f"Against {citation}, its value first."
            yield from texts


def _comparison(quantity: QuotedStatistic, there: xr.DataArray, here: xr.DataArray) -> str:
    label = quantity.label
    published = float(quantity.bounds(there)[0])
    bounds = quantity.bounds(here).tolist()
    unit = quantity.unit_text
    own = no_break(f"{estimate_text(*bounds)}{unit}")
    stated = f"{no_break(f'{number_text(published)}{unit}')}, {own}"
    if not np.isfinite(bounds).all():
        return f"{label} uncertain ({stated} without an interval)"
    _, lower, upper = bounds
    return f"{label} {'agrees' if lower <= published <= upper else 'differs'} ({stated})"


def _largest_contribution(view: ArchiveView, output: str, publication: str) -> Iterator[str]:
    named, ranking = view.statistics.largest_contribution(publication, output), None
    if named:
        ranking = input_ranking(view, output)
    if ranking is None:
        return
    here = next(iter(ranking.estimates))
    if here == named:
        yield f"the largest contribution is the same ({input_label(view, named)})"
        return
    own, other = (
        no_break(estimate_text(*ranking.estimates[name].values.tolist()))
        if name in ranking.estimates
        else "no estimate"
        for name in (here, named)
    )
    yield (
        f"the largest contribution differs ({input_label(view, named)}, which has {other} here; "
        f"{input_label(view, here)} has {own})"
    )


def agreement_sentences(quantities: Sequence[QuotedStatistic], design: str) -> Iterator[str]:
    """Yield whether other designs agree on the first quantities, if there are any.

    Two agree if their intervals overlap.
    """
    parts: list[str] = []
    apart: dict[str, list[str]] = {}
    by: set[str] = set()
    output = ""
    for quantity in quantities[:_MOST_COMPARED]:
        own, others = quantity.leading_estimate(design), other_design_estimates(quantity, design)
        if own is None or not others:
            continue
        label = quantity.label if quantity.output == output else quantity.heading
        output, by = quantity.output, by | set(others)
        parts.append(f"{label}: {_range_text(quantity, own, others)}")
        if far := [name for name, each in others.items() if not _overlap(own, each)]:
            apart[label] = far
    if parts:
        few = count_text(len(by), "other design")
        yield "Not in all." if apart else f"Yes, {few} within their intervals."
        yield f"{'; '.join(parts)}."
    for label, far in apart.items():
        yield f"{label}: the interval of {', '.join(far)} lies apart."


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
