"""``[model]``, or ``[models.<name>]`` where the same points go through several."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from uqpen.core.arrays import Arrays
from uqpen.core.model import Input, Model, Results
from uqpen.core.setting_fields import declared_settings
from uqpen.core.units import are_convertible
from uqpen.study.model_section import PartialModel, mentioned_model, read_model, read_partial_model
from uqpen.study.study import ONLY_MODEL, StandIn, Variant
from uqpen.study.table_reader import TableReader, check_names, named_tables

__all__ = ["ModelsTogether", "check_stand_ins", "check_variants", "read_models"]


@dataclass(frozen=True, eq=False)
class ModelsTogether(Model):
    """The first model of a study with the inputs that only others take; it cannot be run.

    Parameters
    ----------
    first : Model
        It has all outputs of the study.
    further_inputs : tuple of Input
        Inputs of the others that the first does not have.
    """

    first: Model
    further_inputs: tuple[Input, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.first.name)
        object.__setattr__(self, "inputs", (*self.first.inputs, *self.further_inputs))
        object.__setattr__(self, "outputs", self.first.outputs)
        object.__setattr__(self, "alternatives", self.first.alternatives)
        object.__setattr__(self, "derived", self.first.derived)

    def evaluate(self, inputs: Arrays) -> Results:
        """Refuse to run: each model of the study is run by itself."""
        raise NotImplementedError(self.name)


def read_models(root: TableReader) -> tuple[dict[str, Variant], Model]:
    """Read the models of a study, by name, and the one whose variables are the study's.

    That is the first, whose outputs the others have, or some of them. If others take further
    inputs, it is a `ModelsTogether`. A model with a mistake is left out; the first is then a
    `PartialModel`.
    """
    mentioned = mentioned_model(root)
    table, several = root.table("model"), root.table("models")
    if table.is_given and several.is_given:
        root.add_problem("models", "[model] and [models]", "one of them")
        return {}, mentioned
    if several.is_given:
        return _read_several(several, mentioned)
    if "model" not in root and "models" not in root:
        root.add_missing("model", "a [model] table, or [models.<name>] for several")
    model = read_model(table) if table.is_given else None
    if model is None:
        return {}, read_partial_model(table, mentioned)
    return {ONLY_MODEL: Variant(model, {})}, model


def check_variants(root: TableReader, variants: dict[str, Variant], random: set[str]) -> None:
    """Note inputs that a model sets for itself though the study draws them."""
    for name, variant in variants.items():
        for given in filter(random.__contains__, variant.given):
            found = "an input that the study draws at random"
            expected = "an input that has one value in [inputs], or a default"
            root.add_problem(("models", name, "with", given), found, expected)


def check_stand_ins(root: TableReader, models: Mapping[str, Variant]) -> None:
    """Note stand-ins for no other model, in a circle, or without a number in common."""
    names = list(root.table("models"))
    stand_ins = {name: each.stand_in for name, each in models.items() if each.stand_in}
    for name, stand_in in stand_ins.items():
        other, key = stand_in.stands_for, ("models", name, "stands_for")
        if other == name or other not in names:
            others = [each for each in names if each != name]
            root.add_wrong(key, other, f"another model; {root.suggest(other, others)}")
        elif name in _ancestors(name, stand_ins):
            expected = "a model that does not stand for this one in its turn"
            root.add_wrong(key, other, expected)
        elif other in models and not _have_numbers_in_common(models[name], models[other]):
            found = f'a model that has no number in common with "{other}"'
            root.add_problem(key, found, "an output that is a number in both models")


def _ancestors(name: str, stand_ins: Mapping[str, StandIn]) -> list[str]:
    """Return the models that one stands for, directly and through others; a circle ends."""
    found: list[str] = []
    while name in stand_ins and stand_ins[name].stands_for not in found:
        name = stand_ins[name].stands_for
        found.append(name)
    return found


def _have_numbers_in_common(one: Variant, other: Variant) -> bool:
    numbers, others = (
        {output.name for output in each.model.all_outputs if output.is_number}
        for each in (one, other)
    )
    return bool(numbers & others)


def _read_several(table: TableReader, mentioned: PartialModel) -> tuple[dict[str, Variant], Model]:
    found: dict[str, Variant] = {}
    first: Model | None = None
    inputs: dict[str, Input] = {}
    if not table.content:
        table.add_problem((), "an empty table", "a [models.<name>]")
    for name, section in named_tables(table):
        replaced = section.table("with")
        stand_in = _read_stand_in(section)
        model = read_model(section)
        known = model or read_partial_model(section, mentioned)
        if name == next(iter(table)):
            first = known
        if first is not None and mentioned not in (first, known):
            _check_inputs(section, inputs, known)
            _check_outputs(section, first, known)
        if known is not mentioned:
            inputs = {each.name: each for each in known.inputs} | inputs
        given = _read_given_inputs(replaced, known)
        if model is not None:
            found[name] = Variant(model, given, stand_in)
    if first is None or first is mentioned:
        return found, mentioned
    own = {each.name for each in first.inputs}
    further = tuple(each for name, each in inputs.items() if name not in own)
    return found, ModelsTogether(first, further) if further else first


def _read_stand_in(table: TableReader) -> StandIn | None:
    """Read which model another one stands for, and its cost; None where it stands for none."""
    keys = [field.name for field, _ in declared_settings(StandIn)]
    return table.settings(StandIn) if any(key in table for key in keys) else None


def _read_given_inputs(table: TableReader, model: Model) -> dict[str, float]:
    """Read inputs that replace the study's for a model, in SI units."""
    known = {variable.name: variable for variable in model.inputs}
    found = {}
    for name in check_names(table, known, "input", model):
        value = table.quantity(name, known[name].unit)
        if value is None:
            continue
        if not known[name].bounds.contain(np.array(value)):
            table.add_wrong(name, table.content[name], f"a value {known[name].bounds}")
        found[name] = value
    return found


def _check_inputs(table: TableReader, inputs: Mapping[str, Input], model: Model) -> None:
    """Note an input of a model that models above it have in another dimension."""
    for variable in model.inputs:
        same = inputs.get(variable.name)
        if same is not None and not are_convertible(variable.unit, same.unit):
            found = f'an input "{variable.name}" [{variable.unit}]'
            expected = f"a unit of the same dimension as in the models above it, [{same.unit}]"
            table.add_problem((), found, expected)


def _check_outputs(table: TableReader, first: Model, model: Model) -> None:
    """Note an output that the study's first model does not have, or has in another form."""
    known = {output.name: output for output in first.outputs}
    for output in model.outputs:
        same = known.get(output.name)
        if same is None or not are_convertible(output.unit, same.unit):
            found = f'an output "{output.name}" [{output.unit}]'
            expected = "only outputs of the first model, in units of the same dimension"
            table.add_problem((), found, expected)
        elif output.dims != same.dims:
            found = f'an output "{output.name}" with other dimensions or coordinates'
            table.add_problem((), found, "those that it has in the first model")
