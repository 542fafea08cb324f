"""Verdicts of several models on the limits of a study, and the share of model form."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from uqpen.core.labels import OF_EXCEEDANCE
from uqpen.core.statistic_dimensions import THRESHOLD
from uqpen.report.blocks import Finding
from uqpen.report.sections.quoted_statistics import (
    QuotedStatistic,
    no_break,
    output_name,
    requested_statistics,
)
from uqpen.results.acceptance import Acceptance, AcceptanceVerdict
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import percent_texts
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.texts import capitalized, join_names, plain_text, typeset_quantity

__all__ = ["caveat_text", "model_form_findings", "model_limits", "model_verdicts"]

# Verdicts on a limit, the gravest first.
_VERDICTS = (AcceptanceVerdict.NOT_MET, AcceptanceVerdict.NOT_DECIDED, AcceptanceVerdict.MET)
# The ends that a tolerance limit states, and the place of its bound.
_BOUNDS = {"at most": 2, "at least": 1}
_SCOPE = (
    "Each model counts the same. They are no sample of all models: another one can lie outside "
    "them."
)


def model_verdicts(views: Sequence[ArchiveView], output: str, design: str) -> Iterator[Finding]:
    """Yield what the models say of each limit of the study on a probability of an output."""
    for quantity in requested_statistics(views[0], output, design):
        if quantity.statistic.shown.event:
            found = dict(_estimates(views, quantity, design))
            if finding := _verdict(quantity, found):
                yield finding


def model_limits(views: Sequence[ArchiveView], output: str, design: str) -> Iterator[Finding]:
    """Yield the tolerance limits of an output by each model, the smallest first.

    They are those of the first content, and of the largest that all models have a bound for.
    """
    for beyond, end in _BOUNDS.items():
        found = [
            (quantity, bounds)
            for quantity in requested_statistics(views[0], output, design)
            if quantity.statistic.shown.ends == beyond
            and (bounds := _bounds(views, quantity, design, end)) is not None
        ]
        found.sort(key=lambda each: each[0].entry)
        for quantity, bounds in (*found[:1], *found[1:][-1:]):
            named = [f"{text} by {model}" for _, text, model in sorted(bounds)]
            yield Finding(
                quantity.heading,
                f"{capitalized(beyond)} {join_names(named)}: bounds that allow for the finite "
                "number of runs.",
            )


def _bounds(
    views: Sequence[ArchiveView], quantity: QuotedStatistic, design: str, end: int
) -> tuple[tuple[float, str, str], ...] | None:
    """Return the bound of a limit by each model, as number and as text; None if one has none."""
    found = []
    for view in views:
        own = replace(quantity, view=view)
        array = own.estimate(design) if quantity.output in view.numeric_outputs else None
        if array is None or not np.isfinite(array.values[end]):
            return None
        found.append((float(array.values[end]), own.texts(array)[end], view.model))
    return tuple(found)


def _estimates(
    views: Sequence[ArchiveView], quantity: QuotedStatistic, design: str
) -> Iterator[tuple[str, xr.DataArray]]:
    for view in views:
        if quantity.output in view.numeric_outputs:
            own = QuotedStatistic(view, quantity.output, quantity.statistic, quantity.entry)
            array = own.leading_estimate(design)
            if array is not None:
                yield view.model, array


def _verdict(quantity: QuotedStatistic, found: Mapping[str, xr.DataArray]) -> Finding | None:
    """Return what the models say of a limit; None where the study accepts any probability."""
    every = {name: Acceptance.from_array(array) for name, array in found.items()}
    accepted = {name: each for name, each in every.items() if each is not None}
    if not accepted:
        return None
    parts = []
    for verdict in _VERDICTS:
        names = [name for name, each in accepted.items() if each.verdict is verdict]
        if names:
            listed = "; ".join(f"{name} {_share(quantity, found[name])}" for name in names)
            parts.append(f"{verdict} by {len(names)} of {len(accepted)} models ({listed})")
    limit = no_break(str(next(iter(accepted.values()))))
    threshold = no_break(typeset_quantity(plain_text(quantity.entry)))
    name = capitalized(output_name(quantity.view, quantity.output))
    return Finding(
        f"{name} {quantity.statistic.shown.event} {threshold}",
        f"The limit of the study, {limit} of cases, is {', and '.join(parts)}.",
    )


def _share(quantity: QuotedStatistic, array: xr.DataArray) -> str:
    """Return a probability with its interval; of an event that no run has shown, its upper end."""
    estimate, lower, upper = quantity.texts(array)
    if not np.isfinite(array.values[1:]).all():
        return estimate
    if array.values[0] == 0:
        return no_break(f"at most {upper}")
    if array.values[0] == 1:
        return no_break(f"at least {lower}")
    return f"{estimate}, {no_break(f'{lower} to {upper}')}"


def model_form_findings(
    view: ArchiveView, outputs: Sequence[str], design: str
) -> Iterator[Finding]:
    """Yield how much of the spread of each output is model form, and how much is its inputs."""
    statistics = SourceStatistics.of_model_form(view.archive)
    texts = []
    for output in outputs:
        arrays = statistics.statistics(design, output)
        if "model_form_share" not in arrays or np.isnan(arrays["model_form_share"].values[0]):
            continue
        parts = _parts_text(arrays["model_form_share"], arrays["parameter_share"])
        texts.append(f"Of the variance of {output_name(view, output)}, {parts}.")
        texts += _event_texts(arrays)
    if texts:
        yield Finding("How much is model form?", " ".join([*texts, _SCOPE]))


def _event_texts(arrays: Mapping[str, xr.DataArray]) -> Iterator[str]:
    """Yield the same of the events with acceptance limits."""
    form, inputs = (
        arrays.get(f"{OF_EXCEEDANCE}{name}") for name in ("model_form_share", "parameter_share")
    )
    if form is None or inputs is None:
        return
    for of_form, of_inputs in zip(form, inputs, strict=True):
        if Acceptance.from_array(of_form) is not None and np.isfinite(of_form.values[0]):
            threshold = no_break(typeset_quantity(plain_text(str(of_form[THRESHOLD].item()))))
            yield f"Of whether it is above {threshold}, {_parts_text(of_form, of_inputs)}."


def _parts_text(form: xr.DataArray, inputs: xr.DataArray) -> str:
    of_models, of_inputs = map(_with_interval, (form, inputs))
    return f"{of_models} is between the models, and {of_inputs} between inputs"


def _with_interval(array: xr.DataArray) -> str:
    estimate, lower, upper = map(no_break, percent_texts(*array.values.tolist()))
    if not np.isfinite(array.values[1:]).all():
        return f"{estimate} (without an interval)"
    return f"{estimate} ({no_break(f'{lower} to {upper}')})"


def caveat_text(view: ArchiveView, outputs: Sequence[str], design: str) -> str:
    """Return what the study says that a reader has to mind of outputs; empty for nothing."""
    found = (view.statistics.caveat(design, output) for output in outputs)
    return " ".join(dict.fromkeys(plain_text(each, 1_000) for each in found if each))
