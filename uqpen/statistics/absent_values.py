"""Runs in which a derived output has no value, such as the time of an event that never comes.

They are neither used nor missing: a statistic of the output is one of the other runs, and says so.
"""

from __future__ import annotations

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray
from uqpen.core.blocks import BlockedRuns
from uqpen.core.labels import ABSENT, CONDITIONAL, RUNS_ABSENT, STATUS
from uqpen.core.status import Status
from uqpen.statistics import texts

__all__ = ["absent_condition", "absent_runs", "condition_of_absent", "runs_with_value"]


def absent_runs(runs: BlockedRuns, name: str) -> BoolArray | None:
    """Return a mask of the completed runs without a value of an output; None where all have one."""
    if ABSENT not in runs.template[name].attrs:
        return None
    mask: BoolArray = np.isnan(runs.column(name)) & (runs.column(STATUS) == Status.OK)
    return mask if mask.any() else None


def absent_condition(runs: BlockedRuns, name: str) -> dict[str, int | str]:
    """Return what the statistics of an output are conditional on, as attributes.

    Returns
    -------
    dict
        ``runs_absent``, the number of runs without a value, and ``conditional_on``. Empty where
        all completed runs have one.
    """
    mask = absent_runs(runs, name)
    return {} if mask is None else condition_of_absent(runs, name, int(mask.sum()))


def condition_of_absent(runs: BlockedRuns, name: str, count: int) -> dict[str, int | str]:
    """Return the same from the number of completed runs without a value."""
    if not count:
        return {}
    status, absent = runs.column(STATUS), runs.template[name].attrs[ABSENT]
    share = count / (status == Status.OK).sum()
    condition = texts.VALUE_EXISTS.format(absent=absent, share=100 * share)
    if (status == Status.INADMISSIBLE).any():
        condition = f"{texts.ADMISSIBLE_INPUTS} and {condition}"
    return {RUNS_ABSENT: count, CONDITIONAL: condition}


def runs_with_value(runs: BlockedRuns, name: str) -> xr.Dataset:
    """Return all runs of a design, those without a value of an output marked as inadmissible.

    So an analysis of blocks, nodes or trajectories leaves them out as it leaves out those, and
    takes them for no failure. The attribute ``conditional_on`` says what they have in common.
    """
    whole, mask = runs.dataset(), absent_runs(runs, name)
    if mask is None:
        return whole
    status = np.where(mask, Status.INADMISSIBLE, whole[STATUS].values).astype(np.int8)
    condition = {CONDITIONAL: absent_condition(runs, name)[CONDITIONAL]}
    return whole.assign({STATUS: whole[STATUS].copy(data=status)}).assign_attrs(condition)
