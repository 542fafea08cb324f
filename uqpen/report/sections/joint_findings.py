"""Findings on the probabilities of events of several outputs."""

from __future__ import annotations

from collections.abc import Iterator

import xarray as xr

from uqpen.charts.marks import has_interval
from uqpen.core.labels import INTERVAL_LEVEL
from uqpen.core.sampling import Sampling
from uqpen.report.blocks import Finding
from uqpen.report.sections.quoted_statistics import no_break
from uqpen.report.sections.sentences import acceptance_sentence
from uqpen.results.archive_view import ArchiveView
from uqpen.results.digits import percent_text, percent_texts
from uqpen.results.joint_probabilities import disagreements
from uqpen.results.table import estimate_remark
from uqpen.results.texts import capitalized, plain_text

__all__ = ["joint_findings", "rare_event_findings"]


def joint_findings(view: ArchiveView, design: str) -> Iterator[Finding]:
    """Yield how often each event occurs whose probability the study requests."""
    joint = view.statistics.joint_probability(design)
    for array in () if joint is None else joint:
        event = capitalized(plain_text(str(array["event_condition"].values)))
        yield Finding(event, f"In {_stated(array)}.{acceptance_sentence(array)}")


def rare_event_findings(view: ArchiveView) -> Iterator[Finding]:
    """Yield the probability of the event of each design that was made for one, with its caveat."""
    for design in view.designs:
        joint = view.statistics.joint_probability(design)
        if joint is None or view.design(design).sampling is not Sampling.TOWARDS_EVENT:
            continue
        for array, finding in zip(joint, joint_findings(view, design), strict=True):
            caveat = (
                f" {capitalized(estimate_remark(array))}." if has_interval(array.values) else ""
            )
            yield finding._replace(text=f"By {design}: {finding.text}{caveat}")
    yield from _disagreement_findings(view)


def _disagreement_findings(view: ArchiveView) -> Iterator[Finding]:
    """Yield which designs disagree on the event of one that was made for it."""
    found = {design: view.statistics.joint_probability(design) for design in view.designs}
    arrays = {design: array for design, array in found.items() if array is not None}
    of_events = {each for each in arrays if view.design(each).sampling is Sampling.TOWARDS_EVENT}
    for each in disagreements(arrays):
        if of_events & {each.first, each.second}:
            event = capitalized(plain_text(each.condition))
            yield Finding(event, f"{capitalized(plain_text(str(each)))}.")


def _stated(array: xr.DataArray) -> str:
    value, lower, upper = map(no_break, percent_texts(*array.values.tolist()))
    if not has_interval(array.values):
        return f"{value} of cases (without an interval: {estimate_remark(array)})"
    level = no_break(percent_text(array.attrs[INTERVAL_LEVEL]))
    return f"{value} of cases ({lower} to {upper}, {level} interval)"
