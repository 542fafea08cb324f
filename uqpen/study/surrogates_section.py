"""``[surrogates.<name>]``: cheap models to fit to the runs of a design, and to ``refine`` it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import partial

from uqpen.core.labels import WEIGHT
from uqpen.core.lookup import choices, family_name
from uqpen.core.model import Model
from uqpen.core.sampling import Sampling
from uqpen.designs import DESIGNS
from uqpen.designs.design import RUNS, Design, UnloadedDesign
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.repeated import RepeatedDesign, each_point_once
from uqpen.distributions.constraints import Constraint
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.study.study import SurrogateOrigin, Variant
from uqpen.study.table_reader import (
    OBJECT,
    TableReader,
    named_tables,
)
from uqpen.study.user_defined_members import SURROGATE, read_member
from uqpen.surrogates.refinement import (
    FOR_PROBABILITIES,
    RefinedDesign,
    RefinedModel,
    RefinedOutput,
    Refinement,
)
from uqpen.surrogates.surrogate import Surrogate, UnloadedSurrogate

_POINTS = {
    Sampling.QUADRATURE: "the nodes of an integration rule",
    Sampling.TRAJECTORIES: "trajectories",
    Sampling.ONE_AT_A_TIME: "steps from the nominal point",
    Sampling.SEARCH_CURVES: "curves through the inputs' space",
    Sampling.FINITE_DIFFERENCES: "small steps from points",
    Sampling.TWO_LEVELS: "two levels of each input",
    Sampling.OVER_BOX: "points of a mixture over intervals of parameters",
    Sampling.TOWARDS_EVENT: "points that move towards a rare event",
    Sampling.TOWARDS_BOUNDS: "points at bounds over intervals",
    Sampling.POSTERIOR: "draws that move towards a posterior",
    Sampling.WEIGHTED_POSTERIOR: "draws of posteriors by surrogates",
    Sampling.TOWARDS_MEASUREMENTS: "points that move towards measurements",
    Sampling.AT_EXPERIMENTS: "points at the conditions of experiments",
}


def read_surrogates(
    table: TableReader, designs: Collection[str]
) -> tuple[dict[str, Surrogate], dict[str, SurrogateOrigin]]:
    """Read the surrogates of a study; invalid ones are noted and left out.

    `designs` are the names of all designs in the file, which no surrogate has; empty if unknown.

    Returns
    -------
    surrogates, origins
        By name; those of user-defined surrogates.
    """
    found: dict[str, Surrogate] = {}
    origins: dict[str, SurrogateOrigin] = {}
    for name, section in named_tables(table):
        if name in designs:
            section.add_problem((), f'"{name}", which is a design', "a name that no design has")
            continue
        if "kind" in section or OBJECT not in section:
            section.settings(Refinement)  # of any kind; read again where the designs are known
        surrogate, origin, files = read_member(section, SURROGATE, partial(_unloaded, section))
        if surrogate is None:
            continue
        found[name] = surrogate
        if origin:
            origins[name] = SurrogateOrigin(origin, files)
        _check_names(section, surrogate, designs)
    return found, origins


def _interval_problem(joint: JointDistribution) -> tuple[str, str]:
    """Return what is found and expected where a surrogate is over an interval."""
    if joint.intervals:
        found = f"a surrogate over {joint.intervals[0].variable.name}, which is an interval"
        return found, "inputs with a distribution; interval-bounds has a polynomial of its own"
    found = f"a surrogate over {next(iter(joint.boxes))}, whose parameters are intervals"
    return found, "inputs with one distribution each, to which its numbers belong"


def check_surrogates(
    table: TableReader,
    surrogates: Mapping[str, Surrogate],
    designs: Mapping[str, Design],
    model: Model,
    joint: JointDistribution | None,
) -> None:
    """Note surrogates that do not fit the designs, the outputs or the inputs, if known."""
    numeric = [output.name for output in model.all_outputs if output.is_number]
    fields = [output.name for output in model.all_outputs if output.dims]
    for name, surrogate in surrogates.items():
        _check_designs(table, name, surrogate, designs)
        if (design := designs.get(surrogate.design)) is not None:
            repeats = design.repeats if isinstance(design, RepeatedDesign) else 1
            table.add_problems(surrogate.check_repeats(repeats), name)
        for output in surrogate.transform:
            if output in fields:
                found = f'the logarithm of "{output}", which has dimensions'
                expected = "a scalar output: a field is fitted as it is"
                table.add_problem((name, "transform", output), found, expected)
            elif output not in numeric:
                expected = f"an output of {model.name} that has numbers; {choices(output, numeric)}"
                table.add_problem((name, "transform", output), "no such output", expected)
        if joint is not None and not joint.random:
            which = "that are all fixed" if joint.inputs else "without a distribution"
            table.add_problem(name, f"a surrogate over inputs {which}", "a random input")
        elif joint is not None and (joint.intervals or joint.boxes):
            table.add_problem(name, *_interval_problem(joint))
        elif joint is not None:
            table.add_problems(surrogate.check_inputs(joint), name)
        # What an archive names may be missing here; its study can be read all the same.
        if table.trust and surrogate.absence and not isinstance(surrogate, UnloadedSurrogate):
            table.add_problem(name, surrogate.absence, "a surrogate that can be fitted here")


def _unloaded(table: TableReader, kind: str, is_object: bool) -> UnloadedSurrogate:
    """Return a stand-in; of code, with the designs that the table names, whatever else it has."""
    if is_object:
        return UnloadedSurrogate(kind, is_object=True)
    design, check = table.content.get("design"), table.content.get("check")
    return UnloadedSurrogate(
        kind,
        design if isinstance(design, str) else "",
        check if isinstance(check, str) else None,
    )


def _check_names(section: TableReader, surrogate: Surrogate, designs: Collection[str]) -> None:
    """Note names of designs that there are not."""
    if isinstance(surrogate, UnloadedSurrogate):
        return
    for key in ("design", "check"):
        name = getattr(surrogate, key)
        if name is not None and designs and name not in designs:
            section.add_wrong(key, name, f"the name of a design; {choices(name, designs)}")
    if surrogate.check == surrogate.design:
        section.add_problem("check", "the design that it is fitted to", "a design of other runs")


def _check_designs(
    table: TableReader, name: str, surrogate: Surrogate, designs: Mapping[str, Design]
) -> None:
    """Note designs whose points are of no use, as far as they were understood."""
    for key, label in (("design", surrogate.design), ("check", surrogate.check or "")):
        if label not in designs or isinstance(designs[label], UnloadedDesign):
            continue
        if designs[label].keep != RUNS:
            found = f'"{label}", which keeps statistics alone'
            expected = "a design that keeps its runs: predictions and checks go back to them"
            table.add_problem((name, key), found, expected)
            continue
        sampling = designs[label].sampling
        is_rule = sampling is Sampling.QUADRATURE
        if key == "check":
            is_useful, expected = sampling.is_sample, "a design that samples"
        elif surrogate.needs_quadrature:
            is_useful, expected = is_rule, "a design of kind quadrature, for a projection"
        else:
            is_useful = is_rule or sampling.is_sample
            expected = "a design that samples, or a quadrature"
        if not is_useful:
            found = f'"{label}", which makes {_POINTS.get(sampling, "a sample")}'
            table.add_problem((name, key), found, expected)


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
    variants : mapping of str to Variant
        The models of the study.
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
        kind = family_name(DESIGNS, each_point_once(design)) or type(design).__name__
        kind += " with repeats" * isinstance(design, RepeatedDesign)
        what = " that decides its own number of runs" if design.ends_early else ""
        return f"a design of kind {kind}{what}", _INDEPENDENT
    names = {each.name for variant in variants.values() for each in variant.model.inputs}
    if WEIGHT in names:
        return f'an input named "{WEIGHT}"', "another name of it: runs that are placed have weights"
    return None
