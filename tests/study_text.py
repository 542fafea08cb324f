"""The text of a study file, from what a test says of it."""

from __future__ import annotations

import json
from typing import Any

__all__ = ["ONE_INPUT", "TWO_INPUTS", "study_text"]


def study_text(model: Any = None, **tables: Any) -> str:
    """Return the text of a study: a value of TOML, a table or tables by their names a keyword.

    A model may be named alone, and an input be given by the ends of a uniform distribution.
    """
    inputs = tables.get("inputs", {})
    for name, entry in inputs.items():
        if isinstance(entry, tuple):
            tables["inputs"] = {**tables["inputs"], name: uniform(*entry)}
    top = {"title": tables.pop("title", None), "seed": tables.pop("seed", 1)}
    top |= {name: tables.pop(name) for name, value in [*tables.items()] if isinstance(value, bool)}
    lines = [f"{key} = {_value(value)}" for key, value in top.items() if value is not None]
    if model is not None:
        tables = {"model": {"use": model} if isinstance(model, str) else model, **tables}
    for name, table in tables.items():
        if name in ("model", "inputs", "constraints", "dependence", "failures"):
            lines += _table(name, table)
        else:
            for each, settings in table.items():
                lines += _table(f"{name}.{each}", settings)
    return "\n".join([*lines, ""])


def uniform(lower: Any, upper: Any) -> dict[str, Any]:
    """Return a uniform distribution as a study file has it."""
    return {"uniform": {"lower": lower, "upper": upper}}


def _table(name: str, settings: dict[str, Any]) -> list[str]:
    return [f"[{name}]", *(f"{key} = {_value(value)}" for key, value in settings.items())]


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_value(each)}' for key, each in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    return json.dumps(value, ensure_ascii=False)


# Studies of a model that a test writes, by the number of its inputs; what no test looks at is left
# out, as it takes its time.
ONE_INPUT = study_text(
    {"python": "model.py:simulate", "noise": False, "inputs": {"x": "1"}, "outputs": {"y": "m"}},
    seed=3,
    sensitivity=False,
    convergence=False,
    inputs={"x": "0 ± 1"},
    designs={"some": {"kind": "monte-carlo", "runs": 50}},
)
TWO_INPUTS = study_text(
    {
        "python": "model.py:simulate",
        "noise": False,
        "inputs": {"x": "1", "y": "m"},
        "outputs": {"z": "m"},
    },
    seed=11,
    sensitivity=False,
    convergence=False,
    inputs={"x": "0 ± 1", "y": "(0 ± 1) m"},
    designs={"one": {"kind": "monte-carlo", "runs": 30}},
)
