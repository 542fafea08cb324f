"""Parts of the error of an answer, each by its own definition, and the total.

The parts are of different kinds, so their widths do not add. The total is an interval that was
computed for all that it has in it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import model_trees
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.labels import SWEEP
from uqpen.core.statistic import UnitRule
from uqpen.core.units import scale
from uqpen.results.digits import estimate_texts, percent_texts, range_text
from uqpen.results.source_statistics import SourceStatistics, labelled_entries
from uqpen.results.table import NOTHING, OutputTable, estimate_remark, json_value, label_with_unit

# The answers whose errors are stated.
_ANSWERS = tuple(CATALOGUE[name] for name in ("exceedance", "below", "mean"))

# How many times the runs are, in what more of them buy.
_TIMES = 4

_DEFINITIONS = {
    "sampling": "interval of the runs, at the distributions as they are stated or fitted",
    "surrogate": "of a surrogate that real runs correct",
    "fitted": "over all parameters that fit the specimens as well, with the sampling error; the "
    "family is taken as known",
    "intervals": "from the least to the largest answer over the intervals of the inputs",
    "limits of these": "from the lower limit of the least to the upper limit of the largest",
    "model form": "range of the answers of {models} models at common points: no probability, "
    "and in no interval",
}
_TOGETHER = "computed for the parameters and the runs together"
_ALL_TOGETHER = "computed for the parameters, the intervals and the runs together"
_BOUGHT = "if further runs scatter as these do; no other part gets narrower by runs"


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
    """Yield the statement of each answer over parameters that are fitted to specimens.

    It is by the first design that has an interval over them, and of the first model if there are
    several.
    """
    models = {name: SourceStatistics(tree) for name, tree in model_trees(archive).items()}
    if archive.attrs.get(SWEEP):
        return  # its models are one at several values, whose differences are the answer
    statistics = next(iter(models.values()))
    designs = [name for name in statistics.sources if statistics.kind(name) == "design"]
    surrogates = [name for name in statistics.sources if statistics.kind(name) == "surrogate"]
    for output in statistics.scalar_outputs:
        for record in _ANSWERS:
            over = {f"fitted_{record.name}", f"total_{record.name}"}
            having = (each for each in designs if over & {*statistics.statistics(each, output)})
            design = next(having, None)
            if design is None:
                continue
            stated = statistics.statistics(design, output)
            names = (record.name, *(f"{prefix}_{record.name}" for prefix in _PREFIXES))
            found = {name: stated[name] for name in names if name in stated}
            found |= {
                f"{_SURROGATE} {name}": array
                for name in surrogates
                if (array := statistics.get(name, output, record.name)) is not None
            }
            found |= {
                f"{_MODEL} {name}": array
                for name, each in models.items()
                if (array := each.get(design, output, record.name)) is not None
            }
            for label, arrays in labelled_entries(record, found):
                parts = tuple(_parts(record.name, arrays))
                answers = (arrays.get(name) for name in (f"plug_in_{record.name}", record.name))
                known = [float(each[0]) for each in answers if each is not None]
                middle = np.mean([[part.lower, part.upper] for part in parts])
                yield ErrorStatement(
                    output,
                    label,
                    design,
                    record.unit is UnitRule.NONE,
                    statistics.unit(output),
                    next(iter(known), float(middle)),
                    parts,
                    _total(parts, arrays.get(f"total_{record.name}")),
                    tuple(_bought(parts, known)),
                )


# Names of the parts, and what the names of arrays begin with.
_SAMPLING, _SURROGATE, _MODEL = "sampling", "surrogate", "model"
_FITTED, _INTERVALS, _LIMITS = "fitted", "intervals", "limits of these"
_FORM, _TOTAL = "model form", "total"
_PREFIXES = ("plug_in", "fitted", "lower", "upper", "total")


def _parts(name: str, arrays: dict[str, xr.DataArray]) -> Iterator[ErrorPart]:
    """Yield the parts of the error of an answer, from its estimates along ``bound``."""
    own = arrays.get(f"plug_in_{name}", arrays.get(name))
    surrogates = {key: each for key, each in arrays.items() if key.startswith(_SURROGATE)}
    named = {_SAMPLING: own, **surrogates, _FITTED: arrays.get(f"fitted_{name}")}
    for part, array in named.items():
        if array is not None:
            _, lower, upper = array.values.tolist()
            found = ErrorPart(part, lower, upper, _DEFINITIONS[part.split()[0]])
            yield found if found.is_known else found._replace(definition=estimate_remark(array))
    least, largest = arrays.get(f"lower_{name}"), arrays.get(f"upper_{name}")
    if least is not None and largest is not None:
        ends, limits = (least[0], largest[0]), (least[1], largest[2])
        of_limits = ErrorPart(_LIMITS, float(limits[0]), float(limits[1]), _DEFINITIONS[_LIMITS])
        text = _DEFINITIONS[_INTERVALS] if of_limits.is_known else estimate_remark(least)
        yield ErrorPart(_INTERVALS, float(ends[0]), float(ends[1]), text)
        yield of_limits
    answers = [float(each[0]) for key, each in arrays.items() if key.startswith(_MODEL)]
    if len(answers) > 1:
        text = _DEFINITIONS[_FORM].format(models=len(answers))
        yield ErrorPart(_FORM, min(answers), max(answers), text)


def _total(parts: tuple[ErrorPart, ...], both: xr.DataArray | None) -> ErrorPart:
    """Return the interval that has all in it that is computed together."""
    left_out = [each.name for each in parts if each.name.split()[0] in (_SURROGATE, _MODEL)]
    without = f"; without {' and '.join(left_out)}" if left_out else ""
    if both is not None:
        _, lower, upper = both.values.tolist()
        total = ErrorPart(_TOTAL, lower, upper, f"{_ALL_TOGETHER}{without}")
        return total if total.is_known else total._replace(definition=estimate_remark(both))
    fitted = next(each for each in parts if each.name == _FITTED)
    definition = f"{_TOGETHER}{without}" if fitted.is_known else fitted.definition
    return fitted._replace(name=_TOTAL, definition=definition)


def _bought(parts: tuple[ErrorPart, ...], known: list[float]) -> Iterator[ErrorPart]:
    """Yield what more runs make of the sampling error, which is all that they change."""
    for part in parts:
        if part.name == _SAMPLING and part.is_known and known:
            lower, upper = (
                known[0] + (end - known[0]) / math.sqrt(_TIMES) for end in (part.lower, part.upper)
            )
            yield ErrorPart(f"sampling, {_TIMES} times the runs", lower, upper, _BOUGHT)


def error_tables(archive: xr.DataTree) -> Iterator[OutputTable]:
    """Yield the statements of each output as a table: a row for each part, a column an answer."""
    for output, group in groupby(error_statements(archive), lambda each: each.output):
        every = [*group]
        title = f"{output}: what the errors are made of, {every[0].design}"
        table = OutputTable(title, [each.column for each in every])
        rows: dict[str, list[str]] = {}
        for place, each in enumerate(every):
            for part in (*each.parts, each.total, *each.bought):
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
