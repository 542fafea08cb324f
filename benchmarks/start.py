"""What commands cost before and after the work itself, as ratios to an earlier commit.

Each command is run in a fresh process, by turns with the base commit and with this checkout.
The processor times and their ratio are printed, as medians with their ranges over the repeats: the
ratios hold on a busy machine, too, the times do not. Both sides read the same archives, which the
base makes: the concrete study's, and one of many outputs.

    python benchmarks/start.py --base main
    python benchmarks/start.py --base main --without dask --only study --repeats 15

Where Dask is installed, xarray loads it with every command. A plain installation has none, which
``--without dask`` stands for.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]

# The command line, without packages that a plain installation lacks.
_COMMAND = "from uqpen.__main__ import main; main()"
_OPEN = "import uqpen; uqpen.open_archive(sys.argv[1])"

_FUNCTION = """\
def simulate(a, b, c, d):
    return {{f"y{{k}}": a * (k % 7) + b * c * k + d for k in range({outputs})}}
"""
_WIDE = """\
title = "{outputs} outputs"
seed = 1
[model]
python = "wide.py:simulate"
inputs = {{ a = "1", b = "1", c = "1", d = "1" }}
outputs = {{ {names} }}
vectorized = true
[inputs]
a = "0 ± 1"
b = "0 ± 1"
c = "0 ± 1"
d = "0 ± 1"
[designs.plain]
kind = "monte-carlo"
runs = 1_000
"""


class Case(NamedTuple):
    """What is measured: its name, the code that a process runs, and its arguments."""

    name: str
    code: str
    arguments: tuple[str, ...]


CASES = (
    Case("help", _COMMAND, ("--help",)),
    Case("check", _COMMAND, ("check", "plain.toml")),
    Case("study", _COMMAND, ("study", "plain.toml", "-o", "made.nc", "--fresh")),
    Case("open", _OPEN, ("concrete.nc",)),
    Case("show", _COMMAND, ("show", "concrete.nc")),
    Case("report", _COMMAND, ("report", "concrete.nc", "-o", "page.html")),
    Case("show-wide", _COMMAND, ("show", "wide.nc")),
    Case("report-wide", _COMMAND, ("report", "wide.nc", "-o", "page.html")),
)


class Side(NamedTuple):
    """A checkout, the folder that its processes run in, and the packages that they lack."""

    checkout: Path
    folder: Path
    without: Sequence[str]

    def seconds(self, code: str, arguments: Sequence[str]) -> float:
        """Run code in a fresh process, and return the processor time that it took."""
        hidden = f"import sys; sys.modules.update(dict.fromkeys({list(self.without)!r}))\n"
        before = children_seconds()
        subprocess.run(
            [sys.executable, "-c", hidden + code, *arguments],
            cwd=self.folder,
            env={
                **os.environ,
                "PYTHONPATH": str(self.checkout),
                "PYTHONDONTWRITEBYTECODE": "",  # as installed packages are compiled
                "OMP_NUM_THREADS": "1",
                "OPENBLAS_NUM_THREADS": "1",
            },
            capture_output=True,
            check=True,
        )
        return children_seconds() - before


def main() -> None:
    """Measure what is asked, and print a line for each."""
    arguments = _arguments()
    cases = [case for case in CASES if not arguments.only or case.name in arguments.only]
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        with checkout_of(arguments.base, folder) as base:
            sides = [Side(each, folder, arguments.without) for each in (base, ROOT)]
            _prepare(sides[0], {name for case in cases for name in case.arguments}, arguments)
            for case in cases:
                for side in sides:  # the first time, modules and models are compiled
                    side.seconds(case.code, case.arguments)
                pairs = [
                    [side.seconds(case.code, case.arguments) for side in sides]
                    for _ in range(arguments.repeats)
                ]
                _print_ratios(case.name, pairs)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--base", metavar="COMMIT", required=True)
    parser.add_argument("--only", action="append", choices=[case.name for case in CASES])
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--outputs", type=int, default=300, help="of the wide archive")
    parser.add_argument("--without", metavar="PACKAGE", action="append", default=[])
    return parser.parse_args()


def _prepare(base: Side, names: set[str], arguments: argparse.Namespace) -> None:
    """Write the studies, and make the archives that the cases read."""
    outputs, folder = arguments.outputs, base.folder
    for study in (ROOT / "benchmarks" / "plain.toml", ROOT / "studies" / "concrete.toml"):
        (folder / study.name).write_bytes(study.read_bytes())
    (folder / "wide.py").write_text(_FUNCTION.format(outputs=outputs), encoding="utf-8")
    listed = ", ".join(f'y{number} = "1"' for number in range(outputs))
    wide = _WIDE.format(outputs=outputs, names=listed)
    (folder / "wide.toml").write_text(wide, encoding="utf-8")
    for name in ("concrete", "wide"):
        if f"{name}.nc" in names:
            base.seconds(_COMMAND, ("study", f"{name}.toml", "-o", f"{name}.nc"))


def _print_ratios(name: str, pairs: Sequence[Sequence[float]]) -> None:
    columns = [[pair[0] for pair in pairs], [pair[1] for pair in pairs]]
    told = [f"{statistics.median(column):6.2f} s" for column in columns]
    ratios = sorted(new / old for old, new in pairs)
    print(
        f"{name:12} base {told[0]}, here {told[1]}, ratio {statistics.median(ratios):.2f} "
        f"({ratios[0]:.2f} to {ratios[-1]:.2f})",
        flush=True,
    )


def children_seconds() -> float:
    """Return the processor time of all processes that were started and have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@contextmanager
def checkout_of(commit: str, folder: Path) -> Iterator[Path]:
    """Check a commit out below a folder, and remove it in the end."""
    git, base = ["git", "-C", str(ROOT), "worktree"], str(folder / "base")
    subprocess.run([*git, "add", "--quiet", "--detach", base, commit], check=True)
    try:
        yield Path(base)
    finally:
        subprocess.run([*git, "remove", "--force", base], check=True)


if __name__ == "__main__":
    main()
