"""``[outputs.<name>]`` and what else is asked of outputs: events, published estimates, analyses."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from typing import Any, NamedTuple

from uqpen.core.catalogue import REQUESTED
from uqpen.core.errors import (
    ConstraintError,
    ModelError,
    Problem,
    QuantityError,
    SettingsError,
    toml_text,
)
from uqpen.core.formulas import parse_formula
from uqpen.core.labels import LARGEST_CONTRIBUTION, NAME, OUTCOME_OUTPUT
from uqpen.core.lookup import choices, installed_members, load_installed, resolve
from uqpen.core.model import Model, Output
from uqpen.core.quantities import parse_quantity
from uqpen.core.settings import declared_settings, read_list
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.core.units import ANY_DIMENSION, scale
from uqpen.core.variables import DerivedOutput, Reduction, Variable
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.models.outcomes import undecided_outcome
from uqpen.models.user_code import check_signature
from uqpen.models.user_module import load_function
from uqpen.reductions import REDUCTIONS
from uqpen.reductions.derived import FormulaOutput, ReducedOutput, derived_outputs, formula_outputs
from uqpen.reductions.of_fields import At, Maximum
from uqpen.statistics import SALIB_ANALYSES
from uqpen.statistics.joint_event import JointEvent, OutputLimit
from uqpen.statistics.published import (
    STD,
    Publication,
    PublishedEstimates,
    Reading,
    printed_rounding,
)
from uqpen.statistics.quantity_of_interest import AcceptanceLimits, QuantityOfInterest
from uqpen.statistics.user_defined_analysis import SALIB, UserDefinedAnalysis
from uqpen.study.inputs_section import given_inputs
from uqpen.study.joint_section import Inputs
from uqpen.study.model_section import PartialModel
from uqpen.study.study import Variant
from uqpen.study.table_reader import (
    StudyParts,
    TableReader,
    check_names,
    family_member,
    is_variable_name,
    named_tables,
)

_OF, _TAKE, _AT, _FORMULA = "of", "take", "at", "formula"
# A key with the name of a dimension, ``time_of``, and the reductions by its values.
_PLACE_OF = "_of"
_PLACES = {"max": "idxmax", "min": "idxmin", "last": "idxlast"}
_EXAMPLE = '{ time = "10 day" }'


class _Declared(NamedTuple):
    """An output that a study derives from a field."""

    name: str
    field: Output
    reduction: Reduction


def is_derived(table: object) -> bool:
    """Check for the table of an output that follows from a field, or from numbers by a formula."""
    return isinstance(table, Mapping) and (_OF in table or _FORMULA in table)


def derive_outputs(
    table: TableReader, model: Model, variants: Mapping[str, Variant]
) -> tuple[Model, dict[str, Variant]]:
    """Return the models of a study with the outputs that ``[outputs]`` derives from others.

    Mistakes are noted; an output with one is of any dimension.

    Parameters
    ----------
    table : TableReader
        All of ``[outputs]``.
    model : Model
        The first model; a `PartialModel` where it has mistakes.
    variants : mapping of str to Variant
        The models by name. Each gets the outputs that follow from outputs of its own.
    """
    found: list[_Declared] = []
    derived: list[DerivedOutput] = []
    known = {each.name for each in (*model.inputs, *model.outputs)}
    known.update(dimension.name for output in model.outputs for dimension in output.dims)
    for name in table:
        if (
            not is_derived(content := table.content[name])
            or _FORMULA in content
            or (isinstance(model, PartialModel) and name in known)
        ):
            continue
        declared = _read_declared(table.table(name), name, model)
        outputs = derived_outputs(*declared) if declared else _mistaken(name)
        if _has_free_names(table, outputs, known):
            derived += outputs
            found += [declared] if declared else []
            known.update(each.output.name for each in outputs)
    of_numbers, formulas = _read_formulas(table, model.with_derived(derived), known)
    derived += of_numbers
    changed = {}
    for label, variant in variants.items():
        own = {output.name: output for output in variant.model.outputs}
        fields = [
            each._replace(field=own[each.field.name]) for each in found if each.field.name in own
        ]
        of_model = [output for each in fields for output in derived_outputs(*each)]
        for name, text in formulas.items():
            with suppress(ConstraintError):  # of an output that this model does not have
                of_model += _formula_outputs(name, text, variant.model.with_derived(of_model))
        changed[label] = replace(variant, model=variant.model.with_derived(of_model))
    return model.with_derived(derived), changed


def _read_formulas(
    table: TableReader, model: Model, known: set[str]
) -> tuple[list[DerivedOutput], dict[str, str]]:
    """Read the outputs that follow from numbers; return them, and the text of each formula.

    A formula may name an output that another one before it gives. `known` gets the new names.
    """
    made: list[DerivedOutput] = []
    formulas: dict[str, str] = {}
    for name in table:
        if not is_derived(content := table.content[name]) or _FORMULA not in content:
            continue
        section = table.table(name)
        noted = len(table.problems)
        text = section.text(_FORMULA, 'a formula, such as "strength - load"')
        if _OF in section:
            section.add_problem((), f"{_OF} and {_FORMULA}", "one of them")
        outputs = _mistaken(name)
        if text and len(table.problems) == noted and not isinstance(model, PartialModel):
            try:
                outputs = _formula_outputs(name, text, model.with_derived((*model.derived, *made)))
                formulas[name] = text
            except ConstraintError as error:
                section.add_problems(error.problems, _FORMULA)
        if not (isinstance(model, PartialModel) and name in known) and _has_free_names(
            table, outputs, known
        ):
            made += outputs
            known.update(each.output.name for each in outputs)
    return made, formulas


def _mistaken(name: str) -> tuple[DerivedOutput, ...]:
    """Return an output of any dimension, as its declaration has a mistake."""
    output = Output(name, ANY_DIMENSION)
    return (ReducedOutput(output, output, Maximum()),)


def _formula_outputs(name: str, text: str, model: Model) -> tuple[DerivedOutput, ...]:
    """Return what a formula of numbers of a model gives; ConstraintError where it has a mistake."""
    numbers: dict[str, Variable] = {each.name: each for each in model.inputs}
    numbers |= {each.name: each for each in model.all_outputs if each.is_number}
    units = {each.name: each.unit for each in numbers.values()}
    formula = parse_formula(text, units, f"an output or input of {model.name} that is a number")
    named = [each for each in numbers.values() if each.name in formula.names]
    return formula_outputs(name, formula, named)


def check_formulas(table: TableReader, models: Mapping[str, Variant], inputs: Inputs) -> None:
    """Note formulas that name an input without a value."""
    for variant in models.values():
        given = given_inputs(variant.model, inputs).union(variant.given)
        for derived in variant.model.derived:
            if isinstance(derived, FormulaOutput) and not derived.output.categories:
                own = derived.formula.names.intersection(each.name for each in variant.model.inputs)
                for name in sorted(own - given):
                    found = f'"{name}", an input without a value'
                    expected = "inputs of which the study gives a value"
                    table.add_problem((derived.output.name, _FORMULA), found, expected)


def _requests_table(table: TableReader, output: Output, model: Model) -> TableReader:
    """Return the table of an output as far as it asks for statistics.

    The keys by which it says what the output is derived from are taken. It is empty where they
    have a mistake.
    """
    section = table.table(output.name)
    if not is_derived(section.content):
        return section
    derived = {each.output: each for each in model.derived}.get(output)
    if derived is None or output.categories or output.unit is ANY_DIMENSION:
        return section.inside({})
    settings = declared_settings(derived.reduction) if isinstance(derived, ReducedOutput) else ()
    keys = (
        [_FORMULA]
        if isinstance(derived, FormulaOutput)
        else [_OF, _TAKE, _AT, *(setting.key or field.name for field, setting in settings)]
    )
    if isinstance(derived, ReducedOutput):
        keys += [key for key in section if key.endswith(_PLACE_OF)]
    elif output.is_difference:
        _check_unit(section, output.unit)
    for key in keys:
        section.take(key)
    return section


def _has_free_names(table: TableReader, derived: Sequence[DerivedOutput], known: set[str]) -> bool:
    """Check the names of a derived output and its companion; note one that is taken."""
    first, names = derived[0].output.name, [each.output.name for each in derived]
    if not is_variable_name(table, first):
        return False
    if taken := [name for name in names if name in known]:
        found = f'an output "{taken[0]}", a name that the study has already'
        table.add_problem(first, found, "a name of its own")
    return not taken


def _read_declared(table: TableReader, name: str, model: Model) -> _Declared | None:
    """Read what an output is derived from; None where a mistake was noted."""
    field = _read_field(table, model)
    if field is None:
        return None
    key = _way(table, field)
    noted = len(table.problems)
    reduction = _read_reduction(table, key, field) if key else None
    if reduction is None or len(table.problems) > noted:
        return None
    for found, expected in reduction.mistakes(field):
        table.add_problem(key, found, expected)
    if reduction.is_difference:
        _check_unit(table, reduction.unit(field))
    return _Declared(name, field, reduction) if len(table.problems) == noted else None


def _read_field(table: TableReader, model: Model) -> Output | None:
    """Read the field that an output is derived from; None where a mistake was noted."""
    known = [output for output in model.outputs if output.unit is not ANY_DIMENSION]
    fields = {output.name: output for output in known if output.dims}
    name = table.text(_OF, "the name of an output with dimensions")
    if name is None or name in fields or isinstance(model, PartialModel):
        return fields.get(name or "")
    expected = f"an output of {model.name} with dimensions; {choices(name, fields)}"
    table.add_wrong(_OF, name, expected)
    return None


def _way(table: TableReader, field: Output) -> str:
    """Return the key that says what is taken of a field; empty where a mistake was noted."""
    given = [key for key in table if key in (_TAKE, _AT) or key.endswith(_PLACE_OF)]
    known = [f"{dimension.name}{_PLACE_OF}" for dimension in field.dims]
    if len(given) != 1:
        found = " and ".join(given) or "nothing to take"
        table.add_problem((), found, f"one of {', '.join((_TAKE, _AT, *known))}")
        return ""
    if given[0] not in (_TAKE, _AT, *known):
        table.add_problem(given[0], "an unknown dimension", choices(given[0], known))
        return ""
    return given[0]


def _read_reduction(table: TableReader, key: str, field: Output) -> Reduction | None:
    """Read a reduction by the key that names it; None where a mistake was noted."""
    if key == _AT:
        places = table.table(_AT, f"a table of coordinates, such as {_EXAMPLE}")
        if not places.is_given:
            return None
        read = {each.name: places.quantity(each.name, each.unit) for each in field.dims}
        places.check_unknown_keys("dimension")
        return At(tuple((name, value) for name, value in read.items() if value is not None))
    if key == _TAKE:
        family = {name: each for name, each in REDUCTIONS.items() if name != _AT}
        kind = family_member(table, key, family, "something to take")
    else:
        place = table.take(key)
        kind = None
        if isinstance(place, str) and place in _PLACES:
            kind = resolve(REDUCTIONS[_PLACES[place]])
        else:
            table.add_wrong(key, place, f"one of {', '.join(_PLACES)}")
    reduction: Reduction | None = kind and table.settings(kind, like=field.unit)
    return reduction


def _check_unit(table: TableReader, unit: str) -> None:
    """Note a unit with a zero of its own, such as degC, in which no difference can be shown."""
    written = table.content.get("unit")
    try:
        has_zero = isinstance(written, str) and scale(written).offset
    except QuantityError:
        return  # which is noted with the other keys
    if has_zero:
        expected = f"a unit such as {toml_text(unit)}, as it is a difference"
        table.add_wrong("unit", written, expected)


# Requests of which a field has none. A limit that holds a share has one side, a band has two; the
# scale of a chart is of one number.
_OF_SCALARS = {each.asked.key: each.asked.refusal for each in REQUESTED if each.asked.refusal} | {
    "scale": "a scale of charts"
}


def read_quantities_of_interest(
    table: TableReader, parts: StudyParts
) -> tuple[QuantityOfInterest, ...]:
    """Read the quantity of interest of each output, derived ones too, in the model's order."""
    model = parts.model
    refused = [name for name in table if is_derived(table.content[name])]
    known = [output.name for output in model.all_outputs]
    check_names(table, [*known, *refused], "output", model)
    return tuple(
        _read_quantity(_requests_table(table, output, model), output, parts.confidence_level)
        for output in model.all_outputs
    )


