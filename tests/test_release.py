"""What a release has to have: one version everywhere, and a changelog that names what there is."""

import re
import tomllib
from itertools import chain
from pathlib import Path

from packaging.requirements import Requirement

import uqpen
from uqpen.cli.main import COMMANDS

ROOT = Path(__file__).parents[1]
CHANGELOG = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_changelog_names_every_command():
    entry = re.search(r"^- Commands: (.*?)\.\n(?! )", CHANGELOG, re.MULTILINE | re.DOTALL)
    assert entry is not None
    names = re.findall(r"`(?:uqpen )?(\w+)`", entry[1])
    assert names == list(COMMANDS)  # the order of `uqpen --help`


def test_there_is_one_version():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    cited = re.search(r"^version: (\S+)$", citation, re.MULTILINE)
    newest = re.search(r"^## (\S+) ", CHANGELOG, re.MULTILINE)
    assert cited is not None
    assert newest is not None
    assert cited[1] == newest[1] == uqpen.__version__


def test_the_package_is_built_with_that_version():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    path = ROOT / project["tool"]["hatch"]["version"]["path"]
    assert f'__version__ = "{uqpen.__version__}"' in path.read_text(encoding="utf-8")


def test_the_lowest_versions_are_those_that_the_project_allows():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lists = [project["dependencies"], *project["optional-dependencies"].values()]
    lowest = {}
    for line in (ROOT / "lowest.txt").read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            name, _, version = line.partition("==")
            lowest[name.lower()] = version
    requirements = {
        each.name.lower(): each for each in map(Requirement, chain.from_iterable(lists))
    }
    assert lowest.keys() == requirements.keys()
    for name, requirement in requirements.items():
        bound = next(iter(requirement.specifier)).version
        assert lowest[name] == bound or lowest[name].startswith(f"{bound}."), name
