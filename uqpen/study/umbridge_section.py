"""``[model]`` with ``umbridge``: a model on a server, checked by requests to it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

from uqpen.core.errors import toml_text
from uqpen.core.lookup import choices
from uqpen.core.model import Model
from uqpen.models.umbridge import UmbridgeModel, VectorSizes, request_sizes
from uqpen.models.umbridge_client import PROTOCOL, Address, NoAnswerError, UmbridgeClient
from uqpen.study.limits_section import read_time_limit
from uqpen.study.table_reader import TableReader
from uqpen.study.variables_section import Variables, read_variables

__all__ = ["read_umbridge"]

_ADDRESS = 'the address of a UM-Bridge server, such as "http://127.0.0.1:4242"'
_SERVER = "a UM-Bridge server that answers"

# How long the server may think about what it offers, in seconds.
_PATIENCE = 30.0


class _ServerSettings(NamedTuple):
    """Settings of a model on a server."""

    address: Address
    name: str | None
    config: str


def read_umbridge(table: TableReader, folder: Path, *, trust: bool) -> Model | None:
    """Read a model on a server; None where a mistake was noted.

    Parameters
    ----------
    table : TableReader
        Of the model.
    folder : Path
        Folder of the study.
    trust : bool
        True if requests may be sent to the server.
    """
    noted = len(table.problems)
    address = _address(table)
    name = table.text("name", "the name of a model on the server", default="")
    time_limit = read_time_limit(table)
    config = _config(table)
    variables = read_variables(table)
    if address is None or len(table.problems) > noted:
        return None
    wanted = _ServerSettings(address, name or None, config)
    found = _request_model(table, wanted, variables) if trust else (name or "its only model", None)
    if found is None:
        return None
    return UmbridgeModel(found[0], address, *variables, found[1], config, time_limit)


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


def _address(table: TableReader) -> Address | None:
    text = table.text("umbridge", _ADDRESS)
    try:
        return None if text is None else Address.parse(text)
    except ValueError:  # also of a port that is no number, and of a name that cannot be a host's
        table.add_problem("umbridge", toml_text(text), _ADDRESS)
        return None


def _config(table: TableReader) -> str:
    """Return the ``config`` table as JSON, the same for the same content."""
    section = table.table("config")
    if section is None:
        return "{}"
    for key in section:
        if (found := _json_problem(section.take(key))) is not None:
            section.add_problem(
                key, found, "a text, a number, true or false, or lists or tables of them"
            )
    if any(_json_problem(section.content[key]) is not None for key in section):
        return "{}"
    return json.dumps(section.content, sort_keys=True)


def _json_problem(value: Any) -> str | None:
    """Return a part of a value that JSON cannot represent, or None."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        return next((found for entry in value if (found := _json_problem(entry)) is not None), None)
    if isinstance(value, float) and not math.isfinite(value):
        return toml_text(value)
    return None if isinstance(value, str | int | float) else toml_text(value)
