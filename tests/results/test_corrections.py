"""Estimates of a surrogate that real runs have corrected: in an archive, as a table, as JSON."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.archive.estimates import pack, statistic_names, unpack
from uqpen.archive.structure import find_dataset_faults
from uqpen.core.catalogue import CATALOGUE
from uqpen.results.correction_tables import correction_tables, equivalent_runs_text, is_corrected
from uqpen.results.estimate_json import estimate_json
from uqpen.results.source_statistics import SourceStatistics
from uqpen.study.study import ValidatedStudy

STUDY = """
[designs.training]
kind = "monte-carlo"
runs = 40
[surrogates.pce]
kind = "polynomial-chaos"
design = "training"
"""


@pytest.fixture(scope="module")
def tree(module_study_of: Callable[..., ValidatedStudy]) -> xr.DataTree:
    return uqpen.run(module_study_of("np.exp(a) + b", STUDY, a=(0, 1), b=(0, 1)))


def corrected(tree: xr.DataTree, statistic: str) -> xr.DataArray:
    found = SourceStatistics(tree).get("pce", "y", statistic)
    assert found is not None
    return found


def test_an_archive_keeps_the_figure_of_the_surrogate_and_what_the_interval_is_worth(
    tree: xr.DataTree,
) -> None:
    mean, quantile = corrected(tree, "mean"), corrected(tree, "quantile")
    assert is_corrected(mean)
    assert quantile.coords["surrogate_estimate"].dims == ("probability",)
    again = pack({"mean": mean, "quantile": quantile})
    assert statistic_names(again) == ["mean", "quantile"]
    assert again["quantile_surrogate_estimate"].attrs["units"] == quantile.attrs["units"]
    assert again["mean_equivalent_runs"].attrs["units"] == "1"
    for name, array in (("mean", mean), ("quantile", quantile)):
        found = unpack(again, name)
        assert found is not None
        assert found.equals(array)
    assert not list(find_dataset_faults(again, CATALOGUE))


def test_numbers_beside_an_estimate_have_its_dimensions(tree: xr.DataTree) -> None:
    group = pack({"quantile": corrected(tree, "quantile")})
    group["quantile_equivalent_runs"] = ((), 5.0)
    assert list(find_dataset_faults(group, CATALOGUE)) == [
        "quantile_equivalent_runs is not of a number for each entry of quantile"
    ]


def test_the_table_has_both_figures_and_the_plain_runs(tree: xr.DataTree) -> None:
    (table,) = correction_tables(tree, "pce")
    assert table.title == "pce: y"
    rows = dict(table.rows)
    mean = corrected(tree, "mean")
    assert rows["mean"][0] == table.cell(mean)
    assert float(rows["mean"][1]) == pytest.approx(float(mean.coords["surrogate_estimate"]), 1e-3)
    assert rows["mean"][2] == equivalent_runs_text(mean)
    assert list(rows)[:2] == ["mean", "sd"]


@pytest.mark.parametrize(
    ("runs", "text"), [(14321.7, "14\u202f000"), (96.4, "96"), (3.0, "3"), (np.nan, "")]
)
def test_plain_runs_are_given_in_two_digits(tree: xr.DataTree, runs: float, text: str) -> None:
    mean = corrected(tree, "mean").assign_coords(equivalent_runs=runs)
    assert equivalent_runs_text(mean) == text


def test_json_has_the_numbers_beside_a_corrected_estimate(tree: xr.DataTree) -> None:
    mean = corrected(tree, "mean")
    found = estimate_json(mean)
    assert found["surrogate_estimate"] == float(mean.coords["surrogate_estimate"])
    assert found["equivalent_runs"] == float(mean.coords["equivalent_runs"])
    plain = SourceStatistics(tree).get("training", "y", "mean")
    assert plain is not None
    assert "equivalent_runs" not in estimate_json(plain)
