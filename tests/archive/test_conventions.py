"""Archives follow the CF conventions, as the checker of the conventions sees it."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr
from study_text import study_text

import uqpen
from uqpen.archive.read import read_group
from uqpen.benchmark.compare import compare
from uqpen.benchmark.methods import BenchmarkSettings

pytestmark = pytest.mark.slow

DATA = Path(__file__).parents[1] / "data"
RODS = (DATA / "rods.toml").read_text(encoding="utf-8")
TRAJECTORY = RODS.replace('use = "walker-anderson"', 'use = "walker-anderson-trajectory"')

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
runs = 100
"""

# What every kind of design and a surrogate of it have.
DESIGNS = study_text(
    "ishigami",
    title="Every design",
    seed=4,
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": (-3, 3)},
    outputs={"y": {"exceeds": [10]}},
    designs={
        "blocks": {"kind": "saltelli", "base": 32, "second_order": True},
        "rule": {"kind": "quadrature", "order": 3},
        "trajectories": {"kind": "morris", "trajectories": 12},
        "steps": {"kind": "one-at-a-time"},
        "spread": {"kind": "latin-hypercube", "runs": 200},
    },
    surrogates={"pce": {"kind": "polynomial-chaos", "design": "spread", "order": 4}},
    published={"elsewhere": {"source": "a report", "y": {"mean": 3.5, "response": {"x1": 0.1}}}},
)

MODELS = study_text(
    title="Two models",
    seed=4,
    models={"one": {"use": "ishigami"}, "other": {"use": "ishigami", "with": {"x3": 0.5}}},
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": 1},
    dependence={
        "copula": "gaussian",
        "of": "ranks",
        "pairs": [{"inputs": ["x1", "x2"], "correlation": 0.5}],
    },
    designs={"spread": {"kind": "latin-hypercube", "runs": 200}},
)

# Outputs with dimensions, and curves that end, with all that stands beside them: bands and indices.
FIELDS = f"""
title = "Motion"
seed = 4
{TRAJECTORY}
[designs.draws]
kind = "monte-carlo"
runs = 40
"""

# Methods of which one is replicated, head to head.
COMPARED = study_text(
    "ishigami",
    title="Small",
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": 1},
    outputs={"y": {"exceeds": [5]}},
    designs={
        "monte_carlo": {"kind": "monte-carlo", "runs": 100},
        "latin_hypercube": {"kind": "latin-hypercube", "runs": 100},
    },
)


# It would read its table of standard names twice for each file, which takes most of its time.
CHECKER = """
import sys
from functools import cache
from compliance_checker.cf import util
from compliance_checker.runner import CheckSuite, ComplianceChecker
util.StandardNameTable = cache(util.StandardNameTable)
CheckSuite.load_all_available_checkers()
output, *files = sys.argv[1:]
written = {"output_filename": output, "output_format": "json_new"}
ComplianceChecker.run_checker(files, ["cf:1.11"], 0, "normal", **written)
"""


@pytest.fixture(scope="module")
def trees():
    """Archives that hold every kind of group."""
    studies = [uqpen.parse_study(text) for text in (DESIGNS, KINDS, MODELS)]
    # Of a model and of inputs that files tell of.
    studies.append(uqpen.load_study(DATA / "archives" / "schema_1_several.toml"))
    terms = BenchmarkSettings(budgets=(16, 32), repeats=10, reference=64)
    compared = compare(uqpen.parse_study(COMPARED), terms)
    return [*map(uqpen.run, studies), compared, uqpen.run(uqpen.parse_study(FIELDS))]


@pytest.fixture(scope="module")
def report(trees, tmp_path_factory):
    """What the checker says of every kind of variable, beside what belongs to it.

    It does not look inside groups, so each is written as a file of its own. It takes its time, and
    more than that with many variables: of those that are built alike, one is looked at.
    """
    folder = tmp_path_factory.mktemp("groups")
    seen = set()
    files = []
    for number, tree in enumerate(trees):
        uqpen.write(tree, folder / "whole.nc")
        tree = uqpen.open_archive(folder / "whole.nc")
        for node in tree.subtree:
            dataset = (
                read_group(tree, *node.path.strip("/").split("/")) if node.parent else xr.Dataset()
            )
            part = unlike(dataset, seen)
            if not part.variables:
                continue
            # Of the root's attributes, the file of a group alone needs these two.
            root = {name: tree.attrs[name] for name in ("Conventions", "title")}
            path = folder / f"{number}-{node.path.strip('/').replace('/', '-')}.nc"
            none = {str(name): {"_FillValue": None} for name in part.variables}
            part.assign_attrs(root).to_netcdf(path, encoding=none)
            files.append(path)
    output = folder / "report.json"
    command = [sys.executable, "-c", CHECKER, str(output), *map(str, files)]
    subprocess.run(command, check=True, capture_output=True)
    found = json.loads(output.read_text())
    assert len(found) == len(files) > 10
    looked_at = {path.name for path in files}
    known = {"3-files.nc", "4-comparison-y.nc", "0-statistics-blocks-y.nc", "5-runs-draws.nc"}
    assert known <= looked_at
    return {Path(name).stem: checks["cf:1.11"] for name, checks in found.items()}


def unlike(dataset, seen):
    """The variables that are built as none before, with all that they refer to."""
    variables = dataset.variables
    kinds = {kind(each, name in dataset.coords): name for name, each in variables.items()}
    chosen = {name for built, name in kinds.items() if built not in seen}
    seen.update(kinds)
    before = None
    while chosen != before:
        before = set(chosen)
        for name in before:
            words = {word for text in texts(variables[name]) for word in text.split()}
            chosen |= variables.keys() & {*words, *variables[name].dims}
    return dataset.drop_vars(variables.keys() - chosen)


def kind(variable, is_coordinate):
    """What the checker goes by but for names, which are looked at by themselves: not values."""
    said = tuple(variable.attrs.get(name) for name in ("cell_methods", "standard_name"))
    built = (is_coordinate, variable.dims, str(variable.dtype), frozenset(variable.attrs))
    return built, said


def texts(variable):
    said = [*variable.attrs.values(), variable.encoding.get("coordinates")]
    return [text for text in said if isinstance(text, str)]


def test_names_are_letters_digits_and_underscores(trees):
    for tree in trees:
        for node in tree.subtree:
            names = {*map(str, node.variables), *node.dims, node.name or "root"}
            assert all(re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII) for name in names), names
            assert len({name.lower() for name in names}) == len(names), "not distinguished by case"


def test_no_group_has_an_error(report):
    errors = {
        name: check["msgs"]
        for name, checks in report.items()
        for check in checks["high_priorities"]
        if check["msgs"]
    }
    assert errors == {}


def test_all_that_is_advised_and_not_done_is_a_history(report):
    # A history says when a file was written: two archives of one study would differ by it.
    advised = {
        message
        for checks in report.values()
        for check in checks["medium_priorities"]
        for message in check["msgs"]
    }
    assert all("history" in message for message in advised)
