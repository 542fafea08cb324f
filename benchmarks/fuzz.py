"""Wrong studies, damaged archives and data, as many as there is time for: no traceback is allowed.

Run it as ``python benchmarks/fuzz.py --seconds 300``, with uqpen installed. Each file is made from
the seed and its number, in a process of its own kind, which is ended when one takes too long, and
started again where it left off. Files that it fails on are kept, each with its traceback.

An archive is damaged in one process and read in another, as a command is that somebody types: the
HDF5 library may leave a damaged file with its own memory in disorder, and die of the next one.
"""

from __future__ import annotations

import argparse
import collections
import faulthandler
import json
import os
import resource
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from random import Random

TESTS = Path(__file__).parents[1] / "tests" / "fuzz"
sys.path.insert(0, str(TESTS))

# The bare ones lack the checksum of their bytes, so that the HDF5 library meets the damage.
KINDS = (
    *("study-values", "study-bytes"),
    *("archive-parts", "archive-hashed", "archive-bytes", "archive-bare"),
    *("data-netcdf3", "data-netcdf4", "data-compressed", "data-h5py", "data-h5netcdf"),
)
# A file that takes longer has stopped the program; one that takes more memory would. The first file
# waits for the whole archives, which took more than a minute on a busy machine.
MOST_SECONDS = 300
MOST_MEMORY = 6 * 2**30
# Of a process that reads a damaged data file of some kilobytes. Half of it is uqpen's without one.
MOST_DATA_MEMORY = 2**30
MOST_DATA_SECONDS = 20  # of the processor


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="for all kinds together")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=KINDS, action="append", help="default: all")
    parser.add_argument("--files", type=int, default=10**9, help="at most, of each kind")
    parser.add_argument("--keep", type=Path, help="where to keep files that it fails on")
    parser.add_argument("--work", nargs=3, metavar=("KIND", "FIRST", "FOLDER"), help="its own use")
    options = parser.parse_args()
    if options.work:
        kind, first, folder = options.work
        return work(kind, options.seed, int(first), Path(folder))
    keep = options.keep or Path(tempfile.mkdtemp(prefix="fuzz_"))
    keep.mkdir(parents=True, exist_ok=True)
    kinds = options.kind or KINDS
    with tempfile.TemporaryDirectory() as name:
        failures = sum(
            watched(
                kind, options.seed, options.seconds / len(kinds), options.files, Path(name), keep
            )
            for kind in kinds
        )
    print(f"{failures} failures" + f", kept in {keep}" * bool(failures))
    return min(failures, 1)


def watched(kind: str, seed: int, seconds: float, most: int, folder: Path, keep: Path) -> int:
    """How many files of a kind fail; processes that die or hang are started again."""
    end = time.monotonic() + seconds
    outcomes: collections.Counter[str] = collections.Counter()
    number, failures = 0, 0
    while time.monotonic() < end and number < most:
        for done in worked(kind, seed, number, folder, end):
            number = done["number"] + 1
            outcomes[done["outcome"]] += 1
            if "told" in done:
                failures += 1
                kept(kind, done, folder, keep)
            if number >= most:
                break
    told = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.most_common())
    print(f"{kind}: {number} files: {told}", flush=True)
    return failures


def worked(
    kind: str, seed: int, number: int, folder: Path, end: float
) -> Iterator[dict[str, object]]:
    """What a process tells of each file, its own end included."""
    command = [sys.executable, __file__, "--seed", str(seed)]
    with subprocess.Popen(
        [*command, "--work", kind, str(number), str(folder)],
        stdout=subprocess.PIPE,
        bufsize=0,
        start_new_session=True,
        stderr=(folder / "stderr").open("w"),
    ) as process:
        try:
            yield from lines(process, number, folder, end)
        finally:
            # With what it has started itself.
            os.killpg(process.pid, signal.SIGKILL)


def lines(
    process: subprocess.Popen[bytes], number: int, folder: Path, end: float
) -> Iterator[dict[str, object]]:
    """The lines of a process until there is no more time, the last of its end."""
    assert process.stdout is not None
    while time.monotonic() < end:
        is_there = select.select([process.stdout], [], [], MOST_SECONDS)[0]
        line = process.stdout.readline() if is_there else b""
        if line:
            done = json.loads(line)
            number = done["number"] + 1
            yield done
            continue
        died = f"the process left with {process.wait()}" if is_there else "it takes too long"
        told = f"{died}\n{(folder / 'stderr').read_text(errors='replace')[:3000]}"
        yield {"number": number, "outcome": "dies" if is_there else "hangs", "told": told}
        return


