"""Parts of the error of an answer, each by its own definition, and the total.

The parts are of different kinds, so their widths do not add. The total is an interval that was
computed for all that it has in it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.estimates import array_entries
from uqpen.archive.read import group_names, model_trees
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import (
    DIFFERENCES,
    FINER_THAN,
    MISSING,
    MORE_SPECIMENS,
    SPECIMENS,
    STANDS_FOR,
    SWEEP,
)
from uqpen.core.statistic import Statistic, UnitRule
from uqpen.core.status import Status
from uqpen.core.units import scale
from uqpen.results.digits import estimate_texts, percent_texts, range_text
from uqpen.results.source_statistics import SourceStatistics, is_sample_design, labelled_entries
from uqpen.results.table import NOTHING, OutputTable, estimate_remark, json_value, label_with_unit

# The answers whose errors are stated.
_ANSWERS = tuple(CATALOGUE[name] for name in ("exceedance", "below", "mean", "std", "quantile"))
# Those with a statement even if it has no part that may be the largest.
_ALWAYS = _ANSWERS[:3]

# How many times the runs are, in what more of them buy.
_TIMES = 4

# Names of the parts, and what the names of arrays begin with.
_SAMPLING, _SURROGATE, _MODEL, _FINER, _CHANGE = "sampling", "surrogate", "model", "finer", "change"
_FITTED, _INTERVALS, _LIMITS, _FAILED = "fitted", "intervals", "limits of these", "failed runs"
_FORM, _TOTAL = "model form", "total"
# What the name of a part that may be the largest begins with.
MAIN = (_FITTED, _INTERVALS, _FINER, _FAILED)
_PREFIXES = ("plug_in_", "fitted_", "lower_", "upper_", "total_")

_DEFINITIONS = {
    _SAMPLING: "interval of the runs, at the distributions as they are stated or fitted",
    _SURROGATE: "of a surrogate that real runs correct",
    _FITTED: "over all parameters that fit the specimens as well, with the sampling error; the "
    "family is taken as known",
    _INTERVALS: "from the least to the largest answer over the intervals of the inputs",
    _LIMITS: "from the lower limit of the least to the upper limit of the largest",
    _FAILED: "from no failed run in the event to all of them",
    _FINER: "from this answer to that of the finer model, which is the same model, with the error "
    "of their difference at common points; what is finer still may change it further",
    _FORM: "range of the answers of {models} models at common points: no probability, "
    "and in no interval",
}
_OVER_BOTH = "from the least to the largest answer of both models over the intervals of the inputs"
_BOUGHT = "if further runs scatter as these do; no other part gets narrower by runs"
_BOUGHT_BY_SPECIMENS = "this part, if further specimens scatter as these do"


class ErrorPart(NamedTuple):
    """A part of the error of an answer."""

    name: str
    lower: float  # in SI units; not a number where the part is not known
    upper: float
    definition: str

    @property
    def is_known(self) -> bool:
        """True if both of its ends are known."""
        return math.isfinite(self.lower) and math.isfinite(self.upper)


class ErrorStatement(NamedTuple):
    """All parts of the error of one answer, and the total."""

    output: str
    label: str  # of the answer, such as ``"P(> 60 cm)"``
    design: str
    is_probability: bool
    unit: str  # that it is shown in
    answer: float
    parts: tuple[ErrorPart, ...]
    total: ErrorPart
    bought: tuple[ErrorPart, ...]  # what more runs make of a part

    @property
    def column(self) -> str:
        """The label with the unit, as the head of a column."""
        return self.label if self.is_probability else label_with_unit(self.label, self.unit)

    def text(self, part: ErrorPart) -> str:
        """Return the range of a part in the digits that it has; a dash where it is not known."""
        if not part.is_known:
            return NOTHING
        values = [self.answer, part.lower, part.upper]
        if self.is_probability:
            _, *ends = percent_texts(*values)
        else:
            _, *ends = estimate_texts(*scale(self.unit).from_si(np.array(values)).tolist())
        return range_text(*ends)


def error_statements(archive: xr.DataTree) -> Iterator[ErrorStatement]:
    """Yield the statement of each answer whose error has two known parts or more.

    It is of the first model if there are several, and by the first design with an interval over
    fitted parameters, or with one at all.
    """
    if archive.attrs.get(SWEEP):
        return  # its models are one at several values, whose differences are the answer
    for output, design, unit, record, arrays in _estimates(archive):
        for label, entries in labelled_entries(record, arrays):
            name, is_probability = record.name, record.unit is UnitRule.NONE
            answers = (entries.get(each) for each in (f"plug_in_{name}", name))
            known = [float(each[0]) for each in answers if each is not None]
            parts = tuple(_parts(name, entries, known, is_probability=is_probability))
            if not _is_stated(record, entries, parts):
                continue
            middles = ((part.lower + part.upper) / 2 for part in parts if part.is_known)
            answer = next(iter((*known, *middles)))
            total, bought = _total(name, entries, parts), tuple(_bought(entries, parts, answer))
            yield ErrorStatement(
                output, label, design, is_probability, unit, answer, parts, total, bought
            )


def _estimates(
    archive: xr.DataTree,
) -> Iterator[tuple[str, str, str, Statistic, dict[str, xr.DataArray]]]:
    """Yield each output with a design, a unit and an answer, and all estimates that are of it."""
    trees = model_trees(archive)
    models = {name: SourceStatistics(tree) for name, tree in trees.items()}
    statistics = next(iter(models.values()))
    differences = {
        name: SourceStatistics.of_differences(archive, name)
        for name in group_names(archive, DIFFERENCES)
    }
    finer = [name for name, tree in trees.items() if FINER_THAN in tree.attrs]
    alternatives = [
        name for name, tree in trees.items() if not {FINER_THAN, STANDS_FOR} & tree.attrs.keys()
    ]
    surrogates = [name for name in statistics.sources if statistics.kind(name) == "surrogate"]
    for output in statistics.scalar_outputs:
        for record in _ANSWERS:
            name = record.name
            design = _design(statistics, output, name)
            if design is None:
                continue
            found: dict[str, xr.DataArray | None] = {}
            found |= _together(statistics, design, output, name)
            for each in finer:
                of_finer = _together(models[each], design, output, name)
                found |= {f"{_FINER} {each} {key}": array for key, array in of_finer.items()}
                if each in differences:  # those over a box have none
                    found[f"{_CHANGE} {each}"] = differences[each].change(design, output, name)
            for each in surrogates:
                found[f"{_SURROGATE} {each}"] = statistics.get(each, output, name)
            for each in alternatives:
                own = _together(models[each], design, output, name)
                found[f"{_MODEL} {each}"] = own.get(f"plug_in_{name}", own.get(name))
            known = {key: array for key, array in found.items() if array is not None}
            # Those of the runs alone, without a failed one, are of one part.
            alone = {name, f"{_MODEL} {next(iter(models))}"}
            if known.keys() - alone or MISSING in known[name].attrs:
                yield output, design, statistics.unit(output), record, known


def _design(statistics: SourceStatistics, output: str, name: str) -> str | None:
    """Return the design whose answer it is; None where none has an interval."""
    having: dict[int, str] = {}
    for design in statistics.sources:
        if statistics.kind(design) != "design":
            continue
        stated = statistics.statistics(design, output)
        over = {prefix for prefix in _PREFIXES if f"{prefix}{name}" in stated}
        of_unknowns = any(f"{prefix}mean" in stated for prefix in _PREFIXES)
        if {"fitted_", "total_"} & over:
            having.setdefault(0, design)
        elif over or (
            not of_unknowns and name in stated and is_sample_design(statistics.tree, design)
        ):
            having.setdefault(1, design)
        elif not of_unknowns and name in stated and np.isfinite(stated[name].values).all():
            having.setdefault(2, design)
    return having[min(having)] if having else None


def _together(
    statistics: SourceStatistics, design: str, output: str, name: str
) -> dict[str, xr.DataArray]:
    """Return the answer of a model by a design, and those over unknowns, by their names."""
    stated = statistics.statistics(design, output)
    names = (name, *(f"{prefix}{name}" for prefix in _PREFIXES))
    found = {each: stated[each] for each in names if each in stated}
    if (more := stated.get(f"{MORE_SPECIMENS}{name}")) is not None:
        labels = more[SPECIMENS].values.tolist()
        found |= {
            f"{_FITTED}, {key}": each for key, each in zip(labels, array_entries(more), strict=True)
        }
    return found


def _is_stated(
    record: Statistic, arrays: dict[str, xr.DataArray], parts: Sequence[ErrorPart]
) -> bool:
    """Check for two known parts; an answer that need not have a statement has a main one, too.

    The limits of the intervals are those of one part, unless there is one without a row.
    """
    is_one = f"total_{record.name}" not in arrays
    counted = [each for each in parts if each.name != _LIMITS or not is_one]
    is_main = any(each.name.startswith(MAIN) for each in counted)
    return sum(each.is_known for each in counted) > 1 and (is_main or record in _ALWAYS)


def _parts(
    name: str, arrays: dict[str, xr.DataArray], known: list[float], *, is_probability: bool
) -> Iterator[ErrorPart]:
    """Yield the parts of the error of an answer."""
    own = arrays.get(f"plug_in_{name}", arrays.get(name))
    surrogates = {key: each for key, each in arrays.items() if key.startswith(_SURROGATE)}
    named = {_SAMPLING: own, **surrogates, _FITTED: arrays.get(f"fitted_{name}")}
    for part, array in named.items():
        if array is not None:
            _, lower, upper = array.values.tolist()
            text = _DEFINITIONS[part.split()[0]]
            text += "; of the next specimen" * (part in surrogates and f"fitted_{name}" in arrays)
            found = ErrorPart(part, lower, upper, text)
            yield found if found.is_known else found._replace(definition=estimate_remark(array))
    least, largest = arrays.get(f"lower_{name}"), arrays.get(f"upper_{name}")
    if least is not None and largest is not None:
        ends, limits = (least[0], largest[0]), (least[1], largest[2])
        of_limits = ErrorPart(_LIMITS, float(limits[0]), float(limits[1]), _DEFINITIONS[_LIMITS])
        text = _DEFINITIONS[_INTERVALS] if of_limits.is_known else estimate_remark(least)
        yield ErrorPart(_INTERVALS, float(ends[0]), float(ends[1]), text)
        yield of_limits
    if known and is_probability and (share := _missing_share(own)):
        lower, upper = _for_any_outcome(known[0], known[0], share)
        yield ErrorPart(_FAILED, lower, upper, _DEFINITIONS[_FAILED])
    yield from _finer_parts(name, arrays, known, is_probability=is_probability)
    answers = [float(each[0]) for key, each in arrays.items() if key.startswith(_MODEL)]
    if len(answers) > 1:
        text = _DEFINITIONS[_FORM].format(models=len(answers))
        yield ErrorPart(_FORM, min(answers), max(answers), text)


def _finer_parts(
    name: str, arrays: dict[str, xr.DataArray], known: list[float], *, is_probability: bool
) -> Iterator[ErrorPart]:
    """Yield the part of each finer model: of the paired difference, or over the intervals."""
    for finer in dict.fromkeys(key.split()[1] for key in arrays if key.startswith(f"{_FINER} ")):
        change, part = arrays.get(f"{_CHANGE} {finer}"), f"{_FINER}: {finer}"
        if change is not None and known:
            lower, upper = (known[0] + change.values[1:]).tolist()
            if not math.isfinite(upper - lower):
                yield ErrorPart(part, lower, upper, estimate_remark(change))
                continue
            if is_probability:
                lower, upper = max(lower, 0.0), min(upper, 1.0)
            yield ErrorPart(part, min(lower, known[0]), max(upper, known[0]), _DEFINITIONS[_FINER])
            continue
        of_both = [f"{end}_{name}" for end in ("lower", "upper")]
        of_both += [f"{_FINER} {finer} {key}" for key in of_both]
        if ends := [float(arrays[key][0]) for key in of_both if key in arrays]:
            yield ErrorPart(part, min(ends), max(ends), _OVER_BOTH)


def _missing_share(array: xr.DataArray | None) -> float:
    """Return the share of the runs that may lie anywhere, as they have failed; 0 without any."""
    if array is None or MISSING not in array.attrs:
        return 0.0
    lost = sum(
        int(array.attrs.get(f"runs_{each.meaning}", 0))
        for each in Status
        if each not in (Status.OK, Status.INADMISSIBLE)
    )
    return lost / (lost + int(array.attrs["runs_used"]))


def _for_any_outcome(lower: float, upper: float, share: float) -> tuple[float, float]:
    """Return the ends of a probability over the runs with a value, as those over all runs."""
    return (1 - share) * lower, (1 - share) * upper + share


def _computed(name: str, arrays: dict[str, xr.DataArray]) -> tuple[float, float, str, str]:
    """Return the interval of a model that is computed for all at once: for what, or why not."""
    both, fitted = arrays.get(f"total_{name}"), arrays.get(f"fitted_{name}")
    least, largest = arrays.get(f"lower_{name}"), arrays.get(f"upper_{name}")
    if both is not None:
        array, what = both, "the parameters, the intervals and the runs"
    elif fitted is not None:
        array, what = fitted, "the parameters and the runs"
    elif least is not None and largest is not None:
        lower, upper = float(least[1]), float(largest[2])
        return lower, upper, "the intervals and the runs", estimate_remark(least)
    else:
        return *arrays[name].values[1:].tolist(), "the runs", estimate_remark(arrays[name])
    _, lower, upper = array.values.tolist()
    share = _missing_share(array)
    if share and CATALOGUE[name].unit is UnitRule.NONE:
        lower, upper = _for_any_outcome(lower, upper, share)
    return lower, upper, what, estimate_remark(array)


def _total(name: str, arrays: dict[str, xr.DataArray], parts: tuple[ErrorPart, ...]) -> ErrorPart:
    """Return the interval that has all in it but the form of the model.

    It is computed for each model that is the same one, and reaches over these.
    """
    lower, upper, what, remark = _computed(name, arrays)
    if not (math.isfinite(lower) and math.isfinite(upper)):
        return ErrorPart(_TOTAL, lower, upper, remark)
    ends = [(lower, upper)]
    finer = [part.name for part in parts if part.name.startswith(_FINER)]
    for each in finer:
        head = f"{each.replace(':', '')} "
        own = {key.removeprefix(head): arrays[key] for key in arrays if key.startswith(head)}
        ends.append(_computed(name, own)[:2])
    # A surrogate is of the next specimen, and not of the parameters as fitted.
    left_out = (_FORM, *[_SURROGATE] * (f"fitted_{name}" in arrays))
    others = [part for part in parts if not part.name.startswith(left_out)]
    ends += [(part.lower, part.upper) for part in others]
    known = [pair for pair in ends if all(map(math.isfinite, pair))]
    over = [part.name for part in others if part.is_known and part.name.split()[0] == _SURROGATE]
    over += [each.replace(":", "") for each in finer]
    without = [part.name for part in parts if not part.is_known or part not in others]
    text = f"computed for {what}{' together' * (' and ' in what)}"
    text += f", and over the same by {' and by '.join(over)}" if over else ""
    text += f"; without {' and '.join(without)}" if without else ""
    return ErrorPart(_TOTAL, min(low for low, _ in known), max(high for _, high in known), text)


def _bought(
    arrays: dict[str, xr.DataArray], parts: tuple[ErrorPart, ...], answer: float
) -> Iterator[ErrorPart]:
    """Yield what more runs make of the sampling error, and more specimens of that of a fit."""
    named = {part.name: part for part in parts}
    part = named.get(_SAMPLING)
    if part is not None and part.is_known:
        # As many of more runs would fail.
        inner = named.get(_FAILED, part._replace(lower=answer, upper=answer))
        lower = inner.lower + (part.lower - inner.lower) / math.sqrt(_TIMES)
        upper = inner.upper + (part.upper - inner.upper) / math.sqrt(_TIMES)
        yield ErrorPart(f"{_SAMPLING}, {_TIMES} times the runs", lower, upper, _BOUGHT)
    for key, array in arrays.items():
        if key.startswith(f"{_FITTED}, "):
            _, lower, upper = array.values.tolist()
            yield ErrorPart(key, lower, upper, _BOUGHT_BY_SPECIMENS)


def error_tables(archive: xr.DataTree) -> Iterator[OutputTable]:
    """Yield the statements of each output as a table: a row for each part, a column an answer."""
    statements = groupby(error_statements(archive), lambda each: (each.output, each.design))
    for (output, design), group in statements:
        every = [*group]
        title = f"{output}: what the errors are made of, {design}"
        table = OutputTable(title, [each.column for each in every])
        rows: dict[str, list[str]] = {}
        # An answer may lack parts that another has.
        for block in (lambda of: of.parts, lambda of: (of.total,), lambda of: of.bought):
            for place, each in enumerate(every):
                for part in block(each):
                    cells = rows.setdefault(part.name, [NOTHING] * len(every))
                    cells[place] = each.text(part) + table.note_mark(part.definition)
        table.rows = [*rows.items()]
        yield table


def error_json(archive: xr.DataTree) -> dict[str, Any]:
    """Return the parts of the error of each answer, in SI units."""
    return {
        f"{each.output}, {each.label}": {
            "design": each.design,
            **{
                part.name: {
                    "lower": json_value(part.lower),
                    "upper": json_value(part.upper),
                    "definition": part.definition,
                }
                for part in (*each.parts, each.total, *each.bought)
            },
        }
        for each in error_statements(archive)
    }
