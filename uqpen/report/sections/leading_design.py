"""Basis of the page's answers: the design, and its runs as a sample."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from uqpen.archive.read import read_group
from uqpen.core.catalogue import CATEGORY, PROBABILITY, THRESHOLD
from uqpen.core.labels import MISSING, RUNS
from uqpen.core.model import Category, Output
from uqpen.report.sections.view_statistics import failure_probabilities, view_statistics
from uqpen.results.archive_view import ArchiveView
from uqpen.results.texts import title_with_name
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
    """Return the design that answers come from; None where no run of a sample completed.

    It is the first design of the study whose runs are a sample. So its place decides, not its
    results. A design that is made for another purpose is chosen only where there is no other.
    """
    found = [name for name in view.sample_designs if view.has_completed_runs(name)]
    plain = [name for name in found if view.is_sample_design(name)]
    return next(iter((*plain, *found)), None)


def output_sample(view: ArchiveView, design: str, output: str) -> Sample:
    """Return the completed runs of a design, as a sample of an output."""
    return Sample.from_runs(input_sample(read_group(view.tree, RUNS, design)), output)


def missing_runs_note(view: ArchiveView, design: str) -> list[str]:
    """Return a note on the runs that a distribution function and its band leave out, if any."""
    ends = failure_probabilities(view, design)
    missing = None if ends is None else ends.attrs.get(MISSING)
    if not missing:
        return []
    return [f"Curve and band are of the runs that came back; {missing} did not."]


def quantity_with_quantiles(
    view: ArchiveView, output: str, quantiles: Sequence[float]
) -> QuantityOfInterest:
    """Return the quantity of interest of a numeric output, with some quantiles."""
    described = view.attributes(output)
    unit = str(described.get("units", ""))
    variable = Output(output, unit, str(described.get("long_name", output)))
    return QuantityOfInterest(variable, view.unit(output), quantiles=tuple(quantiles))


def requested_quantity(view: ArchiveView, output: str, source: str) -> QuantityOfInterest:
    """Return what the study asks of an output, by the statistics of a source."""
    statistics = view_statistics(view)
    quantiles = statistics.get(source, output, "quantile")
    probabilities = [] if quantiles is None else quantiles[PROBABILITY].values.tolist()
    quantity = quantity_with_quantiles(view, output, probabilities)
    if (exceedance := statistics.get(source, output, "exceedance")) is not None:
        texts, values = exceedance[THRESHOLD].values, exceedance["threshold_value"].values
        pairs = zip(texts, values, strict=True)
        thresholds = tuple(Threshold(str(text), float(value)) for text, value in pairs)
        quantity = replace(quantity, thresholds=thresholds)
    if (shares := statistics.get(source, output, "share")) is not None:
        pairs = zip(shares[CATEGORY].values, shares["category_label"].values, strict=True)
        kinds = tuple(Category(str(flag), str(label)) for flag, label in pairs)
        quantity = replace(quantity, output=replace(quantity.output, categories=kinds))
    return quantity


def output_title(view: ArchiveView, output: str) -> str:
    """Return the title of an output, for a reader."""
    return str(view.attributes(output).get("long_name", output))


def output_heading(view: ArchiveView, output: str) -> str:
    """Return the name of an output in a heading."""
    return title_with_name(output_title(view, output), output)
