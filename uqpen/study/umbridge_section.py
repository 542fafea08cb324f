"""``[model]`` with ``umbridge``: a model on a server, checked by requests to it."""

from __future__ import annotations

import itertools
import json
import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from uqpen.core.errors import Problem, QuantityError, SettingsError, toml_text
from uqpen.core.limits import time_limit
from uqpen.core.lookup import choices
from uqpen.core.model import Model, Output, Variable
from uqpen.core.settings import read_each, setting, text
from uqpen.models.umbridge import (
    PROTOCOL,
    Address,
    NoAnswerError,
    UmbridgeClient,
    UmbridgeModel,
    VectorSizes,
    request_sizes,
)
from uqpen.study.outcomes_section import refuse_outcomes
from uqpen.study.table_reader import TableReader
from uqpen.study.variables_section import Variables, read_variables, refuse_grids

# How long the server may think about what it offers, in seconds.
_PATIENCE = 30.0


def _read_address(written: Any, context: object) -> Any:
    try:
        return Address.parse(written) if isinstance(written, str) else written
    except ValueError:  # also of a port that is no number, and of a name that cannot be a host's
        return written


def _read_config(written: Any, context: object) -> str:
    """Convert a table to JSON, the same for the same content."""
    if not isinstance(written, dict):
        raise QuantityError(toml_text(written), "a table")
    read_each(written, _check_json)
    return json.dumps(written, sort_keys=True)


def _check_json(value: Any) -> None:
    """Refuse a value with a part that JSON cannot represent."""
    if isinstance(value, dict | list):
        for entry in value.values() if isinstance(value, dict) else value:
            _check_json(entry)
    elif not isinstance(value, str | int) and not (
        isinstance(value, float) and math.isfinite(value)
    ):
        expected = "a text, a number, true or false, or lists or tables of them"
        raise QuantityError(toml_text(value), expected)


@dataclass(frozen=True)
class _ServerSettings:
    """Settings of a model on a server."""

    address: Address = setting(
        "address",
        'the address of a UM-Bridge server, such as "http://127.0.0.1:4242"',
        lambda value: isinstance(value, Address),
        read=_read_address,
        key="umbridge",
    )
    name: str | None = text(expected="the name of a model on the server", default=None)
    time_limit: float | None = time_limit()
    config: str = setting("config", "a table", lambda value: True, read=_read_config, default="{}")


def read_umbridge(table: TableReader) -> Model | None:
    """Read a model on a server; None where a mistake was noted.

    Without trust, the server gets no requests.
    """
    noted = len(table.problems)
    wanted = table.settings(_ServerSettings)
    variables = read_variables(table)
    refuse_grids(table, variables.fields, "none: a server's vectors have one length for all runs")
    refuse_outcomes(table, "outcomes of a server, whose errors do not say how a run ended")
    if wanted is None or len(table.problems) > noted:
        return None
    name, sizes = wanted.name or "its only model", None
    if table.trust:
        try:
            with UmbridgeClient(wanted.address, _PATIENCE) as server:
                name = _request_name(server, wanted.name)
                sizes = request_sizes(server, name, wanted.config)
        except NoAnswerError as error:
            found = f"{toml_text(table.content['umbridge'])}: {error}"
            table.add_problem("umbridge", found, "a UM-Bridge server that responds")
            return None
        except SettingsError as error:
            table.add_problems(error.problems)
            return None
        if not _has_matching_sizes(table, name, sizes, variables):
            return None
    inputs, outputs, units, fields = variables
    declared = (name, wanted.address, inputs, outputs, units, sizes, wanted.config)
    return UmbridgeModel(*declared, wanted.time_limit, fields)


def _request_name(server: UmbridgeClient, wanted: str | None) -> str:
    """Request the name of the model to run; raise a SettingsError if there is none."""
    info = server.request("Info")
    if info.get("protocolVersion") != PROTOCOL:
        found = f"a server of protocol version {info.get('protocolVersion')!r}"
        raise _refusal("umbridge", found, f"version {PROTOCOL}")
    listed = info.get("models")
    names = [str(name) for name in listed] if isinstance(listed, list) else []
    if wanted is None and len(names) != 1:
        raise _refusal("name", "nothing", f"a model of this server; {choices('', names)}")
    name = wanted or names[0]
    if name not in names:
        expected = f"a model of this server; {choices(name, names)}"
        raise _refusal("name", toml_text(name), expected)
    support = server.request("ModelInfo", {"name": name}).get("support")
    if not isinstance(support, dict) or support.get("Evaluate") is not True:
        found = f'"{name}", which does not support Evaluate'
        raise _refusal("umbridge", found, "a model that can run")
    return name


def _refusal(key: str, found: str, expected: str) -> SettingsError:
    return SettingsError([Problem((key,), found, expected)])


def _has_matching_sizes(
    table: TableReader, name: str, sizes: VectorSizes, variables: Variables
) -> bool:
    """Check the numbers of a model's inputs and outputs against the study; note a mismatch."""
    noted = len(table.problems)
    for what, does, named, lengths in (
        ("inputs", "takes", variables.inputs, sizes.inputs),
        ("outputs", "gives", variables.outputs, sizes.outputs),
    ):
        numbers = sum(map(_size, named))
        if numbers != sum(lengths):
            vectors = f" ({' + '.join(map(str, lengths))})" if len(lengths) > 1 else ""
            expected = f'as many as "{name}" {does} numbers: {sum(lengths)}{vectors}'
            of = f" of {numbers} numbers" if numbers > len(named) else ""
            table.add_problem(what, f"{len(named)} {what}{of}", expected)
    if len(table.problems) == noted:
        _check_whole_vectors(table, name, sizes.outputs, variables.outputs)
    return len(table.problems) == noted


def _check_whole_vectors(
    table: TableReader, name: str, lengths: Sequence[int], outputs: Sequence[Output]
) -> None:
    """Note a field that is in no single vector: outputs may have another order than the server."""
    ends = [*itertools.accumulate(lengths, initial=0)]
    begin = 0
    for output in outputs:
        end = begin + _size(output)
        vector = bisect_right(ends, begin)
        if output.dims and end > ends[min(vector, len(ends) - 1)]:
            found = f"{_size(output)} values from number {begin} of what the server gives"
            vectors = " + ".join(map(str, lengths))
            expected = f'all of them in one vector; "{name}" gives {vectors} numbers'
            table.add_problem(("outputs", output.name), found, expected)
        begin = end


def _size(variable: Variable) -> int:
    """Return how many numbers of a server a variable takes."""
    return math.prod(variable.shape) if isinstance(variable, Output) else 1