def _read_quantity(
    table: TableReader, output: Output, confidence_level: float
) -> QuantityOfInterest:
    given: dict[str, Any] = {
        "output": output,
        "display_unit": output.preferred_unit,
        "confidence_level": confidence_level,
    }
    default = QuantityOfInterest(**given)
    if output.categories:
        for key in table:
            table.add_problem(
                key, f'a key of "{output.name}"', "none: an output with categories has shares only"
            )
        return default
    for key in _OF_SCALARS if output.dims else ():
        if key in table:
            expected = "an output without dimensions"
            if "tolerance" in _OF_SCALARS[key]:
                expected += "; a field has hold_between"
            table.add_problem(key, f'{_OF_SCALARS[key]} of "{output.name}"', expected)
    quantity = table.settings(
        QuantityOfInterest,
        like=output.unit,
        allow_offset=not output.is_difference,
        given=given,
    )
    table.check_unknown_keys()
    if quantity is not None and quantity.is_logarithmic:
        _check_logarithms(table, quantity)
    return quantity or default


def _check_logarithms(table: TableReader, quantity: QuantityOfInterest) -> None:
    """Note what has no logarithm: a unit with a zero of its own, a threshold at or below 0."""
    if scale(quantity.display_unit).offset:
        expected = "a unit whose zero is no value, such as K; or no scale"
        table.add_wrong("scale", f"log in {quantity.display_unit}", expected)
    asked = {"exceeds": quantity.thresholds, "below": quantity.lower_thresholds}
    for key, thresholds in asked.items():
        for threshold in thresholds:
            if threshold.value <= 0:
                expected = 'a value above 0, as scale = "log" takes its logarithm'
                table.add_wrong(key, threshold.text, expected)


