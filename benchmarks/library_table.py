"""The same problem by chaospy alone, by SALib alone, and by uqpen with both: a table.

`python benchmarks/library_table.py` writes it into docs/libraries.md. The three texts stand in
benchmarks/libraries. The exact answers are those of Ishigami's function.
"""

from __future__ import annotations

import math
import runpy
from pathlib import Path

from seed_table import fill, lines

from uqpen.archive.estimates import unpack
from uqpen.study.load import load_study
from uqpen.workflow import run

HERE = Path(__file__).parent / "libraries"
PAGE = Path(__file__).parents[1] / "docs" / "libraries.md"
_NAMES = ("x1", "x2", "x3")
# Variance 1/2 + 49/8 + π⁴/50 + π⁸/1800.
_VARIANCE = 0.5 + 49 / 8 + math.pi**4 / 50 + math.pi**8 / 1800
_FIRST = (0.5 * (1 + math.pi**4 / 50) ** 2 / _VARIANCE, 49 / 8 / _VARIANCE, 0.0)
EXACT = {"mean": 3.5, "std": math.sqrt(_VARIANCE)} | {
    f"first order of {name}": value for name, value in zip(_NAMES, _FIRST, strict=True)
}
FIGURES = (*EXACT, *(f"PAWN of {name}" for name in _NAMES))
Found = dict[str, tuple[float, float, float]]


def by_script(name: str) -> Found:
    """Return what a script has found, with its error bars."""
    made = runpy.run_path(str(HERE / name))
    bars = made.get("bars", {})
    half = {key: float(bars.get(key, math.nan)) for key in made["found"]}
    return {
        key: (float(value), float(value) - half[key], float(value) + half[key])
        for key, value in made["found"].items()
    }


def by_uqpen() -> Found:
    """Return the same figures of a study: moments by the surrogate, corrected by its runs."""
    archive = run(load_study(HERE / "with_uqpen.toml"))
    surrogate, design = (archive[f"statistics/{name}/y"].dataset for name in ("pce", "mc"))
    found = {name: tuple(unpack(surrogate, name).values.tolist()) for name in ("mean", "std")}
    for name in _NAMES:
        at = {"input": name}
        found[f"first order of {name}"] = tuple(surrogate["first_order"].sel(at).values.tolist())
        found[f"PAWN of {name}"] = tuple(design["salib_pawn"].sel(at).values.tolist())
    return found


def _lines(name: str) -> int:
    written = (HERE / name).read_text(encoding="utf-8").splitlines()
    return sum(bool(line.strip()) and not line.startswith('"""') for line in written)


def _cell(found: Found, figure: str) -> str:
    if figure not in found:
        return "–"
    value, lower, upper = found[figure]
    return f"{value:.2f}" + (f" ({lower:.2f} to {upper:.2f})" if math.isfinite(lower) else "")


def table(columns: dict[str, tuple[int, Found]]) -> str:
    """Return the table: the lines of each text, its figures, and its error bars."""
    rows = [["lines", "", *(count for count, _ in columns.values())]]
    for figure in FIGURES:
        exact = f"{EXACT[figure]:.2f}" if figure in EXACT else "–"
        rows.append([figure, exact, *(_cell(found, figure) for _, found in columns.values())])
    bars = [sum(math.isfinite(each[1]) for each in found.values()) for _, found in columns.values()]
    rows.append(["figures with an error bar", "", *bars])
    return "\n".join(lines(["", "exact", *columns], rows))


def measured() -> dict[str, tuple[int, Found]]:
    """Run all three."""
    return {
        "chaospy alone": (_lines("with_chaospy.py"), by_script("with_chaospy.py")),
        "SALib alone": (_lines("with_salib.py"), by_script("with_salib.py")),
        "uqpen with both": (_lines("with_uqpen.toml"), by_uqpen()),
    }


if __name__ == "__main__":
    fill(PAGE, "comparison", table(measured()))
