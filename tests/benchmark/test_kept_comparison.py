"""A comparison of an earlier schema is read as it was, up to the wording of its notes.

It stands in ``tests/data/comparisons``, packed, beside its study and what ``uqpen show --json``
said of it when it was written.
"""

from __future__ import annotations

import gzip
import json
import re
from pathlib import Path
from typing import Any

import netCDF4
import pytest
import xarray as xr

from uqpen.archive.benchmark_layout import BENCHMARK_VARIABLES
from uqpen.archive.content import group_hashes, recorded_hashes
from uqpen.archive.migrations import migrate
from uqpen.archive.read import open_archive, read_as_written
from uqpen.archive.reworded import reworded
from uqpen.archive.write import write
from uqpen.core.errors import ArchiveError
from uqpen.report.page import report_page
from uqpen.results.benchmark_entries import entries
from uqpen.results.benchmark_json import benchmark_json

FOLDER = Path(__file__).parents[1] / "data" / "comparisons"

# The variables whose names have changed otherwise than by the statistic.
OLD_PLACES = {
    "estimate": "estimates/y/{}",
    "error": "errors/y/{}",
    "slope": "slopes/y/{}",
    "coverage": "errors/y/{}_coverage",
    "scale": "errors/y/{}_scale",
    "remark": "verdicts/y/{}_note",
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """The archive, unpacked."""
    path = tmp_path / "schema_2.nc"
    path.write_bytes(gzip.decompress((FOLDER / "schema_2.nc.gz").read_bytes()))
    return path


def test_scripts_are_told_the_same(path: Path) -> None:
    told = json.loads(gzip.decompress((FOLDER / "schema_2.json.gz").read_bytes()))
    now = json.loads(json.dumps(benchmark_json(open_archive(path))))
    assert {**now, "schema": 2} == _reworded(told)


def _reworded(content: Any) -> Any:
    """Return content of JSON with the present wording of its texts."""
    if isinstance(content, dict):
        return {key: _reworded(value) for key, value in content.items()}
    return reworded(content) if isinstance(content, str) else content


def test_every_variable_has_its_place(path: Path) -> None:
    old, new = read_as_written(path), open_archive(path)
    moved = 0
    for statistic in ("mean", "std", "quantile", "exceedance"):
        for name in BENCHMARK_VARIABLES:
            place = OLD_PLACES.get(name, f"verdicts/y/{{}}_{name}").format(statistic)
            xr.testing.assert_identical(
                old[place].variable, new[f"benchmark/y/{statistic}"][name].variable
            )
            moved += 1
    groups = ("estimates", "errors", "slopes", "verdicts")
    assert moved == sum(len(old[f"{group}/y"].data_vars) for group in groups)


def test_the_reference_keeps_how_each_interval_was_made(path: Path) -> None:
    (least, *others) = (
        e.reference for e in entries(open_archive(path)) if e.statistic == "quantile"
    )
    assert str(least["interval_label"].values) == "conservative"
    assert str(least["note"].values) == "256 runs are too few for a lower bound"
    assert {str(each["interval_label"].values) for each in others} == {"nominal"}


def test_what_was_written_is_not_touched(path: Path) -> None:
    written = read_as_written(path)
    migrate(written)
    assert group_hashes(written) == recorded_hashes(written)


@pytest.mark.slow
def test_it_has_a_page_and_can_be_written_again(path: Path, tmp_path: Path) -> None:
    tree = open_archive(path)
    write(tree, tmp_path / "again.nc")
    pages = [report_page(each) for each in (open_archive(tmp_path / "again.nc"), tree)]
    # The reference of each names the hash of its own record.
    again, before = (re.sub(r"sha256 [0-9a-f]{16}", "sha256", page) for page in pages)
    assert again == before


@pytest.mark.parametrize(
    ("group", "variable"),
    [
        ("estimates/y", "std"),
        ("errors/y", "mean_scale"),
        ("verdicts/y", "mean_lead"),
        ("reference/quantiles", "y_probability_note"),
        ("reference/moments", "y_std"),
        ("methods", "budget"),
    ],
)
def test_one_that_is_damaged_is_told_as_such(path: Path, group: str, variable: str) -> None:
    with netCDF4.Dataset(path, "a") as dataset:
        dataset[group].renameVariable(variable, "lost")
    with pytest.raises(ArchiveError, match="is damaged"):
        open_archive(path)
