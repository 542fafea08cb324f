"""The map of the rooms is right, families hold together, and starting costs nothing."""

import dataclasses
import importlib
import pkgutil
import re
import tomllib
from pathlib import Path

import pytest

import uqpen
from uqpen.core.errors import UqpenError
from uqpen.core.lookup import resolve
from uqpen.core.model import Model
from uqpen.core.variables import Reduction
from uqpen.designs import DESIGNS
from uqpen.designs.design import Design
from uqpen.designs.rare_events import RARE_EVENT_METHODS
from uqpen.distributions import COPULAS, DISTRIBUTIONS
from uqpen.distributions.copulas import Dependence
from uqpen.distributions.distribution import Distribution
from uqpen.execution import EXECUTORS
from uqpen.models import MODELS
from uqpen.reductions import REDUCTIONS
from uqpen.results import TABLE_FORMATS
from uqpen.statistics import ANALYSES, ANALYSES_OF_DESIGNS
from uqpen.surrogates import SURROGATES

ROOT = Path(__file__).parents[1]

MODULES = [
    module.name
    for module in pkgutil.walk_packages(uqpen.__path__, "uqpen.")
    if module.name != "uqpen.__main__"
]


# All modules in one test each: to begin and end a test takes longer than to look at a module.
def test_what_a_module_offers_it_has():
    modules = map(importlib.import_module, MODULES)
    offered = [(each, key) for each in modules for key in getattr(each, "__all__", ())]
    assert [f"{each.__name__}: {key}" for each, key in offered if not hasattr(each, key)] == []


def test_every_module_says_what_it_is_for():
    modules = map(importlib.import_module, MODULES)
    assert [module.__name__ for module in modules if not (module.__doc__ or "").strip()] == []


@pytest.mark.parametrize(
    ("family", "kind"),
    [
        (DESIGNS, Design),
        (DISTRIBUTIONS, Distribution),
        (COPULAS, Dependence),
        (MODELS, Model),
        (REDUCTIONS, Reduction),
    ],
    ids=["designs", "distributions", "copulas", "models", "reductions"],
)
def test_members_of_a_family_are_final_and_frozen(family, kind):
    for name, reference in family.items():
        member = resolve(reference)
        assert issubclass(member, kind), name
        ours = [each for each in member.__subclasses__() if each.__module__.startswith("uqpen.")]
        assert not ours, name
        if dataclasses.is_dataclass(member):
            assert member.__dataclass_params__.frozen, name  # type: ignore[attr-defined]


def test_every_function_of_a_family_resolves_to_a_callable():
    families = [ANALYSES, *ANALYSES_OF_DESIGNS.values()]
    references = [
        reference for family in families for group in family.values() for reference in group
    ]
    references += [each.function for each in TABLE_FORMATS.values()]
    references += [executor.function for executor in EXECUTORS.values()]
    references += [
        part
        for method in RARE_EVENT_METHODS.values()
        for part in (method.design, method.probability, method.quantiles, method.sensitivities)
        if part
    ]
    assert all(callable(resolve(reference)) for reference in references)


def test_the_exception_tree_is_the_one_that_is_drawn():
    errors = importlib.import_module("uqpen.core.errors")
    drawn = {}
    above = []
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


def test_the_public_names_are_there():
    assert set(dir(uqpen)) == {*uqpen.__all__, "__version__"}
    for name in uqpen.__all__:
        assert getattr(uqpen, name).__doc__, name
    with pytest.raises(AttributeError, match="frobnicate"):
        uqpen.frobnicate  # noqa: B018 - the access is the test


@pytest.mark.parametrize(
    "family",
    [DESIGNS, DISTRIBUTIONS, COPULAS, MODELS, SURROGATES],
    ids=["designs", "distributions", "copulas", "models", "surrogates"],
)
def test_each_class_that_a_study_can_name_is_public(family):
    for reference in family.values():
        name = reference.rpartition(":")[2]
        assert name in uqpen.__all__
        assert getattr(uqpen, name) is resolve(reference)


def test_the_map_of_the_rooms_is_the_import_contract():
    contract = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    layers = contract["tool"]["importlinter"]["contracts"][0]["layers"]
    expected = [sorted(layer.split(" | ")) for layer in layers]
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| (.*?) \|", page, re.MULTILINE)
    assert [sorted(re.findall(r"`(\w+)`", modules)) for _, modules in rows] == expected
    assert [int(number) for number, _ in rows] == list(range(len(layers), 0, -1))


DECISIONS = sorted((ROOT / "docs" / "decisions").glob("[0-9]*.md"))


def test_every_decision_is_listed_under_its_title():
    page = (ROOT / "docs" / "decisions" / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| \[(\d+)\]\((\S+)\) \| (.*) \| ([\d, ]*)\|$", page, re.MULTILINE)
    titles = [path.read_text(encoding="utf-8").splitlines()[0] for path in DECISIONS]
    assert [name for _, name, _, _ in rows] == [path.name for path in DECISIONS]
    assert [f"# {title}" for _, _, title, _ in rows] == titles
    assert all(name.startswith(f"{number}-") for number, name, _, _ in rows)


def test_every_number_of_a_decision_is_found_on_one_page():
    page = (ROOT / "docs" / "decisions" / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| \[(\d+)\]\(\S+\) \| .* \| ([\d, ]*)\|$", page, re.MULTILINE)
    found = [int(number) for row in rows for number in re.findall(r"\d+", " ".join(row))]
    assert sorted(found) == list(range(1, len(found) + 1))


@pytest.mark.parametrize("path", DECISIONS, ids=lambda path: path.stem)
def test_a_decision_has_its_four_parts_and_names_files_that_exist(path):
    text = path.read_text(encoding="utf-8")
    parts = re.findall(r"^## (.*)$", text, re.MULTILINE)
    assert parts == ["Context", "Decision", "Reason", "Consequences"]
    for name in re.findall(r"`([\w/]+/[\w.]*)`", text):
        roots = (ROOT, ROOT / "uqpen")
        assert any((root / name).exists() for root in roots) or name.startswith("/"), name
