"""Runs of an output by groups of models, at independent points of each group."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import ROUND, RUN, STATUS
from uqpen.core.status import Status
from uqpen.execution import worst_status_runs

__all__ = ["GroupRuns", "inadmissible_to_some", "read_groups"]


@dataclass(frozen=True, eq=False)
class GroupRuns:
    """Values of an output at the points of a group, by the models that have run them.

    Parameters
    ----------
    models : ndarray of bool, shape (model,)
        The models of the group, the one of interest first.
    values : ndarray, shape (model, run)
        Of runs that all models of the group completed; 0 for models outside of it.
    """

    models: BoolArray
    values: FloatArray

    @property
    def size(self) -> int:
        """Number of points."""
        return self.values.shape[1]

    def transformed(self, values: FloatArray) -> GroupRuns:
        """Return the group with other values of its models; 0 for those outside of it."""
        return GroupRuns(self.models, np.where(self.models[:, np.newaxis], values, 0.0))


def read_groups(runs: Mapping[str, xr.Dataset], output: str) -> tuple[GroupRuns, ...]:
    """Return the runs of an output by groups of models, that of all models first.

    Parameters
    ----------
    runs : mapping of str to Dataset
        The runs of a design by model, with the round of each. The output is a number in all.
    output : str
        Its name.
    """
    found: dict[tuple[bool, ...], list[FloatArray]] = {}
    for parts in _rounds(runs):
        models = np.array([part is not None for part in parts])
        made = [part for part in parts if part is not None]
        is_ok = worst_status_runs(made)[STATUS].values == Status.OK
        is_ok &= np.all([np.isfinite(part[output].values) for part in made], axis=0)
        values = np.zeros((len(parts), int(is_ok.sum())))
        values[models] = [part[output].values[is_ok] for part in made]
        found.setdefault(tuple(models), []).append(values)
    ordered = sorted(found.items(), reverse=True)
    return tuple(
        GroupRuns(np.array(models), np.concatenate(values, axis=1)) for models, values in ordered
    )


def inadmissible_to_some(runs: Mapping[str, xr.Dataset]) -> bool:
    """Check for points that one model admits, and another does not: they have other inputs."""
    for parts in _rounds(runs):
        lost = [part[STATUS].values == Status.INADMISSIBLE for part in parts if part is not None]
        if any((each != lost[0]).any() for each in lost[1:]):
            return True
    return False


def _rounds(runs: Mapping[str, xr.Dataset]) -> Iterator[Sequence[xr.Dataset | None]]:
    """Yield the runs of each round by model; None for a model that has not run it."""
    numbers = {name: each[ROUND].values for name, each in runs.items()}
    for number in np.unique(np.concatenate([*numbers.values()])):
        parts = [each.isel({RUN: numbers[name] == number}) for name, each in runs.items()]
        yield [part if part.sizes[RUN] else None for part in parts]
