"""Study files that are right, covering every key, and ways of making them wrong."""

from __future__ import annotations

import copy
import math
import re
import tomllib
from collections.abc import Callable, Iterator, Sequence
from datetime import date, datetime, time
from pathlib import Path
from random import Random
from typing import Any

__all__ = ["RODS", "STUDIES", "damaged_bytes", "mutant", "prepare", "toml"]

Table = dict[str, Any]
Path_ = tuple[str | int, ...]

# Files that the studies name.
FILES = {
    "line.py": """\
import numpy as np
def f(a, b, c):
    return {"y": a + 2 * b - c, "z": np.exp(a / 100)}
def g(x1, x2):
    if x1 > x2 + 2:
        raise ValueError("too large")
    return {"y": x1 - x2}
""",
    "table.csv": "a [1],b [cm]\n1,2\n2,5\n3,1\n5,4\n",
    "yield.csv": "b [cm],c [kg]\n" + "".join(f"{1 + i / 7},{3 + i % 5}\n" for i in range(14)),
}

_MODEL = """\
title = "Small"
seed = 7
[model]
python = "line.py:f"
vectorized = true
[model.inputs]
a = "1"
b = "m"
c = "kg"
[model.outputs]
y = "m"
z = "1"
"""

RODS = """\
projectile_density = "17.5 g/cm^3"
projectile_yield_limit = "1.65 GPa"
projectile_length = "16 cm"
impact_velocity = "1400 m/s"
projectile_sound_speed = "3071 m/s"
target_density = "(2.5 ± 0.05) g/cm^3"
target_yield_limit = "(400 ± 40) MPa"
plasticity_radius = "(60 ± 25) mm"
crater_radius = "(17 ± 3) mm"
"""
STUDIES = {
    "laws": f"""{_MODEL}
[inputs]
a = {{ beta = {{ alpha = 2, beta = 3.5, lower = 0, upper = 4 }}, upper = 3 }}
b = {{ weibull = {{ shape = 1.5, scale = "2 cm" }}, lower = "1 mm", upper = "9 cm" }}
c = {{ triangular = {{ lower = "1 kg", mode = "2 kg", upper = "4000 g" }} }}
[constraints]
keep = ["a > 0.5 * b / '1 m'", "c ** 2 < '50 kg^2'"]
[outputs.y]
unit = "cm"
quantiles = [0.25, 0.99]
exceeds = ["1 cm", "0.2 m"]
hold = [0.9, 0.5]
[designs.mc]
kind = "monte-carlo"
runs = 40
[designs.lhs]
kind = "latin-hypercube"
runs = 30
replicates = 2
optimization = "random-cd"
""",
    "sequences": f"""{_MODEL}
[inputs]
a = {{ gumbel = {{ mean = 1, std = 0.5 }} }}
b = {{ lognormal = {{ mean = "2 cm", std = "1 mm" }} }}
c = "(3 ± 0.1) kg"
[dependence]
copula = "gaussian"
of = "ranks"
pairs = [{{ inputs = ["a", "b"], correlation = 0.6 }}]
[designs.sobol]
kind = "sobol-sequence"
runs = 32
replicates = 16
[designs.halton]
kind = "halton"
runs = 32
[designs.points]
kind = "table"
file = "points.csv"
independent = true
[published.paper]
source = "A paper"
[published.paper.y]
mean = "3 m"
std = "20 cm"
response = {{ a = 0.3, b = 0.1 }}
largest_contribution = "a"
""",
    "questions": f"""confidence_level = 0.9
{_MODEL}
[inputs]
a = {{ uniform = {{ lower = 1, upper = 2 }} }}
b = "(2 ± 0.1) cm"
c = "(3 ± 0.1) kg"
[outputs.y]
exceeds = {{ "3 cm" = {{ at_most = "20 %" }}, "4 cm" = {{}} }}
below = ["1 cm", "2 cm"]
hold_above = [0.5, 0.9]
hold_between = [0.5]
[outputs.z]
below = {{ "2" = {{ at_least = 0.5 }} }}
[joint_probabilities]
safe = ["y < 3 cm", "z < 2"]
unsafe = {{ any = ["y > 3 cm", "z > 2"], at_most = "20 %" }}
[designs.mc]
kind = "monte-carlo"
runs = 40
[designs.enough]
kind = "monte-carlo"
until = {{ y = {{ mean = "1 %", exceeds = {{ "3 cm" = 0.01 }} }} }}
at_most = 1024
""",
    "matrix": f"""{_MODEL}
[inputs]
a = {{ uniform = {{ lower = 1, upper = 2 }} }}
b = {{ log-uniform = {{ lower = "1 cm", upper = "1 m" }} }}
c = {{ gamma = {{ mean = "3 kg", std = "200 g" }} }}
[dependence]
copula = "student"
of = "kendall"
degrees = 5
inputs = ["a", "b", "c"]
matrix = [[1, 0.5, 0.2], [0.5, 1, 0.1], [0.2, 0.1, 1]]
[designs.mc]
kind = "monte-carlo"
runs = 30
""",
    "archimedean": f"""{_MODEL}
[inputs]
a = "0 ± 2"
b = {{ measured = {{ file = "yield.csv", column = "b" }} }}
c = {{ measured = {{ file = "yield.csv", column = "c [kg]", family = "normal" }}, lower = "1 kg" }}
[dependence]
copula = "clayton"
inputs = ["a", "b"]
theta = 2
[designs.mc]
kind = "monte-carlo"
runs = 30
""",
    "sensitivity": """\
seed = 1
[model]
use = "ishigami"
a = 7.0
b = 0.1
[inputs]
x1 = { uniform = { lower = -3, upper = 3 } }
x2 = { uniform = { lower = -3, upper = 3 } }
x3 = { uniform = { lower = -3, upper = 3 } }
[outputs.y]
exceeds = [3]
[designs.blocks]
kind = "saltelli"
base = 32
replicates = 16
second_order = false
[designs.morris]
kind = "morris"
trajectories = 4
levels = 4
[designs.steps]
kind = "one-at-a-time"
step = 0.01
fixed = true
[designs.grid]
kind = "full-factorial"
levels = 2
""",
    "surrogates": """\
seed = 1
[model]
use = "ishigami"
[inputs]
x1 = { uniform = { lower = 1, upper = 3 } }
x2 = { normal = { mean = 0, std = 1 }, lower = -3, upper = 3 }
x3 = 1
[outputs.y]
hold = [0.9]
[designs.training]
kind = "latin-hypercube"
runs = 40
[designs.fresh]
kind = "monte-carlo"
runs = 40
[designs.rule]
kind = "quadrature"
order = 3
grid = "tensor"
[surrogates.chaos]
kind = "polynomial-chaos"
design = "training"
check = "fresh"
order = 3
truncation = 0.9
method = "sparse"
transform = { y = "log" }
[surrogates.projected]
kind = "polynomial-chaos"
design = "rule"
method = "projection"
""",
    "several": """\
seed = 1
[models.one]
use = "ishigami"
[models.other]
use = "ishigami"
a = 6
with = { x3 = 0.5 }
[models.own]
python = "line.py:g"
inputs = { x1 = "1", x2 = "1" }
outputs = { y = "1" }
[inputs]
x1 = { uniform = { lower = -3, upper = 3 } }
x2 = "0.5 ± 0.2"
x3 = 1
[designs.mc]
kind = "monte-carlo"
runs = 20
""",
    "rods": f"""\
title = "Rods"
seed = 3
[model]
use = "walker-anderson"
tolerance = 1e-5
[inputs]
{RODS}[outputs.penetration_depth]
exceeds = ["60 cm"]
[designs.mc]
kind = "monte-carlo"
runs = 20
""",
}
# A table gives the joint law's inputs in the units of its headings.
FILES["points.csv"] = "a,b [cm],c [kg]\n" + "".join(
    f"{1 + i / 5},{2 + i % 3},{3 + i / 10}\n" for i in range(12)
)


