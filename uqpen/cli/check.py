"""``uqpen check``: whether a study file is right, and what it would run."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from uqpen.cli.options import PATH

if TYPE_CHECKING:
    from uqpen.statistics.quantity_of_interest import QuantityOfInterest
    from uqpen.study.study import Study

__all__ = ["check"]


@click.command(short_help="Check a study file and say what it would run.")
@click.argument("file", type=PATH)
def check(file: Path) -> None:
    """Read the study FILE, report every mistake in it, and say what it would run."""
    from uqpen.cli.printable import printable
    from uqpen.cli.screen import plain_table, standard_output
    from uqpen.study.load import load_study

    study = load_study(file)
    console = standard_output()
    console.print(printable(study.title), style="bold", markup=False)
    console.print(f"{_models(study)}, seed {study.seed}\n", markup=False)
    console.print(plain_table(["input", "value or law"], _inputs(study)))
    console.print()
    for remark in _input_remarks(study):
        console.print(f"{printable(remark)}\n", markup=False)
    outputs = [
        (quantity.output.name, _requested(quantity)) for quantity in study.quantities_of_interest
    ]
    console.print(plain_table(["output", "asked"], outputs))
    console.print()
    for line in _run_settings(study):
        console.print(f"{line}\n", markup=False)
    console.print(plain_table(["design", "kind", "runs"], _designs(study)))
    if study.surrogates:
        surrogates = [
            (name, surrogate.design, next(iter(study.validation_designs(surrogate)), "nothing"))
            for name, surrogate in study.surrogates.items()
        ]
        console.print()
        console.print(plain_table(["surrogate", "fitted to", "checked by"], surrogates))
    console.print(f"\n{study.runs} runs in all; the study is right", markup=False)


def _models(study: Study) -> str:
    if not study.has_several_models:
        return f"model {study.model.name}"
    named = (f"{name} ({variant.model.name})" for name, variant in study.models.items())
    return f"models {', '.join(named)}"


def _inputs(study: Study) -> Iterator[tuple[str, str]]:
    from uqpen.core.units import DIMENSIONLESS, scale
    from uqpen.distributions.joint_distribution import FixedInput

    for entry in study.joint.inputs:
        if isinstance(entry, FixedInput):
            unit = "" if entry.display_unit == DIMENSIONLESS else f" {entry.display_unit}"
            value = scale(entry.display_unit).from_si(entry.value)
            yield entry.variable.name, f"{value:.10g}{unit}"
        else:
            yield entry.variable.name, entry.description


def _input_remarks(study: Study) -> Iterator[str]:
    """Yield remarks on the random inputs that their distributions do not state."""
    if study.joint.dependence is not None:
        yield str(study.joint.dependence)
    for entry in study.joint.random:
        if "fit_warning" in entry.fit:
            yield f"warning: {entry.variable.name}: {entry.fit['fit_warning']}"


def _requested(quantity: QuantityOfInterest) -> str:
    if quantity.output.categories:
        return "shares of " + ", ".join(kind.label for kind in quantity.output.categories)
    requested = ["moments, cdf, quantiles " + ", ".join(f"{p:g}" for p in quantity.quantiles)]
    requested += [f"P(> {threshold.text})" for threshold in quantity.thresholds]
    requested += [f"value held with {p:g}" for p in quantity.tolerance_contents]
    return "; ".join(requested)


def _run_settings(study: Study) -> Iterator[str]:
    """Yield the limits of a run, what is done about failed runs, and the constraints."""
    for name, variant in study.models.items():
        limits = variant.model.run_limits
        allowed = [] if limits.seconds is None else [f"{limits.seconds:g} s"]
        allowed += [] if limits.bytes is None else [f"{limits.bytes / 1e6:.10g} MB of memory"]
        if allowed:
            of = f" of {name}" * study.has_several_models
            yield f"each run{of} may take {' and '.join(allowed)}"
    if study.failures.retry:
        yield f"a lost run is made again, {study.failures.retry} times at the most"
    if study.failures.at_most < 1:
        share = f"{100 * study.failures.at_most:.10g} %"
        yield f"the study ends when more than {share} of a design's runs are lost"
    for constraint in study.constraints:
        yield f"only where {constraint.text}"


def _designs(study: Study) -> Iterator[tuple[str, str, str]]:
    from uqpen.designs import DESIGNS

    kinds = {reference: kind for kind, reference in DESIGNS.items()}
    for name, design in study.designs.items():
        kind = kinds[f"{type(design).__module__}:{type(design).__name__}"]
        yield name, kind, str(design.run_count(study.joint))
