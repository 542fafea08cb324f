"""Guard process: it outlives this one briefly, to kill the processes that it has left.

A process that is killed cannot end its runs itself. So each has a guard: a shell that reads the
current run from a pipe, and finds the pipe's end when nobody is left to write. It sleeps until
then, and knows one run at a time.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

__all__ = ["guard_folder"]

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

    If this process dies, the guard kills the processes in the folder and removes it.

    Yields
    ------
    watch : callable
        Takes the number of the process group that was started, or 0 at its end.
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
