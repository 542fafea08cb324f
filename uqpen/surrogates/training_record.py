"""Record of the runs that a surrogate was fitted to, for its group of an archive."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import xarray as xr

from uqpen.core.labels import INPUT, ROLE
from uqpen.core.model import Input
from uqpen.core.status import Status
from uqpen.surrogates.storage import describe, description

__all__ = ["TrainingRecord"]

_FIXED = "fixed_"
_TEXTS = ("units", "display_units", "long_name")


@dataclass(frozen=True, eq=False)
class TrainingRecord:
    """The design, the varied inputs and the statuses of the training runs.

    Parameters
    ----------
    design : str
        To whose runs a surrogate was fitted.
    random_inputs : tuple of str
        The inputs that varied.
    counts : mapping of Status to int
        Number of those runs with each status.
    is_independent : bool
        Whether the random inputs are.
    """

    design: str
    random_inputs: tuple[str, ...]
    counts: Mapping[Status, int]
    is_independent: bool

    def attributes(self) -> dict[str, Any]:
        """Return what an archive says of the runs."""
        return {
            "inputs": "independent" if self.is_independent else "dependent",
            "runs": sum(self.counts.values()),
            "runs_used": self.counts[Status.OK],
            **{f"runs_{status.meaning}": count for status, count in self.counts.items()},
        }

    @classmethod
    def from_attributes(cls, attributes: Mapping[Any, Any], inputs: xr.Dataset) -> Self:
        """Restore it from `attributes` and the group of `input_dataset`."""
        return cls(
            str(attributes["design"]),
            tuple(map(str, inputs[INPUT].values)),
            {status: int(attributes[f"runs_{status.meaning}"]) for status in Status},
            attributes["inputs"] == "independent",
        )

    def input_dataset(self, inputs: Sequence[Input], fixed: Mapping[str, float]) -> xr.Dataset:
        """Return descriptions of the random inputs, and the values of fixed ones."""
        given = {variable.name: variable for variable in inputs}
        texts = [describe(given[name]) for name in self.random_inputs]
        variables: dict[str, Any] = {
            f"{INPUT}_{key}": (INPUT, np.array([text[key] for text in texts], dtype=object))
            for key in _TEXTS
        }
        for name, value in fixed.items():
            variables[f"{_FIXED}{name}"] = ((), value, describe(given[name]) | {ROLE: INPUT})
        names = np.array(self.random_inputs, dtype=object)
        return xr.Dataset(variables, {INPUT: (INPUT, names, {"long_name": "random input"})})

    @staticmethod
    def read_inputs(group: xr.Dataset) -> tuple[tuple[Input, ...], dict[str, float]]:
        """Return the inputs, and the values of fixed ones, from `input_dataset`."""
        names = [str(name) for name in group[INPUT].values]
        texts = [
            dict(zip(_TEXTS, each, strict=True))
            for each in zip(*(group[f"{INPUT}_{key}"].values for key in _TEXTS), strict=True)
        ]
        fixed = {
            str(entry).removeprefix(_FIXED): variable
            for entry, variable in group.data_vars.items()
            if variable.attrs.get(ROLE) == INPUT
        }
        inputs = [
            *(Input(name, *description(text)) for name, text in zip(names, texts, strict=True)),
            *(Input(name, *description(each.attrs)) for name, each in fixed.items()),
        ]
        return tuple(inputs), {name: float(each.values) for name, each in fixed.items()}