def prepare(folder: Path) -> None:
    """Write the files that the studies name."""
    for name, text in FILES.items():
        (folder / name).write_text(text, encoding="utf-8")


def toml(table: Table) -> str:
    """A nested dict as TOML, each table under its heading."""
    return "\n".join(_lines(table, ()))


def _lines(table: Table, path: tuple[str, ...]) -> Iterator[str]:
    for key, value in table.items():
        if not (isinstance(value, dict) and len(path) < 2):
            yield f"{_text(key)} = {_value(value)}"
    for key, value in table.items():
        if isinstance(value, dict) and len(path) < 2:
            yield f"[{'.'.join(map(_text, (*path, key)))}]"
            yield from _lines(value, (*path, key))


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, dict):
        inner = ", ".join(f"{_text(key)} = {_value(each)}" for key, each in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, list):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, date | time):
        return value.isoformat()
    return repr(value)


def _text(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return (
        '"' + "".join(c if c >= " " and c != "\x7f" else f"\\u{ord(c):04x}" for c in escaped) + '"'
    )


def _nested(depth: int) -> list[Any]:
    return [_nested(depth - 1)] if depth else []


# What nobody means to write, or means for another key.
_HOSTILE: tuple[Any, ...] = (
    *(True, False, 0, 1, -1, 2, 3, 7, 100, 2**31, 2**63, 2**64, -(2**70), 10**25, 10**320),
    *(0.0, -0.0, 0.5, 1.0, 1e-9, 5e-324, 1e-300, 1e15, 1e300, 1.7976931348623157e308, -1e308),
    *(math.nan, math.inf, -math.inf, 0.9999999999999999, 1e-17),
    *("", " ", "x", "a", "b", "nan", "inf", "0", "-1", "1e400", "1e-400", "1_0", "5 m", "5 kg"),
    *("1 m", "-3 cm", "0 m", "1e308 km", "1e-320 m", "5 furlong", "1 m^99", "1 m^0.5", "m", "±"),
    *("(1 ± 0) m", "0 ± 1", "(1 ± 1e308) m", "(1e300 ± 1) kg", "(3 ± 1e-300) cm", "5 % m", "1 K"),
    *("20 degC", "1 ± 2 ± 3", "((1 ± 2)) m", "1,5 m", "5 m # x", "1 m\n", "\x00", "\x1b[31mred"),
    *("é𝒳ﬀ\u202e", "a" * 5000, "9" * 400, "../x", "/dev/zero", "/", ".", "line.py", "line.py:h"),
    *("json:loads", "os:system", "line.py:np", "nowhere:f", ":", "yield.csv", "table.csv", "x.nc"),
    *("a > b", "a > 'm'", "a >", "a ** 9999 > 1", "a ** b > 1", "a > " + "(" * 300, "a < a"),
    *("1 / 0 > a", "a / 0 > 1", "a == b", "a < b < c", "x1 > 1e999", "-" * 500 + "a > 1"),
    *("ranks", "student", "frank", "gumbel", "joe", "clayton", "gaussian", "kendall", "log"),
    *("monte-carlo", "saltelli", "morris", "quadrature", "halton", "table", "full-factorial"),
    *("one-at-a-time", "sobol-sequence", "sparse", "least-squares", "projection", "mc"),
    *("ishigami", "rigid-penetration", "walker-anderson", "lognormal", "weibull"),
    *([], [[]], [1], [math.nan], ["x"], ["a", "b"], ["a", "a"], [0.5, 0.5, 2], [[1, 2], [3]]),
    *([[1, 0.5], [0.5, 1]], [[1, math.nan], [math.nan, 1]], _nested(30), [{}], [True, None or 0]),
    *({}, {"a": 1}, {"normal": {}}, {"normal": {"mean": 0, "std": 1}}, {"": {}}, {"x": {"y": []}}),
    {"normal": {"mean": "1 m", "std": "1e-12 m"}, "lower": "1 m", "upper": "1.0000001 m"},
    {"uniform": {"lower": "-1e308 m", "upper": "1e308 m"}},
    {"uniform": {"lower": 0, "upper": 5e-324}},
    {"lognormal": {"mean": 1e-300, "std": 1e300}},
    {"gamma": {"mean": 1, "std": 1e6}},
    {"weibull": {"shape": 1e-3, "scale": "1 m"}},
    {"beta": {"alpha": 1e-300, "beta": 1e300, "lower": 0, "upper": 1}},
    {"normal": {"mean": 0, "std": 1}, "lower": 30, "upper": 31},
    {"measured": {"file": "yield.csv"}},
    {"measured": {"file": "yield.csv", "column": "b", "family": "triangular"}},
    *(date(2020, 1, 1), datetime(2020, 1, 1, 1, 1), time(1, 1)),
)

_NAMES = (
    *("", "a", "y", "run", "status", "input", "x", "x1", "seed", "kind", "mean", "lower", "file"),
    *("with space", "é", "a.b", "a/b", "_", "1", "__class__", "y_mean", "\x00", "a" * 300, "mc"),
    *("comparison", "moments", "..", "design", "class", "lambda", "measured", "normal", "models"),
    *("y_quantile", "bound", "lost_run", "source", "python", "use", "with", "outputs", "keep"),
)


def mutant(random: Random) -> str:
    """A study with some mistakes, as a text."""
    table = tomllib.loads(STUDIES[random.choice(sorted(STUDIES))])
    # Every other study is changed in its numbers only, to get beyond what is refused at once.
    changes = random.choice((_CHANGES, (_vary,)))
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        random.choice(changes)(table, random)
    return toml(table)


def _places(value: Any, path: Path_ = ()) -> Iterator[Path_]:
    """The paths of everything inside a value."""
    parts = value.items() if isinstance(value, dict) else ()
    parts = enumerate(value) if isinstance(value, list) else parts
    for key, inner in parts:
        yield (*path, key)
        yield from _places(inner, (*path, key))


def _chosen(table: Table, random: Random) -> tuple[Any, Any]:
    """A place at random: what it is in, and its key there."""
    *outer, key = random.choice(list(_places(table)) or [("x",)])
    return _at_path(table, outer), key


def _replace(table: Table, random: Random) -> None:
    inside, key = _chosen(table, random)
    inside[key] = copy.deepcopy(random.choice(_HOSTILE))


def _replace_alike(table: Table, random: Random) -> None:
    """A value of the same type, which gets further than others."""
    inside, key = _chosen(table, random)
    old = inside[key] if isinstance(inside, list) or key in inside else None
    if isinstance(old, int | float) and not isinstance(old, bool):
        alike = [each for each in _HOSTILE if type(each) in (int, float)]
        inside[key] = random.choice([*alike, old * 10, -old, old / 1000])
    elif isinstance(old, str):
        number, _, unit = old.partition(" ")
        alike = [each for each in _HOSTILE if isinstance(each, str)]
        numbers = ("0", "-1", "1e-300", "1e300", "1e9", "1e-9", "nan", number)
        units = ("m", "cm", "kg", "K", "degC", "%", "1", "m m-1", "MPa", unit)
        quantity = f"{random.choice(numbers)} {random.choice(units)}"
        inside[key] = random.choice([random.choice(alike), quantity])
    else:
        _replace(table, random)


def _vary(table: Table, random: Random) -> None:
    """Another number in place of one, its unit as it was."""
    numbers = [path for path in _places(table) if _NUMBER.match(str(_at_path(table, path)))]
    *outer, key = random.choice(numbers or [("seed",)])
    inside = _at_path(table, outer)
    old = inside.get(key, 0) if isinstance(inside, dict) else inside[key]
    if isinstance(old, str):
        inside[key] = _NUMBER.sub(lambda found: _varied(float(found[0]), random), old, count=1)
    elif isinstance(old, int):
        inside[key] = random.choice((0, 1, 2, 3, 5, 16, old - 1, old + 1, 2 * old, old // 2))
    elif isinstance(old, float):
        inside[key] = float(_varied(old, random))


_NUMBER = re.compile(r"(?<![\w.])-?[0-9]+(?:\.[0-9]+)?(?:e-?[0-9]+)?(?!\w)")


def _varied(number: float, random: Random) -> str:
    factors = (0, -1, 1e-30, 1e-12, 1e-3, 0.1, 0.5, 0.9, 1.0001, 1.1, 2, 10, 1e3, 1e12, 1e30, 1e200)
    return repr(number * random.choice(factors) + random.choice((0, 0, 0, 1, -1, 1e-9)))


def _at_path(table: Table, path: Sequence[str | int]) -> Any:
    inside: Any = table
    for key in path:
        inside = inside[key]
    return inside


def _delete(table: Table, random: Random) -> None:
    inside, key = _chosen(table, random)
    if isinstance(inside, list) or key in inside:
        del inside[key]


def _rename(table: Table, random: Random) -> None:
    inside, key = _chosen(table, random)
    if isinstance(inside, dict) and key in inside:
        inside[random.choice(_NAMES)] = inside.pop(key)


def _add(table: Table, random: Random) -> None:
    inside, _ = _chosen(table, random)
    if isinstance(inside, dict):
        inside[random.choice(_NAMES)] = copy.deepcopy(random.choice(_HOSTILE))
    else:
        inside.append(copy.deepcopy(random.choice(_HOSTILE)))


def _move(table: Table, random: Random) -> None:
    """What stands in one place put into another as well."""
    source, key = _chosen(table, random)
    value = source[key] if isinstance(source, list) or key in source else {}
    target, other = _chosen(table, random)
    target[other] = copy.deepcopy(value)


def _borrow(table: Table, random: Random) -> None:
    """A table of another study in place of, or beside, this one's."""
    other = tomllib.loads(STUDIES[random.choice(sorted(STUDIES))])
    key = random.choice(sorted(other))
    table[key] = other[key]


_CHANGES: tuple[Callable[[Table, Random], None], ...] = (
    *(_replace, _replace, _replace_alike, _replace_alike, _replace_alike),
    *(_delete, _rename, _add, _move, _borrow),
)


def damaged_bytes(random: Random) -> bytes:
    """A study whose file has been damaged, byte by byte or line by line."""
    data = bytearray(STUDIES[random.choice(sorted(STUDIES))].encode())
    for _ in range(random.choice((1, 1, 2, 5))):
        data = random.choice(_DAMAGES)(data, random)
    return bytes(data)


def _at(data: bytearray, random: Random) -> int:
    return random.randint(0, len(data))


def _truncated(data: bytearray, random: Random) -> bytearray:
    return data[: _at(data, random)]


def _flipped(data: bytearray, random: Random) -> bytearray:
    if data:
        data[random.randrange(len(data))] ^= 1 << random.randrange(8)
    return data


_PIECES = (
    *(b"\x00", b"\x1b", b"\x7f", b"\xff", b"\xc3", b"\xed\xa0\x80", b"\xef\xbb\xbf", b"\r"),
    *(b"\r\n", b"\n", b'"', b"'", b'"""', b"[", b"]]", b"{", b"=", b".", b"#", b"\\u0000"),
    *(b"\\ud800", b"\xe2\x80\xa8", b"\x85", b"\x0c", b"\x0b", b"\t", b"1e", b"0x", b"_"),
    *(b"inf", b"nan", b"[" * 3000, b"a." * 3000, b"{a=" * 2000, b"9" * 5000),
    *(b"= 0x" + b"f" * 5000 + b"\n", b"x" * 100_000, b"\n[[models]]\n"),
    *(b"\n[model]\n", b"\nseed = 1\n", b"= 1\n", b"a = [" + b"[1]," * 500 + b"]\n"),
)


def _with_piece(data: bytearray, random: Random) -> bytearray:
    at = _at(data, random)
    return data[:at] + random.choice(_PIECES) + data[at:]


def _with_lines_changed(data: bytearray, random: Random) -> bytearray:
    lines = bytes(data).split(b"\n")
    first, second = (random.randrange(len(lines)) for _ in range(2))
    lines[first], lines[second] = random.choice(
        ((lines[second], lines[first]), (lines[second], lines[second]), (b"", lines[second]))
    )
    return bytearray(random.choice((b"\n", b"\n", b"\n", b"\r\n", b"\r")).join(lines))


_DAMAGES: tuple[Callable[[bytearray, Random], bytearray], ...] = (
    *(_truncated, _flipped, _flipped, _with_piece, _with_piece, _with_lines_changed),
)
