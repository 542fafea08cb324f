"""Memory, time and disk of Monte Carlo with very many runs, each size in a process of its own.

    python benchmarks/flat_memory.py                     # 3e6 and 1e7 runs
    python benchmarks/flat_memory.py 100_000_000         # some GB of disk, and minutes
    python benchmarks/flat_memory.py 3_000_000 --kill    # killed half-way, continued: same bytes?

For each number of runs of `plain.toml`: the peak of memory and the processor time of `uqpen study`,
the most disk that it took, and the peaks of `uqpen show`, `report` and `verify` of its archive. The
time of a run is that of the command divided by the number of runs. `--runs-alone` leaves out the
statistics, so that the rest is measured. `--keep statistics` leaves the runs out of the archive.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

_STUDY = Path(__file__).with_name("plain.toml")
_ENVIRONMENT = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
_RECORD = "study.nc.parts/runs/monte_carlo/0_blocks.jsonl"

# Makes all runs and writes them to an archive, with no statistics.
_RUNS_ALONE = """
import sys
from pathlib import Path
import uqpen
import uqpen.workflow
workflow = sys.modules["uqpen.workflow.model_groups"]  # not its function of that name
workflow.analyze = lambda runs, quantities, **_: {each.output.name: {} for each in quantities}
workflow.analyze_failures = lambda *_: {}
uqpen.make_archive(uqpen.load_study(Path("study.toml")), Path("study.nc"))
"""


class Cost(NamedTuple):
    """Cost of a command: seconds of processor time, and peaks of memory and disk in bytes."""

    seconds: float
    memory: int
    disk: int


def main() -> None:
    """Print a row for each number of runs."""
    options = _options()
    print("runs        command   CPU s   µs a run   peak MB   disk GB")
    for runs in options.runs:
        with tempfile.TemporaryDirectory(dir=options.folder) as place:
            folder = Path(place)
            text = _STUDY.read_text().replace("10_000", f'{runs}\nkeep = "{options.keep}"')
            (folder / "study.toml").write_text(text)
            study = _uqpen("study", "study.toml", "-o", "study.nc")
            if options.runs_alone:
                study = [sys.executable, "-c", _RUNS_ALONE]
            if options.kill:
                _kill(study, folder, runs)
            _show(runs, "study", cost(study, folder), runs)
            if options.kill:
                _compare(study, folder)
            for command in () if options.runs_alone else ("show", "report", "verify"):
                _show(runs, command, cost(_uqpen(command, "study.nc"), folder), runs)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("runs", nargs="*", type=int, default=[3_000_000, 10_000_000])
    parser.add_argument("--kill", action="store_true", help="kill each study half-way first")
    parser.add_argument("--keep", choices=["runs", "statistics"], default="runs")
    parser.add_argument("--runs-alone", action="store_true", help="leave out the statistics")
    parser.add_argument("--folder", type=Path, help="where the archives are made")
    return parser.parse_args()


def _uqpen(*words: str) -> list[str]:
    return [sys.executable, "-m", "uqpen", *words]


def _show(runs: int, command: str, cost: Cost, per: int) -> None:
    print(
        f"{runs:<11_} {command:8} {cost.seconds:7.1f} {1e6 * cost.seconds / per:10.2f}"
        f" {cost.memory / 1e6:9.0f} {cost.disk / 1e9:9.2f}",
        flush=True,
    )


def cost(command: Sequence[str], folder: Path) -> Cost:
    """Run a command in a folder, and return what it cost."""
    with (folder / "output.txt").open("wb") as output, _DiskWatch(folder) as watch:
        process = subprocess.Popen(
            command, cwd=folder, env=_ENVIRONMENT, stdout=output, stderr=output
        )
        _, status, usage = os.wait4(process.pid, 0)
    if os.waitstatus_to_exitcode(status):
        sys.exit((folder / "output.txt").read_text()[-2000:])
    return Cost(usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024, watch.most)


class _DiskWatch:
    """The most disk that a folder takes while this is open."""

    def __init__(self, folder: Path) -> None:
        self.most = 0
        self._folder, self._ended = folder, threading.Event()
        self._thread = threading.Thread(target=self._watch)

    def __enter__(self) -> _DiskWatch:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _watch(self) -> None:
        while not self._ended.wait(0.5):
            self.most = max(self.most, sum(map(_blocks_of, self._folder.rglob("*"))))


def _blocks_of(file: Path) -> int:
    try:
        return file.stat().st_blocks * 512
    except OSError:  # it was removed meanwhile
        return 0


def _kill(command: Sequence[str], folder: Path, runs: int) -> None:
    """Start a study, and kill it when half of its blocks are done."""
    process = subprocess.Popen(
        command, cwd=folder, env=_ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    while _kept_blocks(folder) < runs // 65_536 // 2 and process.poll() is None:
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    print(f"killed with {_kept_blocks(folder)} blocks of {-(-runs // 65_536)}")


def _kept_blocks(folder: Path) -> int:
    record = folder / _RECORD
    return record.read_bytes().count(b"\n") if record.exists() else 0


def _compare(command: Sequence[str], folder: Path) -> None:
    """Print whether an archive that was continued has the bytes of one that was not."""
    restored = [
        line for line in (folder / "study.nc.log").read_text().splitlines() if "made before" in line
    ]
    continued = _sha256(folder / "study.nc")
    (folder / "study.nc").unlink()
    cost(command, folder)
    same = "the same" if _sha256(folder / "study.nc") == continued else "OTHER"
    print(f"{restored[0].partition(': ')[2]}; {same} bytes as without the kill")


def _sha256(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


if __name__ == "__main__":
    main()
