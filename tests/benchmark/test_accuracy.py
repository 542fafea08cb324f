"""Errors, slopes and leads on numbers whose answers are known."""

import math

import numpy as np
import pytest

from uqpen.benchmark.record import (
    Accuracy,
    convergence_slope,
    error_ratio,
    find_verdict,
    reference_remark,
    root_mean_square_errors,
    verdict_sentence,
)


def accuracies(logarithms, error=0.1):
    shape = np.shape(logarithms)
    return Accuracy(np.array(logarithms), np.full(shape, error), np.zeros(shape, dtype=bool), 30)


def noisy_parts(found):
    return found.logarithm, found.error, found.is_heavy


class TestAccuracy:
    def test_it_is_the_root_mean_square(self):
        found = root_mean_square_errors(np.array([[3.0, -4.0, 3.0, -4.0], [1.0, 1.0, 1.0, 1.0]]))
        assert found.bounds[:, 0] == pytest.approx([math.sqrt(12.5), 1.0])

    def test_errors_that_are_all_alike_leave_no_noise(self):
        assert root_mean_square_errors(np.full(10, 0.3)).error == 0

    def test_the_jackknife_is_the_textbook_one(self):
        errors = np.random.default_rng(1).normal(size=12)
        without = [0.5 * math.log(np.mean(np.delete(errors, i) ** 2)) for i in range(12)]
        variance = 11 * np.var(without)
        found = root_mean_square_errors(errors).error
        assert found == pytest.approx(math.sqrt(variance), rel=1e-10)

    def test_no_error_at_all_is_minus_infinity_without_bounds(self):
        found = root_mean_square_errors(np.zeros(10))
        assert found.logarithm == -math.inf
        assert np.isnan(found.bounds[1:]).all()

    def test_a_repeat_without_an_estimate_leaves_no_figure(self):
        assert np.isnan(root_mean_square_errors(np.array([1.0, np.nan, 2.0])).bounds).all()

    def test_errors_that_one_repeat_decides_have_no_bounds(self):
        found = root_mean_square_errors(np.array([1e-9] * 29 + [1.0]))
        assert found.is_heavy
        assert np.isnan(found.bounds[1:]).all()

    def test_errors_of_any_size_are_reported(self):
        errors = np.random.default_rng(2).normal(size=30)
        for size in (1e-150, 1e100):
            assert root_mean_square_errors(size * errors).error == pytest.approx(
                root_mean_square_errors(errors).error
            )
            assert not root_mean_square_errors(size * errors).is_heavy

    def test_bounds_cover_on_normal_errors(self):
        # Of 2 000 samples of 30, 94 % were held when it was measured with 6 000; ± 1.6 is three
        # standard errors.
        drawn = np.random.default_rng(3).normal(size=(2000, 30))
        bounds = root_mean_square_errors(drawn).bounds
        held = (bounds[:, 1] <= 1) & (bounds[:, 2] >= 1)
        assert held[~np.isnan(bounds[:, 1])].mean() == pytest.approx(0.94, abs=0.016)


class TestSlope:
    RUNS = np.array([128.0, 256.0, 1024.0])

    def test_a_straight_line_is_found(self):
        logarithm = 2 - 0.5 * np.log(self.RUNS)
        found = convergence_slope(logarithm, np.zeros(3), self.RUNS, 30)
        assert found == pytest.approx([-0.5, -0.5, -0.5])

    def test_noise_widens_it_as_least_squares_has_it(self):
        found = convergence_slope(-np.log(self.RUNS), np.full(3, 0.2), self.RUNS, 30)
        distance = np.log(self.RUNS) - np.log(self.RUNS).mean()
        # 2.0452 is the 97.5 % quantile of Student's t with 29 degrees of freedom.
        half = 2.0452 * 0.2 / math.sqrt(distance @ distance)
        assert found == pytest.approx([-1, -1 - half, -1 + half], rel=1e-4)

    def test_one_budget_has_none(self):
        one = (np.array([1.0]), np.array([0.1]), np.array([128.0]))
        assert np.isnan(convergence_slope(*one, 30)).all()

    def test_an_exact_method_has_none(self):
        exact = np.full(3, -math.inf)
        assert np.isnan(convergence_slope(exact, np.full(3, np.nan), self.RUNS, 30)).all()


