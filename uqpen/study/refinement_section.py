"""``refine`` in ``[surrogates.<name>]``: designs that go on where a surrogate expects to err."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from uqpen.core.labels import WEIGHT
from uqpen.core.lookup import family_name
from uqpen.designs import DESIGNS
from uqpen.designs.design import Design
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.distributions.constraints import Constraint
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.study.study import Variant
from uqpen.study.table_reader import TableReader
from uqpen.surrogates.refinement.refined_design import RefinedDesign, RefinedModel
from uqpen.surrogates.refinement.refinement import FOR_PROBABILITIES, RefinedOutput, Refinement
from uqpen.surrogates.surrogate import Surrogate

__all__ = ["refined_designs"]

_INDEPENDENT = "a design of kind monte-carlo with runs: points that are placed have weights, and "
_INDEPENDENT += "weights are of independent draws"


def refined_designs(
    table: TableReader,
    surrogates: Mapping[str, Surrogate],
    designs: Mapping[str, Design],
    variants: Mapping[str, Variant],
    quantities: Sequence[QuantityOfInterest],
    constraints: tuple[Constraint, ...],
) -> dict[str, Design]:
    """Return the designs of a study, refined ones included; note impossible refinements.

    Parameters
    ----------
    table : TableReader
        ``[surrogates]``.
    surrogates, designs
        By name.
    variants : mapping of str to Variant
        The models of the study.
    quantities : sequence of QuantityOfInterest
    constraints : tuple of Constraint
    """
    found = dict(designs)
    for name, surrogate in surrogates.items():
        section = table.table(name)
        refinement = section.settings(Refinement)
        if refinement is None or surrogate.design not in designs:
            continue
        if refinement.refine is None:
            if "refine_for" in section:
                section.add_missing("refine", "the number of further runs, beside refine_for")
            continue
        targets = _targets(quantities, refinement)
        if refinement.refine_for == FOR_PROBABILITIES and not any(each.limits for each in targets):
            expected = "an output with a threshold (exceeds or below)"
            section.add_wrong("refine_for", refinement.refine_for, expected)
        initial = found[surrogate.design]
        if problem := _problem(initial, variants):
            section.add_problem("refine", *problem)
        elif isinstance(initial, MonteCarlo):
            found[surrogate.design] = RefinedDesign(
                initial,
                name,
                surrogate,
                refinement.refine,
                {
                    model: RefinedModel(each.model, each.given, targets)
                    for model, each in variants.items()
                },
                constraints,
            )
    return found


def _targets(
    quantities: Sequence[QuantityOfInterest], refinement: Refinement
) -> tuple[RefinedOutput, ...]:
    """Return the scalar outputs, with their thresholds if these are meant."""
    scalars = [each for each in quantities if each.output.is_number and not each.output.dims]
    if refinement.refine_for != FOR_PROBABILITIES:
        return tuple(RefinedOutput(each.output.name) for each in scalars)
    return tuple(
        RefinedOutput(each.output.name, tuple(limit.value for limit in limits))
        for each in scalars
        if (limits := (*each.thresholds, *each.lower_thresholds))
    )


def _problem(design: Design, variants: Mapping[str, Variant]) -> tuple[str, str] | None:
    """Return what stands in the way of a refinement, and what is expected; None if nothing."""
    if isinstance(design, RefinedDesign):
        return f"a design that {design.name} refines already", "one refinement of a design"
    if not isinstance(design, MonteCarlo) or design.runs is None:
        kind = family_name(DESIGNS, design) or type(design).__name__
        what = " that decides its own number of runs" if design.ends_early else ""
        return f"a design of kind {kind}{what}", _INDEPENDENT
    names = {each.name for variant in variants.values() for each in variant.model.inputs}
    if WEIGHT in names:
        return f'an input named "{WEIGHT}"', "another name of it: runs that are placed have weights"
    return None
