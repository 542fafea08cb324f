"""``[surrogates.<name>]``: cheap models to fit to the runs of a design."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from uqpen.core.lookup import choices
from uqpen.core.model import Model
from uqpen.core.sampling import Sampling
from uqpen.designs.design import Design
from uqpen.designs.keep import RUNS
from uqpen.designs.unloaded import UnloadedDesign
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.study.named_object import OBJECT, read_named_object
from uqpen.study.study import SurrogateOrigin
from uqpen.study.table_reader import TableReader, family_member, named_tables
from uqpen.study.user_defined_members import SURROGATE, installed_names, is_reference, read_member
from uqpen.surrogates import SURROGATES
from uqpen.surrogates.refinement.refinement import Refinement
from uqpen.surrogates.surrogate import Surrogate
from uqpen.surrogates.unloaded_surrogate import UnloadedSurrogate

__all__ = ["check_surrogates", "read_surrogates"]

_POINTS = {
    Sampling.QUADRATURE: "the nodes of an integration rule",
    Sampling.TRAJECTORIES: "trajectories",
    Sampling.ONE_AT_A_TIME: "steps from the nominal point",
    Sampling.TOWARDS_EVENT: "points that move towards a rare event",
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
        surrogate, origin = _read_surrogate(section)
        if surrogate is None:
            continue
        found[name] = surrogate
        if origin is not None:
            origins[name] = origin
        _check_names(section, surrogate, designs)
    return found, origins


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
    whole = [output.name for output in model.outputs if output.dims and not output.may_end]
    for name, surrogate in surrogates.items():
        _check_designs(table, name, surrogate, designs)
        for output in surrogate.transform:
            if output in fields:
                found = f'the logarithm of "{output}", which has dimensions'
                expected = "a scalar output: a field is fitted as it is"
                table.add_problem((name, "transform", output), found, expected)
            elif output not in numeric:
                expected = f"an output of {model.name} that has numbers; {choices(output, numeric)}"
                table.add_problem((name, "transform", output), "no such output", expected)
        if fields and not numeric and not whole:
            found = f"a surrogate of {', '.join(fields)}, whose curves may end"
            table.add_problem(name, found, "an output with numbers that are always there")
        if joint is not None and not joint.random:
            which = "that are all fixed" if joint.inputs else "without a distribution"
            table.add_problem(name, f"a surrogate over inputs {which}", "a random input")
        elif joint is not None:
            table.add_problems(surrogate.check_inputs(joint), name)
        # What an archive names may be missing here; its study can be read all the same.
        if table.trust and surrogate.absence and not isinstance(surrogate, UnloadedSurrogate):
            table.add_problem(name, surrogate.absence, "a surrogate that can be fitted here")


def _read_surrogate(table: TableReader) -> tuple[Surrogate | None, SurrogateOrigin | None]:
    """Return a surrogate and, of a user-defined one, its origin."""
    if OBJECT in table and "kind" not in table:
        return _read_object(table)
    table.settings(Refinement)  # of any kind; read again where the designs are known
    kind = str(table.content.get("kind"))
    if is_reference(kind) and not table.trust:
        return _unloaded(table, kind), SurrogateOrigin(kind)
    if is_reference(kind) or kind in installed_names(SURROGATE, kind):
        table.take("kind")
        surrogate, files = read_member(table, "kind", kind, SURROGATE)
        return surrogate, SurrogateOrigin(kind, files)
    built_in = family_member(table, "kind", SURROGATES, "a kind of surrogate")
    return built_in and table.whole_settings(built_in), None


def _unloaded(table: TableReader, kind: str) -> UnloadedSurrogate:
    """Return a stand-in with the designs that the table names, whatever else it has."""
    design, check = table.content.get("design"), table.content.get("check")
    return UnloadedSurrogate(
        kind,
        design if isinstance(design, str) else "",
        check if isinstance(check, str) else None,
    )


def _read_object(table: TableReader) -> tuple[Surrogate | None, SurrogateOrigin | None]:
    """Read a surrogate that is an object of the Python program; without it, it is not fitted."""
    expected = f'kind = "{SURROGATE.form}": a file cannot contain a Python object'
    found = read_named_object(table, "surrogate", expected)
    table.check_unknown_keys()
    if found is None:
        return None, None
    origin = SurrogateOrigin(found.name)
    if isinstance(found.value, Surrogate):
        return found.value, origin
    return UnloadedSurrogate(found.name, is_object=True), origin


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
