"""Damaged archives of every sort: each command succeeds, or says what is wrong."""

import subprocess
import sys
from pathlib import Path

import archive_files
import pytest
from properties import archive_outcome

from uqpen.archive.provenance import SCHEMA

pytestmark = pytest.mark.slow

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "fuzz.py"


# In a process of its own: a damaged file may bring the HDF5 library down, and with it the tests.
# Damage that the hashes tell has its own tests.
def test_damage_is_no_traceback(tmp_path):
    kind = ["--kind", "archive-hashed", "--files", "3", "--seconds", "999"]
    done = subprocess.run(
        [sys.executable, BENCHMARK, *kind, "--keep", tmp_path],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith("archive-hashed: 3 files: ")


@pytest.mark.parametrize("command", ["show {file}", "verify {file}", "diff {file} {other}"])
def test_foreign_files_are_refused(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for file in archive_files.foreign_files(tmp_path):
        # Of what says that it is an archive, that can be read which is in the format of one.
        is_hdf5 = file.name.startswith("NETCDF4")
        is_read = is_hdf5 and f"_{SCHEMA}.nc" in file.name and not command.startswith("show")
        read_as = "different" if command.startswith("verify") else "taken"
        assert archive_outcome(file, file, command) == (read_as if is_read else "refused"), file
