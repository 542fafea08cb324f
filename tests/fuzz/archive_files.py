"""Small archives, and ways of damaging them."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import netCDF4
import numpy as np
from study_texts import RODS

import uqpen
from uqpen.archive.provenance import SCHEMA
from uqpen.archive.read import read_tree
from uqpen.benchmark.compare import compare
from uqpen.benchmark.methods import BenchmarkSettings
from uqpen.core.errors import ArchiveError

__all__ = [
    "foreign_files",
    "hashed_anew",
    "make_archives",
    "with_bytes_damaged",
    "with_parts_changed",
]

_INPUTS = """
[inputs]
x1 = { uniform = { lower = -3, upper = 3 } }
x2 = { uniform = { lower = -3, upper = 3 } }
x3 = 1
[outputs.y]
exceeds = [3]
hold = [0.95]
[designs.monte_carlo]
kind = "monte-carlo"
runs = 30
"""
_OWN = """\
seed = 1
[model]
python = "own.py:f"
[model.inputs]
x = "1"
[model.outputs]
y = "cm"
[inputs]
x = "0 ± 1"
[designs.some]
kind = "monte-carlo"
runs = 20
"""
# Leaves a trace wherever it is executed.
TRAP = """\
import pathlib
pathlib.Path("executed").touch()
def f(x):
    if x > {limit}:
        raise ValueError("too large")
    return {{"y": x**3}}
"""

_STUDIES = {
    "plain": f"""\
title = "Small"
seed = 1
[model]
use = "ishigami"
{_INPUTS}
[designs.blocks]
kind = "saltelli"
base = 32
second_order = true
[designs.steps]
kind = "one-at-a-time"
[published.paper]
source = "A paper"
y = {{ mean = 3, response = {{ x1 = 0.2 }}, largest_contribution = "x1" }}
""",
    "several": f"""\
seed = 1
[models.one]
use = "ishigami"
[models.other]
use = "ishigami"
with = {{ x3 = 0.5 }}
{_INPUTS}
""",
    "surrogate": f"""\
seed = 1
[model]
use = "ishigami"
{_INPUTS}
[designs.training]
kind = "latin-hypercube"
runs = 30
[surrogates.chaos]
kind = "polynomial-chaos"
design = "training"
""",
    "own": _OWN,
    "lost": f"{_OWN}[failures]\nstop_after = 0\n",
    "rods": f"""\
