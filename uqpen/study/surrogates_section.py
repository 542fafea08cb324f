"""``[surrogates.<name>]``: cheap models to fit to the runs of a design."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from uqpen.core.lookup import choices
from uqpen.core.model import Model
from uqpen.core.sampling import Sampling
from uqpen.designs.design import Design
from uqpen.designs.unloaded import UnloadedDesign
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.study.table_reader import TableReader, family_member, named_tables
from uqpen.surrogates import SURROGATES
from uqpen.surrogates.surrogate import Surrogate

__all__ = ["check_surrogates", "read_surrogates"]

_POINTS = {
    Sampling.QUADRATURE: "the nodes of an integration rule",
    Sampling.TRAJECTORIES: "trajectories",
    Sampling.ONE_AT_A_TIME: "steps from the nominal point",
}


def read_surrogates(table: TableReader, designs: Collection[str]) -> dict[str, Surrogate]:
    """Read the surrogates of a study; invalid ones are noted and left out.

    `designs` are the names of all designs in the file, which no surrogate has; empty if unknown.
    """
    found: dict[str, Surrogate] = {}
    for name, section in named_tables(table):
        if name in designs:
            section.add_problem((), f'"{name}", which is a design', "a name that no design has")
        elif (surrogate := _surrogate(section, designs)) is not None:
            found[name] = surrogate
    return found


def check_surrogates(
    table: TableReader,
    surrogates: Mapping[str, Surrogate],
    designs: Mapping[str, Design],
    model: Model,
    joint: JointDistribution | None,
) -> None:
    """Note surrogates that do not fit the designs, the outputs or the inputs, if known."""
    numeric = [output.name for output in model.outputs if not output.categories]
    for name, surrogate in surrogates.items():
        _check_designs(table, name, surrogate, designs)
        for output in surrogate.transform:
            if output not in numeric:
                expected = f"an output of {model.name} that has numbers; {choices(output, numeric)}"
                table.add_problem((name, "transform", output), "no such output", expected)
        if joint is not None and not joint.random:
            table.add_problem(name, "a surrogate over inputs that are all fixed", "a random input")
        if joint is not None and joint.implicit_inputs:
            found = f"polynomials of {', '.join(joint.implicit_inputs)}"
            expected = "inputs whose own distributions are known, apart from each other"
            table.add_problem(name, found, expected)


def _surrogate(section: TableReader, designs: Collection[str]) -> Surrogate | None:
    kind = family_member(section, "kind", SURROGATES, "a kind of surrogate")
    surrogate: Surrogate | None = kind and section.whole_settings(kind)
    if surrogate is None:
        return None
    for key in ("design", "check"):
        name = getattr(surrogate, key)
        if name is not None and designs and name not in designs:
            section.add_wrong(key, name, f"the name of a design; {choices(name, designs)}")
    if surrogate.check == surrogate.design:
        section.add_problem("check", "the design that it is fitted to", "a design of other runs")
    return surrogate


def _check_designs(
    table: TableReader, name: str, surrogate: Surrogate, designs: Mapping[str, Design]
) -> None:
    """Note designs whose points are of no use, as far as they were understood."""
    for key, label in (("design", surrogate.design), ("check", surrogate.check or "")):
        if label not in designs or isinstance(designs[label], UnloadedDesign):
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