_COMPARISON = re.compile(r"\s*(\w+)\s*([<>])(?!=)\s*(.+?)\s*\Z", re.ASCII)
_LIMIT = 'a limit of an output, such as "depth < 60 cm"'
_ALL, _ANY, _GIVEN, _SENSITIVITIES = "all", "any", "given", "sensitivities"
_EVENT = 'a list of limits, or a table such as { any = ["depth > 60 cm"], at_most = 0.05 }'

_CONDITION = 'a list of limits, or a table such as { any = ["depth > 60 cm"] }'


def read_joint_probabilities(table: TableReader, parts: StudyParts) -> tuple[JointEvent, ...]:
    """Read the events whose probabilities a study requests; invalid ones are noted and left out."""
    found = []
    for name in table:
        written = table.take(name)
        if not NAME.match(name):
            table.add_wrong(name, name, "a name of letters, digits and _, at most 100")
            continue
        try:
            found.append(_read_event(name, written, parts.model))
        except (SettingsError, QuantityError) as error:
            table.add_problems(error.problems, name)
    return tuple(found)


def _read_event(name: str, written: object, model: Model) -> JointEvent:
    if isinstance(written, list):
        return JointEvent(name, _read_limits(written, model))
    if not isinstance(written, dict):
        raise QuantityError(toml_text(written), _EVENT)
    content = dict(written)
    limits, is_any = _read_quantified(content, model)
    given = _read_given(content.pop(_GIVEN), model) if _GIVEN in content else None
    sensitivities = content.pop(_SENSITIVITIES, False)
    if not isinstance(sensitivities, bool):
        raise SettingsError([Problem((_SENSITIVITIES,), toml_text(sensitivities), "true or false")])
    if sensitivities and given:
        found, expected = "true, of a conditional probability", "an event without given"
        raise SettingsError([Problem((_SENSITIVITIES,), found, expected)])
    if unknown := [key for key in content if key not in ("at_most", "at_least")]:
        expected = "all or any, given, sensitivities, at_most or at_least"
        raise SettingsError([Problem((unknown[0],), "an unknown key", expected)])
    return JointEvent(name, limits, is_any, AcceptanceLimits(**content), given, sensitivities)


