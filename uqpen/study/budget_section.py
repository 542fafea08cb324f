"""``budget``: a number of runs in place of the designs of a study, and the plan of these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import tomli_w

from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.study.data_section import has_data
from uqpen.study.document import Document
from uqpen.study.study import Variant
from uqpen.study.table_reader import TableReader

# Fewer runs estimate next to nothing: ten are the fewest that an empirical distribution takes.
FEWEST_RUNS = 10

# The coverage of replicated designs was measured from 100 runs on.
_REPLICATED, _REPLICATES = 100, 10

# The 59th independent run gives the first upper tolerance limit of 95 % with confidence 95 %.
_CHECK, _CHECK_SHARE = 60, 6
# Rule of thumb for computer experiments: Loeppky, Sacks & Welch (2009), Technometrics 51, 366-376.
_TRAINING_PER_INPUT = 10

# Surrogates were compared with samples up to here; a fit to more runs takes longer and longer.
_MOST_FITTED = 1024
_SETS = 16


@dataclass(frozen=True)
class PlannedTable:
    """Table of a study that a budget gives."""

    section: str  # ``"designs"`` or ``"surrogates"``
    name: str  # its name there
    settings: Mapping[str, Any]  # its keys and values
    reason: str  # why it was chosen

    @property
    def text(self) -> str:
        """The choice and its reason, in one line."""
        runs = f", {self.settings['runs']} runs" if "runs" in self.settings else ""
        return f"{self.settings['kind']}{runs}: {self.reason}"


def plan_runs(runs: int, inputs: int, no_surrogate: str = "") -> tuple[PlannedTable, ...]:
    """Plan designs, and a surrogate with the runs that check it.

    Parameters
    ----------
    runs : int
        The largest number of runs of all designs together, 10 at least.
    no_surrogate : str
        Why no surrogate is planned, if that is known; else empty.

    Returns
    -------
    tuple of PlannedTable
        With at most `runs` runs, and no fewer than for a smaller number.
    """
    if runs < _REPLICATED:
        reason = f"below {_REPLICATED} runs, its intervals assume least"
        return (_design("monte-carlo", runs, reason),)
    if runs > _MOST_FITTED:
        # As many points in a set as 16 sets can have, and as many sets as there are runs for.
        points = 1 << ((runs // _SETS).bit_length() - 1)
        sets = runs // points
        reason = f"mostly the most precise above {_MOST_FITTED} runs"
        return (_design("sobol-sequence", sets * points, reason, replicates=sets),)
    training = _whole(runs - max(_CHECK, runs // _CHECK_SHARE))
    fewest = max(_REPLICATED, _TRAINING_PER_INPUT * inputs)
    if training < fewest and not no_surrogate:
        no_surrogate = f"too few for a surrogate ({fewest}) and its check"
    if no_surrogate:
        return (_hypercubes(_whole(runs), no_surrogate),)
    return (
        _hypercubes(training, f"to fit a surrogate ({_TRAINING_PER_INPUT} or more per input)"),
        _design("monte-carlo", runs - training, "checks the surrogate with runs of its own"),
        PlannedTable(
            "surrogates",
            "pce",
            {"kind": "polynomial-chaos", "design": "latin_hypercube", "check": "monte_carlo"},
            "corrected by all runs, often sharper than a sample",
        ),
    )


def _hypercubes(runs: int, reason: str) -> PlannedTable:
    return _design("latin-hypercube", runs, reason, replicates=_REPLICATES)


def _design(kind: str, runs: int, reason: str, **settings: int) -> PlannedTable:
    name = kind.replace("-", "_")
    return PlannedTable("designs", name, {"kind": kind, "runs": runs, **settings}, reason)


def _whole(runs: int) -> int:
    """Return the largest number of runs that can be split into hypercubes of one size."""
    return runs - runs % _REPLICATES


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
    """Plan of a study with a budget."""

    text: str  # the text of the study with its plan in place of the budget, as the archive keeps it
    # The designs and surrogates; empty where a mistake was noted.
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
    budget : int
        Number of runs of all designs and models.
    models : mapping of str to Variant
        The models; each makes the runs of every design.
    is_constrained : bool
        True if the study has constraints.
    """
    runs, text = budget // max(len(models), 1), root.document.text
    # Not the line of a message: the text of a study made in Python has lines, too.
    line = Document.line(root.document, (BUDGET,))
    if not joint.random:
        found = "a plan of runs over inputs that are all fixed"
        expected = 'a random input, such as "(2.5 ± 0.1) m" or { uniform = { … } }'
    elif joint.intervals:
        found = f"a plan of runs over {joint.intervals[0].variable.name}, which is an interval"
        expected = 'a design of kind "interval-bounds", which states its runs'
    elif runs < FEWEST_RUNS:
        found = f"{budget} runs of {len(models)} models"
        expected = f"{FEWEST_RUNS * len(models)} or more: {FEWEST_RUNS} runs of each model"
    elif line is None:
        found = f"{budget}"
        expected = "[designs.<name>], as the text is too large to put them in its place"
    else:
        no_surrogate = _reason_against_surrogate(joint, models, is_constrained=is_constrained)
        tables = plan_runs(runs, len(joint.random), no_surrogate)
        # The budget becomes a comment, with the tables behind the text: whoever reads the archive
        # needs no rules, and other rules do not change it.
        lines = text.rstrip("\n").split("\n")
        lines[line - 1] = f"# {lines[line - 1]}"
        lines += ["", f"# Planned from the budget of {budget} runs"]
        for each in tables:
            table = tomli_w.dumps({each.section: {each.name: dict(each.settings)}})
            lines += [f"# {each.text}", table]
        return BudgetPlan("\n".join(lines), tables)
    root.add_problem(BUDGET, found, expected)
    return BudgetPlan(text)


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
