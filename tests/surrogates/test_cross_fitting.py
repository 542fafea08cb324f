"""Cross-fitting: no fit has seen the fold that it predicts."""

import numpy as np
import pytest

from uqpen.core.labels import REPLICATE, RUN, SAMPLING
from uqpen.core.streams import Stream
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quadrature import Quadrature
from uqpen.execution import Evaluator, evaluate
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos
from uqpen.surrogates.fitting import FOLDS, cross_fit

STREAM = Stream(1, "surrogates", "pce")
PCE = PolynomialChaos(design="training", order=2)


@pytest.fixture
def study(study_of):
    return study_of("a + a * b ** 2", a=(0, 1), b=(0, 1))


def made(study, design):
    points = next(design.rounds(study.joint, Stream(1, "design")))
    runs = evaluate(Evaluator(study.models[""].model), points, {})
    return runs.assign_attrs({SAMPLING: str(design.sampling)})


def folds(study, runs):
    return cross_fit(PCE, "pce", runs, study.models[""].model, study.joint, STREAM)


def test_a_fit_depends_on_no_run_of_its_fold(study):
    runs = made(study, MonteCarlo(runs=40))
    before = folds(study, runs)
    values = runs["y"].values.copy()
    values[before.fold == 0] += 5
    after = folds(study, runs.assign(y=(RUN, values, runs["y"].attrs)))
    assert (before.fold == after.fold).all()
    inputs = {name: runs[name].values for name in ("a", "b")}
    first, again = (each.models[0].predict(inputs)["y"].mean for each in (before, after))
    assert (first == again).all()
    other, changed = (each.models[1].predict(inputs)["y"].mean for each in (before, after))
    assert not np.allclose(other, changed)


def test_folds_share_the_runs_evenly_and_follow_the_stream_alone(study):
    runs = made(study, MonteCarlo(runs=42))
    found = folds(study, runs)
    assert sorted(np.bincount(found.fold)) == [8, 8, 8, 9, 9]
    assert (folds(study, runs).fold == found.fold).all()
    assert [model.training_range("y") for model in found.models] == [
        (float(seen.min()), float(seen.max()))
        for seen in (runs["y"].values[found.fold != fold] for fold in range(FOLDS))
    ]


def test_whole_replicates_are_dealt(study):
    runs = made(study, LatinHypercube(runs=60, replicates=6))
    fold = folds(study, runs).fold
    for replicate in range(6):
        assert np.unique(fold[runs[REPLICATE].values == replicate]).size == 1
    assert np.unique(fold).size == FOLDS


def test_points_that_are_no_sample_have_no_folds(study):
    found = folds(study, made(study, Quadrature(order=3)))
    assert found.models == ()
    assert found.reason == "the training runs are no sample of the input distribution"
    few = folds(study, made(study, MonteCarlo(runs=9)))
    assert few.reason == "9 training runs are too few for 5 folds"


def test_an_output_without_a_fit_in_one_fold_says_why(study_of):
    rare = study_of("np.where(a > np.sort(a)[-2], 1.0, 0.0)", a=(0, 1), b=(0, 1))
    found = folds(rare, made(rare, MonteCarlo(runs=20)))
    reasons = [model.reasons.get("y", "") for model in found.models]
    assert sum("does not vary" in reason for reason in reasons) == 1