def _read_quantified(
    content: dict[str, object], model: Model
) -> tuple[tuple[OutputLimit, ...], bool]:
    """Take the limits out of a table; return them, and whether any of them suffices."""
    quantifiers = [key for key in (_ALL, _ANY) if key in content]
    if len(quantifiers) != 1:
        found = "both all and any" if quantifiers else "neither all nor any"
        raise QuantityError(found, _EVENT)
    (quantifier,) = quantifiers
    with _within(quantifier):
        is_any = quantifier == _ANY
        return _read_limits(content.pop(quantifier), model, is_any=is_any), is_any


def _read_given(written: object, model: Model) -> JointEvent:
    """Read the condition of an event: limits that all hold, or a table of those."""
    with _within(_GIVEN):
        if isinstance(written, list):
            return JointEvent(_GIVEN, _read_limits(written, model))
        if not isinstance(written, dict):
            raise QuantityError(toml_text(written), _CONDITION)
        content = dict(written)
        limits, is_any = _read_quantified(content, model)
        if content:
            raise SettingsError([Problem((next(iter(content)),), "an unknown key", "all or any")])
        return JointEvent(_GIVEN, limits, is_any)


@contextmanager
def _within(key: str) -> Iterator[None]:
    """Extend the path of problems that are raised in this context by a key."""
    try:
        yield
    except (SettingsError, QuantityError) as error:
        raise SettingsError([each.within(key) for each in error.problems]) from None


