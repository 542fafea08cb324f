"""Plan of a budget of runs: the designs, a surrogate where it pays, and the reason for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

__all__ = ["FEWEST_RUNS", "PlannedTable", "plan_runs"]

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
    """Table of a study that a budget gives.

    Parameters
    ----------
    section : str
        ``"designs"`` or ``"surrogates"``.
    name : str
        Its name there.
    settings : mapping
        Its keys and values.
    reason : str
        Why it was chosen.
    """

    section: str
    name: str
    settings: Mapping[str, Any]
    reason: str

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
    inputs : int
        Number of random inputs.
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
        return (_sobol_sets(runs),)
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


def _sobol_sets(runs: int) -> PlannedTable:
    """Plan as many points in a set as 16 sets can have, and as many sets as there are runs for."""
    points = 1 << ((runs // _SETS).bit_length() - 1)
    sets = runs // points
    reason = f"mostly the most precise above {_MOST_FITTED} runs"
    return _design("sobol-sequence", sets * points, reason, replicates=sets)


def _design(kind: str, runs: int, reason: str, **settings: int) -> PlannedTable:
    name = kind.replace("-", "_")
    return PlannedTable("designs", name, {"kind": kind, "runs": runs, **settings}, reason)


def _whole(runs: int) -> int:
    """Return the largest number of runs that can be split into hypercubes of one size."""
    return runs - runs % _REPLICATES
