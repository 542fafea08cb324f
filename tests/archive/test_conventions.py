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

STUDIES = Path(__file__).parents[2] / "studies"


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, list[dict[str, str]]]]:
    """What the checker says of every group of the concrete study.

    It does not look inside groups, so each is written as a file of its own.
    """
    folder = tmp_path_factory.mktemp("groups")
    uqpen.write(uqpen.run(uqpen.load_study(STUDIES / "concrete.toml")), folder / "whole.nc")
    tree = uqpen.open_archive(folder / "whole.nc")
    files = []
    for node in tree.subtree:
        dataset = group(tree, *node.path.strip("/").split("/")) if node.parent else xr.Dataset()
        if not dataset.variables:
            continue
        # Of the root's attributes, the file of a group alone needs these two.
        root = {name: tree.attrs[name] for name in ("Conventions", "title")}
        path = folder / f"{node.path.strip('/').replace('/', '-')}.nc"
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
    return {Path(name).stem: checks["cf:1.11"] for name, checks in found.items()}


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
