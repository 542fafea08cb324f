"""Parts of the error of an answer, each by its own definition, and the total.

The parts are of different kinds, so their widths do not add. The total is an interval that was
computed for all that it has in it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby, product
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
    STANDS_FOR,
    SWEEP,
)
from uqpen.core.statistic import Statistic, UnitRule
from uqpen.core.status import Status
from uqpen.core.units import DIMENSIONLESS, scale
from uqpen.results.digits import estimate_texts, percent_texts, range_text
from uqpen.results.source_statistics import SourceStatistics, is_sample_design, labelled_entries
from uqpen.results.table import NOTHING, OutputTable, estimate_remark, json_value, label_with_unit

# The answers whose errors are stated.
_ANSWERS = tuple(CATALOGUE[name] for name in ("exceedance", "below", "mean", "std", "quantile"))
# Those with a statement even if it has no part that may be the largest.
_ALWAYS = _ANSWERS[:3]

# How many times the runs are, in what more of them buy.
_TIMES = 4

# The parts of an error.
_SAMPLING, _SURROGATE, _FITTED, _FINER = "sampling", "surrogate", "fitted", "finer"
_INTERVALS, _LIMITS, _FAILED = "intervals", "limits of these", "failed runs"
_FORM, _TOTAL = "model form", "total"
# Those that may be the largest.
MAIN = (_FITTED, _INTERVALS, _FINER, _FAILED)

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

    kind: str  # such as ``"sampling"``
    lower: float  # in SI units; not a number where the part is not known
    upper: float
    definition: str
    of: str = ""  # the surrogate or the finer model, or what more of is bought

    @property
    def name(self) -> str:
        """Name of the part in tables and in JSON."""
        before = {_SURROGATE: " ", _FINER: ": "}.get(self.kind, ", ")
        return f"{self.kind}{before}{self.of}" if self.of else self.kind

    @property
    def is_known(self) -> bool:
        """True if both of its ends are known."""
        return math.isfinite(self.lower) and math.isfinite(self.upper)


class ErrorStatement(NamedTuple):
    """All parts of the error of one answer, and the total."""

    output: str
    label: str  # of the answer, such as ``"P(> 60 cm)"``
    design: str
    unit: str  # that it is shown in
    is_probability: bool
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
        if part is self.total:  # it has the digits of the widest part, which may have its end
            beside = (each for each in self.parts if each.is_known and each.kind != _FORM)
            values += [end for each in beside for end in (each.lower, each.upper)]
        unit = DIMENSIONLESS if self.is_probability else self.unit
        shown = scale(unit).from_si(np.array(values))
        longest = np.abs(shown[3:] - shown[0]).max(initial=0) or math.inf
        texts = percent_texts if self.is_probability else estimate_texts
        return range_text(*texts(*shown[:3].tolist(), longest=longest)[1:])


def error_statements(archive: xr.DataTree) -> Iterator[ErrorStatement]:
    """Yield the statement of each answer whose error has two known parts or more.

    It is of the first model if there are several, and by the first design with an interval over
    fitted parameters, or with one at all.
    """
    if archive.attrs.get(SWEEP):
        return  # its models are one at several values, whose differences are the answer
    for of in _estimates(archive):
        parts = tuple(_parts(of))
        # The limits of the intervals are those of one part, unless there is one without a row.
        counted = [each for each in parts if each.kind != _LIMITS or of.own.total is not None]
        is_main = any(each.kind in MAIN for each in counted)
        if sum(each.is_known for each in counted) > 1 and (is_main or of.record in _ALWAYS):
            middles = ((each.lower + each.upper) / 2 for each in parts if each.is_known)
            value = next(middles) if of.own.value is None else of.own.value
            made_of = parts, _total(of, parts), tuple(_bought(of, parts, value))
            yield ErrorStatement(*of[:4], of.is_probability, value, *made_of)


# Names of an answer's statistics in an archive begin with these: of its own, and over unknowns.
_PREFIXES = ("", "plug_in_", "fitted_", "lower_", "upper_", "total_")


class _ModelEstimates(NamedTuple):
    """Estimates of one answer by one model, each a value and an interval in SI units."""

    stated: xr.DataArray | None  # at the distributions as they are stated
    plug_in: xr.DataArray | None  # at the fitted parameters
    fitted: xr.DataArray | None  # over all parameters that fit the specimens as well
    lower: xr.DataArray | None  # the least over the intervals of the inputs
    upper: xr.DataArray | None  # the largest over these
    total: xr.DataArray | None  # over the parameters and the intervals together

    @property
    def of_runs(self) -> xr.DataArray | None:
        """The estimate whose interval is of the runs alone."""
        return self.stated if self.plug_in is None else self.plug_in

    @property
    def value(self) -> float | None:
        """The answer; None where it is a range over intervals of the inputs."""
        return None if self.of_runs is None else float(self.of_runs.values[0])


class _Estimates(NamedTuple):
    """An answer, and all estimates that its error follows from."""

    output: str
    label: str
    design: str
    unit: str
    record: Statistic
    own: _ModelEstimates  # by the first model
    more_specimens: Mapping[str, xr.DataArray]  # `own.fitted` with more, by how many of what
    surrogates: Mapping[str, xr.DataArray | None]
    # The estimates of each finer model, and the change from the first model to it.
    finer: Mapping[str, tuple[_ModelEstimates, xr.DataArray | None]]
    forms: Sequence[float]  # the answer by each model that is neither finer nor a stand-in

    @property
    def is_probability(self) -> bool:
        """True for a probability, which is from 0 to 1."""
        return self.record.unit is UnitRule.NONE


def _estimates(archive: xr.DataTree) -> Iterator[_Estimates]:
    """Yield each answer of the first model with the estimates of its error."""
    trees = model_trees(archive)
    models = {name: SourceStatistics(tree) for name, tree in trees.items()}
    first, *_ = models.values()
    surrogates = [name for name in first.sources if first.kind(name) == "surrogate"]
    finer = [name for name, tree in trees.items() if FINER_THAN in tree.attrs]
    forms = [name for name, tree in trees.items() if not {FINER_THAN, STANDS_FOR} & {*tree.attrs}]
    differences = {
        name: SourceStatistics.of_differences(archive, name)
        for name in group_names(archive, DIFFERENCES)
    }
    for output, record in product(first.scalar_outputs, _ANSWERS):
        name = record.name
        if (design := _design(first, output, name)) is None:
            continue
        stated = first.statistics(design, output)
        array = next(stated[x] for each in _PREFIXES if (x := f"{each}{name}") in stated)
        for place, (label, _) in enumerate(labelled_entries(record, {design: array})):

            def entry(array: xr.DataArray | None, place: int = place) -> xr.DataArray | None:
                return array if array is None or array.ndim == 1 else array_entries(array)[place]

            by_model = {
                model: _ModelEstimates(
                    *(entry(each.get(design, output, f"{prefix}{name}")) for prefix in _PREFIXES)
                )
                for model, each in models.items()
            }
            changes = {key: each.change(design, output, name) for key, each in differences.items()}
            more = first.entries(design, output, f"{MORE_SPECIMENS}{name}")
            yield _Estimates(
                *(output, label, design, first.unit(output), record),
                next(iter(by_model.values())),
                {key: each[place] if record.dims else each for key, each in more.items()},
                {key: entry(first.get(key, output, name)) for key in surrogates},
                {key: (by_model[key], entry(changes.get(key))) for key in finer},
                [value for key in forms if (value := by_model[key].value) is not None],
            )


def _design(statistics: SourceStatistics, output: str, name: str) -> str | None:
    """Return the design whose answer it is; None where none has an interval."""
    having: dict[int, str] = {}
    for design in (each for each in statistics.sources if statistics.kind(each) == "design"):
        stated = statistics.statistics(design, output)
        over = {prefix for prefix in _PREFIXES[1:] if f"{prefix}{name}" in stated}
        is_plain = name in stated and not any(f"{each}mean" in stated for each in _PREFIXES[1:])
        if {"fitted_", "total_"} & over:
            having.setdefault(0, design)
        elif over or (is_plain and is_sample_design(statistics.tree, design)):
            having.setdefault(1, design)
        elif is_plain and np.isfinite(stated[name].values).all():
            having.setdefault(2, design)
    return having[min(having)] if having else None


def _parts(of: _Estimates) -> Iterator[ErrorPart]:
    """Yield the parts of the error of an answer."""
    own, value = of.own, of.own.value
    remark = "; of the next specimen" * (own.fitted is not None)
    for kind, source, array, text in (
        (_SAMPLING, "", own.of_runs, _DEFINITIONS[_SAMPLING]),
        *((_SURROGATE, *each, _DEFINITIONS[_SURROGATE] + remark) for each in of.surrogates.items()),
        (_FITTED, "", own.fitted, _DEFINITIONS[_FITTED]),
    ):
        if array is not None:
            _, lower, upper = array.values.tolist()
            found = ErrorPart(kind, lower, upper, text, source)
            yield found if found.is_known else found._replace(definition=estimate_remark(array))
    if own.lower is not None and own.upper is not None:
        (least, low, _), (largest, _, high) = own.lower.values.tolist(), own.upper.values.tolist()
        of_limits = ErrorPart(_LIMITS, low, high, _DEFINITIONS[_LIMITS])
        text = _DEFINITIONS[_INTERVALS] if of_limits.is_known else estimate_remark(own.lower)
        yield ErrorPart(_INTERVALS, least, largest, text)
        yield of_limits
    if value is not None and of.is_probability and (share := _missing_share(own.of_runs)):
        yield ErrorPart(_FAILED, *_for_any_outcome(value, value, share), _DEFINITIONS[_FAILED])
    yield from _finer_parts(of)
    if len(answers := of.forms) > 1:
        text = _DEFINITIONS[_FORM].format(models=len(answers))
        yield ErrorPart(_FORM, min(answers), max(answers), text)


def _finer_parts(of: _Estimates) -> Iterator[ErrorPart]:
    """Yield the part of each finer model: of the paired difference, or over the intervals."""
    for model, (finer, change) in of.finer.items():
        if change is not None and (value := of.own.value) is not None:
            lower, upper = (value + change.values[1:]).tolist()
            if not math.isfinite(upper - lower):
                yield ErrorPart(_FINER, lower, upper, estimate_remark(change), model)
                continue
            if of.is_probability:
                lower, upper = max(lower, 0.0), min(upper, 1.0)
            ends = (min(lower, value), max(upper, value))
            yield ErrorPart(_FINER, *ends, _DEFINITIONS[_FINER], model)
            continue
        if all(each is None for each in finer):
            continue
        over_both = (of.own.lower, of.own.upper, finer.lower, finer.upper)
        if known := [float(each.values[0]) for each in over_both if each is not None]:
            yield ErrorPart(_FINER, min(known), max(known), _OVER_BOTH, model)


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


def _computed(of: _ModelEstimates, *, is_probability: bool) -> tuple[float, float, str, str]:
    """Return the interval of a model that is computed for all at once: for what, or why not."""
    if of.total is not None:
        array, what = of.total, "the parameters, the intervals and the runs"
    elif of.fitted is not None:
        array, what = of.fitted, "the parameters and the runs"
    elif of.lower is not None and of.upper is not None:
        lower, upper = of.lower.values[1].item(), of.upper.values[2].item()
        return lower, upper, "the intervals and the runs", estimate_remark(of.lower)
    else:
        assert of.stated is not None
        return *of.stated.values[1:].tolist(), "the runs", estimate_remark(of.stated)
    _, lower, upper = array.values.tolist()
    if is_probability and (share := _missing_share(array)):
        lower, upper = _for_any_outcome(lower, upper, share)
    return lower, upper, what, estimate_remark(array)


def _total(of: _Estimates, parts: tuple[ErrorPart, ...]) -> ErrorPart:
    """Return the interval that has all in it but the form of the model.

    It is computed for each model that is the same one, and reaches over these.
    """
    lower, upper, what, remark = _computed(of.own, is_probability=of.is_probability)
    if not (math.isfinite(lower) and math.isfinite(upper)):
        return ErrorPart(_TOTAL, lower, upper, remark)
    finer = {
        part.of: _computed(of.finer[part.of][0], is_probability=of.is_probability)[:2]
        for part in parts
        if part.kind == _FINER
    }
    # A surrogate is of the next specimen, and not of the parameters as fitted.
    left_out = {_FORM} if of.own.fitted is None else {_FORM, _SURROGATE}
    others = [part for part in parts if part.kind not in left_out]
    ends = [(lower, upper), *((part.lower, part.upper) for part in others)]
    known = [pair for pair in (*ends, *finer.values()) if all(map(math.isfinite, pair))]
    over = [part.name for part in others if part.is_known and part.kind == _SURROGATE]
    over += [f"{_FINER} {model}" for model, pair in finer.items() if pair in known]
    without = [part.name for part in parts if not part.is_known or part not in others]
    without += [f"an interval by {_FINER} {each}" for each in finer if finer[each] not in known]
    text = f"computed for {what}{' together' * (' and ' in what)}"
    text += f", and over the same by {' and by '.join(over)}" if over else ""
    text += f"; without {' and '.join(without)}" if without else ""
    return ErrorPart(_TOTAL, min(low for low, _ in known), max(high for _, high in known), text)


def _bought(of: _Estimates, parts: tuple[ErrorPart, ...], value: float) -> Iterator[ErrorPart]:
    """Yield what more runs make of the sampling error, and more specimens of that of a fit."""
    named = {part.kind: part for part in parts}
    if (part := named.get(_SAMPLING)) and part.is_known:
        # As many of more runs would fail.
        inner = named.get(_FAILED, part._replace(lower=value, upper=value))
        lower = inner.lower + (part.lower - inner.lower) / math.sqrt(_TIMES)
        upper = inner.upper + (part.upper - inner.upper) / math.sqrt(_TIMES)
        yield ErrorPart(_SAMPLING, lower, upper, _BOUGHT, f"{_TIMES} times the runs")
    for specimens, array in of.more_specimens.items():
        _, lower, upper = array.values.tolist()
        yield ErrorPart(_FITTED, lower, upper, _BOUGHT_BY_SPECIMENS, specimens)


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
