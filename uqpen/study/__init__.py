"""The study file: TOML into a frozen, validated study, every mistake met before a model runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypedDict

from uqpen.core.labels import LEFT_OUT, SWEEP

__all__ = ["SECTIONS", "Section", "SectionArguments"]


@dataclass(frozen=True, kw_only=True)
class Section:
    """Section of a study file, of the same name as the argument of `uqpen.Study` for it.

    A section that refers to no other one has its `settings`, or a `reader`; both give a `field`.
    The others are read together, in `load.py`. References are texts, so that whoever reads the
    declarations loads nothing.
    """

    # False for a key that stands in no table, and for models, which are read before all tables.
    is_table: bool = True
    expected: str = ""  # what a study without it lacks, for a message; empty where it is optional
    # Reference to the class whose settings the table has. An object of it is the section, too.
    settings: str = ""
    reader: str = ""  # reference to a function of the table and of `StudyParts`
    # Field of `ValidatedStudy` with its value; that has a default if the section is optional.
    field: str = ""
    determines_points: bool = False  # true if the points of every design depend on it
    lines: str = ""  # reference to a function of the study, which yields lines of its summary
    rank: int = 99  # place of these lines among those of other sections
    attribute: str = ""  # attribute of an archive's root with the field, where that is not empty
    fact: str = ""  # statement at the head of a page, with ``{value}`` for the attribute


# In the order in which the text of a study made in Python has them.
SECTIONS: Mapping[str, Section] = {
    "title": Section(is_table=False),
    "seed": Section(is_table=False, determines_points=True),
    "confidence_level": Section(is_table=False),
    "budget": Section(is_table=False),
    # What this one and the next leave out is one field.
    "sensitivity": Section(
        is_table=False,
        field="left_out",
        attribute=LEFT_OUT,
        fact="without {value}, as the study says",
    ),
    "convergence": Section(is_table=False),
    "analyses": Section(is_table=False),
    "model": Section(is_table=False, lines="uqpen.study.summary:run_limit_lines", rank=1),
    "models": Section(is_table=False),
    "inputs": Section(expected="an [inputs] table", determines_points=True),
    # Values of inputs, each of which is a variant of the model, at the same points.
    "sweep": Section(
        field="swept", attribute=SWEEP, fact="at several values of {value}, at the same points"
    ),
    "joint": Section(determines_points=True),
    "dependence": Section(determines_points=True),
    "constraints": Section(
        determines_points=True, lines="uqpen.study.summary:constraint_lines", rank=4
    ),
    "outputs": Section(
        reader="uqpen.study.outputs_section:read_quantities_of_interest",
        field="quantities_of_interest",
    ),
    "joint_probabilities": Section(
        reader="uqpen.study.outputs_section:read_joint_probabilities",
        field="joint_events",
    ),
    # Experiments that the model is compared with; designs refer to them.
    "measured": Section(lines="uqpen.study.measured_section:role_lines", rank=5),
    # How far off it may be there.
    "validation": Section(),
    "designs": Section(
        expected="at least one [designs.<name>]", lines="uqpen.study.summary:design_lines", rank=3
    ),
    "surrogates": Section(),
    "published": Section(reader="uqpen.study.outputs_section:read_published", field="published"),
    "failures": Section(
        settings="uqpen.execution.failures:FailurePolicy",
        field="failures",
        lines="uqpen.study.summary:failure_lines",
        rank=2,
    ),
}


class SectionArguments(TypedDict, total=False):
    """Arguments of `uqpen.Study` that are given as the tables of these names in a study file."""

    sweep: Mapping[str, object] | None
    joint: Mapping[str, object] | None
    measured: Mapping[str, object] | None
    validation: Mapping[str, object] | None
    joint_probabilities: Mapping[str, object] | None
    surrogates: Mapping[str, object] | None
    published: Mapping[str, object] | None
    failures: object | None
    dependence: object | None
