"""Kill a study again and again, and see whether its archive is the same in the end.

Each time a study of a Python function is ended by SIGKILL at a moment of its own: in the middle of
its runs (in the process or on two workers), while it keeps those that are done, or while it writes
the archive. Then it is started again. It must complete, write the bytes of the archive that was
never interrupted, and make no run that had been kept: the function counts its calls.

    python benchmarks/kills.py --kills 200
"""

from __future__ import annotations

import argparse
import os
import random
import re
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import netCDF4

import uqpen
from uqpen.cli.main import main as uqpen_main

SECONDS_PER_RUN = 0.02
RUNS = 10

MODEL = f"""\
import os, pathlib, time
calls = pathlib.Path(__file__).with_name("calls")
def simulate(x, y):
    time.sleep({SECONDS_PER_RUN})
    # One write to the end of the file: it is there even if this process is killed right after.
    with calls.open("ab", buffering=0) as stream:
        stream.write(b"call\\n")
    if x > 1.5:
        raise ValueError("x is too large")
    return {{"z": x * y, "w": float("nan") if y > 1.5 else x + y}}
"""

STUDY = f"""\
seed = 11
[model]
python = "model.py:simulate"
noise = false
inputs = {{ x = "1", y = "m" }}
outputs = {{ z = "m", w = "1" }}
[inputs]
x = "0 ± 1"
y = "(0 ± 1) m"
[designs.monte_carlo]
kind = "monte-carlo"
runs = {RUNS}
[designs.latin_hypercube]
kind = "latin-hypercube"
runs = {RUNS}
replicates = 2
"""

KINDS = ("runs", "workers", "part", "archive")


def main() -> int:
    """Kill a study as often as asked; the exit code says whether all was well each time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    chance = random.Random(arguments.seed)
    counts: Counter[str] = Counter()
    lags: Counter[int] = Counter()
    failures = []
    with tempfile.TemporaryDirectory() as scratch:
        whole = _prepared(Path(scratch), "whole")
        # It also imports what every fork needs, which takes longer than the study.
        uqpen.make_archive(uqpen.load_study(whole / "study.toml"), whole / "study.nc")
        expected = (whole / "study.nc").read_bytes()
        assert _calls(whole) == 2 * RUNS
        for number in range(arguments.kills):
            kind = KINDS[number % len(KINDS)]
            folder = _prepared(Path(scratch), str(number))
            lag, failure = _killed(folder, kind, chance, expected)
            counts[kind] += 1
            lags[lag] += 1
            if failure:
                failures.append(f"kill {number} ({kind}): {failure}")
    for failure in failures:
        print(failure)
    print(f"{arguments.kills} kills: {dict(counts)}; {len(failures)} failed")
    print(f"runs called but not kept when killed, and how often: {dict(sorted(lags.items()))}")
    return bool(failures)


def _prepared(scratch: Path, name: str) -> Path:
    folder = scratch / name
    folder.mkdir()
    (folder / "model.py").write_text(MODEL)
    (folder / "study.toml").write_text(STUDY)
    return folder


class _Program:
    """The study's command line in a process of its own, a fork of this one, which knows uqpen."""

    def __init__(self, folder: Path, *options: str, dies: tuple[str, int] | None = None) -> None:
        self._said = folder / "said"
        self.pid = os.fork()
        self.code: int | None = None
        if not self.pid:
            _become(folder, self._said, options, dies)

    def poll(self) -> int | None:
        """The code that it has ended with; None while it runs."""
        if self.code is None:
            ended, status = os.waitpid(self.pid, os.WNOHANG)
            self.code = os.waitstatus_to_exitcode(status) if ended else None
        return self.code

    def wait(self) -> str:
        """What it has said when it has ended."""
        if self.code is None:
            self.code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        return self._said.read_text()


def _become(
    folder: Path, said: Path, options: tuple[str, ...], dies: tuple[str, int] | None
) -> NoReturn:
    """Run the study in this process, and end it."""
    code = 70
    try:
        os.chdir(folder)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
        sys.argv = ["uqpen", "study", "study.toml", "-o", "study.nc", *options]
        if dies:
            _let_die(*dies)
        uqpen_main()
    except SystemExit as left:
        code = int(left.code or 0)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)


def _let_die(what: str, times: int) -> None:
    """End this process, as a kill would, at the n-th time that it does something.

    It stops with a file half written, or written and not yet in its place.
    """
    left = times

    def dying(function: Callable[..., Any]) -> Callable[..., Any]:
        def counted(*arguments: Any, **options: Any) -> Any:
            nonlocal left
            left -= 1
            if left == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            return function(*arguments, **options)

        return counted

    if what == "part":
        os.fsync = dying(os.fsync)
        Path.replace = dying(Path.replace)
    else:

        class Dataset(netCDF4.Dataset):
            createGroup = dying(netCDF4.Dataset.createGroup)  # noqa: N815 - its name there

        netCDF4.Dataset = Dataset


def _calls(folder: Path) -> int:
    calls = folder / "calls"
    return len(calls.read_bytes().splitlines()) if calls.exists() else 0


def _killed(folder: Path, kind: str, chance: random.Random, expected: bytes) -> tuple[int, str]:
    """How many calls were lost to a kill, and what went wrong."""
    if kind in ("runs", "workers"):
        _kill_in_mid_run(folder, kind, chance)
    else:
        most = RUNS if kind == "part" else 12
        dying = _Program(folder, dies=(kind, chance.randint(1, most)))
        dying.wait()
        if dying.code != -signal.SIGKILL:
            return 0, f"it was not killed, but ended with {dying.code}"
    called = _calls(folder)
    again = _Program(folder)
    said = again.wait()
    if again.code != 0:
        return 0, f"the next start ended with {again.code}: {said}"
    found = sum(map(int, re.findall(r"(\d+) of \d+ runs (?:already done|from)", said)))
    compared = sum(map(int, re.findall(r"(\d+)\s+of\s+\d+\s+runs\s+made\s+again", said)))
    lag = called - found
    made = _calls(folder) - called - compared
    if made != 2 * RUNS - found:
        return lag, f"{found} runs were kept, but {made} made again"
    if (folder / "study.nc").read_bytes() != expected:
        return lag, "the archive is not the same"
    left = [file.name for file in folder.iterdir() if file.name.startswith((".", "study.nc."))]
    if left != ["study.nc.log"]:
        return lag, f"left behind: {left}"
    return lag, ""


def _kill_in_mid_run(folder: Path, kind: str, chance: random.Random) -> None:
    running = _Program(folder, *(("--workers", "2") if kind == "workers" else ()))
    at = chance.randint(1, 2 * RUNS - 4)
    while _calls(folder) < at and running.poll() is None:
        time.sleep(0.001)
    time.sleep(chance.random() * SECONDS_PER_RUN)
    if running.poll() is None:
        os.kill(running.pid, signal.SIGKILL)
    running.wait()


if __name__ == "__main__":
    sys.exit(main())
