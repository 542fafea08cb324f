"""Models that a server offers, and the runs that clients ask for."""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import ndtr

from uqpen.core.errors import ModelError
from uqpen.core.model import Input, Model, Output
from uqpen.core.status import Status
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.execution import Evaluator


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
    """

    name: str  # its name for the clients
    evaluator: Evaluator  # makes the runs
    varied_inputs: tuple[str, ...]  # the inputs that make up the vector, in its order
    # The values of others, in SI units.
    fixed_inputs: Mapping[str, float] = field(default_factory=dict)
    # What a study says of the model, such as its units and constraints, and the hashes of its
    # files; empty without a study.
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


# A model whose inputs a client does not see: their stand-ins are standard normal numbers.


@dataclass(frozen=True)
class HiddenModel:
    """A served model in standard normal space, under a name that says nothing of it.

    A client needs to know neither names nor units nor distributions of the inputs: a vector of
    independent standard normal numbers becomes a draw of them, by their own transformation.
    """

    name: str  # its name for the clients
    served: ServedModel  # the model, with random inputs in its vector
    # The inputs. Each random one has a place in the vector, also one that the model does not take.
    joint: JointDistribution

    @property
    def identity(self) -> dict[str, Any]:
        """All that decides the result of a run with a vector, for JSON."""
        return {
            **self.served.identity,
            "random": {each.variable.name: repr(each.distribution) for each in self.joint.random},
            "dependence": self.joint.dependence_text,
        }

    @property
    def input_size(self) -> int:
        """Length of the input vector."""
        return len(self.joint.random)

    @property
    def output_sizes(self) -> list[int]:
        """Lengths of the output vectors."""
        return self.served.output_sizes

    def run(self, values: Sequence[float]) -> list[list[float | None]]:
        """Return the output vectors of one run; a `RefusedError` says that it failed, and no more.

        A reason would name the inputs.
        """
        points = self.joint.points(ndtr(np.array([values], dtype=np.float64)), {})
        try:
            return self.served.run([points[name].item() for name in self.served.varied_inputs])
        except RefusedError as refused:
            message = "the run has no result"
            raise RefusedError(refused.kind, message, refused.code) from None


# Budget of runs that clients of a server may ask for, counted in a file.


if sys.platform != "win32":
    import fcntl


class RunBudget:
    """The runs of each model that clients may still ask for.

    The file has a line of JSON for what is served, and one for each run that was granted, with its
    model and its input vector. A line is on the disk before its run is made. So a count survives a
    server that is killed, and no answer is given that is not counted.

    Parameters
    ----------
    path : Path
        The file. If it exists, its count goes on.
    runs : int
        Runs of each model that are granted in all.
    identities : mapping of str to mapping
        By name, all that decides the result of a run of a model. The file has a hash of it, and
        one of other models is refused.

    Raises
    ------
    ModelError
        If the file counts the runs of other models, is no such file, or belongs to a server that
        is running.
    OSError
        If it cannot be read or written.
    """

    def __init__(self, path: Path, runs: int, identities: Mapping[str, Mapping[str, Any]]) -> None:
        models = {
            name: hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()
            for name, identity in identities.items()
        }
        self.path = path
        self.runs = runs
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("a+b")
        try:
            if sys.platform != "win32":
                try:
                    fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    message = f"{self.path}: another server counts its runs in this file"
                    raise ModelError(message) from None
            self._granted = dict.fromkeys(models, 0)
            self._read({"models": dict(models)})
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> RunBudget:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def left(self, model: str) -> int:
        """Return the number of runs of a model that are left."""
        return max(self.runs - self._granted[model], 0)

    def grant(self, model: str, vector: Sequence[float]) -> None:
        """Count a run of a model; refuse it where none is left.

        The caller sees to it that no other thread is here at the same time.

        Raises
        ------
        RefusedError
            If the budget is spent, or a run cannot be counted.
        """
        if not self.left(model):
            message = f"all {self.runs} runs of {model} have been made"
            raise RefusedError("BudgetSpent", message, HTTPStatus.FORBIDDEN)
        # Counted first: if the line is lost half-way, the run is made for nobody.
        self._granted[model] += 1
        try:
            self._append({"model": model, "input": list(vector)})
        except OSError:
            code = HTTPStatus.INTERNAL_SERVER_ERROR
            raise RefusedError("NotCounted", "the run cannot be counted", code) from None

    def _append(self, entry: Mapping[str, Any]) -> None:
        self._file.write(json.dumps(entry).encode() + b"\n")
        self._file.flush()
        os.fsync(self._file.fileno())

    def _read(self, head: Mapping[str, Any]) -> None:
        """Take the count of a file, or begin one."""
        self._file.seek(0)
        lines = self._file.read().splitlines(keepends=True)
        if lines and not lines[-1].endswith(b"\n"):
            # A server was killed at this line, before the run that it grants.
            self._file.truncate(sum(map(len, lines[:-1])))
            del lines[-1]
        if not lines:
            self._append(head)
            return
        entries = [_parse_entry(line) for line in lines]
        if None in entries or "models" not in (entries[0] or {}):
            raise ModelError(f"{self.path}: is no count of runs of a server")
        if entries[0] != head:
            raise ModelError(f"{self.path}: counts the runs of other models, or of another version")
        for entry in entries[1:]:
            self._granted[str((entry or {}).get("model"))] += 1


def _parse_entry(line: bytes) -> dict[str, Any] | None:
    try:
        entry = json.loads(line)
    except ValueError:
        return None
    return entry if isinstance(entry, dict) else None
