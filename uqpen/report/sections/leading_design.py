"""What the page's answers are made of: which design, and its runs as a sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from uqpen.archive.read import read_group
from uqpen.core.labels import EXCEEDANCE, MISSING, QUANTILES, RUNS, SHARES, STATUSES
from uqpen.core.model import Category, Output
from uqpen.figures.archive_view import ArchiveView
from uqpen.figures.texts import title_with_name
from uqpen.statistics.quantity_of_interest import QuantityOfInterest, Threshold
from uqpen.statistics.sample import Sample, input_sample

__all__ = [
    "leading_design",
    "missing_runs_note",
    "output_heading",
    "output_sample",
    "output_title",
    "quantity_with_quantiles",
    "requested_quantity",
]


def leading_design(view: ArchiveView) -> str | None:
    """The design that answers come from; None where no run of a sample came back.

    It is the first of the study's whose runs are a sample, so that it is chosen by its place and
    not by what it says; one that is made for another purpose only where there is no other.
    """
    found = [name for name in view.sample_designs if view.has_completed_runs(name)]
    plain = [name for name in found if view.is_sample_design(name)]
    return next(iter((*plain, *found)), None)


def output_sample(view: ArchiveView, design: str, output: str) -> Sample:
    """The runs of a design that came back, as a sample of an output."""
    return Sample.from_runs(input_sample(read_group(view.tree, RUNS, design)), output)


def missing_runs_note(view: ArchiveView, design: str) -> list[str]:
    """What a distribution function and its band say nothing of, as a note; none where nothing."""
    missing = read_group(view.tree, STATUSES, design).attrs.get(MISSING)
    if not missing:
        return []
    return [f"Curve and band are of the runs that came back; {missing} did not."]


def quantity_with_quantiles(
    view: ArchiveView, output: str, quantiles: Sequence[float]
) -> QuantityOfInterest:
    """What an analysis is asked of an output that is a number."""
    described = view.attributes(output)
    unit = str(described.get("units", ""))
    variable = Output(output, unit, str(described.get("long_name", output)))
    return QuantityOfInterest(variable, view.unit(output), tuple(quantiles))


def requested_quantity(view: ArchiveView, output: str, source: str) -> QuantityOfInterest:
    """What the study asks of an output, by what a source answers."""
    quantiles = read_group(view.tree, QUANTILES, source).get(output)
    probabilities = [] if quantiles is None else quantiles[f"{output}_probability"].values.tolist()
    quantity = quantity_with_quantiles(view, output, probabilities)
    if (exceedance := read_group(view.tree, EXCEEDANCE, source).get(output)) is not None:
        along = f"{output}_threshold"
        pairs = zip(exceedance[along].values, exceedance[f"{along}_value"].values, strict=True)
        thresholds = tuple(Threshold(str(text), float(value)) for text, value in pairs)
        quantity = replace(quantity, thresholds=thresholds)
    if (shares := read_group(view.tree, SHARES, source).get(output)) is not None:
        along = f"{output}_category"
        pairs = zip(shares[along].values, shares[f"{along}_label"].values, strict=True)
        kinds = tuple(Category(str(flag), str(label)) for flag, label in pairs)
        quantity = replace(quantity, output=replace(quantity.output, categories=kinds))
    return quantity


def output_title(view: ArchiveView, output: str) -> str:
    """What a person reads of an output."""
    return str(view.attributes(output).get("long_name", output))


def output_heading(view: ArchiveView, output: str) -> str:
    """What an output is called in a heading."""
    return title_with_name(output_title(view, output), output)