def _read_limits(written: object, model: Model, *, is_any: bool = False) -> tuple[OutputLimit, ...]:
    limits = read_list(written, lambda each: _read_limit(each, model))
    if not limits:
        raise QuantityError("an empty list", _LIMIT)
    outcomes = [each for each in limits if each.is_category]
    for each in outcomes if len(outcomes) < len(limits) else ():
        if fault := undecided_outcome(each.text, is_any=is_any):
            raise QuantityError(*fault)
    return tuple(limits)


def _read_limit(written: object, model: Model) -> OutputLimit:
    match = _COMPARISON.match(written) if isinstance(written, str) else None
    if match is None:
        flags = _outcome_flags(model)
        text = written if isinstance(written, str) else ""
        *negation, flag = text.split() or [""]
        if flag in flags and negation in ([], ["not"]):
            position = float(flags.index(flag))
            words = " ".join(text.split())
            return OutputLimit(words, OUTCOME_OUTPUT, not negation, position, is_category=True)
        expected = f"{_LIMIT}; or an outcome, {', '.join(flags[1:])}" if flags else _LIMIT
        raise QuantityError(toml_text(written), expected)
    name, sign, value = match.groups()
    outputs = {output.name: output for output in model.all_outputs if output.is_number}
    if name not in outputs:
        expected = f"an output of {model.name} that is a number; {choices(name, outputs)}"
        raise QuantityError(toml_text(name), expected)
    output = outputs[name]
    number = parse_quantity(value, output.unit, allow_offset=not output.is_difference).value
    return OutputLimit(f"{name} {sign} {value}", name, sign == ">", number)


def _outcome_flags(model: Model) -> list[str]:
    """Return the categories of the runs of a model with declared outcomes; empty without."""
    outputs = [each for each in model.outputs if each.name == OUTCOME_OUTPUT]
    return [category.flag for output in outputs for category in output.categories]


def read_published(table: TableReader, parts: StudyParts) -> dict[str, Publication]:
    """Read the publications of a study; invalid entries are noted and left out."""
    found: dict[str, Publication] = {}
    for name, section in named_tables(table):
        if name in parts.sources:
            section.add_wrong((), name, "a name that no design or surrogate has")
            continue
        publication = section.settings(Publication)
        printed = section.table("uncertainties")
        known = [variable.name for variable in parts.model.inputs]
        check_names(printed, known, "input", parts.model)
        readings = dict(_read_readings(section.table("readings"), parts.model))
        estimates = [
            _read_estimates(section, output, parts.model) for output in parts.model.all_outputs
        ]
        section.check_unknown_keys("output")
        if publication is not None:
            found[name] = replace(
                publication,
                estimates=tuple(filter(None, estimates)),
                uncertainty_rounding=printed_rounding(printed.content),
                readings=readings,
            )
    return found


