"""``[surrogates.<name>]``: cheap models to fit to the runs of a design."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from uqpen.core.lookup import choices
from uqpen.core.model import Model
from uqpen.core.sampling import Sampling
from uqpen.designs.design import Design
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.study.table_reader import TableReader, family_member, named_tables
from uqpen.surrogates import SURROGATES
from uqpen.surrogates.surrogate import Surrogate

__all__ = ["check_surrogates", "read_surrogates"]


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
    for name, surrogate in surrogates.items():
        _check_design(table, name, surrogate, designs)
        _check_transform(table, name, surrogate, model)
        if joint is not None and not joint.random:
            table.add_problem(name, "a surrogate over inputs that are all fixed", "a random input")


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


def _check_design(
    table: TableReader, name: str, surrogate: Surrogate, designs: Mapping[str, Design]
) -> None:
    """Note a design whose points are of no use, as far as it was understood itself."""
    trained, checked = designs.get(surrogate.design), designs.get(surrogate.check or "")
    if trained is not None:
        found = f'"{surrogate.design}", which makes {_design_description(trained)}'
        is_rule = trained.sampling is Sampling.QUADRATURE
        if surrogate.needs_quadrature and not is_rule:
            table.add_problem(
                (name, "design"), found, "a design of kind quadrature, for a projection"
            )
        elif not (is_rule or trained.sampling.is_sample):
            table.add_problem((name, "design"), found, "a design that samples, or a quadrature")
    if checked is not None and not checked.sampling.is_sample:
        found = f'"{surrogate.check}", which makes {_design_description(checked)}'
        table.add_problem((name, "check"), found, "a design that samples")


def _design_description(design: Design) -> str:
    """Describe the points of a design in words."""
    words = {
        Sampling.QUADRATURE: "the nodes of an integration rule",
        Sampling.TRAJECTORIES: "trajectories",
        Sampling.ONE_AT_A_TIME: "steps from the nominal point",
    }
    return words.get(design.sampling, "a sample")


def _check_transform(table: TableReader, name: str, surrogate: Surrogate, model: Model) -> None:
    """Note transformations of what is no output, or has no numbers."""
    numeric = [output.name for output in model.outputs if not output.categories]
    for output in surrogate.transform:
        if output not in numeric:
            expected = f"an output of {model.name} that has numbers; {choices(output, numeric)}"
            table.add_problem((name, "transform", output), "no such output", expected)
