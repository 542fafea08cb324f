"""Integration rules: exact where they should be, and honest where nodes were lost."""

import math

import numpy as np
import pytest
from designed_runs import estimates_of, law_of, points
from study_text import study_text

from uqpen.archive.estimates import interval_text
from uqpen.core.errors import StudyError
from uqpen.core.model import Bounds
from uqpen.designs.one_at_a_time import Morris
from uqpen.designs.quadrature import FullFactorial, Quadrature
from uqpen.distributions.orthogonal_polynomials import recurrence
from uqpen.distributions.univariate import (
    Beta,
    Gamma,
    Gumbel,
    Lognormal,
    Normal,
    Triangular,
    Truncated,
    Uniform,
    Weibull,
)
from uqpen.study.load import parse_study

# Sums of some hundred rounded products.
ROUNDING = 1e-12

LAWS = [
    Normal(2.0, 0.5),
    Uniform(-1.0, 3.0),
    Lognormal(2.0, 0.5),
    Triangular(-1.0, 0.5, 3.0),
    Beta(2.0, 3.5, -1.0, 3.0),
    Gamma(2.0, 0.5),
    Weibull(1.7, 2.0),
    Gumbel(2.0, 0.5),
    Truncated(Normal(0.0, 1.0), -0.5, 2.0),
]


def value(found, statistic):
    return float(found[statistic].sel(bound="estimate"))


def note(found, statistic):
    return interval_text(found[statistic], "note")


GRIDS = ["tensor", "sparse"]


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("distribution", LAWS, ids=str)
def test_mean_and_std_of_an_input_are_its_laws(distribution, grid):
    found = estimates_of(Quadrature(2, grid), law_of(distribution), lambda x1: x1)
    exact = recurrence(distribution, 1)
    assert value(found, "mean") == pytest.approx(exact.mean, rel=ROUNDING)
    assert value(found, "std") == pytest.approx(exact.std, rel=ROUNDING)
    assert note(found, "mean") == "a quadrature rule has no scatter, so its error is unknown"
    assert np.isnan(found["mean"].values[1:]).all()


def test_skewness_and_kurtosis_are_the_laws():
    found = estimates_of(Quadrature(2), law_of(Gamma(2.0, 0.5)), lambda x1: x1)
    assert value(found, "skewness") == pytest.approx(2 / math.sqrt(16), rel=ROUNDING)
    assert value(found, "kurtosis") == pytest.approx(3 + 6 / 16, rel=ROUNDING)


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize(("order", "degree"), [(1, 3), (3, 7)])
def test_polynomials_up_to_its_degree_are_exact(grid, order, degree):
    drawn = points(Quadrature(order, grid), law_of(*[Uniform(0.0, 1.0)] * 3))
    weights = drawn["quadrature_weight"].values
    assert weights.sum() == pytest.approx(1.0, abs=ROUNDING)
    for powers in np.ndindex(*[degree + 1] * 3):
        if sum(powers) <= degree:
            product = np.prod(
                [drawn[f"x{i}"].values ** power for i, power in enumerate(powers, 1)], axis=0
            )
            exact = math.prod(1 / (power + 1) for power in powers)
            assert product @ weights == pytest.approx(exact, abs=ROUNDING)


def test_the_order_of_a_rule_is_where_it_ends():
    drawn = points(Quadrature(1), law_of(Uniform(0.0, 1.0)))
    assert drawn["x1"].values ** 4 @ drawn["quadrature_weight"].values != pytest.approx(0.2)


def test_a_sparse_grid_has_far_fewer_nodes_and_says_how_many():
    joint = law_of(*[Normal(0.0, 1.0)] * 6)
    tensor, sparse = Quadrature(3), Quadrature(3, "sparse")
    assert tensor.run_count(joint) == 4**6
    assert sparse.run_count(joint) == points(sparse, joint).sizes["run"] < 600
    assert (points(sparse, joint)["quadrature_weight"] < 0).any()
    # No node stands twice.
    nodes = np.stack([points(sparse, joint)[f"x{i}"].values for i in range(1, 7)], axis=1)
    assert len(np.unique(np.round(nodes, 9), axis=0)) == len(nodes)


def test_a_full_factorial_takes_every_combination_of_medians():
    joint = law_of(Uniform(0.0, 1.0), Uniform(0.0, 10.0))
    drawn = points(FullFactorial(2), joint)
    pairs = list(zip(drawn["x1"].values.tolist(), drawn["x2"].values.tolist(), strict=True))
    assert pairs == [(0.25, 2.5), (0.25, 7.5), (0.75, 2.5), (0.75, 7.5)]
    assert drawn["quadrature_weight"].values.tolist() == [0.25] * 4


