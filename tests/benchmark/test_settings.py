"""The terms of a comparison, and what becomes of designs on them."""

import numpy as np
import pytest
from study_text import study_text

import uqpen
from uqpen.benchmark.methods import BUDGETS, BenchmarkSettings, study_methods
from uqpen.core.errors import SettingsError
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import points_in_memory
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quasi_monte_carlo import Halton, SobolSequence
from uqpen.designs.replicated import split_replicates
from uqpen.designs.saltelli import Saltelli

STUDY = study_text(
    "ishigami",
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": (-3, 3)},
    designs={
        "training": {"kind": "latin-hypercube", "runs": 100, "replicates": 1},
        "monte_carlo": {"kind": "monte-carlo", "runs": 50},
        "latin_hypercube": {"kind": "latin-hypercube", "runs": 100},
    },
    surrogates={"pce": {"kind": "polynomial-chaos", "design": "training", "check": "monte_carlo"}},
)
LAW = uqpen.parse_study(STUDY).joint


class TestTerms:
    def test_budgets_are_taken_once_and_in_order(self):
        assert BenchmarkSettings((256, 128, 256)).budgets == (128, 256)
        assert BenchmarkSettings().budgets == BUDGETS

    @pytest.mark.parametrize(
        ("terms", "complaint"),
        [
            ({"budgets": (128, 0)}, "budget: found 0; expected whole numbers of runs from 8"),
            ({"budgets": (1.5,)}, "budget: found 1.5"),
            ({"budgets": ()}, "budget: found none"),
            ({"repeats": 9}, "repeats: found 9; expected a whole number, at least 10"),
            ({"reference": 31}, "reference: found 31; expected a whole number, at least 32"),
        ],
    )
    def test_what_is_out_of_range_is_reported(self, terms, complaint):
        with pytest.raises(SettingsError, match=complaint):
            BenchmarkSettings(**terms)

    def test_the_reference_is_balanced_and_at_least_as_large_as_asked(self):
        assert BenchmarkSettings((128,)).reference_design(vectorized=True) == (1_048_576, 16)
        assert BenchmarkSettings((128,)).reference_design(vectorized=False) == (2048, 16)
        assert BenchmarkSettings((128,), reference=5000).reference_design(vectorized=True) == (
            8192,
            16,
        )


@pytest.mark.parametrize(
    ("runs", "wanted", "shape"),
    [
        (1024, 10, (1024, 8)),
        (1000, 16, (1000, 20)),
        (1000, 10, (1000, 10)),
        (127, 16, (112, 16)),
        (20, 16, (20, 10)),
        (3, 2, None),
        (100, 1, None),
    ],
)
def test_runs_are_split_into_about_so_many_replicates(runs, wanted, shape):
    assert split_replicates(runs, wanted, replicated=True) == shape


class TestScaled:
    @pytest.mark.parametrize(
        "design", [MonteCarlo(50), LatinHypercube(100), SobolSequence(256), Halton(160)]
    )
    @pytest.mark.parametrize("runs", [128, 1000])
    def test_a_budget_is_spent_whole(self, design, runs):
        for replicated in (False, True):
            scaled = design.scaled(LAW, runs, replicated=replicated)
            if scaled is not None:
                points = points_in_memory(next(scaled.rounds(LAW, Stream(1))))
                assert points.sizes["run"] == scaled.run_count(LAW) == runs

    def test_independent_points_have_no_replicates(self):
        assert MonteCarlo(50).scaled(LAW, 100, replicated=True) is None

    def test_a_sequence_cut_short_is_its_beginning(self):
        whole, cut = (
            points_in_memory(next(design.rounds(LAW, Stream(1))))["x1"].values
            for runs in (1024, 1000)
            if (design := SobolSequence(256).scaled(LAW, runs, replicated=False))
        )
        np.testing.assert_array_equal(whole[:1000], cut)

    def test_settings_stay(self):
        design = LatinHypercube(100, optimization="random-cd")
        assert design.scaled(LAW, 64, replicated=False) == LatinHypercube(64, 1, "random-cd")

    def test_blocks_take_what_they_can(self):
        # A block takes five runs; 128 of them hold two sets of eight blocks.
        assert Saltelli(64).scaled(LAW, 128, replicated=False) == Saltelli(16, replicates=2)
        assert Saltelli(64).scaled(LAW, 128, replicated=True) is None


class TestMethods:
    METHODS = study_methods(uqpen.parse_study(STUDY), (120, 4096))

    def test_a_design_that_is_like_another_is_not_tried_twice(self):
        assert [method.name for method in self.METHODS] == [
            "latin_hypercube",
            "latin_hypercube replicated",
            "monte_carlo",
            "pce",
        ]

    def test_a_surrogate_is_charged_its_check_and_keeps_to_few_runs(self):
        pce = self.METHODS[-1]
        # 100 for training and 50 to check: two thirds of the budget are for training.
        assert pce.cost(120) == (120, 1)
        assert pce._scaled(120) == LatinHypercube(80, 1)  # type: ignore[attr-defined]
        assert pce.cost(4096).runs == 0

    def test_a_check_that_is_larger_than_the_training_is_not_made_so_large(self):
        large = STUDY.replace("runs = 50", "runs = 10_000")
        pce = study_methods(uqpen.parse_study(large), (120,))[-1]
        assert pce._scaled(120) == LatinHypercube(100, 1)  # type: ignore[attr-defined]
