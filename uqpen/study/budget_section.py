"""``budget``: a number of runs in place of the designs of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import tomli_w

from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.study.data_section import has_data
from uqpen.study.document import Document
from uqpen.study.run_plan import FEWEST_RUNS, PlannedTable, plan_runs
from uqpen.study.study import Variant
from uqpen.study.table_reader import TableReader

__all__ = ["BUDGET", "STAND_IN", "BudgetPlan", "check_budget", "plan_budget"]

# The key with the number of runs of all designs and models.
BUDGET = "budget"

# The designs of a study with a budget until its inputs are known.
STAND_IN: dict[str, Any] = {"monte_carlo": {"kind": "monte-carlo", "runs": FEWEST_RUNS}}


def check_budget(root: TableReader, budget: int | None) -> int | None:
    """Return the budget of a study if runs can be planned; note what stands in the way."""
    noted = len(root.problems)
    if budget is not None and has_data(root):
        expected = "no budget: all runs are those of [model] data, and no other can be made"
        root.add_problem(BUDGET, f"{budget} runs to make", expected)
    for section in ("designs", "surrogates"):
        if budget is not None and section in root:
            expected = f"a budget, which plans its own, or [{section}.<name>], not both"
            root.add_problem(BUDGET, f"{budget} beside [{section}]", expected)
    return budget if len(root.problems) == noted else None


@dataclass(frozen=True)
class BudgetPlan:
    """Plan of a study with a budget.

    Parameters
    ----------
    text : str
        The text of the study with its plan in place of the budget, as the archive keeps it.
    tables : tuple of PlannedTable
        The designs and surrogates; empty where a mistake was noted.
    """

    text: str
    tables: tuple[PlannedTable, ...] = ()

    def section(self, name: str) -> dict[str, Any] | None:
        """Return the tables of a section by their names; None where there are none."""
        return {
            each.name: dict(each.settings) for each in self.tables if each.section == name
        } or None


def plan_budget(
    root: TableReader,
    budget: int,
    joint: JointDistribution,
    models: Mapping[str, Variant],
    *,
    is_constrained: bool,
) -> BudgetPlan:
    """Plan the runs of a budget; note one that is too small.

    Parameters
    ----------
    root : TableReader
        The study.
    budget : int
        Number of runs of all designs and models.
    joint : JointDistribution
        The inputs.
    models : mapping of str to Variant
        The models; each makes the runs of every design.
    is_constrained : bool
        True if the study has constraints.
    """
    each, text = budget // max(len(models), 1), root.document.text
    if not joint.random:
        expected = 'a random input, such as "(2.5 ± 0.1) m" or { uniform = { … } }'
        root.add_problem(BUDGET, "a plan of runs over inputs that are all fixed", expected)
        return BudgetPlan(text)
    if each < FEWEST_RUNS:
        expected = f"{FEWEST_RUNS * len(models)} or more: {FEWEST_RUNS} runs of each model"
        root.add_problem(BUDGET, f"{budget} runs of {len(models)} models", expected)
        return BudgetPlan(text)
    no_surrogate = _reason_against_surrogate(joint, models, is_constrained=is_constrained)
    tables = plan_runs(each, len(joint.random), no_surrogate)
    # Not the line of a message: the text of a study made in Python has lines, too.
    line = Document.line(root.document, (BUDGET,))
    if line is None:
        expected = "[designs.<name>], as the text is too large to put them in its place"
        root.add_problem(BUDGET, f"{budget}", expected)
        return BudgetPlan(text)
    return BudgetPlan(_text(text, line, budget, tables), tables)


def _reason_against_surrogate(
    joint: JointDistribution, models: Mapping[str, Variant], *, is_constrained: bool
) -> str:
    """Return why no surrogate can be planned, whatever the budget; empty if one can."""
    if len(models) > 1:
        return "no surrogate of several models"
    if is_constrained:
        return "no surrogate with constraints"
    if joint.implicit_inputs or not joint.is_independent:
        return "no surrogate of dependent inputs"
    if not any(output.is_number for each in models.values() for output in each.model.all_outputs):
        return "no surrogate, as no output is a number"
    return ""


def _text(text: str, line: int, budget: int, tables: Sequence[PlannedTable]) -> str:
    """Return the text of a study with the budget as a comment, and tables behind it.

    So whoever reads the archive needs no rules, and other rules do not change it.
    """
    lines = text.rstrip("\n").split("\n")
    lines[line - 1] = f"# {lines[line - 1]}"
    lines += ["", f"# Planned from the budget of {budget} runs"]
    for each in tables:
        table = tomli_w.dumps({each.section: {each.name: dict(each.settings)}})
        lines += [f"# {each.text}", table]
    return "\n".join(lines)
