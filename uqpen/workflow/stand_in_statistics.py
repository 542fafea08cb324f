"""Statistics of a design in which stand-ins have run further points, as control variates."""

from __future__ import annotations

from collections.abc import Mapping

from uqpen.core.labels import COST_SPENT, RUN
from uqpen.core.threads import one_blas_thread
from uqpen.statistics.analyze import OutputStatistics
from uqpen.study.study import ValidatedStudy
from uqpen.workflow.design_runs import Runs

__all__ = ["cost_attributes", "use_stand_ins"]


def use_stand_ins(
    study: ValidatedStudy,
    model: str,
    design: str,
    runs: Mapping[str, Runs],
    found: dict[str, OutputStatistics],
) -> dict[str, OutputStatistics]:
    """Return the statistics of a model, of the first those with stand-ins where there are any.

    Parameters
    ----------
    study : ValidatedStudy
        The study.
    model, design : str
        The names of a model and of a design.
    runs : mapping of str to dict of str to Dataset
        All runs, by model and design.
    found : mapping of str to dict of str to DataArray
        By output, estimate arrays from the model's own runs.
    """
    family = {name: runs[name][design] for name in study.family_costs}
    if model != next(iter(family)) or len(family) < 2:
        return found
    from uqpen.statistics.control_variates import (
        control_variate_statistics,
    )

    with one_blas_thread():
        return {
            name: found[name] | control_variate_statistics(family, quantity, found[name])
            for quantity in study.quantities_of_interest
            if (name := quantity.output.name)
        }


def cost_attributes(
    study: ValidatedStudy, model: str, design: str, runs: Mapping[str, Runs]
) -> dict[str, float]:
    """Return the cost of a design's runs by all models, in runs of the first, for its statistics.

    It is known where all models of the study stand for the first. For others it is empty.
    """
    costs = study.family_costs
    if model not in costs or costs[model] < 1 or not 1 < len(costs) == len(study.models):
        return {}
    spent = sum(cost * runs[name][design].sizes[RUN] for name, cost in costs.items())
    return {COST_SPENT: float(spent)}