class TestLead:
    def test_its_factor_and_interval(self):
        found = error_ratio((0.0, 0.1), (math.log(2), 0.1), 30)
        # Welch's degrees of freedom are 58 for equal variances: t = 2.0017.
        step = 2.0017 * math.sqrt(0.02)
        assert found.factor == pytest.approx(2)
        assert found.lower == pytest.approx(2 * math.exp(-step), rel=1e-4)
        assert found.upper == pytest.approx(2 * math.exp(step), rel=1e-4)
        assert found.is_significant

    def test_a_small_one_is_noise(self):
        assert not error_ratio((0.0, 0.1), (0.1, 0.1), 30).is_significant

    def test_an_exact_method_leads_without_end(self):
        assert error_ratio((-math.inf, math.nan), (0.0, 0.1), 30).is_significant
        assert not error_ratio((-math.inf, math.nan), (-math.inf, math.nan), 30).is_significant

    def test_of_methods_that_are_alike_one_in_twenty_leads(self):
        drawn = root_mean_square_errors(np.random.default_rng(4).normal(size=(2, 1000, 30)))
        pairs = np.stack([drawn.logarithm, drawn.error], axis=-1).transpose(1, 0, 2).tolist()
        decided = sum(error_ratio(*map(tuple, sorted(pair)), 30).is_significant for pair in pairs)
        # 5 % with a standard error of 0.7 %.
        assert decided / 1000 == pytest.approx(0.05, abs=0.021)


class TestVerdict:
    NAMES = ("a", "b", "c")

    def test_the_least_error_wins(self):
        found = find_verdict(self.NAMES, accuracies([0.0, -1.0, 1.0]))
        assert found is not None
        assert (found.winner, found.runner_up, found.level) == ("b", "a", ("b",))
        assert found.lead.factor == pytest.approx(math.e)
        reported = "at 1\u202f024 runs b leads a by a factor of 2.7 (2.0 … 3.6)"
        assert verdict_sentence(found, 1024) == reported

    def test_ties_are_named(self):
        found = find_verdict(self.NAMES, accuracies([0.0, -0.1, 1.0]))
        assert verdict_sentence(found, 128) == "at 128 runs b and a are level"

    def test_few_repeats_that_decide_leave_a_doubt(self):
        known = accuracies([0.0, -1.0, 1.0])
        heavy = Accuracy(known.logarithm, known.error, np.array([False, True, False]), 30)
        found = find_verdict(self.NAMES, heavy)
        assert found is not None
        assert found.doubt
        assert verdict_sentence(found, 128) == (
            "at 128 runs b is ahead of a by a factor of 2.7, but few of the repeats decide that"
        )

    def test_who_is_far_behind_by_few_repeats_is_not_level(self):
        is_heavy = np.array([False, False, True])
        noisy = Accuracy(np.array([0.0, 0.1, 4.0]), np.array([0.1, 0.1, 3.0]), is_heavy, 30)
        found = find_verdict(self.NAMES, noisy)
        assert found is not None
        assert found.level == ("a", "b")
        alone = find_verdict(self.NAMES[1:], Accuracy(*(x[1:] for x in noisy_parts(noisy)), 30))
        assert alone is not None
        assert alone.doubt
        assert alone.level == ("b",)

    def test_so_does_a_reference_that_is_no_better(self):
        found = find_verdict(self.NAMES, accuracies([0.0, -1.0, 1.0]), resolution=0.5)
        assert found is not None
        assert found.winner == "b"
        assert np.isnan(found.lead.lower)
        assert verdict_sentence(found, 128).endswith(
            "its errors are no larger than the reference's own"
        )
        better = find_verdict(self.NAMES, accuracies([0.0, -1.0, 1.0]), resolution=0.3)
        assert better is not None
        assert (better.level, better.doubt) == (("b",), "")

    def test_who_has_no_figure_is_passed_over(self):
        found = find_verdict(self.NAMES, accuracies([0.0, math.nan, 1.0]))
        assert found is not None
        assert (found.winner, found.runner_up) == ("a", "c")
        assert find_verdict(self.NAMES, accuracies([0.0, math.nan, math.nan])) is None
        assert verdict_sentence(None, 128) == "at 128 runs no two methods have figures to compare"

    def test_who_alone_is_exact_is_reported(self):
        found = find_verdict(self.NAMES, accuracies([0.0, -math.inf, 1.0]))
        assert verdict_sentence(found, 128) == "at 128 runs b alone is exact"

    @pytest.mark.parametrize(
        ("half_width", "reported"),
        [(0.1, ""), (0.6, "take a larger"), (2.0, "no larger than"), (math.nan, "no interval")],
    )
    def test_a_reference_that_is_not_far_better_is_reported(self, half_width, reported):
        assert reported in reference_remark(1.0, half_width)
        assert bool(reference_remark(1.0, half_width)) == bool(reported)
