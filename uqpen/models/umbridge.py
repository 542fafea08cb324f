"""A model on a UM-Bridge server, asked for one run at a time."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqpen.arrays import floats
from uqpen.errors import as_written
from uqpen.labels import Status
from uqpen.limits import Limits
from uqpen.model import Arrays, FloatArray, Input, Model, Output, Results
from uqpen.models.umbridge_client import Address, NoAnswerError, Questions
from uqpen.units import scale

__all__ = ["ServedModel", "Sizes", "sizes_of"]


@dataclass(frozen=True)
class Sizes:
    """The lengths of the vectors that a model takes and gives.

    Parameters
    ----------
    inputs, outputs : tuple of int
        One for each vector.
    """

    inputs: tuple[int, ...]
    outputs: tuple[int, ...]


@dataclass(frozen=True)
class ServedModel(Model):
    """A model on a UM-Bridge server, whose vectors are filled with its inputs in their order.

    Parameters
    ----------
    name : str
        What the server calls it.
    address : Address
        Where the server listens; the results are the model's, wherever it is.
    inputs, outputs : tuple
        As of any model, in SI units.
    called_in : mapping of str to str
        The unit that the server takes each input and gives each output in.
    sizes : Sizes or None
        How inputs and outputs are divided into vectors; None of a server that is not to be asked.
    config : str
        What every question holds beside the inputs, as a JSON object.
    time_limit : float, optional
        How long a run may take, in seconds.
    """

    name: str
    address: Address
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    called_in: Mapping[str, str]
    sizes: Sizes | None
    config: str = "{}"
    time_limit: float | None = None

    vectorized = False

    @property
    def allowed(self) -> Limits:
        return Limits(self.time_limit)

    def evaluate(self, inputs: Arrays) -> Results:
        columns = [scale(self.called_in[v.name]).from_si(inputs[v.name]) for v in self.inputs]
        points = np.stack(columns, axis=1).tolist()
        values = np.full((len(points), len(self.outputs)), np.nan)
        status = np.full(len(points), Status.OK, dtype=np.int8)
        reasons: dict[int, str] = {}
        with Questions(self.address, self.time_limit) as server:
            for run, point in enumerate(points):
                try:
                    values[run] = self._answer(server, point)
                except NoAnswerError as error:
                    status[run], reasons[run] = error.status, str(error)
        return Results(self._in_si(values), status, reasons)

    def identity(self) -> dict[str, str]:
        config = {"config": self.config} if self.config != "{}" else {}
        return {"name": self.name, "kind": "UM-Bridge", **config}

    def _answer(self, server: Questions, point: list[float]) -> FloatArray:
        """The outputs of one run, in the server's units."""
        if self.sizes is None:
            raise NoAnswerError(f"{self.name}: the server is not asked without --trust")
        question = {
            "name": self.name,
            "input": _divided(point, self.sizes.inputs),
            "config": json.loads(self.config),
        }
        return _joined(server.ask("Evaluate", question).get("output"), self.sizes.outputs)

    def _in_si(self, values: FloatArray) -> dict[str, FloatArray]:
        measures = [scale(self.called_in[output.name]) for output in self.outputs]
        return {
            output.name: values[:, column] * measure.factor + measure.offset
            for column, (output, measure) in enumerate(zip(self.outputs, measures, strict=True))
        }


def sizes_of(server: Questions, name: str, config: str) -> Sizes:
    """Ask a server for the lengths of a model's vectors.

    Raises
    ------
    NoAnswerError
        If it does not tell.
    """
    question = {"name": name, "config": json.loads(config)}
    found = []
    for what in ("InputSizes", "OutputSizes"):
        answer = server.ask(what, question)
        sizes = answer.get(what[0].lower() + what[1:])
        if not isinstance(sizes, list) or not all(type(n) is int and n >= 0 for n in sizes):
            raise NoAnswerError(f"the server's answer to {what} is no list of whole numbers")
        found.append(tuple(sizes))
    return Sizes(*found)


def _divided(values: Sequence[float], sizes: Sequence[int]) -> list[list[float]]:
    """Values in vectors of these lengths."""
    rest = iter(values)
    return [[next(rest) for _ in range(size)] for size in sizes]


def _joined(vectors: Any, sizes: Sequence[int]) -> FloatArray:
    """The values of vectors that should have these lengths."""
    found = [len(v) if isinstance(v, list) else -1 for v in _listed(vectors)]
    if found != list(sizes):
        expected = ", ".join(map(str, sizes))
        raise NoAnswerError(f"the server's output is not made of vectors of length {expected}")
    flat = [value for vector in vectors for value in vector]
    for value in flat:
        if value is not None and type(value) not in (int, float):
            raise NoAnswerError(f"the server's output has {as_written(value)}, not a number")
    # JSON knows no NaN, and some write null instead.
    return floats([np.nan if value is None else value for value in flat])


def _listed(vectors: object) -> list[Any]:
    return vectors if isinstance(vectors, list) else []
