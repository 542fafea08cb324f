"""Published figures: compared with own runs by both noises and the rounding of the print."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy import special

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import SAMPLING, STATUS
from uqpen.core.model import Output
from uqpen.core.quantities import half_last_digit
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count, difference, flag, quantities, quantity, text, validate
from uqpen.core.status import Status
from uqpen.core.units import DIMENSIONLESS
from uqpen.statistics import texts
from uqpen.statistics.estimate import LEVEL, Estimate

if TYPE_CHECKING:
    import xarray as xr

    from uqpen.statistics.analyze import OutputStatistics

MEAN, STD = "mean", "std"


@dataclass(frozen=True)
class PublishedEstimates:
    """Estimates that a publication gives for one output."""

    output: Output
    mean: float | None = quantity(default=None)  # in the output's SI unit
    std: float | None = difference(default=None)  # in the output's SI unit
    # By input: the relative response of the output, dimensionless.
    response: Mapping[str, float] = quantities(unit=DIMENSIONLESS)
    # The input whose contribution to the uncertainty it calls the largest; empty for none.
    largest_contribution: str = ""
    # Half of the last printed digit of the figures that are given as text, in SI units.
    rounding: Mapping[str, float] = field(default_factory=dict, hash=False)
    response_rounding: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        validate(self)

    @property
    def moments(self) -> dict[str, float]:
        """Mean and standard deviation, as far as they are published."""
        moments = {MEAN: self.mean, STD: self.std}
        return {name: value for name, value in moments.items() if value is not None}


@dataclass(frozen=True)
class Reading:
    """Another reading of a publication: changes of the study that compares itself with it."""

    note: str  # what is read otherwise, in words; may be empty
    changes: Mapping[str, Any]  # tables of the study file, merged into those of the study
    # By status of a run that did not complete: values of outputs that stand for it, in SI units.
    lost: Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Publication:
    """Publication, by its reference, with its estimates of some outputs."""

    source: str = text(expected="where the figures stand")
    estimates: tuple[PublishedEstimates, ...] = ()
    # Number of independent runs behind its means and standard deviations; None if not stated.
    runs: int | None = count(minimum=2, default=None)
    magnitudes: bool = flag(default=False)  # whether its responses are without their signs
    # By input: its printed standard deviation over its nominal value.
    uncertainties: Mapping[str, float] = quantities(unit=DIMENSIONLESS)
    uncertainty_rounding: Mapping[str, float] = field(default_factory=dict, hash=False)
    readings: Mapping[str, Reading] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        validate(self)


def printed_rounding(table: Mapping[str, Any], differences: Sequence[str] = ()) -> dict[str, float]:
    """Return half the last digit, in SI units, of each figure of a table that is text.

    A figure that is a plain number is not among them: it may have lost its last zeros.
    """
    return {
        name: half_last_digit(written, difference=name in differences)
        for name, written in table.items()
        if isinstance(written, str)
    }


# Comparison with independent runs.


class Comparison(NamedTuple):
    """Published figure of one output beside that of independent runs."""

    output: str
    figure: str  # "mean" or "std"
    published: float
    found: float
    # Standard errors: of the published figure by its own runs, of that found here; half its digit.
    published_error: float
    found_error: float
    half_digit: float

    @property
    def decimals(self) -> int:
        """Number of decimals that the published figure is known to."""
        return max(0, math.ceil(-math.log10(2 * self.half_digit) - 1e-9)) if self.half_digit else 9

    @property
    def error(self) -> float:
        """Standard deviation of the difference: both noises, and a rounding that is uniform."""
        return math.hypot(self.published_error, self.found_error, self.half_digit / math.sqrt(3))

    @property
    def z(self) -> float:
        """The difference in its standard deviations; infinite if it has none."""
        gap = self.published - self.found
        return gap / self.error if self.error else math.copysign(math.inf, gap) if gap else 0.0


class TableComparison(NamedTuple):
    """All means and standard deviations of a publication beside those of independent runs."""

    figures: tuple[Comparison, ...]
    runs: int  # values behind the figures found here
    p: float  # probability of so large a largest |z|, by chance alone; 1 without a figure


# Normal vectors by which the largest of several correlated figures is judged.
VECTORS = 100_000

# A skewness that moves no figure by its last digit, and the least probability that is told from 0.
_NO_SKEWNESS, _LEAST = 1e-3, 1e-300


def compare_moments(
    publication: Publication,
    runs: xr.Dataset,
    rng: np.random.Generator,
    lost: Mapping[str, Mapping[str, float]] | None = None,
) -> TableComparison:
    """Compare published means and standard deviations with those of independent runs.

    Parameters
    ----------
    publication : Publication
        With the number of runs behind its figures; without it, these are exact but for rounding.
    runs : Dataset
        Runs of a design whose points are independent.
    rng : Generator
        For the distribution of the largest difference.
    lost : mapping of str to mapping, optional
        By the meaning of a status: values of outputs that stand for its runs, in SI units.

    Notes
    -----
    The standard errors are those of the influence functions, y - m of the mean and
    ((y - m)² - s²) / (2 s) of the standard deviation, whose correlations over the runs are those of
    the figures: outputs of the same run, and a mean with its standard deviation, go together. The
    probability is that of the largest absolute value of a normal vector with these correlations.
    Each z is first made a normal one, see `_normal_score`: a standard deviation of a heavy tail is
    skewed over samples, and its noise is known from few values.
    """
    figures: list[Comparison] = []
    scores: list[float] = []
    influences: list[FloatArray] = []
    size = 0
    for estimates in publication.estimates:
        name = estimates.output.name
        if not estimates.moments or name not in runs:
            continue
        values = _values_with(runs, name, lost or {})
        present = np.isfinite(values)
        size = int(present.sum())
        if size < 2:
            continue
        mean, std = float(values[present].mean()), float(values[present].std(ddof=1))
        away = np.where(present, values - mean, 0.0)
        of_std = (away**2 - np.where(present, std**2, 0.0)) / (2 * std) if std else 0.0 * away
        for figure, found, influence in ((MEAN, mean, away), (STD, std, of_std)):
            if figure not in estimates.moments:
                continue
            square = influence**2
            spread = math.sqrt(float(square.sum()) / size)
            behind = math.inf if publication.runs is None else publication.runs
            figures.append(
                Comparison(
                    name,
                    figure,
                    estimates.moments[figure],
                    found,
                    spread / math.sqrt(behind),
                    spread / math.sqrt(size),
                    estimates.rounding.get(figure, 0.0),
                )
            )
            influences.append(influence)
            third, fourth = float((square * influence).sum()), float((square**2).sum())
            scores.append(_normal_score(figures[-1], spread, size, third / size, fourth / size))
    p = _largest_probability(figures, scores, influences, rng)
    return TableComparison(tuple(figures), size, p)


def _normal_score(
    figure: Comparison, spread: float, size: int, third: float, fourth: float
) -> float:
    """Return the normal deviation that is as improbable as z of a figure.

    The difference has the skewness that follows from the third moment of the influence function,
    and a gamma distribution, where that makes it more probable. Its noise has the degrees of
    freedom that follow from the fourth moment (by Satterthwaite), and Student's t.
    """
    z = figure.z
    noise = math.hypot(figure.published_error, figure.found_error)
    if not noise:
        return z
    # A third cumulant of a mean over N values is that of a value over N².
    cumulant = third * (figure.published_error**4 - figure.found_error**4) / spread**4
    skewness = cumulant / figure.error**3
    if abs(skewness) > _NO_SKEWNESS:
        side, shape = math.copysign(1.0, skewness), 4 / skewness**2
        place = max(0.0, shape + side * z * math.sqrt(shape))
        below, above = special.gammainc(shape, place), special.gammaincc(shape, place)
        skewed = side * _deviation(below, above)
        # A skewness that is itself known from few values may excuse a figure, not accuse it.
        z = min(z, skewed, key=abs)
    scatter = max(fourth / spread**4 - 1, 1 / size)  # of the squares of the influence function
    freedom = 2 * size / scatter * (figure.error / noise) ** 4
    tail = special.stdtr(freedom, -abs(z))
    return math.copysign(_deviation(1 - tail, tail), z)


def _deviation(below: float, above: float) -> float:
    """Return the normal deviation with these probabilities below and above it."""
    tail = float(special.ndtri(max(min(below, above), _LEAST)))
    return tail if below < above else -tail


def _values_with(
    runs: xr.Dataset, name: str, lost: Mapping[str, Mapping[str, float]]
) -> FloatArray:
    """Return the values of an output, NaN where a run has none and no value stands for it."""
    status = runs[STATUS].values
    values = np.where(status == Status.OK, runs[name].values, np.nan)
    for each in Status:
        if name in lost.get(each.meaning, {}):
            values[status == each] = lost[each.meaning][name]
    return values


def _largest_probability(
    figures: Sequence[Comparison],
    scores: Sequence[float],
    influences: Sequence[FloatArray],
    rng: np.random.Generator,
) -> float:
    """Return the probability that the largest of correlated normal scores is as large as found."""
    if not figures:
        return 1.0
    largest = max(map(abs, scores))
    errors = np.array([each.error for each in figures])
    if len(figures) == 1 or not errors.all():
        return min(1.0, len(figures) * float(special.erfc(largest / math.sqrt(2))))
    noise = np.array([math.hypot(each.published_error, each.found_error) for each in figures])
    lengths = np.array([math.sqrt(float(each @ each)) for each in influences])
    units = np.array(influences) / np.where(lengths, lengths, 1.0)[:, None]
    correlation = units @ units.T * np.outer(noise / errors, noise / errors)
    np.fill_diagonal(correlation, 1.0)
    values, vectors = np.linalg.eigh(correlation)
    root = vectors * np.sqrt(np.clip(values, 0.0, None))
    drawn = rng.standard_normal((VECTORS, len(figures))) @ root.T
    return float((np.abs(drawn).max(axis=1) >= largest).mean())


def independent_runs(runs: Mapping[str, xr.Dataset]) -> xr.Dataset | None:
    """Return the runs of the first design whose points are independent; None without one."""
    return next((each for each in runs.values() if is_independent(each)), None)


def is_independent(runs: xr.Dataset) -> bool:
    """Check that each point of some runs was drawn by itself."""
    return runs.attrs.get(SAMPLING) == Sampling.INDEPENDENT


# What an archive keeps.


def published_estimates(
    publication: Publication, runs: Mapping[str, xr.Dataset], level: float = LEVEL
) -> dict[str, OutputStatistics]:
    """Return a publication's estimates by output and statistic.

    A mean or a standard deviation has an interval where the publication states the number of its
    runs: by the scatter that independent runs show here, and its rounding. That of a response is
    its rounding alone.
    """
    from uqpen.statistics.sensitivity.input_measures import input_array

    reason = texts.PUBLISHED.format(source=publication.source)
    own = independent_runs(runs) if publication.runs else None
    compared: Sequence[Comparison] = ()
    if own is not None:
        compared = compare_moments(publication, own, np.random.default_rng(0)).figures
    errors = {(each.output, each.figure): each for each in compared}
    factor = float(special.ndtri((1 + level) / 2))

    def moment_estimate(name: str, figure: str, value: float) -> Estimate:
        each = errors.get((name, figure))
        if each is None:
            return Estimate.without_bounds(value, reason)
        half = factor * math.hypot(each.published_error, each.half_digit / math.sqrt(3))
        method = texts.PUBLISHED_NOISE.format(runs=publication.runs)
        return Estimate(value, value - half, value + half, method, "nominal", reason)

    def response_estimate(value: float, half: float | None) -> Estimate:
        if half is None:
            return Estimate.without_bounds(value, reason)
        ends = value - half, value + half
        return Estimate(value, *ends, texts.PUBLISHED_ROUNDING, "conservative", reason)

    found: dict[str, OutputStatistics] = {}
    for estimates in publication.estimates:
        name, title = estimates.output.name, estimates.output.title
        found[name] = {
            moment: moment_estimate(name, moment, value).to_array(
                units=estimates.output.unit, long_name=f"{moment} of {title}, published"
            )
            for moment, value in estimates.moments.items()
        }
        if estimates.response:
            found[name]["response"] = input_array(
                [
                    response_estimate(value, estimates.response_rounding.get(entry))
                    for entry, value in estimates.response.items()
                ],
                [*estimates.response],
                f"relative response of {title}, published",
            )
    return found
