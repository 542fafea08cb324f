"""A surrogate as a source: its fit, its estimates, and their validation."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr

from uqpen.core.labels import RUN, RUNS_SPENT, SOURCE_KIND, VERDICT_RULE
from uqpen.core.streams import Stream
from uqpen.models.user_code import error_text
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.statistics.surrogate.surrogate_statistics import (
    SurrogateStatistics,
    surrogate_statistics,
)
from uqpen.study.study import ValidatedStudy
from uqpen.surrogates.fitting import fit_surrogate, is_built_in
from uqpen.surrogates.output_surrogate import unfitted
from uqpen.trust import VALIDATION_RULE, ValidationRuns, validate_surrogate
from uqpen.workflow.analysis_steps import AnalysisSteps
from uqpen.workflow.design_runs import Runs
from uqpen.workflow.source import Source

__all__ = ["surrogate_source"]


def surrogate_source(
    study: ValidatedStudy,
    model: str,
    name: str,
    runs: Runs,
    sources: Mapping[str, Source],
    steps: AnalysisSteps,
) -> tuple[xr.DataTree, Source]:
    """Fit a surrogate to its design, and compare its estimates with those of other designs."""
    variant = study.models[model]
    surrogate = study.surrogates[name]
    validation_runs = study.validation_designs(surrogate)
    check = runs[validation_runs[0]] if validation_runs else None
    training = runs[surrogate.design]
    try:
        tree, statistics = _surrogate_results(study, model, name, training, check, steps)
    except (Exception, SystemExit) as error:
        if is_built_in(surrogate):
            raise
        # Runs of the model are not lost by a mistake in a surrogate of the user's own.
        reason = f"its predictions fail: {error_text(error)}"
        fitted = unfitted(surrogate, name, training, variant.model, study.joint, reason)
        tree, statistics = fitted.to_tree(), SurrogateStatistics({}, {})
    outputs = validate_surrogate(
        statistics.outputs,
        [ValidationRuns(validation, sources[validation].outputs) for validation in validation_runs],
        statistics.training_ranges,
    )
    outputs |= statistics.fields
    used = [surrogate.design, *validation_runs[:1]]
    attributes: dict[str, str | int | float] = {
        RUNS_SPENT: sum(runs[design].sizes[RUN] for design in used),
        "check": validation_runs[0] if validation_runs else "none",
    }
    rule = {VERDICT_RULE: VALIDATION_RULE}
    source = Source({SOURCE_KIND: "surrogate", **attributes, **rule}, outputs)
    if name in study.surrogate_origins:
        tree.attrs["kind"] = study.surrogate_origins[name].kind
    tree.attrs |= attributes
    return tree, source


def _surrogate_results(
    study: ValidatedStudy,
    model: str,
    name: str,
    training: xr.Dataset,
    check: xr.Dataset | None,
    steps: AnalysisSteps,
) -> tuple[xr.DataTree, SurrogateStatistics]:
    """Return the group of a fitted surrogate and its statistics, before their validation."""
    variant = study.models[model]
    stream = Stream(study.seed, "surrogates", name)
    surrogate = study.surrogates[name]
    steps.start(f"fitting {name}", model)
    fitted = fit_surrogate(surrogate, name, training, variant.model, study.joint, stream)
    checked = fitted if check is None else fitted.with_check(check)
    steps.start(f"estimates of {name}", model)
    draws = SurrogateDraws(checked, study.joint, study.constraints, variant.given, stream)
    statistics = surrogate_statistics(draws, study.model_quantities(variant.model))
    return checked.to_tree(), statistics
