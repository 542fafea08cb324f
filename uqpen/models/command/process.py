"""Process under limits: start it, wait for it, and kill it with all its child processes.

It leads a session and a process group of its own, so that a Ctrl-C at the terminal does not reach
it, and ending it ends its children as well. Its output goes to files: nothing waits for a pipe that
one of its children keeps open.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from uqpen.core.limits import Limits

STDOUT, STDERR = "stdout", "stderr"

# Sets the limit on address space, in KiB, and becomes the program; no word of it is expanded.
_WITH_LESS_MEMORY = 'ulimit -v "$0" && exec "$@"'

# Interval between checks for the end of a process where the system does not report it, in seconds.
_GLANCE = 0.005

# More seconds than the system can be asked to wait for: 23 days.
_FOREVER = 2e6


@dataclass(frozen=True)
class ProcessEnd:
    """End of a process: its exit code, or the negative number of the signal that ended it.

    A late process was killed because its time was over.
    """

    code: int
    is_late: bool = False

    @property
    def signal(self) -> str:
        """Name of the signal that ended it; empty if there was none.

        >>> ProcessEnd(-11).signal, ProcessEnd(3).signal
        ('SIGSEGV', '')
        """
        if self.code >= 0:
            return ""
        try:
            return signal.Signals(-self.code).name
        except ValueError:  # a real-time signal
            return f"signal {-self.code}"


def run_process(
    words: Sequence[str], folder: Path, limits: Limits, watch: Callable[[int], None]
) -> ProcessEnd:
    """Run a program in a folder, and kill its remaining processes at the end.

    The words are the program's path and its arguments; no shell expands them. The folder gets its
    `stdout` and `stderr`. `watch` gives the group to the guard of the folder.

    OSError if it cannot be started.
    """
    if limits.bytes is not None:
        # Not by code of ours between fork and exec: that can deadlock where there are threads.
        words = ["/bin/sh", "-c", _WITH_LESS_MEMORY, str(limits.bytes // 1024), *words]
    with (folder / STDOUT).open("wb") as stdout, (folder / STDERR).open("wb") as stderr:
        process = subprocess.Popen(
            words,
            cwd=folder,
            # Some programs ask the environment where they are.
            env={**os.environ, "PWD": str(folder)},
            stdin=subprocess.DEVNULL,
            stdout=stdout,
            stderr=stderr,
            start_new_session=True,
        )
    try:
        watch(process.pid)
        is_late = not _wait(process, limits.seconds)
    except BaseException:  # Ctrl-C above all
        _end(process, is_forced=True)
        raise
    _end(process, is_forced=is_late)
    watch(0)
    return ProcessEnd(process.returncode, is_late)


def _end(process: subprocess.Popen[bytes], *, is_forced: bool) -> None:
    """Kill the remaining processes of a process's group, and wait for the process.

    If it was forced to end, it may have children in other groups. To look for them takes a
    millisecond or more, so this is not done for a program that ended by itself.
    """
    if process.returncode is None:
        # As long as it has not been waited for, its number cannot be that of another group.
        _kill(process.pid)
        for group in _session_groups(process.pid) if is_forced else ():
            _kill(group)
    process.wait()


def _kill(group: int) -> None:
    # A group of nothing but a zombie is refused on some systems.
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)


def _session_groups(leader: int) -> set[int]:
    """Return the process groups of a session, if the system lists them; MPI launchers make some."""
    groups = set()
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            # The name in brackets can contain anything, so begin behind it.
            fields = entry.read_bytes().rpartition(b")")[2].split()
            if int(fields[3]) == leader:
                groups.add(int(fields[2]))
    return groups


def _wait(process: subprocess.Popen[bytes], seconds: float | None) -> bool:
    """Check that a process ends in time; it is not reaped, so that its number stays taken."""
    if sys.platform != "linux":
        return _poll(process, seconds)
    try:
        descriptor = os.pidfd_open(process.pid)
    except OSError:  # an old system, or one that does not let programs have them
        return _poll(process, seconds)
    try:
        poll = select.poll()
        poll.register(descriptor, select.POLLIN)
        milliseconds = None if seconds is None or seconds > _FOREVER else seconds * 1000
        return bool(poll.poll(milliseconds))
    finally:
        os.close(descriptor)


def _poll(process: subprocess.Popen[bytes], seconds: float | None) -> bool:
    """Check that a process ends in time, on a system without process descriptors."""
    deadline = time.monotonic() + (float("inf") if seconds is None else seconds)
    while process.poll() is None:
        if time.monotonic() > deadline:
            return False
        time.sleep(_GLANCE)
    _kill(process.pid)
    return True


# Guard process: it outlives this one briefly, to kill the processes that it has left.
#
# A process that is killed cannot end its runs itself. So each has a guard: a shell that reads the
# current run from a pipe, and finds the pipe's end when nobody is left to write. It sleeps until
# then, and knows one run at a time.

# The last line read is the current run: the number of its process group (0 while there is none) and
# its folder, or nothing. Other groups of the session are ended too, and, where the system reports
# it, every process in the folder.
_SCRIPT = """\
trap '' HUP INT TERM
group= folder=
while IFS=' ' read -r last where; do group=$last folder=$where; done
[ -n "$folder" ] || exit 0
if [ "$group" != 0 ]; then
    pkill -KILL -s "$group"
    kill -KILL -- "-$group"
fi
for entry in /proc/[0-9]*/cwd; do
    case $(readlink "$entry") in
    "$folder" | "$folder (deleted)")
        process=${entry%/cwd}
        kill -KILL "${process#/proc/}"
    esac
done
rm -rf -- "$folder"
"""


@contextlib.contextmanager
def guard_folder(folder: Path) -> Iterator[Callable[[int], None]]:
    """Ensure within this context that no process started in a run's folder outlives this one.

    If this process dies, the guard kills the processes in the folder and removes it. The function
    of the context takes the number of the process group that was started, or 0 at its end.
    """
    starting = f"0 {folder}"
    _send(starting)
    try:
        yield lambda group: _send(f"{group} {folder}")
    except BaseException:
        # The run may have been about to start. By the end, its number can be that of another.
        _send(starting)
        raise
    _send("")


def _send(line: str) -> None:
    # If it cannot be started, or has been killed, runs continue without it.
    with contextlib.suppress(OSError):
        pipe = _process_guard().stdin
        assert pipe is not None
        os.write(pipe.fileno(), f"{line}\n".encode("utf-8", "surrogateescape"))


_guards: dict[int, subprocess.Popen[bytes]] = {}


def _process_guard() -> subprocess.Popen[bytes]:
    """Return the guard of this process; start it if there is none."""
    process = os.getpid()
    if process not in _guards:
        _guards[process] = subprocess.Popen(
            ["/bin/sh", "-c", _SCRIPT],
            cwd="/",
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        atexit.register(_stop, process)
    return _guards[process]


def _stop(process: int) -> None:
    if process == os.getpid():
        _guards.pop(process).communicate()  # closes the pipe, and waits for the end
