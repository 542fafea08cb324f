"""Models that a server offers, and the runs that clients ask for."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any

import numpy as np

from uqpen.core.errors import ModelError
from uqpen.core.model import Input, Model, Output
from uqpen.core.status import Status
from uqpen.execution import Evaluator

__all__ = ["RefusedError", "ServedModel", "only_vector"]


class RefusedError(Exception):
    """Error: a request that gets an error as its response."""

    def __init__(self, kind: str, message: str, code: HTTPStatus = HTTPStatus.BAD_REQUEST) -> None:
        super().__init__(message)
        self.kind = kind
        self.code = code


@dataclass(frozen=True)
class ServedModel:
    """A model of a server, with one vector of inputs, and its outputs in SI units.

    Outputs that are numbers share a vector with those next to them. A field is a vector of its own;
    values along its last dimension follow each other there.

    Parameters
    ----------
    name : str
        Its name for the clients.
    evaluator : Evaluator
        Makes the runs.
    varied_inputs : tuple of str
        The inputs that make up the vector, in its order.
    fixed_inputs : mapping of str to float
        The values of others, in SI units.
    fingerprint : mapping of str to str
        What a study says of the model, such as its units and constraints, and the hashes of its
        files; empty without a study.
    """

    name: str
    evaluator: Evaluator
    varied_inputs: tuple[str, ...]
    fixed_inputs: Mapping[str, float] = field(default_factory=dict)
    fingerprint: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        model, given = self.model, {*self.varied_inputs, *self.fixed_inputs}
        for name in self.varied_inputs:
            model.input(name)
        if len(set(self.varied_inputs)) < len(self.varied_inputs):
            names = ", ".join(self.varied_inputs)
            raise ModelError(f"{self.name}: an input is given twice: {names}")
        if missing := list(model.missing_inputs(given)):
            raise ModelError(f"{self.name} also needs {', '.join(missing)}")

    @property
    def model(self) -> Model:
        """Model that is run."""
        return self.evaluator.model

    @property
    def inputs(self) -> tuple[Input, ...]:
        """Inputs that make up the input vector."""
        return tuple(self.model.input(name) for name in self.varied_inputs)

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Outputs that make up the output vectors."""
        return self.model.outputs

    @property
    def identity(self) -> dict[str, Any]:
        """All that decides the result of a run with a vector, for JSON."""
        return {
            "identity": {**self.fingerprint, **self.model.identity()},
            "inputs": self.varied_inputs,
            "held": dict(self.fixed_inputs),
        }

    @property
    def input_size(self) -> int:
        """Length of the input vector."""
        return len(self.varied_inputs)

    @property
    def output_sizes(self) -> list[int]:
        """Lengths of the output vectors."""
        return [sum(math.prod(output.shape) for output in each) for each in self._vectors]

    @property
    def _vectors(self) -> list[list[Output]]:
        """Outputs of each vector."""
        # Only numbers have the same key as their neighbours.
        keys = {output.name: output.name if output.dims else "" for output in self.outputs}
        return [[*each] for _, each in itertools.groupby(self.outputs, lambda v: keys[v.name])]

    def run(self, values: Sequence[float]) -> list[list[float | None]]:
        """Return the output vectors of one run; a `RefusedError` says that it failed.

        What follows the end of a curve is None: JSON knows no NaN.
        """
        given = {**self.fixed_inputs, **dict(zip(self.varied_inputs, values, strict=True))}
        results = self.evaluator({name: np.array([value]) for name, value in given.items()})
        status = Status(int(results.status[0]))
        if status is not Status.OK:
            kind = status.meaning.title().replace("_", "")
            raise RefusedError(kind, results.reasons[0], HTTPStatus.INTERNAL_SERVER_ERROR)
        found = {name: each[0].ravel().tolist() for name, each in results.outputs.items()}
        return [
            [
                None if math.isnan(value) else value
                for output in each
                for value in found[output.name]
            ]
            for each in self._vectors
        ]


def only_vector(vectors: Any, size: int) -> list[float]:
    """Return the only vector of an input; refuse one of another size, or without finite numbers."""
    match vectors:
        case [[*vector]] if len(vector) == size and {*map(type, vector)} <= {int, float}:
            try:
                values = [float(value) for value in vector]
            except OverflowError:
                raise RefusedError("InvalidInput", "a number is too large") from None
            if not all(map(math.isfinite, values)):
                raise RefusedError("InvalidInput", "a number is not finite")
            return values
    raise RefusedError("InvalidInput", f"expected one vector of {size} numbers")
