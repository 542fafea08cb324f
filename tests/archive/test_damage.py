"""What is damaged is told in words: by its bytes, and by what figures have to lie along."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest

import uqpen
from uqpen.archive.checksum import is_broken
from uqpen.archive.read import open_archive
from uqpen.core.errors import ArchiveError

STUDY = """
seed = 1
[models.one]
use = "ishigami"
[models.other]
use = "ishigami"
with = { x3 = 0.5 }
[inputs]
x1 = { uniform = { lower = -3, upper = 3 } }
x2 = { uniform = { lower = -3, upper = 3 } }
x3 = 1
[outputs.y]
hold = [0.95]
[designs.first]
kind = "monte-carlo"
runs = 30
[designs.second]
kind = "latin-hypercube"
runs = 30
[surrogates.chaos]
kind = "polynomial-chaos"
design = "first"
order = 2
"""


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "whole.nc"
    uqpen.write(uqpen.run(uqpen.parse_study(STUDY)), path)
    return path


@pytest.fixture
def copy(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(whole, tmp_path / "copy.nc"))


@pytest.mark.parametrize("at", [0, 100, 0.5, 0.9, -1])
def test_a_byte_that_has_changed_is_told_before_it_is_read(copy: Path, at: float) -> None:
    data = bytearray(copy.read_bytes())
    position = int(at * len(data)) if isinstance(at, float) else at
    data[position] ^= 1
    copy.write_bytes(data)
    with pytest.raises(ArchiveError) as caught:
        open_archive(copy)
    assert str(caught.value) == f"{copy}: is damaged: its bytes are not those that were written"


def test_a_file_without_its_end_is_refused(copy: Path) -> None:
    copy.write_bytes(copy.read_bytes()[:-5000])
    with pytest.raises(ArchiveError, match="is not an archive"):
        open_archive(copy)


def test_what_others_have_edited_has_no_checksum_and_is_opened(copy: Path) -> None:
    with netCDF4.Dataset(copy, "a") as dataset:
        dataset.title = "another"
    assert not is_broken(copy)
    assert b"uqpen sha256" not in copy.read_bytes()[-100:]
    assert open_archive(copy).attrs["title"] == "another"


def drop(group: str, name: str) -> Callable[[Any], None]:
    return lambda root: root[group].renameVariable(name, "formerly")


def told(path: str, name: str, value: Any) -> Callable[[Any], None]:
    return lambda root: (root[path] if path else root).setncattr(name, value)


def filled(path: str, at: Any, value: Any) -> Callable[[Any], None]:
    return lambda root: root[path].__setitem__(at, value)


ONE = "models/one"
DAMAGES = {
    "bounds": (
        drop(f"{ONE}/moments/first", "bound"),
        "/models/one/moments/first: y_mean: not the bounds of an estimate",
    ),
    "names of bounds": (
        filled(f"{ONE}/moments/first/bound", 1, "least"),
        "/models/one/moments/first: y_mean: not the bounds of an estimate",
    ),
    "inputs": (
        drop(f"{ONE}/sensitivity/first", "input"),
        "/models/one/sensitivity/first: no input to tell its entries apart",
    ),
    "entries": (
        filled(f"{ONE}/quantiles/second/y_probability", 1, 0.4),
        "/models/one/quantiles/second: another y_probability than elsewhere",
    ),
    "needed": (
        drop(f"{ONE}/holds/first", "y_hold_runs_needed"),
        "/models/one/holds/first: no y_hold_runs_needed for each entry",
    ),
    "unit": (
        told(f"{ONE}/runs/first/y", "display_units", "m^^"),
        "/models/one/runs/first/y: display_units that are no unit",
    ),
    "note": (
        told(f"{ONE}/moments/first/y_mean", "note", np.array([1, 2])),
        "/models/one/moments/first/y_mean: note is no text",
    ),
    "count": (
        told(f"{ONE}/sensitivity/first", "runs", "many"),
        "/models/one/sensitivity/first: runs is no count",
    ),
    "seed": (told("", "seed", "9" * 5000), "a seed that is no number"),
    "run numbers": (
        filled(f"{ONE}/runs/first/run", 3, 1),
        "/models/one/runs/first: run numbers that do not ascend",
    ),
    "pair": (
        lambda root: root["differences"].renameGroup("other", "third"),
        "/differences/third: of no model",
    ),
    "minus": (
        lambda root: root["differences/other/moments/first"].delncattr("minus"),
        "/differences/other/moments/first: does not say of which model",
    ),
    "fit": (
        drop(f"{ONE}/surrogates/chaos", "y_coefficient"),
        "/models/one/surrogates/chaos: does not say how well it fits y",
    ),
}


@pytest.mark.parametrize("how", list(DAMAGES))
def test_a_damaged_part_is_named(copy: Path, how: str) -> None:
    change, message = DAMAGES[how]
    with netCDF4.Dataset(copy, "a") as root:
        change(root)
    with pytest.raises(ArchiveError) as caught:
        open_archive(copy)
    assert str(caught.value) == f"{copy}: is damaged: {message}"
