"""The house: arrows point down, families hold together, and starting costs nothing."""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest

import uqpen
from uqpen.cli.main import COMMANDS
from uqpen.core.errors import UqpenError
from uqpen.core.lookup import resolve
from uqpen.core.model import Model
from uqpen.designs import DESIGNS
from uqpen.designs.design import Design
from uqpen.distributions.continuous import DISTRIBUTIONS
from uqpen.distributions.copulas import COPULAS
from uqpen.distributions.dependence import Dependence
from uqpen.distributions.distribution import Distribution
from uqpen.models import MODELS
from uqpen.statistics import ANALYSES, ANALYSES_OF_DESIGNS

ROOT = Path(__file__).parents[1]

MODULES = [
    module.name
    for module in pkgutil.walk_packages(uqpen.__path__, "uqpen.")
    if module.name != "uqpen.__main__"
]

HEAVY = ("numpy", "scipy", "xarray", "netCDF4", "numba", "rich", "cf_units", "matplotlib")


def _tool(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", *command], cwd=ROOT, capture_output=True, text=True, check=False
    )


def test_arrows_point_down() -> None:
    code = "from importlinter.cli import lint_imports; import sys; sys.exit(lint_imports())"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout


def test_the_linter_finds_nothing() -> None:
    done = _tool("ruff", "check", "--no-cache", ".")
    assert done.returncode == 0, done.stdout


def test_the_code_is_formatted() -> None:
    done = _tool("ruff", "format", "--no-cache", "--check", ".")
    assert done.returncode == 0, done.stdout


def test_types_hold() -> None:
    done = _tool("mypy")
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("name", MODULES)
def test_what_a_module_offers_it_has(name: str) -> None:
    module = importlib.import_module(name)
    own = [key for key, value in vars(module).items() if getattr(value, "__module__", "") == name]
    offered = getattr(module, "__all__", None)
    if offered is None:
        assert [key for key in own if not key.startswith("_")] == []
        return
    missing = [entry for entry in offered if not hasattr(module, entry)]
    assert missing == []


@pytest.mark.parametrize("name", MODULES)
def test_every_module_says_what_it_is_for(name: str) -> None:
    module = importlib.import_module(name)
    assert (module.__doc__ or "").strip(), name


@pytest.mark.parametrize(
    ("family", "kind"),
    [(DESIGNS, Design), (DISTRIBUTIONS, Distribution), (COPULAS, Dependence), (MODELS, Model)],
    ids=["designs", "distributions", "copulas", "models"],
)
def test_members_of_a_family_are_final_and_frozen(family: dict[str, str], kind: type) -> None:
    for name, reference in family.items():
        member = resolve(reference)
        assert issubclass(member, kind), name
        assert not member.__subclasses__(), name
        if dataclasses.is_dataclass(member):
            assert member.__dataclass_params__.frozen, name  # type: ignore[attr-defined]


def test_every_analysis_resolves_to_a_callable() -> None:
    families = [ANALYSES, *ANALYSES_OF_DESIGNS.values()]
    references = [
        reference for family in families for group in family.values() for reference in group
    ]
    assert all(callable(resolve(reference)) for reference in references)


def test_the_exception_tree_is_the_one_that_is_drawn() -> None:
    errors = importlib.import_module("uqpen.core.errors")
    drawn: dict[str, str] = {}
    above: list[str] = []
    for line in (errors.__doc__ or "").splitlines():
        if match := re.match(r"    ([│ ├└─]*)(\w+Error)", line):
            del above[len(match[1]) // 4 :]
            drawn[match[2]] = above[-1] if above else "Exception"
            above.append(match[2])
    defined = {
        name: value.__bases__[0].__name__
        for name, value in vars(errors).items()
        if isinstance(value, type) and issubclass(value, UqpenError)
    }
    assert drawn == defined


def test_the_public_names_are_there() -> None:
    assert set(uqpen.__all__) <= set(dir(uqpen))
    for name in uqpen.__all__:
        assert getattr(uqpen, name) is not None
    with pytest.raises(AttributeError, match="frobnicate"):
        uqpen.frobnicate  # noqa: B018 - the access is the test


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys; from uqpen.cli.main import uqpen;"
        "uqpen(['--help'], standalone_mode=False);"
        f"print([name for name in {HEAVY} if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout.splitlines()[-1] == "[]"
    assert all(command in done.stdout for command in COMMANDS)
