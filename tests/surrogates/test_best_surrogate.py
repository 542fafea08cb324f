"""The kind of surrogate that best predicts runs left out: the race, the fits, the archive."""

import numpy as np
import pytest

import uqpen
from uqpen.results.surrogate_tables import fit_diagnostics
from uqpen.surrogates.archived_surrogate import restore_surrogate
from uqpen.surrogates.best_surrogate import BestSurrogate, FixedChoice, ModelRace

STUDY = """
[designs.training]
kind = "latin-hypercube"
runs = 40
[surrogates.chosen]
kind = "best"
design = "training"
"""


class TestRace:
    """Errors at the same runs, and how far the least of them is ahead."""

    values = np.array([0.0, 1.0, 2.0, 3.0])  # of variance 5/4

    def test_the_least_mean_square_error_wins(self):
        near, far = self.values + 0.1, self.values + np.array([0.5, -0.5, 0.5, -0.3])
        race = ModelRace.of_predictions(self.values, {"far": far, "near": near})
        assert race.winner == "near"
        assert list(race.q2) == ["near", "far"]
        assert race.q2["near"] == pytest.approx(1 - 0.01 / 1.25)
        more = (np.array([0.25, 0.25, 0.25, 0.09]) - 0.01) / 1.25
        assert race.lead == pytest.approx(more.mean())
        assert race.lead_error == pytest.approx(more.std(ddof=1) / 2)
        assert race.is_decided
        assert race.text.endswith("is beyond the noise")

    def test_a_lead_that_one_run_decides_is_noise(self):
        one, other = self.values.copy(), self.values + 0.1
        one[0] += 0.15
        race = ModelRace.of_predictions(self.values, {"one": one, "other": other})
        assert not race.is_decided
        assert race.text.endswith("is within the noise")

    def test_a_single_candidate_has_no_lead(self):
        race = ModelRace.of_predictions(self.values, {"alone": self.values})
        assert np.isnan([race.lead, race.lead_error]).all()
        assert (
            race.text
            == "alone predicts the runs left out (Q² > 0.99999); no other kind could be fitted"
        )

    def test_diagnostics_have_all_of_it(self):
        far = self.values + 0.2
        race = ModelRace.of_predictions(self.values, {"a-b": self.values + 0.1, "c": far})
        values = {each.name: each.value for each in race.diagnostics()}
        assert ModelRace.from_diagnostics("a-b", values) == race


@pytest.fixture(scope="module")
def tree(module_study_of):
    return uqpen.run(module_study_of("a**2.5 / b**1.5", STUDY, a=(1, 5), b=(1, 5)))


def test_a_product_of_powers_is_fitted_by_its_logarithm(tree):
    made = tree["surrogates/chosen"]
    assert made["y"].attrs["chosen_kind"] == "polynomial-chaos-log"
    reported = fit_diagnostics(made, "y")
    assert float(reported["race_q2_polynomial_chaos_log"]) > 0.999
    assert float(reported["race_lead"]) > 0
    assert "polynomial-chaos-log predicts the runs left out" in made["y"].attrs["fit"]
    # The estimates are those of any surrogate: corrected by its runs.
    mean = tree["statistics/chosen/y"]["mean"]
    exact = (5**3.5 - 1) / 3.5 / 4 * (1 - 5**-0.5) / 0.5 / 4
    assert mean[1] < exact < mean[2]


def test_refits_keep_the_kind_that_was_chosen(tree):
    fitted = restore_surrogate(tree["surrogates/chosen"], "chosen")
    again = BestSurrogate("training").for_refits(fitted)
    assert isinstance(again, FixedChoice)
    assert dict(again.choice) == {"y": tree["surrogates/chosen/y"].attrs["chosen_kind"]}


def test_a_rule_is_no_sample_to_leave_out_runs_of(study_of):
    text = STUDY.replace('"latin-hypercube"\nruns = 40', '"quadrature"\norder = 4')
    tree = uqpen.run(study_of("a + b", text, a=(0, 1), b=(0, 1)))
    reason = tree["surrogates/chosen/y"].attrs["not_fitted"]
    assert reason == "the training runs are no sample of the input distribution"