@pytest.mark.parametrize("design", [Quadrature(3), Quadrature(3, "sparse"), FullFactorial(5)])
class TestLosses:
    LAW = law_of(Uniform(-1.0, 1.0), Uniform(-1.0, 1.0), bounds=Bounds(lower=-0.75))

    def lossy(self, design, worst):
        joint = law_of(Uniform(-1.0, 1.0), Uniform(-1.0, 1.0))
        return estimates_of(
            design, joint, lambda x1, x2: worst(x1) if x1 > 0.7 else 5.0 + x2, vectorized=False
        )

    def counted(self, found, design, joint):
        counts = found["mean"].attrs
        lost = counts["runs"] - counts["runs_used"]
        assert 0 < lost < counts["runs"] == design.run_count(joint)
        for statistic in ("mean", "std", "skewness", "kurtosis"):
            assert f"{lost} of {design.run_count(joint)} nodes" in note(found, statistic)
            assert "biased" in note(found, statistic)

    def test_a_run_that_is_not_finite_is_reported(self, design):
        found = self.lossy(design, lambda x: math.nan)
        self.counted(found, design, self.LAW)
        counts = found["mean"].attrs
        assert counts["runs_not_finite"] == counts["runs"] - counts["runs_used"]
        assert value(found, "mean") == pytest.approx(5.0, abs=ROUNDING)

    def test_an_exception_is_reported(self, design):
        found = self.lossy(design, lambda x: 1 // 0)
        self.counted(found, design, self.LAW)
        assert value(found, "mean") == pytest.approx(5.0, abs=ROUNDING)

    def test_an_inadmissible_node_is_reported(self, design):
        found = estimates_of(design, self.LAW, lambda x1, x2: 5.0 + x1 * x2)
        self.counted(found, design, self.LAW)
        assert found["mean"].attrs["conditional_on"] == "admissible inputs"
        assert math.isfinite(value(found, "mean"))

    def test_with_no_run_left_there_is_no_figure(self, design):
        found = estimates_of(design, self.LAW, lambda x1, x2: x1 * math.nan)
        for statistic in ("mean", "std", "skewness", "kurtosis"):
            assert math.isnan(value(found, statistic))
            assert "no run completed" in note(found, statistic)

    def test_a_constant_does_not_vary(self, design):
        found = estimates_of(design, law_of(Uniform(-1.0, 1.0)), lambda x1: 0 * x1 + 0.1)
        assert value(found, "mean") == 0.1
        assert value(found, "std") == 0.0
        assert math.isnan(value(found, "skewness"))
        assert note(found, "skewness") == "the output does not vary"


def test_a_variance_below_zero_is_none():
    # A spike at the middle, whose weight on this sparse grid is negative.
    found = estimates_of(
        Quadrature(2, "sparse"),
        law_of(*[Normal(0.0, 1.0)] * 4),
        lambda x1, x2, x3, x4: np.where(np.abs(x1) + x2**2 + x3**2 + x4**2 < 1e-9, 1.0, 0.0),
    )
    drawn = points(Quadrature(2, "sparse"), law_of(*[Normal(0.0, 1.0)] * 4))
    middle = np.abs(drawn["x1"]) + drawn["x2"] ** 2 + drawn["x3"] ** 2 + drawn["x4"] ** 2 < 1e-9
    weight = float(drawn["quadrature_weight"][middle].item())
    assert weight * (1 - weight) <= 0
    assert math.isnan(value(found, "std"))
    assert "an impossible variance" in note(found, "std")


class TestMistakes:
    TEXT = study_text(
        "ishigami", inputs={"x1": (-1, 1), "x2": (-1, 1), "x3": (-1, 1)}, designs={"mine": {}}
    )

    @pytest.mark.parametrize(
        ("keys", "complaint"),
        [
            ('kind = "quadrature"\norder = 0', "at least 1"),
            ('kind = "quadrature"\norder = 101', "at most 100"),
            ('kind = "quadrature"\norder = 3\ngrid = "full"', 'one of "tensor", "sparse"'),
            ('kind = "quadrature"\norder = 99\ngrid = "tensor"', ""),
            ('kind = "full-factorial"\nlevels = 1', "at least 2"),
            ('kind = "full-factorial"\nlevels = 1000', "1e+09 runs"),
            ('kind = "morris"\ntrajectories = 10\nlevels = 5', "an even number"),
            ('kind = "one-at-a-time"\nstep = 1', "above 0 and below 1"),
        ],
    )
    def test_a_design_that_cannot_be_is_refused(self, keys, complaint):
        if not complaint:
            assert parse_study(self.TEXT + keys).runs == 100**3
            return
        with pytest.raises(StudyError) as caught:
            parse_study(self.TEXT + keys)
        assert complaint in str(caught.value)

    def test_a_grid_over_many_inputs_is_refused_before_it_is_made(self):
        joint = law_of(*[Normal(0.0, 1.0)] * 40)
        sparse = Quadrature(20, "sparse"), Quadrature(8, "sparse", "leja")
        for design in (Quadrature(5), *sparse, FullFactorial(3)):
            (problem,) = design.check_inputs(joint)
            assert "40 random inputs" in problem.found
            assert "10_000_000" in problem.expected

    def test_more_nodes_than_a_law_has_polynomials_are_refused(self):
        joint = law_of(Lognormal(1.0, 10.0))
        (problem,) = Quadrature(90).check_inputs(joint)
        assert "x1 has no polynomials" in problem.found


def test_gausss_rules_are_for_independent_inputs_and_a_grid_of_probabilities_is_not():
    assert Quadrature(2).assumes_independence
    assert Morris(2).assumes_independence
    assert not FullFactorial(2).assumes_independence
