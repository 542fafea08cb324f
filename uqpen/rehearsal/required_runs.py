"""Numbers of runs that designs take for wanted half-widths, found on a surrogate."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from uqpen.core.streams import Stream
from uqpen.designs.design import Design
from uqpen.designs.feedback import Feedback
from uqpen.designs.stopping.precision import Precision, Target
from uqpen.rehearsal.rehearsed_study import is_drawn, run_once
from uqpen.statistics.running_estimates import RunningEstimates
from uqpen.study.study import ONLY_MODEL, ValidatedStudy

__all__ = ["MOST_RUNS", "SufficientRuns", "sufficient_runs"]

# Powers of two are fair to all designs.
_FEWEST_RUNS, MOST_RUNS = 64, 131_072

# The median half-width of so many repeats is known to a few per cent.
_REPEATS = 15


class SufficientRuns(NamedTuple):
    """Number of runs of a design after which an interval is as narrow as wanted.

    Attributes
    ----------
    target : str
        The wanted half-width in words.
    design : str
        The name of the design.
    runs : int or None
        A power of two, or the most that the design makes of it; None where `MOST_RUNS` are too few.
    """

    target: str
    design: str
    runs: int | None


def sufficient_runs(study: ValidatedStudy, rule: Precision) -> Iterator[SufficientRuns]:
    """Yield the number of runs that each design takes for each target.

    It is the first of doubled numbers at which the median half-width of repeats is at most as
    wanted.

    Parameters
    ----------
    study : ValidatedStudy
        With a surrogate as its only model.
    rule : Precision
        The targets.
    """
    known = {quantity.output.name for quantity in study.quantities_of_interest}
    targets = [target for target in rule.each_target() if target.output in known]
    for name, design in study.designs.items():
        if is_drawn(design) and _scaled(study, design, MOST_RUNS) is not None:
            for target, runs in _first_sufficient(study, name, design, targets).items():
                yield SufficientRuns(str(target), name, runs)


def _first_sufficient(
    study: ValidatedStudy, name: str, stated: Design, targets: list[Target]
) -> Mapping[Target, int | None]:
    found: dict[Target, int | None] = dict.fromkeys(targets)
    budget = _FEWEST_RUNS
    while budget <= MOST_RUNS and (missing := [each for each in targets if found[each] is None]):
        design = _scaled(study, stated, budget)
        if design is not None:
            excesses = [_excesses(study, name, design, missing, i) for i in range(_REPEATS)]
            for target, excess in zip(missing, np.median(excesses, axis=0), strict=True):
                if excess <= 1:
                    found[target] = design.run_count(study.joint)
        budget *= 2
    return found


def _scaled(study: ValidatedStudy, design: Design, runs: int) -> Design | None:
    return design.scaled(study.joint, runs, replicated=design.replicate_count > 1)


def _excesses(
    study: ValidatedStudy, name: str, design: Design, targets: list[Target], repeat: int
) -> list[float]:
    """Return the half-widths in one repeat, in parts of the wanted ones; infinite for none."""
    runs = design.run_count(study.joint)
    stream = Stream(study.seed, "rehearsal", "sufficient runs", name, runs, repeat)
    made = {ONLY_MODEL: run_once(study, design, stream)}
    quantities = {ONLY_MODEL: study.quantities_of_interest}
    feedback = Feedback(made, RunningEstimates((made,), design.sampling, quantities))
    found = [target.excess(feedback, ONLY_MODEL) for target in targets]
    return [np.inf if np.isnan(excess) else excess for excess in found]
