"""Guard process: it outlives this one briefly, to kill the processes that it has left.

A worker that is killed, or a program that is, cannot end its runs itself. So each has a guard: a
shell that reads from a pipe what is under way, and finds the pipe's end when nobody is left to
write. It sleeps until then, and knows one run at a time.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

__all__ = ["guard_folder"]

# What it has read last is what is under way: the number of a process group and its folder; 0 where
# it has no number yet, as it is being started; or nothing. Other groups of the session are ended
# too, and, where the system reports it, every process in the folder.
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
    """Ensure within this context that no process started in a folder outlives this one.

    Parameters
    ----------
    folder : Path
        Folder of one run. If this process dies, the guard removes it and kills the processes in it.

    Yields
    ------
    watch : callable
        Takes the number of the process group that was started.
    """
    starting = f"0 {folder}"
    _send(starting)
    try:
        yield lambda group: _send(f"{group} {folder}")
    except BaseException:
        # It may have been about to be started. Its number can be another's by the time of the end.
        _send(starting)
        raise
    _send("")


def _send(what: str) -> None:
    # If it cannot be started, or has been killed, runs continue without it.
    with contextlib.suppress(OSError):
        pipe = _process_guard().stdin
        assert pipe is not None
        os.write(pipe.fileno(), f"{what}\n".encode("utf-8", "surrogateescape"))


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
        _guards.pop(process).communicate()  # the end of what it reads, and its own
