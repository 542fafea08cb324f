"""uqpen beside its peers: the same work in one run, by turns, with accuracy beside speed.

    python benchmarks/peers.py --markdown docs/performance.md

Each package of ``peers.txt`` gets a virtual environment in the folder ``--environments``, which is
kept for the next time. uqpen and a plain loop with NumPy run in the interpreter of this script. One
that cannot be installed is named as missing. A task is a process of its own, so start-up is in
every figure; its processor time is measured, with one thread each. Tasks are in ``peers/``.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import signal
import subprocess
import sys
import tempfile
import venv
from collections.abc import Iterator, Mapping
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).with_name("peers")))

import shared
from seed_table import counted, fill
from start import children_seconds

HERE = Path(__file__).resolve().parent
OURS = "uqpen"
# What a package needs beside what it declares. chaospy has its sparse regressions
# from scikit-learn; the tasks of OpenTURNS give and take arrays of NumPy. EasyVVUQ imports a
# package that it does not declare, and UQpy 4.1 fails with NumPy 2.
BESIDE = {
    "chaospy": ("scikit-learn",),
    "easyvvuq": ("six",),
    "openturns": ("numpy",),
    "UQpy": ("numpy<2",),
}
HEAD = (
    "| work | package | s | times uqpen's | µs a run beyond start | largest error | half-width |",
    "|---|---|---|---|---|---|---|",
)
# Numbers of runs that are tried for an expansion, and the share of variance that it may leave.
LADDER, ENOUGH = (60, 80, 100, 140, 200, 280, 400, 600, 1000), 1e-6


class Work(NamedTuple):
    """A task with its number of runs, and why uqpen may take longer for it."""

    name: str
    task: str
    runs: int
    reason: str


class Measured(NamedTuple):
    """Processor seconds and figures of one process."""

    seconds: float
    figures: Mapping[str, Any]


class Package(NamedTuple):
    """A package, the Python that has it, its version and the tasks that it can do."""

    name: str
    python: Path
    version: str
    tasks: frozenset[str]

    def measure(self, task: str, runs: int, seed: int, most: int) -> Measured | str:
        """Return what a task took; a text if it took more than `most` seconds or failed."""
        before = children_seconds()
        done = _child(self.python, self.name, task, str(runs), str(seed), most=most)
        seconds = children_seconds() - before
        if done.returncode:
            over = done.returncode in (-signal.SIGXCPU, -signal.SIGKILL)
            return f"more than {most} s" if over else f"fails: {_last_line(done.stderr)}"
        return Measured(seconds, json.loads(_last_line(done.stdout)))


def main() -> None:
    options = _options()
    found = dict(_packages(options.environments, options.peer))
    packages = [each for each in found.values() if isinstance(each, Package)]
    lines = [*HEAD]
    starts: dict[str, float] = {}
    reasons: list[str] = []
    for work in _works(options.million):
        if options.only and work.task not in (*options.only, "start"):
            continue
        rows = _measure(work, packages, options.repeats, options.most)
        lines += _rows(work, rows, starts)
        if behind := [name for name, row in rows.items() if _is_ahead_of_us(row, rows)]:
            reasons.append(f"- **{work.name}**: behind {', '.join(behind)}. {work.reason}")
        print("\n".join(lines[-len(rows) :]), flush=True)
    said = ["Where uqpen is behind:", "", *reasons] if reasons else ["uqpen is ahead in all rows."]
    text = "\n".join([_machine(found, options.repeats), "", *lines, "", *said])
    print(text)
    if options.markdown:
        fill(options.markdown, "peers", text)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    folder = Path(tempfile.gettempdir()) / "uqpen_peers"
    parser.add_argument("--environments", type=Path, default=folder, metavar="FOLDER")
    parser.add_argument("--peer", action="append", metavar="NAME", help="only these, beside uqpen")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--only", action="append", metavar="TASK", help="and the start-up")
    parser.add_argument("--million", type=int, default=1_000_000, help="runs of the largest study")
    parser.add_argument("--most", type=int, default=60, help="processor seconds of a task")
    parser.add_argument("--markdown", type=Path, metavar="FILE.md", help="the page of the docs")
    return parser.parse_args()


def _works(million: int) -> tuple[Work, ...]:
    more = (
        "A study of uqpen also has an interval for each of its figures, a distribution function "
        "with its band, and all runs with their status."
    )
    indices = (
        "uqpen also estimates correlations and Borgonovo's delta, each with its interval, beside "
        "all statistics of a study without sensitivities."
    )
    return (
        Work("start-up, 256 runs", "start", 256, f"Its imports are xarray and pandas. {more}"),
        Work("10 000 runs, one by one", "one-by-one", 10_000, f"Start-up decides it. {more}"),
        Work("10 000 runs: moments, quantiles", "moments", 10_000, more),
        Work(f"{counted(million)} runs: moments, quantiles", "moments", million, more),
        Work("10 000 runs: first-order indices", "given-data", 10_000, indices),
        Work(f"{counted(million)} runs: first-order indices", "given-data", million, indices),
        Work(
            "Sobol' indices, 10 240 pick-freeze runs",
            "sobol",
            10_240,
            f"Start-up decides it. {more}",
        ),
        Work(
            "sparse expansion",
            "expansion",
            0,
            "It also corrects the moments and indices of the expansion by cross-fitting, with "
            "intervals; the others only fit.",
        ),
    )


def _packages(folder: Path, wanted: list[str] | None) -> Iterator[tuple[str, Package | str]]:
    """Yield packages, or the reason why one is missing."""
    for name in (OURS, "numpy"):
        yield name, _package(name, Path(sys.executable))
    lines = (HERE / "peers.txt").read_text(encoding="utf-8").splitlines()
    for line in lines:
        if line and not line.startswith("#"):
            name = line.partition("==")[0]
            if wanted and name not in wanted:
                yield name, "not asked for"
                continue
            python = folder / name / "bin" / "python"
            missing = "" if python.exists() else _install(folder / name, line)
            yield name, missing or _package(name, python)


def _install(environment: Path, requirement: str) -> str:
    """Make an environment with a package; return why that could not be done."""
    venv.create(environment, with_pip=True)
    beside = BESIDE.get(requirement.partition("==")[0], ())
    line = [str(environment / "bin" / "python"), "-m", "pip", "install", "-q", requirement, *beside]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    return f"not installed: {_last_line(done.stderr)}" if done.returncode else ""


def _package(name: str, python: Path) -> Package | str:
    done = _child(python, name)
    if done.returncode:
        return f"cannot be imported: {_last_line(done.stderr)}"
    told = json.loads(_last_line(done.stdout))
    return Package(name, python, told["version"], frozenset(told["tasks"]))


def _child(
    python: Path, name: str, *arguments: str, most: int = 600
) -> subprocess.CompletedProcess[str]:
    one = dict.fromkeys(
        ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENTURNS_NUM_THREADS", "UQPEN_THREADS"), "1"
    )
    paths = os.pathsep.join([str(HERE.parent), os.environ.get("PYTHONPATH", "")])
    ours = {"PYTHONPATH": paths} if python == Path(sys.executable) else {"PYTHONPATH": ""}
    ours |= {"PYTHONDONTWRITEBYTECODE": ""}  # as installed packages are compiled
    return subprocess.run(
        [str(python), str(HERE / "peers" / f"with_{name.lower()}.py"), *arguments],
        env={**os.environ, **one, **ours},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (most, most)),
        capture_output=True,
        text=True,
        check=False,
    )


def _measure(
    work: Work, packages: list[Package], repeats: int, most: int
) -> dict[str, tuple[int, list[Measured]] | str]:
    """Measure all packages that can do it, by turns; a text for one that did not."""
    able = {each.name: each for each in packages if work.task in each.tasks}
    rows: dict[str, tuple[int, list[Measured]] | str] = {}
    for name, package in able.items():  # the first time, modules and models are compiled
        runs = work.runs or _enough_runs(package, most)
        first = package.measure(work.task, runs, 0, most) if isinstance(runs, int) else runs
        rows[name] = first if isinstance(first, str) else (int(runs), [])
    for seed in range(1, repeats + 1):
        for name, row in rows.items():
            if not isinstance(row, str):
                found = able[name].measure(work.task, row[0], seed, most)
                rows[name] = found if isinstance(found, str) else (row[0], [*row[1], found])
    return rows


def _enough_runs(package: Package, most: int) -> int | str:
    """Return the fewest runs from which an expansion is good enough for each of three seeds."""
    for runs in LADDER:
        found = [package.measure("expansion", runs, seed, most) for seed in (1, 2, 3)]
        failed = [each for each in found if isinstance(each, str)]
        if failed:
            return failed[0]
        if all(
            each.figures["unexplained"] <= ENOUGH for each in found if not isinstance(each, str)
        ):
            return runs
    return f"not reached with {LADDER[-1]} runs"


def _rows(
    work: Work, rows: Mapping[str, tuple[int, list[Measured]] | str], starts: dict[str, float]
) -> Iterator[str]:
    ours = rows[OURS]
    assert not isinstance(ours, str), ours
    for name, row in rows.items():
        if isinstance(row, str):
            yield f"| {work.name} | {name} | {row} | | | | |"
            continue
        runs, found = row
        seconds = [each.seconds for each in found]
        ratios = [a / b.seconds for a, b in zip(seconds, ours[1], strict=True)]
        if work.task == "start":
            starts[name] = median(seconds)
        micros = (median(seconds) - starts[name]) / runs * 1e6
        beyond = _short(micros) if micros > 0 else "in the noise"
        cells = [
            f"{work.name}" + ("" if work.runs else f", {runs} runs"),
            name,
            f"{median(seconds):.2f}",
            "1" if name == OURS else f"{_short(median(ratios))} ({_range(ratios)})",
            "–" if work.task in ("start", "expansion") else beyond,
            f"{median([_error(each.figures) for each in found]):.1g}",
            _half_width(found[0].figures),
        ]
        yield f"| {' | '.join(cells)} |"


def _is_ahead_of_us(row: object, rows: Mapping[str, Any]) -> bool:
    if isinstance(row, str):
        return False
    ratios = [a.seconds / b.seconds for a, b in zip(row[1], rows[OURS][1], strict=True)]
    return median(ratios) < 1


def _error(figures: Mapping[str, Any]) -> float:
    """The largest error: of a mean in standard deviations, of indices, or of an expansion."""
    if "unexplained" in figures:
        return figures["unexplained"]
    if "mean" in figures:
        return abs(figures["mean"] - shared.MEAN) / shared.VARIANCE**0.5
    truths = {"first_order": shared.FIRST_ORDER, "total_order": shared.TOTAL_ORDER}
    return max(
        abs(found - truth)
        for name, true in truths.items()
        for found, truth in zip(figures.get(name, true), true, strict=True)
    )


def _half_width(figures: Mapping[str, Any]) -> str:
    """The largest half-width of 95 % intervals of indices."""
    bounds = [pair for name, pairs in figures.items() if name.endswith("_bounds") for pair in pairs]
    return f"{max((high - low) / 2 for low, high in bounds):.1g}" if bounds else "–"


def _machine(found: Mapping[str, Package | str], repeats: int) -> str:
    versions = [
        f"{name} {each.version}" for name, each in found.items() if isinstance(each, Package)
    ]
    missing = [f"{name} ({each})" for name, each in found.items() if isinstance(each, str)]
    lost = f" Missing: {'; '.join(missing)}." if missing else ""
    return (
        f"{_processor()}, {os.cpu_count()} cores, Python {platform.python_version()}; medians of "
        f"{repeats} repeats, by turns, with the range of ratios. {', '.join(versions)}.{lost}"
    )


def _processor() -> str:
    described = Path("/proc/cpuinfo")
    lines = described.read_text().splitlines() if described.exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _last_line(text: str) -> str:
    return (text.strip().splitlines() or ["no message"])[-1]


def _short(value: float) -> str:
    return f"{value:.2g}" if abs(value) < 100 else f"{value:.0f}"


def _range(values: list[float]) -> str:
    return f"{_short(min(values))} to {_short(max(values))}"


if __name__ == "__main__":
    main()
