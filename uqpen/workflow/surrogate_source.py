"""A surrogate as a source: its fit, and its estimates as real runs correct them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import xarray as xr

from uqpen.core.labels import REFUTED, RUN, RUNS_SPENT, SOURCE_KIND, SURROGATE_RECIPE
from uqpen.core.streams import Stream
from uqpen.execution import first_repeats, mean_repeats
from uqpen.models.user_code import error_text
from uqpen.statistics.analyze import OutputStatistics, all_analyses_but
from uqpen.statistics.surrogate.corrected_statistics import correct_statistics, correction_evidence
from uqpen.statistics.surrogate.correction_runs import missing_run_predictions
from uqpen.statistics.surrogate.refutation import (
    contradiction,
    refutations,
    without_numbers,
)
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.statistics.surrogate.surrogate_statistics import surrogate_statistics
from uqpen.study.study import ValidatedStudy
from uqpen.surrogates.diagnostics import DIAGNOSTICS, diagnostics_dataset
from uqpen.surrogates.fitting import cross_fit, fit_surrogate, is_built_in
from uqpen.surrogates.gaussian_process_fit import GaussianProcessFit
from uqpen.surrogates.output_surrogate import unfitted
from uqpen.surrogates.separate_fits import SeparateFits
from uqpen.workflow.design_runs import Runs
from uqpen.workflow.noise_check import is_noisy

# Whoever changes how surrogates are fitted or corrected raises it: `verify` then leaves out those
# of earlier archives.
RECIPE = 1


def surrogate_source(
    study: ValidatedStudy, model: str, name: str, runs: Runs, start_step: Callable[[str, str], None]
) -> tuple[xr.DataTree, dict[str, str | int | float], Mapping[str, OutputStatistics]]:
    """Fit a surrogate to its design, and correct its estimates by that and its check design.

    `runs` are all of them, the repeats of points included.

    Returned are its group, the attributes of the group of its estimates, and these by output.
    """
    surrogate = study.surrogates[name]
    training = runs[surrogate.design]
    check = None if surrogate.check is None else runs[surrogate.check]
    try:
        tree, outputs = _surrogate_results(study, model, name, training, check, start_step)
    except (Exception, SystemExit) as error:
        if is_built_in(surrogate):
            raise
        # Runs of the model are not lost by a mistake in a user-defined surrogate.
        reason = f"its predictions fail: {error_text(error)}"
        original = study.models[model].model
        fitted = unfitted(surrogate, name, training, original, study.joint, reason)
        tree, outputs = fitted.to_tree(), {}
    if name in study.surrogate_origins:
        tree.attrs["kind"] = study.surrogate_origins[name].kind
    attributes: dict[str, str | int | float] = {
        RUNS_SPENT: training.sizes[RUN] + (0 if check is None else check.sizes[RUN]),
        "check": surrogate.check or "none",
    }
    tree.attrs |= attributes
    return tree, {SOURCE_KIND: "surrogate", **attributes, SURROGATE_RECIPE: RECIPE}, outputs


def _surrogate_results(
    study: ValidatedStudy,
    model: str,
    name: str,
    training: xr.Dataset,
    check: xr.Dataset | None,
    start_step: Callable[[str, str], None],
) -> tuple[xr.DataTree, Mapping[str, OutputStatistics]]:
    """Return the group of a fitted surrogate and its corrected estimates."""
    variant = study.models[model]
    stream = Stream(study.seed, "surrogates", name)
    surrogate = study.surrogates[name]
    start_step(f"fitting {name}", model)
    fitted = fit_surrogate(surrogate, name, training, variant.model, study.joint, stream)
    checked = fitted if check is None else fitted.with_check(first_repeats(check))
    again = surrogate.for_refits(fitted.without_fields)
    folds = cross_fit(again, name, training, variant.model, study.joint, stream)
    start_step(f"estimates of {name}", model)
    draws = SurrogateDraws(checked, study.joint, study.constraints, variant.given, stream)
    quantities = study.model_quantities(variant.model)
    only = all_analyses_but(study.left_out)
    found = surrogate_statistics(draws, quantities, only=only)
    evidence = correction_evidence(draws, folds, training, check, quantities, only)
    corrected = correct_statistics(found.outputs, evidence, quantities)
    tree = checked.to_tree()
    if is_noisy(variant.model, {surrogate.design: training}):
        # What the nuggets of its processes mean as noise of the model.
        for output, each in checked.fitted.items() if isinstance(checked, SeparateFits) else ():
            if isinstance(each.fit, GaussianProcessFit):
                noise = diagnostics_dataset(each.fit.noise_diagnostics(each.output.unit))
                group = tree.children[output].children[DIAGNOSTICS]
                group.dataset = group.to_dataset().merge(noise)
    training, check = mean_repeats(training), None if check is None else mean_repeats(check)
    refuted = refutations(draws, folds, training, check, tree.children)
    for output, reason in refuted.items():
        tree.children[output].attrs[REFUTED] = reason
    believed = [each for each in quantities if each.output.name not in refuted]
    for output, missing in missing_run_predictions(checked, training, believed).items():
        tree.children[output].attrs |= missing
    statistics = {**corrected, **found.fields}
    if reason := contradiction(training, check):
        refuted |= dict.fromkeys(statistics, reason)
    return tree, without_numbers(statistics, refuted)
