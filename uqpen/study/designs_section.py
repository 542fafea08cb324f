"""``[designs.<name>]``: which runs to make."""

from __future__ import annotations

from pathlib import Path

from uqpen.designs import DESIGNS
from uqpen.designs.design import Design
from uqpen.designs.table import Table
from uqpen.errors import TableError, as_written
from uqpen.inputs.law import InputLaw
from uqpen.study.section import Section, member, named

__all__ = ["check_designs", "read_designs"]

# What has a meaning where the inputs depend on each other.
_VALID = (
    "take a sample (monte-carlo, latin-hypercube, sobol-sequence, halton): any sample tells "
    "first-order indices, which then include what an input shares with others, and delta; "
    "Shapley effects, which divide what is shared, follow from a surrogate"
)


def read_designs(table: Section, folder: Path) -> dict[str, Design]:
    """The designs of a study; what could not be understood is noted and left out."""
    found: dict[str, Design] = {}
    for name, section in named(table):
        design = _design(section, folder)
        if design is not None:
            found[name] = design
    if not table.content:
        table.wrong((), "no design", f"a [designs.<name>] of kind {', '.join(DESIGNS)}")
    return found


def check_designs(table: Section, designs: dict[str, Design], law: InputLaw) -> set[str]:
    """Note designs that do not fit the inputs.

    Returns
    -------
    set of str
        The inputs that every design gives by itself, as a column of its table.
    """
    given: list[set[str]] = []
    for name, design in designs.items():
        if isinstance(design, Table):
            try:
                given.append(set(design.columns(law)))
            except TableError as error:
                expected = 'a column "name [unit]" for each input that it varies'
                table.wrong((name, "file"), str(error), expected)
            continue
        given.append(set())
        if not law.random:
            expected = 'a random input, such as "(2.5 ± 0.1) m" or { uniform = { … } }'
            table.wrong(name, "a design over inputs that are all fixed", expected)
            continue
        if design.assumes_independence and not law.is_independent:
            kind = as_written(table.content[name]["kind"])
            found = f"{kind} with inputs that depend on each other ([dependence])"
            table.wrong((name, "kind"), found, f"{design.independence_reason}; {_VALID}")
            continue
        for problem in design.misfit(law):
            table.wrong((name, *problem.path), problem.found, problem.expected)
    return set.intersection(*given) if given else set()


def _design(table: Section, folder: Path) -> Design | None:
    kind = member(table, "kind", DESIGNS, "a kind of design")
    if kind is None:
        return None
    design: Design | None = table.settings(kind, folder=folder)
    table.close()
    return design
