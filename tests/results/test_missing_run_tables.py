"""What a surrogate predicts at the inputs of failed runs, in an archive and as a table."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

import uqpen
from uqpen.archive.read import open_archive
from uqpen.archive.write import write
from uqpen.results.json import archive_json
from uqpen.results.missing_run_tables import missing_run_tables


def corner(a: float, b: float) -> dict[str, float]:
    if a > 0.7:
        raise ValueError("too far")
    return {"y": a + b}


def made(largest: float) -> xr.DataTree:
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


def test_predictions_at_failed_runs_are_a_statement_of_their_own(tmp_path: Path) -> None:
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


def test_without_failed_runs_there_is_nothing_to_say() -> None:
    assert not list(missing_run_tables(made(0.6), "pce"))