seed = 3
[model]
use = "walker-anderson"
[inputs]
{RODS}[designs.mc]
kind = "monte-carlo"
runs = 20
""",
}


def make_archives(folder: Path) -> list[Path]:
    """Archives of every kind, and the file that they name."""
    made = []
    for name, text in _STUDIES.items():
        (folder / "own.py").write_text(TRAP.format(limit=-9 if name == "lost" else 1))
        study = uqpen.parse_study(text, name=name, folder=folder)
        made.append(folder / f"{name}.nc")
        uqpen.write(uqpen.run(study), made[-1])
    terms = BenchmarkSettings(budgets=(16, 32), repeats=10, reference=64)
    contest = compare(uqpen.parse_study(_STUDIES["plain"], folder=folder), terms)
    made.append(folder / "contest.nc")
    uqpen.write(contest, made[-1])
    return made


def with_bytes_damaged(data: bytes, random: Random) -> bytes:
    """A file as a bad disk or a broken transfer leaves it."""
    damaged = bytearray(data)
    for _ in range(random.choice((1, 1, 2, 10))):
        start = random.randrange(len(damaged) or 1)
        # What describes the file stands at its beginning, as a rule.
        start = random.choice((start, start, min(start, 2048)))
        match random.randrange(6):
            case 0:
                damaged = damaged[:start]
            case 1:
                length = random.choice((1, 8, 512, 4096))
                damaged[start : start + length] = bytes(len(damaged[start : start + length]))
            case 2:
                damaged[start : start + 8] = random.choice((b"\xff" * 8, b"\x80" + bytes(7)))
            case 3:
                other = random.randrange(len(damaged) or 1)
                damaged[start : start + 64] = damaged[other : other + 64]
            case _:
                if damaged:
                    damaged[min(start, len(damaged) - 1)] ^= 1 << random.randrange(8)
    return bytes(damaged)


_TEXTS = (
    *("", " ", "x", "nan", "0", "-1", "1", "monte_carlo", "y", "x1", "median", "stratified", "m^^"),
    *("independent", "rule", "steps", "trajectories", "head-to-head", "1e999"),
    *(
        "9" * 500,
        "furlong",
        "a" * 5000,
        "\x1b[31mred",
        "é𝒳\u202e",
        "%s {0} {x.__class__}",
        "[bold]x[/nope]",
        "..",
        "y\ny",
    ),
)
_NUMBERS = (
    *(0, 1, -1, 2, 99, 2**31 - 1, -(2**31), 2**62, 0.5, math.nan, math.inf),
    *(-1e308, 1.7e308, 5e-324),
)
_NAMES = (
    *("x", "y", "mean", "mean_interval", "run", "status", "bound", "input", "quantile", "a b", "é"),
    *("models", "runs", "statistics", "a" * 200, "monte_carlo", "lost_run", "lost_reason"),
    *("interval_label", "note"),
)


def hostile_texts(random: Random) -> str:
    """A study that names code, or asks for what nobody has."""
    text = _STUDIES[random.choice(sorted(_STUDIES))]
    changes = (
        ('use = "ishigami"', 'python = "trap.py:f"\ninputs = {x = "1"}\noutputs = {y = "1"}'),
        ("seed = 1", f"seed = {10**300}"),
        ("runs = 30", "runs = 29"),
        ("lower = -3", "lower = -1e308"),
        ("monte_carlo", "mc"),
        ('"own.py:f"', '"trap:f"'),
        ('"own.py:f"', '"os:system"'),
        ("x3 = 1", 'x3 = { measured = { file = "/etc/passwd" } }'),
        ("x3 = 1", "x3 = nan"),
        ('"monte-carlo"', '"latin-hypercube"'),
        ("[", "[["),
        ("exceeds = [3]", "exceeds = [3, 4]"),
        ("hold = [0.95]", ""),
        ("y", "q"),
    )
    return text.replace(*random.choice(changes))


def with_parts_changed(path: Path, random: Random) -> None:
    """Change a NetCDF file in place, as a careless or malicious hand might."""
    # The library may refuse, only on closing, what it has taken before; the file is then as broken.
    with contextlib.suppress(RuntimeError), netCDF4.Dataset(path, "a") as root:
        root.set_auto_maskandscale(False)
        for _ in range(random.choice((1, 1, 2, 4))):
            groups = list(_groups(root))
            random.choice(_CHANGES)(random.choice([root, *groups, *groups]), random)


def hashed_anew(path: Path) -> None:
    """Give a changed archive right hashes and a right checksum, as a malicious hand might."""
    with contextlib.suppress(ArchiveError):
        uqpen.write(read_tree(path), path)


def _groups(group: Any) -> Iterator[Any]:
    for inner in group.groups.values():
        yield inner
        yield from _groups(inner)


def _owner(group: Any, random: Random) -> Any:
    """The group, or a variable of it."""
    return random.choice([group, *group.variables.values()])


def _drop_attribute(group: Any, random: Random) -> None:
    owner = _owner(group, random)
    if names := owner.ncattrs():
        _refused_or(lambda: owner.delncattr(random.choice(names)))


def _set_attribute(group: Any, random: Random) -> None:
    owner = _owner(group, random)
    names = [*owner.ncattrs(), *owner.ncattrs(), *_NAMES, "units", "coordinates", "uqpen_kind"]
    if owner is group and "study_text" in names and random.random() < 0.5:
        owner.setncattr("study_text", hostile_texts(random))
        return
    name = random.choice(
        [*names, "_FillValue", "flag_meanings", "flag_note", "interval_label", "role"]
    )
    value: Any = random.choice((*_TEXTS, *_NUMBERS))
    match random.randrange(5):
        case 0:
            value = np.array(random.choices(_NUMBERS[:7], k=random.choice((0, 1, 3))))
        case 1:
            value = random.choices(_TEXTS, k=3)
    _refused_or(lambda: owner.setncattr(name, value))


def _rename_attribute(group: Any, random: Random) -> None:
    owner = _owner(group, random)
    if names := owner.ncattrs():
        _refused_or(lambda: owner.renameAttribute(random.choice(names), random.choice(_NAMES)))


def _rename(group: Any, random: Random) -> None:
    match random.randrange(3):
        case 0 if group.variables:
            old = random.choice(list(group.variables))
            _refused_or(lambda: group.renameVariable(old, random.choice(_NAMES)))
        case 1 if group.dimensions:
            old = random.choice(list(group.dimensions))
            _refused_or(lambda: group.renameDimension(old, random.choice(_NAMES)))
        case 2 if group.groups:
            old = random.choice(list(group.groups))
            _refused_or(lambda: group.renameGroup(old, random.choice(_NAMES)))


def _set_values(group: Any, random: Random) -> None:
    if not group.variables:
        return
    variable = random.choice(list(group.variables.values()))
    if not variable.size:
        return
    if variable.dtype is str:
        value: Any = random.choice(_TEXTS)
    elif variable.dtype.kind == "f":
        value = random.choice(_NUMBERS)
    else:
        value = random.choice((0, 1, -1, 2, 7, 99, -128, 127))
    at = tuple(random.randrange(size) for size in variable.shape)
    everywhere = random.random() < 0.5 or not at
    _refused_or(lambda: variable.__setitem__(slice(None) if everywhere else at, value))


def _add(group: Any, random: Random) -> None:
    """A group, a dimension or a variable by a name that may mean something, of another type."""
    siblings = [*group.groups, *group.variables, *_NAMES]
    name = random.choice(siblings)
    match random.randrange(3):
        case 0:
            _refused_or(lambda: group.createGroup(name))
        case 1:
            _refused_or(lambda: group.createDimension(name, random.choice((0, 1, 3))))
        case 2:
            dimensions = [*group.dimensions, None]
            along = random.choice(dimensions)
            kind = random.choice((str, "f8", "i1", "i8", "u2", "S1"))
            _refused_or(lambda: group.createVariable(name, kind, (along,) if along else ()))


def _retype(group: Any, random: Random) -> None:
    """A variable in place of another, by its name but of another type or shape."""
    if not group.variables:
        return
    name = random.choice(list(group.variables))
    old = group.variables[name]
    attributes = {key: old.getncattr(key) for key in old.ncattrs() if key != "_FillValue"}
    dimensions = list(old.dimensions)
    match random.randrange(3):
        case 0:
            dimensions = dimensions[1:]
        case 1:
            dimensions = dimensions[::-1]
        case 2 if group.dimensions:
            dimensions = [random.choice(list(group.dimensions))]
    kind = random.choice((str, "f8", "f4", "i1", "i8", "u2", old.dtype, old.dtype))

    def change() -> None:
        group.renameVariable(name, "formerly")
        new = group.createVariable(name, kind, dimensions)
        new.setncatts(attributes)
        if kind is not str:
            new[...] = random.choice((0, 1, 3))

    _refused_or(change)


def _refused_or(change: Callable[[], object]) -> None:
    """Make a change, unless the library refuses it."""
    try:
        change()
    except (RuntimeError, ValueError, TypeError, AttributeError, KeyError, OverflowError, OSError):
        return
    except IndexError:
        return


_CHANGES: tuple[Callable[[Any, Random], None], ...] = (
    *(_drop_attribute, _drop_attribute, _set_attribute, _set_attribute, _rename_attribute),
    *(_rename, _set_values, _set_values, _add, _retype),
)


def foreign_files(folder: Path) -> Iterator[Path]:
    """Files that are no archives, of every kind that a NetCDF library opens, or nearly opens."""
    contents = {
        "empty.nc": b"",
        "text.nc": "Größe\n".encode(),
        "hdf5_head.nc": b"\x89HDF\r\n\x1a\n",
        "netcdf3_head.nc": b"CDF\x01",
        "pickle.nc": b"\x80\x04.",
        "url.nc": b"http://localhost/",
    }
    for name, data in contents.items():
        (folder / name).write_bytes(data)
        yield folder / name
    for kind in ("NETCDF3_CLASSIC", "NETCDF3_64BIT_DATA", "NETCDF4_CLASSIC", "NETCDF4"):
        for schema in (None, SCHEMA, "1", SCHEMA + 1, 1.0, [1, 2], -1):
            path = folder / f"{kind}_{schema!r}.nc"
            with netCDF4.Dataset(path, "w", format=kind) as dataset:
                dataset.createDimension("x", 2)
                dataset.createVariable("y", "f8", ("x",))[:] = 1
                if schema is not None:
                    dataset.setncattr("uqpen_schema", schema)
            yield path