# Statuses of runs for which a reading may have values.
_LOST = tuple(status.meaning for status in Status if status is not Status.OK)
# The tables of a study that a reading may change, and its other keys.
_CHANGED = ("model", "models", "inputs", "joint", "dependence", "constraints", "designs")
_READING_KEYS = ("note", "lost", *_CHANGED)


def _read_readings(table: TableReader, model: Model) -> Iterator[tuple[str, Reading]]:
    """Yield the readings of a publication; whether each is a study is found by reading it."""
    for name, section in named_tables(table):
        note = section.text("note", "a text in quotes") if "note" in section else ""
        lost = {}
        for status in (losses := section.table("lost")):
            if status not in _LOST:
                losses.add_problem(status, "an unknown status", f"one of {', '.join(_LOST)}")
                continue
            values = losses.table(status)
            outputs = [output.name for output in model.all_outputs if output.is_number]
            given = check_names(values, outputs, "output", model)
            quantities = {each: values.quantity(each, model.output(each).unit) for each in given}
            lost[status] = {key: each for key, each in quantities.items() if each is not None}
        changes = {key: section.take(key) for key in _CHANGED if key in section}
        for key, value in changes.items():
            if not isinstance(value, dict):
                section.add_wrong(key, value, f"a table of changes of [{key}]")
        for key in section:
            if key not in _READING_KEYS:
                expected = f"a table of the study; {choices(key, _READING_KEYS)}"
                section.add_problem(key, "an unknown key", expected)
        if section.content.keys() <= {"note"}:
            expected = 'a change of the study, such as inputs.x = "(17 ± 4) mm"'
            section.add_problem((), "a reading that changes nothing", expected)
        yield name, Reading(note or "", changes, lost)


def _read_estimates(
    section: TableReader, output: Output, model: Model
) -> PublishedEstimates | None:
    if output.name not in section:
        return None
    table = section.table(output.name)
    if output.categories:
        for key in table:
            table.add_problem(
                key, "an estimate of an output with categories", "an output with numbers"
            )
        return None
    if output.dims:
        for key in table:
            expected = "an output without dimensions"
            table.add_problem(key, f'an estimate of "{output.name}"', expected)
        return None
    largest = table.content.get(LARGEST_CONTRIBUTION) or ""
    given = {"output": output, LARGEST_CONTRIBUTION: str(largest)}
    estimates = table.settings(
        PublishedEstimates,
        like=output.unit,
        allow_offset=not output.is_difference,
        given=given,
    )
    known = [variable.name for variable in model.inputs]
    check_names(table.table("response"), known, "input", model)
    if table.take(LARGEST_CONTRIBUTION) and largest not in known:
        expected = f"an input of {model.name}; {choices(str(largest), known)}"
        table.add_wrong(LARGEST_CONTRIBUTION, largest, expected)
    table.check_unknown_keys()
    if estimates is None or not table.is_given:
        return None
    moments = {name: table.content[name] for name in estimates.moments}
    return replace(
        estimates,
        rounding=printed_rounding(moments, [STD]),
        response_rounding=printed_rounding(table.table("response").content),
    )


ANALYSES_KEY = "analyses"

# The entry points with which installed packages add analyses.
_GROUP = "uqpen.analyses"

# Stand-ins of its arguments, a sample and a quantity of interest.
_ARGUMENTS = (None, None)


# What is asked of SALib in another way, and how.
_NOT_OF_RUNS = {
    "sobol": 'a design of kind = "saltelli", which has its indices',
    "morris": 'a design of kind = "morris", which has its effects',
    "fast": 'a design of kind = "salib:fast_sampler", which has its indices',
    "dgsm": 'a design of kind = "salib:finite_diff": of given runs, an input without effect '
    "would seem to have one",
    "ff": 'a design of kind = "salib:ff", which has its effects',
    "hdmr": '"salib:enhanced_hdmr": two calls of this one differ, as it ignores its seed',
}


