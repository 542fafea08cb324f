"""Archives follow the CF conventions, as the checker of the conventions sees it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr

import uqpen
from uqpen.archive.read import group

DATA = Path(__file__).parents[1] / "data"
RODS = (DATA / "rods.toml").read_text(encoding="utf-8")

# What a model of several outputs and kinds has, with a course and lost runs.
KINDS = f"""
title = "Rods"
seed = 4
{RODS}
[outputs.penetration_depth]
exceeds = ["60 cm"]
hold = [0.9]
[designs.few]
kind = "monte-carlo"
runs = 3000
"""

# What every kind of design and a surrogate of it have.
DESIGNS = """
title = "Every design"
seed = 4
[model]
use = "ishigami"
[inputs]
x1 = { uniform = { lower = -3, upper = 3 } }
x2 = { uniform = { lower = -3, upper = 3 } }
x3 = { uniform = { lower = -3, upper = 3 } }
[outputs.y]
exceeds = [10]
[designs.blocks]
kind = "saltelli"
base = 128
second_order = true
[designs.rule]
kind = "quadrature"
order = 3
[designs.trajectories]
kind = "morris"
trajectories = 12
[designs.steps]
kind = "one-at-a-time"
[designs.spread]
kind = "latin-hypercube"
runs = 200
[surrogates.pce]
kind = "polynomial-chaos"
design = "spread"
[published.elsewhere]
source = "a report"
[published.elsewhere.y]
mean = 3.5
response = { x1 = 0.1 }
"""

MODELS = """
title = "Two models"
seed = 4
[models.one]
use = "ishigami"
[models.other]
use = "ishigami"
with = { x3 = 0.5 }
[inputs]
x1 = { uniform = { lower = -3, upper = 3 } }
x2 = { uniform = { lower = -3, upper = 3 } }
x3 = 1
[dependence]
copula = "gaussian"
of = "ranks"
pairs = [{ inputs = ["x1", "x2"], correlation = 0.5 }]
[designs.spread]
kind = "latin-hypercube"
runs = 200
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, list[dict[str, str]]]]:
    """What the checker says of every kind of group.

    It does not look inside groups, so each is written as a file of its own.
    """
    folder = tmp_path_factory.mktemp("groups")
    seen: set[object] = set()
    files = []
    studies = [uqpen.parse_study(text) for text in (KINDS, DESIGNS, MODELS)]
    # Of a model and of inputs that files tell of.
    studies.append(uqpen.load_study(DATA / "archives" / "schema_2_several.toml"))
    for number, study in enumerate(studies):
        uqpen.write(uqpen.run(study), folder / "whole.nc")
        tree = uqpen.open_archive(folder / "whole.nc")
        for node in tree.subtree:
            dataset = group(tree, *node.path.strip("/").split("/")) if node.parent else xr.Dataset()
            # The checker takes its time, and more than that with many variables. Groups that are
            # built alike pass alike, and the comparison of several outputs like that of one.
            is_large = number == 0 and node.path == "/comparison"
            structure = structure_of(dataset)
            if not dataset.variables or is_large or structure in seen:
                continue
            seen.add(structure)
            # Of the root's attributes, the file of a group alone needs these two.
            root = {name: tree.attrs[name] for name in ("Conventions", "title")}
            path = folder / f"{number}-{node.path.strip('/').replace('/', '-')}.nc"
            none = {str(name): {"_FillValue": None} for name in dataset.variables}
            dataset.assign_attrs(root).to_netcdf(path, encoding=none)
            files.append(path)
    output = folder / "report.json"
    checker = Path(sys.executable).with_name("compliance-checker")
    command = [str(checker), "--test", "cf:1.11", "--format", "json_new"]
    command += ["--output", str(output), *map(str, files)]
    subprocess.run(command, check=False, capture_output=True)
    found = json.loads(output.read_text())
    assert len(found) == len(files) > 10
    assert any(path.name == "3-files.nc" for path in files)
    return {Path(name).stem: checks["cf:1.11"] for name, checks in found.items()}


def structure_of(dataset: xr.Dataset) -> object:
    """What the checker goes by: names, dimensions and attributes, not values."""
    return frozenset(
        (str(name), variable.dims, str(variable.dtype), frozenset(variable.attrs))
        for name, variable in dataset.variables.items()
    )


def test_no_group_has_an_error(report: dict[str, dict[str, list[dict[str, str]]]]) -> None:
    errors = {
        name: check["msgs"]
        for name, checks in report.items()
        for check in checks["high_priorities"]
        if check["msgs"]
    }
    assert errors == {}


def test_all_that_is_advised_and_not_done_is_a_history(
    report: dict[str, dict[str, list[dict[str, str]]]],
) -> None:
    # A history says when a file was written: two archives of one study would differ by it.
    advised = {
        message
        for checks in report.values()
        for check in checks["medium_priorities"]
        for message in check["msgs"]
    }
    assert all("history" in message for message in advised)
