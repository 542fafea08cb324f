"""Estimates of a surrogate that real runs have corrected, and its predictions of failed runs."""

import numpy as np
import pytest

import uqpen
from uqpen.archive.estimates import pack, statistic_names, unpack
from uqpen.archive.read import open_archive
from uqpen.archive.structure import find_dataset_faults
from uqpen.archive.write import write
from uqpen.core.catalogue import CATALOGUE
from uqpen.results.json import archive_json
from uqpen.results.source_statistics import SourceStatistics
from uqpen.results.surrogate_tables import (
    correction_tables,
    equivalent_runs_text,
    is_corrected,
    missing_run_tables,
)
from uqpen.results.table import estimate_json

STUDY = """
[designs.training]
kind = "monte-carlo"
runs = 40
[surrogates.pce]
kind = "polynomial-chaos"
design = "training"
"""


@pytest.fixture(scope="module")
def tree(module_study_of):
    return uqpen.run(module_study_of("np.exp(a) + b", STUDY, a=(0, 1), b=(0, 1)))


def corrected(tree, statistic):
    found = SourceStatistics(tree).get("pce", "y", statistic)
    assert found is not None
    return found


def test_an_archive_keeps_the_figure_of_the_surrogate_and_what_the_interval_is_worth(tree):
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


def test_numbers_beside_an_estimate_have_its_dimensions(tree):
    group = pack({"quantile": corrected(tree, "quantile")})
    group["quantile_equivalent_runs"] = ((), 5.0)
    assert list(find_dataset_faults(group, CATALOGUE)) == [
        "quantile_equivalent_runs is not of a number for each entry of quantile"
    ]


def test_the_table_has_both_figures_and_the_plain_runs(tree):
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
def test_plain_runs_are_given_in_two_digits(tree, runs, text):
    mean = corrected(tree, "mean").assign_coords(equivalent_runs=runs)
    assert equivalent_runs_text(mean) == text


def test_json_has_the_numbers_beside_a_corrected_estimate(tree):
    mean = corrected(tree, "mean")
    found = estimate_json(mean)
    assert found["surrogate_estimate"] == float(mean.coords["surrogate_estimate"])
    assert found["equivalent_runs"] == float(mean.coords["equivalent_runs"])
    plain = SourceStatistics(tree).get("training", "y", "mean")
    assert plain is not None
    assert "equivalent_runs" not in estimate_json(plain)


# What a surrogate predicts at the inputs of failed runs


def corner(a, b):
    if a > 0.7:
        raise ValueError("too far")
    return {"y": a + b}


def made(largest):
    return uqpen.run(
        uqpen.Study(
            model=corner,
            inputs={"a": uqpen.Uniform(0, largest), "b": uqpen.Uniform(0, 1)},
            outputs={"y": uqpen.OutputSpec("1", exceeds=["0.7", "1.2"], below=["9"])},
            designs={"mc": uqpen.MonteCarlo(runs=60)},
            surrogates={"pce": uqpen.PolynomialChaos(design="mc", order=1)},
            seed=1,
        )
    )


def test_predictions_at_failed_runs_are_a_statement_of_their_own(tmp_path):
    write(made(1), tmp_path / "a.nc")
    tree = open_archive(tmp_path / "a.nc")
    (table,) = missing_run_tables(tree, "pce")
    assert "these are predictions of the surrogate, not results" in table.notes
    rows = dict(table.rows)
    fit = archive_json(tree)["surrogates"]["pce"]["outputs"]["y"]["fit"]
    failed = tree["runs/mc"]["a"].values > 0.7
    all_of_them = f"{failed.sum()} of {failed.sum()}"
    assert rows["y > 0.7"][-1] == rows["y < 9"][-1] == all_of_them
    some = round(fit["missing_runs_shares"][1] * failed.sum())
    assert 0 < some < failed.sum()
    assert rows["y > 1.2"][-1] == f"{some} of {failed.sum()}"
    assert fit["missing_runs_predicted"] == failed.sum()
    assert 0.7 < fit["missing_runs_lowest"] < fit["missing_runs_highest"] < 2
    assert fit["missing_runs_beyond"] == ["> 0.7", "> 1.2", "< 9"]


def test_without_failed_runs_there_is_nothing_to_say():
    assert not list(missing_run_tables(made(0.6), "pce"))
