"""Principal components of curves that end: up to the place that all reach, or scaled by the end."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from uqpen.core.arrays import FloatArray, IntArray
from uqpen.core.model import Dimension, Output
from uqpen.surrogates.principal_components import PrincipalComponents, share_text
from uqpen.surrogates.training import size_problem

# Curves of different lengths have no components. They are brought to one grid, in one of two ways.
# Up to the place that all training curves reach, they are taken as they are. Or each is taken along
# the share of its own length, and its end is one number more. A curve of features that move with
# its end is simple along the scaled coordinate, one of features at fixed places along its own.
#
# A curve exists at places, so its end is known to a step of the grid.

# Behind the name of a curve: its end, as a number that a surrogate fits and predicts.
END = "end"

_SCALED = "scaled_"
_COMMON, _HAS_END, _CHOICE = "common_places", "end_varies", "choice"

# Share of the variance, 0.3 % of the standard deviation, below which scaled curves are good enough:
# the rest of the curve is worth more than a smaller error.
_NEGLIGIBLE = 1e-5

_SAME_END = "all training curves end at the same place"
_TOO_SHORT = "some training curves have fewer than 3 places, too few to scale"


@dataclass(frozen=True, eq=False)
class EndingComponents(PrincipalComponents):
    """Principal components of curves that end; the last score is the end, where it varies."""

    dimension: Dimension
    common_places: int  # number of places that all training curves have
    is_scaled: bool  # whether the components are along shares of the length of each curve
    has_end: bool  # whether the end varies, and is a score
    choice: str = ""  # why this way and not the other one, as a clause
    left: float = math.nan  # share of the variance left at runs left out; NaN if unknown

    @classmethod
    def of_curves(
        cls,
        output: Output,
        values: FloatArray,
        wanted: float,
        run_weights: FloatArray | None,
        *,
        is_scaled: bool,
    ) -> EndingComponents | str:
        """Find the components of curves, shape (run, place), NaN after their ends.

        The result is the reason where that is not possible.
        """
        (dimension,) = output.dims
        counts = _counts(values)
        common_places = int(counts.min())
        has_end = bool((counts != common_places).any())
        if is_scaled and common_places < 3:
            return _TOO_SHORT
        if is_scaled and not has_end:
            return _SAME_END
        on_grid = _on_grid(values, dimension, common_places, is_scaled=is_scaled)
        if (on_grid == on_grid[0]).all():
            return f"it does not vary up to {_place_text(dimension, common_places)}"
        if problem := size_problem(on_grid):
            return problem
        weights = _grid(dimension, common_places, is_scaled=is_scaled).weights
        found = PrincipalComponents.of_runs(on_grid, weights, wanted, run_weights)
        return cls(
            **vars(found),
            dimension=dimension,
            common_places=common_places,
            is_scaled=is_scaled,
            has_end=has_end,
        )

    def left_in_common(self, scores: FloatArray, truth: FloatArray) -> float:
        """Return the share of the variance that predicted scores leave, up to the common reach."""
        kept = slice(self.common_places)
        errors = (self.fields(scores, is_cut=False)[:, kept] - truth[:, kept]) ** 2
        weights = _grid(self.dimension, self.common_places, is_scaled=False).weights
        with np.errstate(all="ignore"):
            variance = weights @ truth[:, kept].var(axis=0, ddof=1)
            return float(weights @ errors.mean(axis=0) / variance)

    @property
    def places(self) -> FloatArray:
        """The coordinates of a whole curve, shape (place,)."""
        return np.array(self.dimension.values)

    @property
    def place_weights(self) -> FloatArray:
        """Weight of each place in a mean over a whole curve."""
        return self.dimension.weights

    @property
    def last_common_text(self) -> str:
        """The last place that all training curves have."""
        return _place_text(self.dimension, self.common_places)

    @property
    def beyond_text(self) -> str:
        """Reason why nothing is estimated beyond the components."""
        return f"some training curves end after {self.last_common_text}, and the fit ends there"

    @property
    def text(self) -> str:
        """Clause on the way that the curves were taken, and why."""
        way = f"along {self.dimension.title} scaled by the end of each curve"
        if not self.is_scaled:
            way = f"up to {self.last_common_text}, which all training curves reach"
        return f"; {way}{self.choice}"

    def names(self, output: str) -> list[str]:
        """Return the names of the scores as outputs; the last is the end."""
        return [*super().names(output), *[f"{output}.{END}"] * self.has_end]

    def score_outputs(self, output: Output) -> Iterator[Output]:
        """Yield the scores as outputs."""
        yield from super().score_outputs(output)
        if not self.has_end:
            return
        title = f"last {self.dimension.title} of {output.title}"
        name, shown = self.names(output.name)[-1], self.dimension.display_unit
        yield Output(name, self.dimension.unit, title, shown)

    def scores(self, values: FloatArray) -> FloatArray:
        """Return the scores of some curves, shape (run, place), and their ends as the last one."""
        on_grid = _on_grid(values, self.dimension, self.common_places, is_scaled=self.is_scaled)
        scores = super().scores(on_grid)
        if not self.has_end:
            return scores
        return np.column_stack([scores, self.places[_counts(values) - 1]])

    def fields(self, scores: FloatArray, *, is_cut: bool = True) -> FloatArray:
        """Return whole curves, shape (run, place), from their scores and ends.

        They are NaN where nothing is known, and after the place that is nearest to the end; if not
        `is_cut`, the last value of a scaled curve stands there.
        """
        if self.is_scaled:
            return self.curves_at(scores, slice(None), is_cut=is_cut)
        return self._padded(self.sums(scores[:, : self.count]))

    def curves_at(self, scores: FloatArray, places: slice, *, is_cut: bool = True) -> FloatArray:
        """Return scaled curves at some places, shape (run, place)."""
        found = [values for values, *_ in self._at_places(scores, places, is_cut=is_cut)]
        return np.column_stack(found)

    def field_variances(self, scores: FloatArray, deviations: FloatArray) -> FloatArray:
        """Return variances of predicted curves, shape (run, place), from those of the scores.

        That of the end counts by the slope of the curve.
        """
        if not self.is_scaled:
            own = slice(self.count)
            return self._padded(super().field_variances(scores[:, own], deviations[:, own]))
        found = []
        for values, truncated, components, slope in self._at_places(scores, slice(None)):
            variances = truncated + (slope * deviations[:, -1]) ** 2
            for deviation, component in zip(deviations.T, components, strict=False):
                variances = variances + deviation**2 * component**2
            found.append(np.where(np.isnan(values), np.nan, variances))
        return np.column_stack(found)

    def _padded(self, values: FloatArray) -> FloatArray:
        """Return values on the grid, shape (…, grid), along a whole curve."""
        width = [(0, 0)] * (values.ndim - 1) + [(0, len(self.places) - values.shape[-1])]
        return np.pad(values, width, constant_values=np.nan)

    def _at_places(
        self, scores: FloatArray, places: slice, *, is_cut: bool = True
    ) -> Iterator[tuple[FloatArray, FloatArray, list[FloatArray], FloatArray]]:
        """Yield scaled curves place by place, each of shape (run,).

        They are the values, the variance that the components leave, the components, and the change
        of the values with the end.
        """
        every, ends = self.places, scores[:, -1]
        grid = np.array(_grid(self.dimension, self.common_places, is_scaled=True).values)
        length = ends - every[0]
        nearest = np.searchsorted((every[:-1] + every[1:]) / 2, ends)
        for position in range(len(every))[places]:
            with np.errstate(divide="ignore", invalid="ignore"):
                share = (every[position] - every[0]) / length
            share = np.where(length > 0, np.minimum(share, 1.0), 0.0 if position == 0 else 1.0)
            at = np.clip(np.searchsorted(grid, share, side="right") - 1, 0, len(grid) - 2)
            step = grid[at + 1] - grid[at]
            part = (share - grid[at]) / step
            values, truncated = (_between(each, at, part) for each in (self.mean, self.truncated))
            components = [_between(each, at, part) for each in self.components]
            slope = (self.mean[at + 1] - self.mean[at]) / step
            for score, component, parts in zip(scores.T, self.components, components, strict=False):
                values = values + score * parts
                slope = slope + score * (component[at + 1] - component[at]) / step
            with np.errstate(divide="ignore", invalid="ignore"):
                change = np.where(length > 0, slope * share / length, 0.0)
            if is_cut:
                values = np.where(nearest >= position, values, np.nan)
            yield values, truncated, components, change

    # Group of an archive: along the whole dimension, or along the scaled one.

    def archived(self, values: FloatArray) -> FloatArray:
        """Return values on the grid as an archive has them, along `archived_dims`."""
        return values if self.is_scaled else self._padded(values)

    def archived_dims(self, output: Output) -> tuple[Dimension, ...]:
        """Return the dimension of the components in an archive."""
        return (
            (_grid(self.dimension, self.common_places, is_scaled=True),)
            if self.is_scaled
            else output.dims
        )

    def attributes(self) -> dict[str, Any]:
        """Return what an archive says of the way."""
        return {_COMMON: self.common_places, _HAS_END: int(self.has_end), _CHOICE: self.choice}

    @staticmethod
    def is_described(attributes: Mapping[Any, Any]) -> bool:
        """Check that a group of an archive has the components of curves that end."""
        return _COMMON in attributes

    @classmethod
    def restored(
        cls,
        parts: PrincipalComponents,
        attributes: Mapping[Any, Any],
        along: Dimension,
        every: Iterable[Dimension],
    ) -> tuple[EndingComponents, tuple[Dimension]]:
        """Return components of a group of an archive, and the dimension of the whole curves."""
        common_places, is_scaled = int(attributes[_COMMON]), along.name.startswith(_SCALED)
        whole = next(each for each in every if not is_scaled or each.name != along.name)
        found = cls(
            **vars(parts.at(slice(None) if is_scaled else slice(common_places))),
            dimension=whole,
            common_places=common_places,
            is_scaled=is_scaled,
            has_end=bool(attributes[_HAS_END]),
            choice=str(attributes[_CHOICE]),
        )
        return found, (whole,)


def best_way(
    common: PrincipalComponents | str,
    scaled: PrincipalComponents | str,
    of_common: tuple[float, float] | None,
    of_scaled: tuple[float, float] | None,
) -> PrincipalComponents | str:
    """Return the components of the better way for a curve, which say why.

    Each way may have the shares of the variance that it leaves at runs left out: up to the place
    that all curves reach, and of the whole.
    """
    if not isinstance(scaled, EndingComponents):
        if isinstance(common, EndingComponents):
            return _chosen(common, "", of_common)
        return common
    if not isinstance(common, EndingComponents):
        return _chosen(scaled, f", as {common}", of_scaled)
    if of_common is None or of_scaled is None:
        choice = ", as no fit without some runs says which way is better"
        if of_scaled is not None:
            return _chosen(scaled, choice, of_scaled)
        return _chosen(common, choice, of_common)
    is_scaled = of_scaled[0] < max(of_common[0], _NEGLIGIBLE)
    own, other = (of_scaled, of_common) if is_scaled else (of_common, of_scaled)
    shares = [share_text(each[0]) for each in (own, other)]
    choice = f"; up to {common.last_common_text}, this leaves {shares[0]} of the variance at runs "
    choice += f"left out, and the other way {shares[1]}"
    choice += ", but nothing is known beyond" * (own[0] > other[0])
    return _chosen(scaled if is_scaled else common, choice, own)


def _chosen(
    way: EndingComponents, choice: str, left: tuple[float, float] | None
) -> EndingComponents:
    return replace(way, choice=choice, left=math.nan if left is None else left[1])


def has_ends(values: FloatArray) -> bool:
    """Check whether some curve, shape (run, place), ends before the last place."""
    return bool(np.isnan(values[:, -1]).any())


def _counts(values: FloatArray) -> IntArray:
    """Return the number of places of each curve."""
    counts: IntArray = np.isfinite(values).sum(axis=1)
    return counts


def _place_text(dimension: Dimension, common_places: int) -> str:
    return dimension.place_text(dimension.values[common_places - 1])


def _grid(dimension: Dimension, common_places: int, *, is_scaled: bool) -> Dimension:
    """Return the places that all curves have, or the shares of a length, spaced as the places."""
    if not is_scaled:
        values = dimension.values[:common_places]
        return Dimension(dimension.name, dimension.unit, values=values)
    places = np.array(dimension.values)
    shares = tuple(((places - places[0]) / (places[-1] - places[0])).tolist())
    title = f"{dimension.title} as a share of that of the end"
    return Dimension(f"{_SCALED}{dimension.name}", "1", title, "1", shares)


def _on_grid(
    values: FloatArray, dimension: Dimension, common_places: int, *, is_scaled: bool
) -> FloatArray:
    """Return curves on the grid, shape (run, grid), linear between their places."""
    if not is_scaled:
        return values[:, :common_places]
    places = np.array(dimension.values)
    shares = np.array(_grid(dimension, common_places, is_scaled=True).values)
    found = np.empty_like(values)
    for row, count in enumerate(_counts(values)):
        at = places[0] + shares * (places[count - 1] - places[0])
        found[row] = np.interp(at, places[:count], values[row, :count])
    return found


def _between(values: FloatArray, at: IntArray, part: FloatArray) -> FloatArray:
    """Return values between two neighbours of a grid, shape (run,)."""
    found: FloatArray = values[at] + part * (values[at + 1] - values[at])
    return found
