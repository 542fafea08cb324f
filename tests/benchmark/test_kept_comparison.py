"""A comparison that is kept is read as it was.

It stands in ``tests/data/comparisons``, packed, beside its study and what ``uqpen show --json``
said of it when it was written.
"""

import gzip
import json
import re
from pathlib import Path

import netCDF4
import pytest

from uqpen.archive.read import open_archive
from uqpen.archive.write import write
from uqpen.core.errors import ArchiveError
from uqpen.report.page import report_page
from uqpen.report.sections.summary import summary_lines
from uqpen.results.method_comparison import MethodComparison, benchmark_json

FOLDER = Path(__file__).parents[1] / "data" / "comparisons"


@pytest.fixture
def path(tmp_path):
    """The archive, unpacked."""
    path = tmp_path / "schema_1.nc"
    path.write_bytes(gzip.decompress((FOLDER / "schema_1.nc.gz").read_bytes()))
    return path


def test_scripts_get_the_same(path):
    reported = json.loads(gzip.decompress((FOLDER / "schema_1.json.gz").read_bytes()))
    assert json.loads(json.dumps(benchmark_json(open_archive(path)))) == reported


def test_it_sums_itself_up_by_its_leaders(path):
    lines = list(summary_lines(open_archive(path)))
    assert lines
    assert all(re.match(r"At \d+ runs, .*(lead|level|ahead)", line) for line in lines)


def test_the_reference_keeps_how_each_interval_was_made(path):
    (least, *others) = (
        entry.reference
        for entry in MethodComparison.of(open_archive(path)).entries
        if entry.statistic.name == "quantile"
    )
    assert str(least["interval_label"].values) == "conservative"
    assert str(least["note"].values) == "256 runs are too few for a lower bound"
    assert {str(each["interval_label"].values) for each in others} == {"nominal"}


@pytest.mark.slow
def test_it_has_a_page_and_can_be_written_again(path, tmp_path):
    tree = open_archive(path)
    write(tree, tmp_path / "again.nc")
    pages = [report_page(each) for each in (open_archive(tmp_path / "again.nc"), tree)]
    # The reference of each names the hash of its own record.
    again, before = (re.sub(r"sha256 [0-9a-f]{16}", "sha256", page) for page in pages)
    assert again == before


@pytest.mark.parametrize(
    ("group", "variable"),
    [
        ("statistics/monte_carlo/y", "std"),
        ("statistics/monte_carlo/y", "budget"),
        ("comparison/y", "mean_scale"),
        ("statistics/reference/y", "quantile_interval"),
        ("statistics/reference/y", "std"),
    ],
)
def test_one_that_is_damaged_is_reported_as_such(path, group, variable):
    with netCDF4.Dataset(path, "a") as dataset:
        dataset[group].renameVariable(variable, "lost")
    with pytest.raises(ArchiveError, match="is damaged"):
        open_archive(path)
