"""Corrected indices where no term of the surrogate gives them: exact answers of simple models."""

import math
from collections import Counter

import numpy as np
from corrected_surrogates import NORMAL, corrected_by, made

from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.statistics.estimate import Estimate
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos
from uqpen.surrogates.gaussian_process import GaussianProcess

LINEAR = PolynomialChaos(design="training", order=1)


def corrected(study, surrogate=LINEAR):
    """Return the statistics of y by a surrogate, corrected by a hundred runs."""
    return corrected_by(study, surrogate, made(study, MonteCarlo(runs=100)))


def check_index(found, true, width):
    """Check that an index has narrow intervals that hold the true values."""
    _, lower, upper = found.values.reshape(-1, 3).T
    assert (lower <= true).all()
    assert (upper >= true).all()
    assert (upper - lower < width).all()
    assert set(np.ravel(found["interval_label"].values)) == {"conservative"}


def test_of_dependent_inputs_a_first_order_index_includes_correlation(study_of):
    pair = 'pairs = [ { inputs = ["a", "b"], correlation = 0.5 } ]'
    dependence = f'[dependence]\ncopula = "gaussian"\nof = "normal-scores"\n{pair}\n'
    found = corrected(study_of("a + b", dependence, a=NORMAL, b=NORMAL))
    # Var E[y|a] = (1 + r)², and Var y = 2 (1 + r).
    check_index(found["first_order"], [0.75, 0.75], 0.1)
    assert (found["first_order"]["note"] == "includes correlation").all()
    assert np.isnan(found["total_order"].values).all()
    assert (found["total_order"]["note"] == "the random inputs depend on each other").all()


def test_a_discrete_input_may_depend_on_another(study_of):
    pair = 'pairs = [ { inputs = ["a", "b"], correlation = 0.5 } ]'
    dependence = f'[dependence]\ncopula = "gaussian"\nof = "normal-scores"\n{pair}\n'
    coin = "{ discrete = { values = [0, 1], weights = [1, 1] } }"
    found = corrected(study_of("b + 0 * a", dependence, a=coin, b=NORMAL))
    # Given either side of the coin, b has the mean ± 0.5 √(2/π).
    check_index(found["first_order"], [0.25 * 2 / math.pi, 1.0], 0.1)


def test_inadmissible_draws_leave_indices_given_admissible(study_of):
    keep = '[constraints]\nkeep = ["a + b < 1"]'
    found = corrected(study_of("a + b", keep, a=(0, 1), b=(0, 1)))
    # Of a density 2 on the triangle: Var y = 1/18, Var E[y|a] = 1/72, E Var(y|b) = 1/24.
    check_index(found["first_order"], [1 / 4, 1 / 4], 0.1)
    check_index(found["total_order"], [3 / 4, 3 / 4], 0.1)
    assert "conditional on admissible inputs" in found["first_order"].attrs["estimand"]


def test_of_a_logarithm_both_sets_of_indices_have_intervals(study_of):
    study = study_of("np.exp((a + b) / 2)", a=(0, 1), b=(0, 1))
    found = corrected(study, PolynomialChaos(design="t", order=1, transform={"y": "log"}))
    for order in ("log_first_order", "log_total_order"):
        check_index(found[order], [0.5, 0.5], 0.1)
    mean, square = 2 * (math.sqrt(math.e) - 1), math.e - 1
    of_one, of_both = square - mean**2, square**2 - mean**4
    check_index(found["first_order"], [of_one * mean**2 / of_both] * 2, 0.1)
    check_index(found["total_order"], [of_one * square / of_both] * 2, 0.1)


def test_an_event_has_indices_that_allow_for_disagreements_not_met(study_of):
    found = corrected(study_of("a + b", "[outputs.y]\nexceeds = [1, 1.9]", a=(0, 1), b=(0, 1)))
    first, total = (found[f"exceedance_{order}_order"] for order in ("first", "total"))
    # Given a, the event has the probability a; not one of the runs is on the wrong side.
    check_index(first.isel(threshold=[0]), [1 / 3, 1 / 3], 0.5)
    check_index(total.isel(threshold=[0]), [2 / 3, 2 / 3], 0.5)
    assert float((first[0, :, 2] - first[0, :, 1]).min()) > 0.1
    assert (first["note"][1] == "fewer than ten runs lie on one side").all()


def test_the_work_for_thresholds_grows_with_their_number(study_of, monkeypatch):
    estimates, made_ones = Counter[int](), Estimate.without_bounds

    def counted(value, *reasons):
        estimates[len(limits)] += 1
        return made_ones(value, *reasons)

    monkeypatch.setattr(Estimate, "without_bounds", counted)
    for number in (3, 6):
        limits = np.linspace(0.5, 1.5, number).round(3).tolist()
        corrected(study_of("a + b", f"[outputs.y]\nexceeds = {limits}", a=(0, 1), b=(0, 1)))
    # Each has two indices of two inputs.
    assert estimates[6] - estimates[3] <= 3 * 2 * 2 * 3


def test_a_surrogate_without_terms_has_intervals_of_indices(study_of):
    study = study_of("a + b", a=(0, 1), b=(0, 1))
    process = GaussianProcess(design="training")
    found = corrected_by(study, process, made(study, MonteCarlo(runs=30)))
    check_index(found["first_order"], [0.5, 0.5], 0.15)
    check_index(found["total_order"], [0.5, 0.5], 0.15)


def test_a_useless_surrogate_claims_nothing_of_an_index(study_of):
    keep = '[constraints]\nkeep = ["a + b < 1.8"]'
    found = corrected(study_of("np.sign(np.sin(31 * a))", keep, a=(0, 1), b=(0, 1)))
    lower, upper = found["first_order"].values[0, 1:]
    assert lower < 0.05
    assert upper > 0.9
