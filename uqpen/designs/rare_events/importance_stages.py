"""Stages of importance sampling: each draws from a mixture fitted to all draws before."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.special import logsumexp

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.designs.rare_events.event_components import effective_size, fitted_components
from uqpen.designs.rare_events.gaussian_mixture import (
    GaussianComponent,
    GaussianMixture,
    inflation,
    log_normal_density,
)
from uqpen.designs.rare_events.limit_state import EventOutcomes, LimitState

__all__ = ["ImportanceStages"]

# Shares of the nominal and of the inflated component. The inflated one looks for parts of the event
# that the others miss. The nominal one measures what is common: failed runs, inadmissible draws.
_FIRST_SHARES = 0.1, 0.4
_LATER_SHARES = 0.1, 0.1

# Share of the fitted components that go where runs fail, and the number of effective draws in the
# event that are enough for a fit, for one input and each further one.
_FAILED_SHARE = 0.2
_ENOUGH, _ENOUGH_EACH = 30, 4

# Where too few draws show the event, the nearest tenth of them lead on. Where more are as near as
# that, as by an output with few values, none of them says where the event lies.
_NEAREST, _USELESS = 0.1, 0.5


@dataclass(frozen=True, eq=False)
class ImportanceStages:
    """Draws of all stages so far, and the mixtures that follow from them.

    Parameters
    ----------
    event : LimitState
        The event.
    centres : ndarray, shape (point, random input)
        Design points that are known before any draw; may be none.
    """

    event: LimitState
    centres: FloatArray
    _points: list[FloatArray] = field(default_factory=list)
    _mixtures: list[GaussianMixture] = field(default_factory=list)
    _outcomes: list[EventOutcomes] = field(default_factory=list)

    def add(self, mixture: GaussianMixture, points: FloatArray, outcomes: EventOutcomes) -> None:
        """Add the draws of a stage."""
        self._points.append(points)
        self._mixtures.append(mixture)
        self._outcomes.append(outcomes)

    def first(self, number: int) -> GaussianMixture:
        """Return the mixture of the first stage, around the design points."""
        dimension = self.centres.shape[1]
        around = tuple(GaussianComponent(each, np.eye(dimension)) for each in self.centres)
        density = np.exp(-0.5 * ((self.centres**2).sum(axis=1)))
        shares = np.maximum(density / density.max(initial=1e-300), 0.3) if around else density
        return self._mixture(around, shares, _FIRST_SHARES, number)

    def following(self, number: int) -> GaussianMixture:
        """Return a mixture that is fitted to the draws so far."""
        points, weights = np.concatenate(self._points), self._weights()
        occurs, missing = self._joined("occurs"), self._joined("missing")
        scales = self.event.scales(self._outcomes[0])
        performance = np.concatenate(
            [self.event.performance(each, scales) for each in self._outcomes]
        )
        leading = self._leading(performance, occurs, missing, weights)
        if not leading.any():
            return self.first(number)
        components, shares = fitted_components(points[leading], weights[leading], self.centres)
        if missing.any():
            none = np.empty((0, points.shape[1]))
            failed, parts = fitted_components(points[missing], weights[missing], none)
            components += failed
            shares = np.concatenate(
                [(1 - _FAILED_SHARE) * shares / shares.sum(), _FAILED_SHARE * parts / parts.sum()]
            )
        nominal, inflated = _LATER_SHARES
        is_common = missing.any() or not self._joined("belongs").all()
        return self._mixture(components, shares, (nominal * is_common, inflated), number)

    @property
    def are_enough(self) -> bool:
        """True if enough draws show the event for a fit to it."""
        dimension = self.centres.shape[1]
        size = effective_size(self._weights()[self._joined("occurs")])
        return size >= _ENOUGH + _ENOUGH_EACH * (dimension - 1)

    def _leading(
        self, performance: FloatArray, occurs: BoolArray, missing: BoolArray, weights: FloatArray
    ) -> BoolArray:
        """Return the draws to fit to: those with the event, or the nearest to it; may be none."""
        known = np.isfinite(performance) & ~missing
        if effective_size(weights[occurs]) >= _ENOUGH / 3 or not known.any():
            return occurs
        last = np.zeros(len(performance), dtype=np.bool_)
        last[-self._mixtures[-1].number :] = True
        among = known & last if (known & last).any() else known
        threshold = min(0.0, float(np.quantile(performance[among], 1 - _NEAREST)))
        nearest = known & (performance >= threshold)
        return nearest if nearest.sum() <= _USELESS * known.sum() else occurs

    def _weights(self) -> FloatArray:
        """Return the ratio of the inputs' density to that of all stages together."""
        points = np.concatenate(self._points)
        numbers = np.array([each.number for each in self._mixtures], dtype=np.float64)
        densities = np.array([each.log_density(points) for each in self._mixtures])
        together = logsumexp(densities, axis=0, b=(numbers / numbers.sum())[:, np.newaxis])
        ratio: FloatArray = np.exp(log_normal_density(points) - together)
        return ratio

    def _joined(self, name: str) -> BoolArray:
        return np.concatenate([getattr(each, name) for each in self._outcomes])

    def _mixture(
        self,
        fitted: tuple[GaussianComponent, ...],
        shares: FloatArray,
        general: tuple[float, float],
        number: int,
    ) -> GaussianMixture:
        """Return the two general components, and the fitted ones behind them, if there are any."""
        dimension = self.centres.shape[1]
        centre, identity = np.zeros(dimension), np.eye(dimension)
        components = (
            GaussianComponent(centre, identity),
            GaussianComponent(centre, inflation(dimension) ** 2 * identity),
            *fitted,
        )
        rest = (1 - sum(general)) * shares / shares.sum() if fitted else shares
        return GaussianMixture.of_shares(components, np.array([*general, *rest]), number)
