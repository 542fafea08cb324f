"""``[model]`` with ``umbridge``: a model on a server, checked by requests to it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uqpen.core.errors import QuantityError, toml_text
from uqpen.core.limits import time_limit
from uqpen.core.lookup import choices
from uqpen.core.model import Model
from uqpen.core.settings import read_each, setting, text
from uqpen.models.umbridge import UmbridgeModel, VectorSizes, request_sizes
from uqpen.models.umbridge_client import PROTOCOL, Address, NoAnswerError, UmbridgeClient
from uqpen.study.table_reader import TableReader
from uqpen.study.variables_section import Variables, read_variables

__all__ = ["read_umbridge"]

_SERVER = "a UM-Bridge server that answers"

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


def read_umbridge(table: TableReader, folder: Path, *, trust: bool) -> Model | None:
    """Read a model on a server; None where a mistake was noted.

    Without `trust`, the server gets no requests.
    """
    noted = len(table.problems)
    wanted = table.settings(_ServerSettings)
    variables = read_variables(table)
    if wanted is None or len(table.problems) > noted:
        return None
    found: tuple[str, VectorSizes | None] | None = wanted.name or "its only model", None
    if trust:
        found = _request_model(table, wanted, variables)
    if found is None:
        return None
    name, sizes = found
    return UmbridgeModel(name, wanted.address, *variables, sizes, wanted.config, wanted.time_limit)


def _request_model(
    table: TableReader, wanted: _ServerSettings, variables: Variables
) -> tuple[str, VectorSizes] | None:
    """Request the name and the sizes of a model of the server; None where a mistake was noted."""
    try:
        with UmbridgeClient(wanted.address, _PATIENCE) as server:
            name = _request_name(table, server, wanted.name)
            if name is None:
                return None
            sizes = request_sizes(server, name, wanted.config)
    except NoAnswerError as error:
        table.add_problem("umbridge", f"{toml_text(table.content['umbridge'])}: {error}", _SERVER)
        return None
    return (name, sizes) if _has_matching_sizes(table, name, sizes, variables) else None


def _request_name(table: TableReader, server: UmbridgeClient, wanted: str | None) -> str | None:
    """Request the name of the model to run; None where a mistake was noted."""
    info = server.request("Info")
    if info.get("protocolVersion") != PROTOCOL:
        found = f"a server of protocol version {info.get('protocolVersion')!r}"
        table.add_problem("umbridge", found, f"version {PROTOCOL}")
        return None
    listed = info.get("models")
    names = [str(name) for name in listed] if isinstance(listed, list) else []
    if wanted is None and len(names) != 1:
        table.add_missing("name", f"a model of this server; {choices('', names)}")
        return None
    name = wanted or names[0]
    if name not in names:
        table.add_problem(
            "name", toml_text(name), f"a model of this server; {choices(name, names)}"
        )
        return None
    support = server.request("ModelInfo", {"name": name}).get("support")
    if not isinstance(support, dict) or support.get("Evaluate") is not True:
        table.add_problem(
            "umbridge", f'"{name}", which does not support Evaluate', "a model that can run"
        )
        return None
    return name


def _has_matching_sizes(
    table: TableReader, name: str, sizes: VectorSizes, variables: Variables
) -> bool:
    """Check the numbers of a model's inputs and outputs against the study; note a mismatch."""
    noted = len(table.problems)
    for what, named, lengths in (
        ("inputs", variables.inputs, sizes.inputs),
        ("outputs", variables.outputs, sizes.outputs),
    ):
        if len(named) != sum(lengths):
            does = "takes" if what == "inputs" else "gives"
            vectors = " + ".join(map(str, lengths)) if len(lengths) > 1 else ""
            numbers = f"{sum(lengths)} ({vectors})" if vectors else f"{sum(lengths)}"
            expected = f'as many as "{name}" {does} numbers: {numbers}'
            table.add_problem(what, f"{len(named)} {what}", expected)
    return len(table.problems) == noted
