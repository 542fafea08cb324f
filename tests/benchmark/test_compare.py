"""Verdicts on functions of which it is known who wins; and the same bits every time."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from study_text import study_text

import uqpen
from uqpen.benchmark.compare import compare
from uqpen.benchmark.methods import BenchmarkSettings
from uqpen.core.errors import ArchiveError, SettingsError
from uqpen.execution.runs_in_file import runs_in_file

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent

STUDY = study_text(
    {
        "python": "functions.py:FUNCTION",
        "vectorized": True,
        "inputs": dict.fromkeys("abc", "1"),
        "outputs": {"y": "1"},
    },
    seed=3,
    inputs=dict.fromkeys("abc", (0, 1)),
    designs={
        "latin_hypercube": {"kind": "latin-hypercube", "runs": 64, "replicates": 1},
        "sobol_sequence": {"kind": "sobol-sequence", "runs": 64},
    },
)
PCE = """
[surrogates.pce]
kind = "polynomial-chaos"
design = "latin_hypercube"
order = 3
"""


def study(function, more=""):
    return uqpen.parse_study(STUDY.replace("FUNCTION", function) + more, folder=HERE)


@cache
def comparison(function, budgets, more=""):
    # Errors fall below those of so large a reference from some thousand runs only.
    return compare(study(function, more), BenchmarkSettings(budgets, repeats=12, reference=32_768))


def statistic(function, budgets, more="", *, name="mean"):
    """What is said of a statistic of all methods, by what it is."""
    found = comparison(function, budgets, more)["/comparison/y"].to_dataset()
    own = [each for each in found.data_vars if str(each).startswith(f"{name}_")]
    return found[own].rename({each: str(each).removeprefix(f"{name}_") for each in own})


def test_a_comparison_by_way_of_a_file_is_that_in_memory(tmp_path):
    settings = BenchmarkSettings((64,), repeats=10, reference=512)
    with runs_in_file(tmp_path / "runs", runs_in_memory=100) as checkpoint:
        found = compare(study("additive"), settings, checkpoint=checkpoint)
        assert (tmp_path / "runs").exists()
    assert not (tmp_path / "runs").exists()
    assert found.identical(compare(study("additive"), settings))


def test_a_file_that_cannot_be_written_is_named(tmp_path):
    path = tmp_path / "missing" / "runs"
    with (
        pytest.raises(ArchiveError, match=f"^{re.escape(str(path))}: runs cannot be kept: [A-Z]"),
        runs_in_file(path, runs_in_memory=100) as checkpoint,
    ):
        compare(
            study("additive"), BenchmarkSettings((64,), 10, reference=512), checkpoint=checkpoint
        )


class TestWinners:
    """As they were measured with other programs before this one was written."""

    def test_on_an_additive_function_a_broken_sequence_loses(self):
        found = statistic("additive", (128, 1000, 1024))
        assert found["level"].values[0, 1] == "latin_hypercube"
        assert found["lead"].values[0, 1, 1] > 2
        # At powers of two: level, or ahead by errors that few of the scrambles decide.
        for position in (0, 2):
            is_level = " " in found["level"].values[0, position]
            assert is_level or np.isnan(found["lead"].values[0, position, 1])

    def test_on_steps_along_the_axes_a_sequence_wins(self):
        found = statistic("step", (256, 1024))
        assert (found["level"].values[0] == "sobol_sequence").all()
        assert 2 < found["lead"].values[0, 1, 0] < 20

    def test_polynomial_chaos_is_exact_on_polynomials(self):
        for name in ("mean", "std"):
            found = statistic("polynomial", (64,), PCE, name=name)
            assert (found["winner"].values[0] == "pce").all()
        # The reference is not: it cannot say by how much.
        found = statistic("polynomial", (64,), PCE)
        assert "the reference's own" in found["verdict"].values[0, 0]
        sources = comparison("polynomial", (64,), PCE)["statistics"].children
        shown = [sources[name].attrs["kind"] for name in ("pce", "sobol_sequence")]
        assert shown == ["surrogate", "design"]


class TestNumbers:
    TREE = staticmethod(
        cache(
            lambda: compare(study("step"), BenchmarkSettings((64, 100), repeats=10, reference=1024))
        )
    )

    def test_another_method_or_budget_or_repeat_changes_no_estimate(self):
        more = '[designs.halton]\nkind = "halton"\nruns = 64\n'
        many = compare(study("step", more), BenchmarkSettings((32, 64), 11, 1024))
        for method in ("latin_hypercube", "sobol_sequence", "sobol_sequence_replicated"):
            few = self.TREE()[f"/statistics/{method}/y"]["mean"].sel(budget=[64])
            all_estimates = many[f"/statistics/{method}/y"]["mean"].sel(budget=[64])
            xr.testing.assert_identical(few, all_estimates.isel(repeat=slice(10)))

    def test_repeats_differ(self):
        for method in ("latin_hypercube", "sobol_sequence", "sobol_sequence_replicated"):
            found = self.TREE()[f"/statistics/{method}/y"]["mean"]
            assert (np.ptp(found.values, axis=-1) > 0).all()

    def test_runs_and_replicates_are_reported(self):
        found = self.TREE()["/statistics/sobol_sequence_replicated/y"].to_dataset()
        assert found["replicates"].values.tolist() == [16, 20]
        assert found["runs"].values.tolist() == [64, 100]


class TestRefusals:
    def test_a_single_method(self):
        text = STUDY.replace("FUNCTION", "step").partition("[designs.sobol")[0]
        alone = uqpen.parse_study(text, folder=HERE)
        complaint = "designs: found only latin_hypercube that can be scaled .* at least two"
        with pytest.raises(SettingsError, match=complaint):
            compare(alone)