def kept(kind: str, done: dict[str, object], folder: Path, keep: Path) -> None:
    name = f"{kind}_{done['number']}"
    for file in folder.glob("mutant.toml" if kind.startswith("study") else "mutant.nc"):
        shutil.copy(file, keep / f"{name}{file.suffix}")
    (keep / f"{name}.txt").write_text(str(done["told"]))
    last = str(done["told"]).strip().splitlines()[-1][:200]
    print(f"  {name}: {done['outcome']}: {last}", flush=True)


def work(kind: str, seed: int, number: int, folder: Path) -> int:
    """Make files and try them, from a number on, until the process is ended."""
    faulthandler.enable()
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    os.chdir(folder)
    told_to = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    attempts = {"study": study_attempts, "archive": archive_attempts, "data": data_attempts}
    attempt = attempts[kind.partition("-")[0]](kind, folder)
    while True:
        done: dict[str, object] = {"number": number}
        try:
            done["outcome"] = attempt(Random(f"{seed} {kind} {number}"))
        except Exception:
            done["outcome"] = "fails"
            done["told"] = traceback.format_exc()
        print(json.dumps(done), file=told_to, flush=True)
        if "told" in done:
            # Until the file has been copied.
            time.sleep(0.2)
        number += 1


def study_attempts(kind: str, folder: Path) -> Callable[[Random], str]:
    import study_texts
    from properties import study_outcome

    study_texts.prepare(folder)
    file = folder / "mutant.toml"

    def attempt(random: Random) -> str:
        if kind == "study-values":
            file.write_text(study_texts.mutant(random), encoding="utf-8")
        else:
            file.write_bytes(study_texts.damaged_bytes(random))
        return study_outcome(file, random)

    return attempt


def archive_attempts(kind: str, folder: Path) -> Callable[[Random], str]:
    import archive_files
    from properties import ARCHIVE_COMMANDS, archive_outcome

    whole = sorted((folder / "whole").glob("*.nc"))
    if not whole:
        (folder / "whole").mkdir(exist_ok=True)
        whole = archive_files.make_archives(folder / "whole")
    # Beside the damaged ones stands what leaves a trace when it is executed.
    for name in ("own.py", "trap.py"):
        (folder / name).write_text(archive_files.TRAP.format(limit=1))
    contents = {path: path.read_bytes() for path in whole}
    file = folder / "mutant.nc"

    def damage(path: Path, random: Random) -> str:
        if kind in ("archive-bytes", "archive-bare"):
            data = contents[path]
            bare = data[: data.rindex(b"\nuqpen sha256")]
            data = archive_files.with_bytes_damaged(
                bare if kind == "archive-bare" else data, random
            )
            file.write_bytes(data)
        else:
            file.write_bytes(contents[path])
            archive_files.with_parts_changed(file, random)
            if kind == "archive-hashed":
                archive_files.hashed_anew(file)
        return ""

    def attempt(random: Random) -> str:
        for path in (Path("executed"), Path("again.nc")):
            path.unlink(missing_ok=True)
        path = random.choice(whole)
        forked(lambda: damage(path, random))
        return forked(partial(archive_outcome, file, path, random.choice(ARCHIVE_COMMANDS)))

    return attempt


def data_attempts(kind: str, folder: Path) -> Callable[[Random], str]:
    from archive_files import with_bytes_damaged
    from data_files import DATA_KINDS, data_outcome

    content = DATA_KINDS[kind]()
    file = folder / "mutant.nc"

    def outcome() -> str:
        resource.setrlimit(resource.RLIMIT_CPU, (MOST_DATA_SECONDS, MOST_DATA_SECONDS))
        found = data_outcome(file)
        taken = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        if taken > MOST_DATA_MEMORY:
            raise MemoryError(f"it takes {taken / 1e6:.0f} MB")
        return found

    def attempt(random: Random) -> str:
        file.write_bytes(with_bytes_damaged(content, random))
        return forked(outcome)

    return attempt


def forked(attempt: Callable[[], str]) -> str:
    """What a function returns in a copy of this process; an error with its traceback else."""
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        with os.fdopen(writer, "w") as stream:
            try:
                stream.write(attempt())
            except BaseException:
                stream.write(f"Traceback: {traceback.format_exc()}")
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as stream:
        told = stream.read()
    if status := os.waitpid(child, 0)[1]:
        raise RuntimeError(f"the process left with {os.waitstatus_to_exitcode(status)}")
    if told.startswith("Traceback: "):
        raise RuntimeError(told)
    return told


if __name__ == "__main__":
    sys.exit(main())
