"""``uqpen check``: whether a study file is right, and what it would run."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from uqpen.study.study import Study

__all__ = ["check"]


@click.command(short_help="Check a study file and say what it would run.")
@click.argument("file", type=click.Path(path_type=Path))
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
    console.print(plain_table(["output", "asked"], _outputs(study)))
    console.print()
    for line in _run_settings(study):
        console.print(f"{line}\n", markup=False)
    for constraint in study.constraints:
        console.print(f"only where {constraint.text}\n", markup=False)
    console.print(plain_table(["design", "kind", "runs"], _designs(study)))
    if study.surrogates:
        console.print()
        console.print(plain_table(["surrogate", "fitted to", "checked by"], _surrogates(study)))
    console.print(f"\n{study.runs} runs in all; the study is right", markup=False)


def _models(study: Study) -> str:
    if not study.has_several_models:
        return f"model {study.model.name}"
    named = (f"{name} ({variant.model.name})" for name, variant in study.models.items())
    return f"models {', '.join(named)}"


def _inputs(study: Study) -> list[tuple[str, str]]:
    from uqpen.core.units import DIMENSIONLESS, scale
    from uqpen.distributions.joint_distribution import FixedInput

    rows = []
    for entry in study.joint.inputs:
        unit = "" if entry.display_unit == DIMENSIONLESS else f" {entry.display_unit}"
        if isinstance(entry, FixedInput):
            text = f"{scale(entry.display_unit).from_si(entry.value):.10g}{unit}"
        else:
            text = entry.description
        rows.append((entry.variable.name, text))
    return rows


def _input_remarks(study: Study) -> Iterator[str]:
    """Yield remarks on the random inputs that their distributions do not state."""
    if study.joint.dependence is not None:
        yield str(study.joint.dependence)
    for entry in study.joint.random:
        if "fit_warning" in entry.fit:
            yield f"warning: {entry.variable.name}: {entry.fit['fit_warning']}"


def _run_settings(study: Study) -> Iterator[str]:
    """Yield the limits of a run, and what is done about failed runs."""
    for name, variant in study.models.items():
        allowed = variant.model.run_limits
        seconds = "" if allowed.seconds is None else f"{allowed.seconds:g} s"
        memory = "" if allowed.bytes is None else f"{allowed.bytes / 1e6:.10g} MB of memory"
        if allowed:
            of = f" of {name}" * study.has_several_models
            yield f"each run{of} may take {' and '.join(filter(None, (seconds, memory)))}"
    if study.failures.retry:
        yield f"a lost run is made again, {study.failures.retry} times at the most"
    if study.failures.at_most < 1:
        share = f"{100 * study.failures.at_most:.10g} %"
        yield f"the study ends when more than {share} of a design's runs are lost"


def _outputs(study: Study) -> list[tuple[str, str]]:
    rows = []
    for quantity in study.quantities_of_interest:
        if quantity.output.categories:
            requested = [
                "shares of " + ", ".join(kind.label for kind in quantity.output.categories)
            ]
        else:
            requested = [
                "moments, cdf, quantiles " + ", ".join(f"{p:g}" for p in quantity.quantiles)
            ]
            requested += [f"P(> {threshold.text})" for threshold in quantity.thresholds]
            requested += [f"value held with {p:g}" for p in quantity.tolerance_contents]
        rows.append((quantity.output.name, "; ".join(requested)))
    return rows


def _designs(study: Study) -> list[tuple[str, str, str]]:
    from uqpen.designs import DESIGNS

    kinds = {reference: kind for kind, reference in DESIGNS.items()}
    return [
        (
            name,
            kinds[f"{type(design).__module__}:{type(design).__name__}"],
            str(design.run_count(study.joint)),
        )
        for name, design in study.designs.items()
    ]


def _surrogates(study: Study) -> list[tuple[str, str, str]]:
    """Return each surrogate with its design and its first validation design."""
    return [
        (name, surrogate.design, next(iter(study.validation_designs(surrogate)), "nothing"))
        for name, surrogate in study.surrogates.items()
    ]
