"""Pages of the reference that follow from declarations: keys, statistics, notes, commands, API."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import click

import uqpen
from uqpen.cli.main import COMMANDS
from uqpen.core.catalogue import CATALOGUE
from uqpen.core.lookup import resolve
from uqpen.core.settings import declared_settings
from uqpen.core.status import STATUS_TEXT
from uqpen.designs import DESIGNS
from uqpen.distributions import COPULAS, DISTRIBUTIONS
from uqpen.models import MODELS
from uqpen.reductions import REDUCTIONS
from uqpen.statistics import texts
from uqpen.study import SECTIONS
from uqpen.surrogates import SURROGATES

# What a study names a member of each family by.
FAMILIES: Mapping[str, tuple[str, Mapping[str, str]]] = {
    "Distributions": ("in `[inputs]`, `name = { FAMILY = { … } }`", DISTRIBUTIONS),
    "Dependence": ("in `[dependence]`, `copula = FAMILY`", COPULAS),
    "Designs": ("in `[designs.NAME]`, `kind = FAMILY`", DESIGNS),
    "Surrogates": ("in `[surrogates.NAME]`, `kind = FAMILY`", SURROGATES),
    "Built-in models": ("in `[model]`, `use = FAMILY`", MODELS),
    "Numbers of curves and fields": ("in `[outputs.NAME]`", REDUCTIONS),
}


def write(folder: Path) -> None:
    """Write all pages into a folder; a page that has not changed is left as it is."""
    pages = {
        "study_keys.md": study_keys(),
        "statistics.md": statistics(),
        "notes.md": notes(),
        "commands.md": commands(),
        "api.md": api(),
        **{f"api/{name}.rst": member_page(name) for name in public_names()},
    }
    for name, lines in pages.items():
        path, text = folder / name, "\n".join(lines) + "\n"
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def study_keys() -> Iterator[str]:
    """Yield the page of all keys of a study file that are declared."""
    yield "# Keys of a study file\n"
    yield "Sections and keys as the code declares them. [The study file](../study_file.md) explains"
    yield "them one by one, with examples.\n"
    yield "## Sections\n"
    yield from table(
        ("section", "form", "needed"),
        (
            (f"`{name}`", "table" if section.is_table else "key", section.expected or "no")
            for name, section in SECTIONS.items()
        ),
    )
    for title, (named, family) in FAMILIES.items():
        yield f"\n## {title}\n"
        yield f"Named {named}."
        for name, reference in family.items():
            member = resolve(reference)
            yield f"\n### {name}\n"
            yield f"{first_line(member)}\n"
            settings = list(declared_settings(member)) if dataclasses.is_dataclass(member) else []
            if settings:
                yield from table(
                    ("key", "expected", "default"),
                    (
                        (f"`{each.key or field.name}`", each.expected, default_text(field))
                        for field, each in settings
                    ),
                )
    failures = resolve(SECTIONS["failures"].settings)
    yield "\n## [failures]\n"
    yield from table(
        ("key", "expected", "default"),
        (
            (f"`{each.key or field.name}`", each.expected, default_text(field))
            for field, each in declared_settings(failures)
        ),
    )


def default_text(field: dataclasses.Field[Any]) -> str:
    """Return the default of a setting as a table has it."""
    value = field.default
    if value is dataclasses.MISSING:
        return "" if field.default_factory is dataclasses.MISSING else "none"
    return "none" if value is None else f"`{value}`"


def statistics() -> Iterator[str]:
    """Yield the page of all statistics, by the records of the catalogue."""
    yield "# Statistics of an archive\n"
    yield "Each statistic has a record in the catalogue. Its name is that of its variable in the"
    yield "archive. [Statistics](../statistics.md) says how they are estimated.\n"
    rows = (
        (
            f"`{each.name}`",
            each.title,
            ", ".join(f"`{dim}`" for dim in each.dims),
            each.unit.value,
            f"`{each.asked.key}`" if each.asked.key else "",
            each.measure.label or each.shown.label.replace("{entry}", "…"),
        )
        for each in CATALOGUE.values()
    )
    yield from table(("variable", "meaning", "dimensions", "unit", "asked for by", "label"), rows)


def notes() -> Iterator[str]:
    """Yield the page of statuses of runs, methods of intervals and reasons without one."""
    yield "# Statuses and notes\n"
    yield "## Statuses of a run\n"
    yield from table(
        ("code", "status"), ((str(int(status)), text) for status, text in STATUS_TEXT.items())
    )
    yield "\n## Notes\n"
    yield "Methods of intervals, reasons for having none, and warnings. A name in braces stands for"
    yield "what the estimate has there.\n"
    named = ((name, text) for name, text in vars(texts).items() if name.isupper())
    yield from (f"- {text.strip()}" for _, text in named if isinstance(text, str))


def commands() -> Iterator[str]:
    """Yield the page of all commands with their help."""
    yield "# Commands\n"
    for name, reference in COMMANDS.items():
        command = resolve(reference)
        assert isinstance(command, click.Command)
        context = click.Context(command, info_name=f"uqpen {name}", max_content_width=100)
        yield f"## uqpen {name}\n"
        yield f"```text\n{command.get_help(context)}\n```\n"


def public_names() -> list[str]:
    """Return the names of `import uqpen`, without its version."""
    return [name for name in dir(uqpen) if not name.startswith("_")]


def api() -> Iterator[str]:
    """Yield the page that leads to each name of `import uqpen`."""
    yield "# Names of `import uqpen`\n"
    rows = (
        (f"[`{name}`](api/{name}.rst)", first_line(getattr(uqpen, name))) for name in public_names()
    )
    yield from table(("name", "what it is"), rows)
    yield "\n```{toctree}\n:hidden:\n"
    yield from (f"api/{name}" for name in public_names())
    yield "```"


def member_page(name: str) -> Iterator[str]:
    """Yield the page of a class or a function."""
    member = getattr(uqpen, name)
    yield from (name, "=" * len(name), "")
    yield ".. currentmodule:: uqpen\n"
    yield f".. auto{'class' if inspect.isclass(member) else 'function'}:: {name}"
    # A member of a family has methods for the study that it is part of, not for its user.
    members = {
        each.rpartition(":")[2] for _, family in FAMILIES.values() for each in family.values()
    }
    if inspect.isclass(member) and name not in members:
        yield "   :members:"


def first_line(member: object) -> str:
    """Return the first line of a docstring."""
    return (inspect.getdoc(member) or "").partition("\n")[0]


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> Iterator[str]:
    """Yield the lines of a table in Markdown."""
    heads = list(heads)
    yield f"| {' | '.join(heads)} |"
    yield f"|{'---|' * len(heads)}"
    escaped = str.maketrans({"|": r"\|", "<": "&lt;"})
    for row in rows:
        yield f"| {' | '.join(cell.translate(escaped) for cell in row)} |"
