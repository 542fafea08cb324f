"""A study's surrogate, corrected by its runs, for the tests that share it."""

from __future__ import annotations

import xarray as xr

from uqpen.core.labels import SAMPLING
from uqpen.core.streams import Stream
from uqpen.designs.design import Design
from uqpen.execution import Evaluator, evaluate
from uqpen.statistics.analyze import OutputStatistics
from uqpen.statistics.surrogate.corrected_statistics import correct_statistics, correction_evidence
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.statistics.surrogate.surrogate_statistics import surrogate_statistics
from uqpen.study.study import ValidatedStudy
from uqpen.surrogates.fitting import cross_fit, fit_surrogate
from uqpen.surrogates.surrogate import Surrogate

STREAM = Stream(1, "surrogates", "pce")
NORMAL = "{ normal = { mean = 0, std = 1 } }"


def made(study: ValidatedStudy, design: Design) -> xr.Dataset:
    """Return the runs of a design."""
    points = next(design.rounds(study.joint, Stream(1, "design", str(design))))
    runs = evaluate(Evaluator(study.models[""].model, study.constraints), points, {})
    return runs.assign_attrs({SAMPLING: str(design.sampling)})


def corrected_by(
    study: ValidatedStudy,
    surrogate: Surrogate,
    training: xr.Dataset,
    check: xr.Dataset | None = None,
) -> OutputStatistics:
    """Return the corrected statistics of the output y by a surrogate."""
    model = study.models[""].model
    fitted = fit_surrogate(surrogate, "pce", training, model, study.joint, STREAM)
    folds = cross_fit(surrogate, "pce", training, model, study.joint, STREAM)
    draws = SurrogateDraws(fitted, study.joint, study.constraints, {}, STREAM)
    quantities = study.model_quantities(model)
    evidence = correction_evidence(draws, folds, training, check, quantities)
    found = surrogate_statistics(draws, quantities).outputs
    return correct_statistics(found, evidence, quantities)["y"]
