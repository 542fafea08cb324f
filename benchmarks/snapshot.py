"""Everything that is shown of six archives, before and after a change of the code.

`make FOLDER` runs six studies and writes what the terminal, the JSON, the long table, the page and
the figures show of each. `compare BEFORE AFTER` lists the differences: archives and tables to the
byte, JSON as parsed, pages and figures line by line. Code of another commit is captured by its
folder in PYTHONPATH:

    PYTHONPATH=../before python benchmarks/snapshot.py make before
    python benchmarks/snapshot.py make after
    python benchmarks/snapshot.py compare before after
"""

from __future__ import annotations

import argparse
import difflib
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

STUDIES = Path(__file__).parents[1] / "studies"

FAILURES = """\
title = "Ishigami function with failed runs"
seed = 2
[model]
python = "model.py:ishigami"
inputs = { a = "1", b = "1", c = "1" }
outputs = { y = "m" }
[inputs]
a = { uniform = { lower = -3.14, upper = 3.14 } }
b = { uniform = { lower = -3.14, upper = 3.14 } }
c = { uniform = { lower = -3.14, upper = 3.14 } }
[outputs.y]
exceeds = { "5 m" = {}, "9 m" = { at_most = "10 %" } }
below = ["0 m"]
hold = [0.95]
expected_shortfall = [0.95]
return_periods = [100]
[designs.monte_carlo]
kind = "monte-carlo"
runs = 2_000
[designs.hypercubes]
kind = "latin-hypercube"
runs = 1_000
replicates = 10
[designs.sobol]
kind = "saltelli"
base = 256
[designs.rare]
kind = "subset-simulation"
event = "y > 14 m"
samples = 200
[surrogates.chaos]
kind = "polynomial-chaos"
design = "monte_carlo"
order = 5
"""

DEPENDENT = """\
title = "A cooler with dependent inputs"
seed = 3
[model]
python = "model.py:cooler"
inputs = { air = "degC", flow = "kg/s", load = "W" }
outputs = { water = "degC" }
[inputs]
air = { normal = { mean = "25 degC", std = "4 degC" } }
flow = { lognormal = { mean = "0.5 kg/s", std = "0.05 kg/s" } }
load = { gumbel = { mean = "12 kW", std = "1 kW" } }
[dependence]
copula = "gaussian"
of = "ranks"
pairs = [{ inputs = ["air", "load"], correlation = 0.6 }]
[outputs.water]
unit = "degC"
exceeds = ["40 degC"]
[designs.monte_carlo]
kind = "monte-carlo"
runs = 2_000
[designs.training]
kind = "latin-hypercube"
runs = 200
replicates = 1
[surrogates.process]
kind = "gaussian-process"
design = "training"
"""

FIELDS = """\
title = "A decay along time"
seed = 4
[model]
python = "model.py:decay"
inputs = { a = "m", k = "1/s" }
[model.outputs]
total = "m"
y = { unit = "m", along = { time = { unit = "s", from = 0, to = 4, size = 41 } } }
[inputs]
a = "(2 ± 0.2) m"
k = { uniform = { lower = "0.5 s-1", upper = "1.5 s-1" } }
[designs.monte_carlo]
kind = "monte-carlo"
runs = 1_000
[designs.sobol]
kind = "saltelli"
base = 128
[surrogates.chaos]
kind = "polynomial-chaos"
design = "monte_carlo"
order = 4
"""

MODEL = """\
import numpy as np

def ishigami(a, b, c):
    if a > 3:
        raise ValueError("a is too large")
    return {"y": np.sin(a) + 7 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a)}

def cooler(air, flow, load):
    return {"water": air + load / (4186 * flow) * 2}

def decay(a, k):
    time = np.linspace(0, 4, 41)
    y = a * np.exp(-k * time)
    return {"y": y, "total": float(y.sum() * 0.1)}
"""

