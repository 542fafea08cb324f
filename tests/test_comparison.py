"""The comparison: each figure from all sources, beside the runs that each took."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.archive.read import open_archive
from uqpen.archive.write import write
from uqpen.study.study import Study

pytestmark = pytest.mark.processor

MakeStudy = Callable[..., Study]

DESIGNS = """
[outputs.y]
exceeds = [0.5, 1.5]
[designs.mc]
kind = "monte-carlo"
runs = 400
[designs.blocks]
kind = "saltelli"
base = 256
[designs.steps]
kind = "one-at-a-time"
[surrogates.pce]
kind = "polynomial-chaos"
design = "mc"
"""


@pytest.fixture
def tree(study_of: MakeStudy) -> xr.DataTree:
    return uqpen.run(study_of("a + b**2", DESIGNS, a=(0, 1), b=(0, 1)))


def test_each_source_stands_with_its_runs(tree: xr.DataTree) -> None:
    comparison = tree["comparison"]
    assert comparison["source"].values.tolist() == ["mc", "blocks", "steps", "pce"]
    assert comparison["source_kind"].values.tolist() == ["design"] * 3 + ["surrogate"]
    # The surrogate takes the runs that it is fitted to and those that check it.
    assert comparison["runs_spent"].values.tolist() == [400, 1024, 5, 1424]


def test_the_figures_are_those_of_the_groups(tree: xr.DataTree) -> None:
    comparison = tree["comparison"].to_dataset()
    for source in ("mc", "blocks", "pce"):
        at = comparison.sel(source=source)
        own = tree[f"moments/{source}"]["y_mean"]
        np.testing.assert_array_equal(at["y_mean"].values, own.values)
        assert str(at["y_mean_interval_label"].values) == own.attrs["interval_label"]
        own = tree[f"exceedance/{source}"]["y"]
        np.testing.assert_array_equal(at["y_exceedance"].values, own.values)
        labels = at["y_exceedance_interval_label"].values.tolist()
        assert labels == own["y_threshold_interval_label"].values.tolist()


def test_what_a_source_does_not_tell_is_not_a_number_and_says_so(tree: xr.DataTree) -> None:
    at = tree["comparison"].to_dataset().sel(source="steps")
    assert np.isnan(at["y_mean"].values).all()
    assert str(at["y_mean_note"].values) == "this source does not tell it"
    assert np.isfinite(at["y_response"].sel(bound="estimate")).all()


def test_it_reads_back_from_an_archive(tree: xr.DataTree, tmp_path: Path) -> None:
    write(tree, tmp_path / "all.nc")
    read = open_archive(tmp_path / "all.nc")["comparison"].to_dataset()
    xr.testing.assert_equal(read["y_quantile"], tree["comparison"].to_dataset()["y_quantile"])


def test_a_source_that_tells_of_more_inputs_stands_beside_one_that_tells_of_fewer(
    study_of: MakeStudy,
) -> None:
    text = """
    [designs.mc]
    kind = "monte-carlo"
    runs = 200
    [designs.steps]
    kind = "one-at-a-time"
    fixed = true
    """
    tree = uqpen.run(study_of("a + b * c", text, a=(1, 2), b=(1, 2), c=3.0))
    comparison = tree["comparison"].to_dataset()
    assert comparison["input"].values.tolist() == ["a", "b", "c"]
    responses = comparison["y_response"].sel(source="steps", bound="estimate")
    assert np.isfinite(responses).all()
    first = comparison["y_first_order"].sel(source="mc", bound="estimate")
    assert np.isfinite(first).values.tolist() == [True, True, False]
