"""Stand-in for a user-defined distribution whose code is not executed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NoReturn

from uqpen.core.arrays import FloatArray
from uqpen.core.errors import ModelError
from uqpen.distributions.distribution import Distribution

__all__ = ["UnloadedDistribution"]


@dataclass(frozen=True)
class UnloadedDistribution(Distribution):
    """Distribution known by its name only: a reference, or an object of a program."""

    name: str

    def ppf(self, probability: FloatArray) -> NoReturn:
        self._refuse()

    def isf(self, probability: FloatArray) -> NoReturn:
        self._refuse()

    def cdf(self, value: FloatArray) -> NoReturn:
        self._refuse()

    def sf(self, value: FloatArray) -> NoReturn:
        self._refuse()

    def _refuse(self) -> NoReturn:
        raise ModelError(f"{self.name} is not loaded: it has no values without --trust")
