"""Repeats of a model with noise: how much is noise, and what more of them or more points buy."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from uqpen.archive.read import read_group
from uqpen.core.labels import REPEATS, RUNS_SPENT, STATISTICS_GROUP
from uqpen.core.units import scale
from uqpen.results.archive_view import ArchiveView, output_title
from uqpen.results.digits import (
    estimate_text,
    grouped_number,
    number_text,
    percent_text,
    percent_texts,
)
from uqpen.results.table import first_runs, shown_unit
from uqpen.results.texts import unit_suffix

# More repeats at a point are never advised: points are then too few.
_MOST_REPEATS = 20


class RepeatWidths(NamedTuple):
    """Standard errors that some runs leave, if noise and mean are about normal."""

    repeats: int
    points: int
    mean: float  # in standard deviations of the output
    noise_share: float  # of the variance
    of_mean: float  # of the standard deviation of the mean given the inputs, relative to it


def best_repeats(noise_share: float) -> int:
    """Return how many runs at each point make the noise share known best, for a number of runs.

    >>> [best_repeats(share) for share in (0.1, 0.5, 0.75, 0.9)]
    [2, 3, 5, 11]
    """
    if noise_share >= 1 - 1 / _MOST_REPEATS:
        return _MOST_REPEATS
    return max(round(1 + 1 / (1 - noise_share)), 2)


def repeat_widths(noise_share: float, runs: int, repeats: int) -> RepeatWidths:
    """Return the errors of a number of runs with some repeats at each point.

    Sums of squares between and within points are those of an analysis of variance.
    """
    points, mean = runs // repeats, 1 - noise_share
    between = mean + noise_share / repeats
    of_mean = share = math.inf
    if repeats > 1 and points > 1:
        share = noise_share * between * math.sqrt(2 * repeats / (points * (repeats - 1)))
        within = (noise_share / repeats) ** 2 / (repeats - 1)
        of_mean = math.sqrt(2 * (between**2 + within) / points) / (2 * mean) if mean > 0 else share
    return RepeatWidths(repeats, points, math.sqrt(between / max(points, 1)), share, of_mean)


# Numbers of runs for which widths are shown where no target says how many are needed.
_RUNS = 1000


def noise_plans(view: ArchiveView, runs: int) -> Iterator[tuple[str, list[tuple[str, ...]], str]]:
    """Yield what a number of runs says by several repeats, for each output with a noise share.

    It is a sentence, the head and the rows of a table of widths, and an advice.
    """
    runs = runs or _RUNS
    for output in view.numeric_outputs:
        shares = view.estimates(output, "noise_share")
        share = next((float(each.values[0]) for each in shares.values()), math.nan)
        if not math.isfinite(share):
            continue
        best = best_repeats(share)
        of_mean = "sd of the mean given the inputs, relative"
        rows: list[tuple[str, ...]] = [
            ("runs at a point", "points", "mean / sd", "noise share", of_mean)
        ]
        for repeats in sorted({1, 2, 3, 5, best}):
            found = repeat_widths(share, runs, repeats)
            # Two standard errors are about the half-width of an interval of 95 %.
            halves = [2 * each for each in (found.mean, found.noise_share, found.of_mean)]
            cells = (
                f"± {number_text(each, 2)}" if math.isfinite(each) else "unknown" for each in halves
            )
            rows.append((str(repeats), grouped_number(found.points), *cells))
        yield (
            next(noise_sentences(view, output), f"{output}: the noise share has no interval."),
            rows,
            f"With {grouped_number(runs)} runs in all. Means, quantiles and indices of the whole "
            "output are known best with one run at each point, indices of the mean given the "
            f"inputs with {2 if share <= 0.5 else 3}, the noise share with {best}.",
        )


def noise_sentences(view: ArchiveView, output: str) -> Iterator[str]:
    """Yield how much of the variance of an output is noise, and what more runs would buy."""
    found = view.estimates(output, "noise_share")
    known = {name: each for name, each in found.items() if math.isfinite(each.values[1])}
    if not known:
        return
    source = min(known, key=lambda each: float(np.ptp(known[each].values[1:])))
    # As that of an index, an estimate may lie beyond the ends that there are.
    within = np.clip(known[source].values, 0, 1).tolist()
    value = within[0]
    estimate, lower, upper = percent_texts(*within)
    text = f"{estimate} ({lower} to {upper}) of the variance of {output_title(view, output)}"
    deviation = view.statistics.get(source, output, "noise_std")
    about = ""
    if deviation is not None:
        unit = shown_unit(first_runs(view.tree)[output].attrs)
        shown = [scale(unit).difference_from_si(each) for each in deviation.values.tolist()]
        about = f", with a standard deviation of {estimate_text(*shown)}{unit_suffix(unit)}"
    yield f"Noise of the model is {text}: runs at the same inputs differ{about}."
    attributes = read_group(view.tree, STATISTICS_GROUP, source).attrs
    if not (repeats := int(attributes.get(REPEATS, 0))):
        return
    runs = int(attributes[RUNS_SPENT])
    now, more = (
        repeat_widths(value, runs * each // repeats, each) for each in (repeats, 2 * repeats)
    )
    narrower = [1 - math.sqrt(0.5), 1 - more.mean / now.mean]
    as_points, as_repeats = (percent_text(round(each, 2)) for each in narrower)
    yield (
        f"As many runs again would make the interval of its mean narrower by {as_points} as "
        f"further points, and by {as_repeats} as further repeats."
    )
    if (best := best_repeats(value)) != repeats:
        yield f"The share itself is known best with {best} runs at each point."
