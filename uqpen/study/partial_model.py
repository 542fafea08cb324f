"""A model whose table has mistakes, so that the rest of a study can be read all the same."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any

from uqpen.core.model import Arrays, Input, Model, Output, Results
from uqpen.core.units import ANY_DIMENSION
from uqpen.study.table_reader import TableReader

__all__ = ["PartialModel", "mentioned_model"]

_WORD = re.compile(r"[^\W\d]\w*")


class PartialModel(Model):
    """The inputs and outputs of a model that could not be read in full; it cannot be run.

    Parameters
    ----------
    name : str
        The model's name in messages.
    inputs, outputs : tuple
        Its variables; where a unit is not known, it is `ANY_DIMENSION`.
    alternatives : tuple of tuple of str
        As in `Model`.
    """

    def __init__(
        self,
        name: str,
        inputs: tuple[Input, ...],
        outputs: tuple[Output, ...],
        alternatives: tuple[tuple[str, ...], ...] = (),
    ) -> None:
        self.name = name
        self.inputs = inputs
        self.outputs = outputs
        self.alternatives = alternatives

    def evaluate(self, inputs: Arrays) -> Results:
        """Refuse to run: the study has mistakes."""
        raise NotImplementedError(self.name)


def mentioned_model(root: TableReader) -> PartialModel:
    """A model with all variables that the sections of a study mention, of any dimension."""
    content = root.content
    published = list(_tables(content.get("published")))
    of_outputs = [figures for each in published for figures in _tables(each)]
    inputs = {
        *_keys(content.get("inputs")),
        *(name for figures in of_outputs for name in _keys(figures.get("response"))),
        *(str(figures.get("largest_contribution")) for figures in of_outputs),
        *(
            name
            for variant in _tables(content.get("models"))
            for name in _keys(variant.get("with"))
        ),
        *_WORD.findall(str(content.get("constraints"))),
    }
    outputs = {
        *_keys(content.get("outputs")),
        *(name for each in published for name in _keys(each) if name != "source"),
        *(
            name
            for surrogate in _tables(content.get("surrogates"))
            for name in _keys(surrogate.get("transform"))
        ),
    }
    return PartialModel(
        "the model",
        tuple(Input(name, ANY_DIMENSION) for name in sorted(inputs)),
        tuple(Output(name, ANY_DIMENSION) for name in sorted(outputs)),
    )


def _keys(value: Any) -> Iterable[str]:
    return value if isinstance(value, dict) else ()


def _tables(value: Any) -> Iterator[dict[str, Any]]:
    for entry in value.values() if isinstance(value, dict) else ():
        if isinstance(entry, dict):
            yield entry
