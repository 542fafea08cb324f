"""A model whose table has mistakes, so that the rest of a study can be read all the same."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from uqpen.core.arrays import Arrays
from uqpen.core.model import Input, Model, Output, Results
from uqpen.core.units import ANY_DIMENSION
from uqpen.study.table_reader import TableReader

__all__ = ["PartialModel", "mentioned_model"]

_WORD = re.compile(r"[^\W\d]\w*")


@dataclass(frozen=True, eq=False)
class PartialModel(Model):
    """The inputs and outputs of a model that could not be read in full; it cannot be run.

    A variable whose unit is not known is of `ANY_DIMENSION`.
    """

    name: str
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    alternatives: tuple[tuple[str, ...], ...] = ()

    def evaluate(self, inputs: Arrays) -> Results:
        """Refuse to run: the study has mistakes."""
        raise NotImplementedError(self.name)


def mentioned_model(root: TableReader) -> PartialModel:
    """Return a model with all variables that a study mentions, of any dimension."""
    content = root.content
    published = _tables(content.get("published"))
    of_outputs = [figures for each in published for figures in _tables(each)]
    inputs = {
        *_keys(content.get("inputs")),
        *(name for figures in of_outputs for name in _keys(figures.get("response"))),
        *(
            str(each["largest_contribution"])
            for each in of_outputs
            if "largest_contribution" in each
        ),
        *(str(name) for group in _tables(content.get("joint")) for name in _list(group, "inputs")),
        *(name for model in _tables(content.get("models")) for name in _keys(model.get("with"))),
        *_WORD.findall(str(content.get("constraints", ""))),
    }
    surrogates = _tables(content.get("surrogates"))
    outputs = {
        *_keys(content.get("outputs")),
        *(name for each in published for name in each if name != "source"),
        *(name for each in surrogates for name in _keys(each.get("transform"))),
    }
    return PartialModel(
        "the model",
        tuple(Input(name, ANY_DIMENSION) for name in sorted(inputs)),
        tuple(Output(name, ANY_DIMENSION) for name in sorted(outputs)),
    )


def _keys(value: Any) -> Iterable[str]:
    return value if isinstance(value, dict) else ()


def _list(table: dict[str, Any], key: str) -> list[Any]:
    value = table.get(key)
    return value if isinstance(value, list) else []


def _tables(value: Any) -> list[dict[str, Any]]:
    entries = value.values() if isinstance(value, dict) else ()
    return [entry for entry in entries if isinstance(entry, dict)]