COMPARISON = ["--budget", "128,256,512", "--repeats", "10", "--reference", "16384"]

# The identifiers of clip paths are hashes of their figures' own; the date is that of the drawing.
_OWN = re.compile(r"clip\w{10,}|\bp[0-9a-f]{10}\b|<dc:date>[^<]*</dc:date>")


def uqpen(folder: Path, *arguments: str) -> str:
    line = [sys.executable, "-m", "uqpen", *arguments]
    done = subprocess.run(line, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 3):
        sys.exit(f"{' '.join(line)}\n{done.stdout}{done.stderr}")
    return done.stdout


def make(folder: Path) -> None:
    folder.mkdir(parents=True)
    (folder / "model.py").write_text(MODEL)
    texts = {"failures": FAILURES, "dependent": DEPENDENT, "fields": FIELDS}
    texts |= {name: (STUDIES / f"{name}.toml").read_text() for name in ("concrete", "rods")}
    texts["budgets"] = (STUDIES / "ishigami.toml").read_text()
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text)
        command = ["compare", *COMPARISON] if name == "budgets" else ["study"]
        archive = f"{name}.nc"
        print(name, flush=True)
        uqpen(folder, *command, f"{name}.toml", "-o", archive, "-q")
        (folder / f"{name}.txt").write_text(uqpen(folder, "show", archive, "--all"))
        (folder / f"{name}.json").write_text(uqpen(folder, "show", archive, "--json"))
        (folder / f"{name}.check.txt").write_text(uqpen(folder, "check", f"{name}.toml"))
        uqpen(folder, "report", archive, "-o", f"{name}.html")
        if name != "budgets":
            uqpen(folder, "export", archive, "-o", f"{name}.csv")
        for figure in re.findall(
            r"^ *([a-z_-]+)\b", uqpen(folder, "figure", archive), re.MULTILINE
        ):
            uqpen(folder, "figure", archive, figure, "-o", f"{name}.{figure}.svg")


def lines_of(path: Path) -> list[str]:
    """Return a text in short lines, without what differs from one drawing to the next."""
    text = _OWN.sub("…", path.read_text(encoding="utf-8"))
    return re.sub(r"(>)(?=<)|([,;}])(?=[\"{.#\w])", r"\1\2\n", text).splitlines()


def differences(before: Path, after: Path) -> Iterator[str]:
    if before.suffix == ".json":
        if json.loads(before.read_text()) == json.loads(after.read_text()):
            return
    elif before.read_bytes() == after.read_bytes():
        return
    if before.suffix == ".nc":
        yield "their bytes"
    else:
        found = difflib.unified_diff(lines_of(before), lines_of(after), n=0, lineterm="")
        yield from (line for line in found if not line.startswith(("---", "+++", "@@")))


def compare(before: Path, after: Path, shown: int) -> int:
    kinds = (".nc", ".txt", ".json", ".csv", ".html", ".svg")
    names = sorted({each.name for folder in (before, after) for each in folder.iterdir()})
    differing = 0
    for name in (each for each in names if each.endswith(kinds)):
        if not ((before / name).exists() and (after / name).exists()):
            found = ["only in one of the folders"]
        else:
            found = list(differences(before / name, after / name))
        differing += bool(found)
        if found:
            print(f"{name}: {len(found)} lines differ")
            print(*(f"    {line[:200]}" for line in found[:shown]), sep="\n")
    print(f"{differing} of {len(names)} files differ")
    return int(differing > 0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("make").add_argument("folder", type=Path)
    comparison = commands.add_parser("compare")
    comparison.add_argument("before", type=Path)
    comparison.add_argument("after", type=Path)
    comparison.add_argument("--lines", type=int, default=20, help="shown of each file")
    given = parser.parse_args()
    if given.command == "make":
        make(given.folder)
    else:
        sys.exit(compare(given.before, given.after, given.lines))


if __name__ == "__main__":
    main()