def read_analyses(root: TableReader, seed: int) -> tuple[UserDefinedAnalysis, ...]:
    """Read the analyses of a study's own, without those for which a mistake was noted.

    Those of SALib draw their random numbers from the study's seed.
    """
    analyses: dict[str, UserDefinedAnalysis] = {}
    for position, reference in enumerate(root.entries(ANALYSES_KEY)):
        place = (ANALYSES_KEY, position)
        is_of_salib = isinstance(reference, str) and reference.startswith(SALIB)
        table = {"salib": reference[len(SALIB) :]} if is_of_salib else reference
        if isinstance(table, dict):
            made = _read_salib(root.inside(table, *place), seed)
            if made and made.reference in analyses:
                root.add_problem(place, f"{toml_text(made.reference)} again", "each analysis once")
            elif made:
                analyses[made.reference] = made
        elif not isinstance(reference, str) or not reference.strip():
            expected = 'a function such as "spread.py:interquartile_range", or "salib:pawn"'
            root.add_wrong(place, reference, expected)
        elif reference in analyses:
            root.add_problem(place, f"{toml_text(reference)} again", "each function once")
        else:
            try:
                analysis = analyses[reference] = _load_analysis(root, reference)
                if fault := analysis.record_fault:
                    root.add_problem(place, f"{reference}: {fault[0]}", fault[1])
            except ModelError as error:
                expected = "a function that can be called with a sample and a quantity of interest"
                root.add_problem(place, str(error), error.expected or expected)
    return tuple(analyses.values())


def _read_salib(table: TableReader, seed: int) -> UserDefinedAnalysis | None:
    """Read an analysis of SALib with its settings; None where a mistake was noted."""
    name = table.text("salib", f"an analysis of SALib: {', '.join(SALIB_ANALYSES)}")
    if name is None:
        return None
    if name not in SALIB_ANALYSES:
        expected = (
            _NOT_OF_RUNS.get(name) or f"an analysis of SALib; {choices(name, SALIB_ANALYSES)}"
        )
        table.add_wrong("salib", name, expected)
        return None
    cls = resolve(SALIB_ANALYSES[name])
    drawn = int(Stream(seed, ANALYSES_KEY, SALIB + name).generator().integers(1, 2**31))
    made = table.settings(cls, given={"seed": drawn})
    table.check_unknown_keys()
    return made and UserDefinedAnalysis(SALIB + name, made)


def check_analyses(
    root: TableReader, analyses: Sequence[UserDefinedAnalysis], joint: JointDistribution
) -> None:
    """Note analyses that have no meaning for inputs that depend on each other."""
    if joint.is_independent:
        return
    entries = root.content[ANALYSES_KEY] if analyses else []
    names = [each.get("salib") if isinstance(each, dict) else each for each in entries]
    names = [str(name).removeprefix(SALIB) for name in names]
    for analysis in analyses:
        if reason := getattr(analysis.function, "independence_reason", ""):
            name = analysis.reference.removeprefix(SALIB)
            place = (ANALYSES_KEY, names.index(name))
            found = f'"{analysis.reference}" with inputs that depend on each other'
            root.add_problem(place, found, f'{reason}; "{SALIB}pawn" and "{SALIB}delta" take any')


def _load_analysis(root: TableReader, reference: str) -> UserDefinedAnalysis:
    """Return the analysis behind a reference; one that is not trusted is not loaded.

    An analysis of an installed package has a name without a colon, and needs no trust.
    """
    if ":" not in reference:
        installed = installed_members(_GROUP)
        if reference not in installed:
            found = f'"{reference}" is not of the form "my_analysis.py:function", nor installed'
            raise ModelError(f"{found}; {choices(reference, installed)}")
        function: Callable[..., Any] = load_installed(_GROUP, reference)
        if not callable(function):
            raise ModelError(f'"{reference}" is an object of class {type(function).__name__}')
        check_signature(function, "", _ARGUMENTS)
        return UserDefinedAnalysis(reference, function)
    if not root.trust:
        return UserDefinedAnalysis(reference, _refuse)
    function, surroundings = load_function(reference, root.folder)
    check_signature(function, "", _ARGUMENTS)
    return UserDefinedAnalysis(reference, function, surroundings)


def _refuse(*arguments: object) -> Iterator[Any]:
    raise ModelError("user-defined analyses are not executed without --trust")
