"""Model on a UM-Bridge server, with one request for each run."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from uqpen.core.arrays import Arrays, FloatArray, floats
from uqpen.core.errors import toml_text
from uqpen.core.files import FileSnapshot
from uqpen.core.limits import Limits
from uqpen.core.model import Input, Model, Output, Results, empty_outputs
from uqpen.core.status import Status
from uqpen.core.units import scale
from uqpen.models.run_grid import FieldSources
from uqpen.models.umbridge_client import Address, NoAnswerError, UmbridgeClient

__all__ = ["UmbridgeModel", "VectorSizes", "request_sizes"]


@dataclass(frozen=True)
class VectorSizes:
    """Lengths of each input vector and each output vector of a model."""

    inputs: tuple[int, ...]
    outputs: tuple[int, ...]


@dataclass(frozen=True)
class UmbridgeModel(Model):
    """Model on a UM-Bridge server; its inputs and outputs fill the server's vectors in their order.

    Parameters
    ----------
    name : str
        Its name on the server.
    address : Address
        Address of the server; results do not depend on it.
    units : mapping of str to str
        The unit that the server takes each input and gives each output in.
    sizes : VectorSizes or None
        Division of inputs and outputs into vectors; None if no request is to be made.
    config : str
        Content of every request in addition to the inputs, as a JSON object.
    time_limit : float, optional
        Time limit of a run, in seconds.
    fields : FieldSources
        The files with coordinates.
    """

    name: str
    address: Address
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    units: Mapping[str, str]
    sizes: VectorSizes | None
    config: str = "{}"
    time_limit: float | None = None
    fields: FieldSources = field(default=FieldSources(), repr=False)

    vectorized = False

    @property
    def run_limits(self) -> Limits:
        return Limits(self.time_limit)

    def evaluate(self, inputs: Arrays) -> Results:
        columns = [scale(self.units[v.name]).from_si(inputs[v.name]) for v in self.inputs]
        points = np.stack(columns, axis=1).tolist()
        outputs = empty_outputs(self.outputs, len(points))
        sizes = [math.prod(output.shape) for output in self.outputs]
        status = np.full(len(points), Status.OK, dtype=np.int8)
        reasons: dict[int, str] = {}
        with UmbridgeClient(self.address, self.time_limit) as server:
            for run, point in enumerate(points):
                try:
                    values = self._request_outputs(server, point)
                except NoAnswerError as error:
                    status[run], reasons[run] = error.status, str(error)
                    continue
                parts = np.split(values, np.cumsum(sizes)[:-1])
                for output, part in zip(self.outputs, parts, strict=True):
                    outputs[output.name][run] = part.reshape(output.shape)
        for name, column in outputs.items():
            outputs[name] = scale(self.units[name]).array_to_si(column)
        return Results(outputs, status, reasons)

    def files(self) -> tuple[FileSnapshot, ...]:
        return self.fields.files

    @property
    def uncompared(self) -> tuple[str, ...]:
        return (f"the server {self.address}",)

    def identity(self) -> dict[str, str]:
        config = {"config": self.config} if self.config != "{}" else {}
        return {"name": self.name, "kind": "UM-Bridge", **config}

    def _request_outputs(self, server: UmbridgeClient, point: list[float]) -> FloatArray:
        """Request the outputs of one run, in the server's units."""
        if self.sizes is None:
            raise NoAnswerError(f"{self.name}: the server is not asked without --trust")
        values = iter(point)
        vectors = [list(itertools.islice(values, size)) for size in self.sizes.inputs]
        request = {"name": self.name, "input": vectors, "config": json.loads(self.config)}
        return _join_vectors(server.request("Evaluate", request).get("output"), self.sizes.outputs)


def request_sizes(server: UmbridgeClient, name: str, config: str) -> VectorSizes:
    """Request the lengths of a model's vectors; NoAnswerError if the server does not give them."""
    request = {"name": name, "config": json.loads(config)}
    found = []
    for what in ("InputSizes", "OutputSizes"):
        answer = server.request(what, request)
        sizes = answer.get(what[0].lower() + what[1:])
        if not isinstance(sizes, list) or not all(type(n) is int and n >= 0 for n in sizes):
            raise NoAnswerError(f"the server's answer to {what} is no list of whole numbers")
        found.append(tuple(sizes))
    return VectorSizes(*found)


def _join_vectors(vectors: Any, sizes: Sequence[int]) -> FloatArray:
    """Join the values of vectors after a check of their lengths."""
    lists = vectors if isinstance(vectors, list) else []
    if [len(v) if isinstance(v, list) else -1 for v in lists] != list(sizes):
        expected = ", ".join(map(str, sizes))
        raise NoAnswerError(f"the server's output is not made of vectors of length {expected}")
    # JSON knows no NaN, and some servers write null instead.
    flat = [np.nan if value is None else value for vector in lists for value in vector]
    for value in flat:
        if type(value) not in (int, float):
            raise NoAnswerError(f"the server's output has {toml_text(value)}, not a number")
    return floats(flat)
