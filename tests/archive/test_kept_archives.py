"""Archives that are kept are read, checked and repeated by this uqpen.

They stand in ``tests/data/archives``, packed, beside the studies that they were made of. For a new
schema: ``uqpen study schema_N.toml -o schema_N.nc && gzip -9n schema_N.nc`` in that folder.
"""

from __future__ import annotations

import gzip
import hashlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.archive.hashes import group_hashes, recorded_hashes
from uqpen.archive.provenance import SCHEMA
from uqpen.archive.read import open_archive, read_tree
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.verification.check_result import CheckOutcome, find_differences
from uqpen.verification.diff import diff_archives
from uqpen.verification.verify import verify
from uqpen.workflow.repetition import TOLERANCE

# To make its study again takes a second each.
pytestmark = pytest.mark.slow

FOLDER = Path(__file__).parents[1] / "data" / "archives"
NAMES = sorted(path.name.removesuffix(".nc.gz") for path in FOLDER.glob("*.nc.gz"))

NAN = np.nan
# By archive, group and variable: what stands in the file, to the bit.
OF_ISHIGAMI = {
    "runs/monte_carlo/y": {3: 0.2450454206611793},
    "statistics/monte_carlo/y/mean": {
        ...: [3.6915976938972275, 2.037671323203666, 5.5461142398741705]
    },
    "statistics/blocks/y/first_order": {
        (..., 0): [0.8860775861308721, 0.6169951125916516, 0.010820809803753608]
    },
    "statistics/trajectories/y/mu_star": {
        0: [4.69362561011677, 2.4792627373373985, 6.907988482896142]
    },
    "statistics/report/y/response": {0: [0.1, NAN, NAN]},
}
FIGURES = {
    "schema_1": OF_ISHIGAMI,
    "schema_1_several": {
        "differences/other/monte_carlo/y/mean": {...: [-0.5, -0.5, -0.5]},
        "models/other/runs/given/y": {...: [0.5, -0.5, 0.515625, 1.5]},
    },
}


class Kept(NamedTuple):
    """An archive that is kept, unpacked."""

    name: str
    path: Path
    tree: xr.DataTree


@pytest.fixture(scope="module", params=NAMES)
def kept(request, tmp_path_factory):
    """Each archive in turn."""
    path = tmp_path_factory.mktemp("kept") / f"{request.param}.nc"
    path.write_bytes(gzip.decompress((FOLDER / f"{request.param}.nc.gz").read_bytes()))
    return Kept(request.param, path, open_archive(path))


def test_there_is_one_of_this_schema():
    assert f"schema_{SCHEMA}" in NAMES
    assert set(FIGURES) == set(NAMES)


def test_it_is_of_its_schema_and_study(kept):
    assert kept.tree.attrs["uqpen_schema"] == int(kept.name.split("_")[1])
    text = (FOLDER / f"{kept.name}.toml").read_text()
    assert kept.tree.attrs["study_text"] == text
    assert kept.tree.attrs["study_sha256"] == hashlib.sha256(text.encode()).hexdigest()


def test_it_opens_with_the_same_figures(kept):
    for path, figures in FIGURES[kept.name].items():
        group, _, variable = path.rpartition("/")
        for position, expected in figures.items():
            found = kept.tree[group][variable].values[position]
            np.testing.assert_array_equal(found, expected, path)


def test_it_is_shown(kept):
    rows = [row for table in output_tables(kept.tree) for row in dict(table.rows)]
    assert "mean" in rows
    assert archive_json(kept.tree)["schema"] == SCHEMA


@pytest.mark.processor
def test_it_is_verified(kept, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    parts = list(verify(kept.path, runs=None, trust=True))
    assert {"hashes", "study", "runs", "statistics"} <= {part.name for part in parts}
    assert {part.verdict for part in parts} <= {CheckOutcome.EQUAL, CheckOutcome.CLOSE}


def have_close_runs(one, other):
    """Return whether the runs differ by no more than another processor's last bits."""
    groups = [node.path for node in one.subtree if "status" in node.data_vars]
    pairs = [(one[path].to_dataset(), other[path].to_dataset()) for path in groups]
    return all(each.relative <= TOLERANCE for pair in pairs for each in find_differences(*pair))


@pytest.mark.processor
def test_its_differences_from_a_new_one_are_explained(kept):
    now = uqpen.run(uqpen.load_study(FOLDER / f"{kept.name}.toml"))
    reported = {section.name: section.lines for section in diff_archives(kept.tree, now)}
    # What another version or processor brings along, but no other run or estimate.
    is_close = "made with" in reported and have_close_runs(kept.tree, now)
    last_bits = {"points", "outputs"} if is_close else set()
    assert set(reported) <= {"root", "groups", "made with", "equal", "other groups", *last_bits}
    groups = reported.get("groups", ())
    assert all(line.endswith("is in the second only") for line in groups)


def test_what_is_read_can_be_written_again(kept, tmp_path):
    uqpen.write(kept.tree, tmp_path / "again.nc")
    again = read_tree(tmp_path / "again.nc")
    assert group_hashes(again) == recorded_hashes(again) == group_hashes(kept.tree)
