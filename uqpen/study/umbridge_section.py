"""``[model]`` with ``umbridge``: a model on a server, which is asked whether it fits."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

from uqpen.errors import as_written
from uqpen.lookup import choices
from uqpen.model import Model
from uqpen.models.umbridge import ServedModel, Sizes, sizes_of
from uqpen.models.umbridge_client import PROTOCOL, Address, NoAnswerError, Questions
from uqpen.study.limits_section import read_time_limit
from uqpen.study.section import Section
from uqpen.study.variables_section import Variables, read_variables

__all__ = ["read_umbridge"]

_ADDRESS = 'the address of a UM-Bridge server, such as "http://127.0.0.1:4242"'
_SERVER = "a UM-Bridge server that answers"

# How long the server may think about what it offers, in seconds.
_PATIENCE = 30.0


class _Wanted(NamedTuple):
    """What a study says of a model on a server."""

    address: Address
    name: str | None
    config: str


def read_umbridge(table: Section, folder: Path, *, trust: bool) -> Model | None:
    """A model on a server, or None where a mistake was noted.

    Parameters
    ----------
    table : Section
        Of the model.
    folder : Path
        Where the study lies.
    trust : bool
        Whether the server may be asked.
    """
    noted = len(table.problems)
    address = _address(table)
    name = table.text("name", "the name of a model on the server", default="")
    time_limit = read_time_limit(table)
    config = _config(table)
    variables = read_variables(table)
    if address is None or len(table.problems) > noted:
        return None
    wanted = _Wanted(address, name or None, config)
    found = _asked(table, wanted, variables) if trust else (name or "its only model", None)
    if found is None:
        return None
    return ServedModel(found[0], address, *variables, found[1], config, time_limit)


def _asked(table: Section, wanted: _Wanted, variables: Variables) -> tuple[str, Sizes] | None:
    """The name and the sizes of a model that the server has; None where a mistake was noted."""
    try:
        with Questions(wanted.address, _PATIENCE) as server:
            name = _offered(table, server, wanted.name)
            if name is None:
                return None
            sizes = sizes_of(server, name, wanted.config)
    except NoAnswerError as error:
        table.wrong("umbridge", f"{as_written(table.content['umbridge'])}: {error}", _SERVER)
        return None
    return (name, sizes) if _fit(table, name, sizes, variables) else None


def _offered(table: Section, server: Questions, wanted: str | None) -> str | None:
    """The name of the model to run; None where a mistake was noted."""
    info = server.ask("Info")
    if info.get("protocolVersion") != PROTOCOL:
        found = f"a server of protocol version {info.get('protocolVersion')!r}"
        table.wrong("umbridge", found, f"version {PROTOCOL}")
        return None
    listed = info.get("models")
    names = [str(name) for name in listed] if isinstance(listed, list) else []
    if wanted is None and len(names) != 1:
        table.missing("name", f"a model of this server; {choices('', names)}")
        return None
    name = wanted or names[0]
    if name not in names:
        table.wrong("name", as_written(name), f"a model of this server; {choices(name, names)}")
        return None
    support = server.ask("ModelInfo", {"name": name}).get("support")
    if not isinstance(support, dict) or support.get("Evaluate") is not True:
        table.wrong(
            "umbridge", f'"{name}", which does not support Evaluate', "a model that can run"
        )
        return None
    return name


def _fit(table: Section, name: str, sizes: Sizes, variables: Variables) -> bool:
    """Whether a model takes and gives as many numbers as the study names; if not, it is noted."""
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
            table.wrong(what, f"{len(named)} {what}", expected)
    return len(table.problems) == noted


def _address(table: Section) -> Address | None:
    text = table.text("umbridge", _ADDRESS)
    try:
        return None if text is None else Address.parsed(text)
    except ValueError:  # also of a port that is no number, and of a name that cannot be a host's
        table.wrong("umbridge", as_written(text), _ADDRESS)
        return None


def _config(table: Section) -> str:
    """The ``config`` table as JSON, the same for the same content."""
    section = table.table("config")
    if section is None:
        return "{}"
    for key in section:
        if (found := _no_json(section.take(key))) is not None:
            section.wrong(key, found, "a text, a number, true or false, or lists or tables of them")
    if any(_no_json(section.content[key]) is not None for key in section):
        return "{}"
    return json.dumps(section.content, sort_keys=True)


def _no_json(value: Any) -> str | None:
    """What in a value JSON cannot hold, or None."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        return next((found for entry in value if (found := _no_json(entry)) is not None), None)
    if isinstance(value, float) and not math.isfinite(value):
        return as_written(value)
    return None if isinstance(value, str | int | float) else as_written(value)
