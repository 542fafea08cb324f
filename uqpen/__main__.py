"""``uqpen`` and ``python -m uqpen``: the command line, which takes a moment to load."""

from __future__ import annotations

import gc
import signal
import sys

_INTERRUPTED = 130

# Exit codes above this one are of interrupts and of requests to terminate.
_BY_SIGNAL = 128


def main() -> None:
    """Run the command line, and leave with its exit code; 130 at Ctrl-C, however early it comes."""
    try:
        from uqpen.cli.main import main as run

        run()
    except (KeyboardInterrupt, RuntimeError) as error:
        # Before Python 3.12, an exception of `__set_name__` is the cause of a RuntimeError.
        if not any(isinstance(each, KeyboardInterrupt) for each in (error, error.__cause__)):
            raise
        sys.stderr.write("interrupted\n")
        _end_children()
        sys.exit(_INTERRUPTED)
    except SystemExit as left:
        if isinstance(left.code, int) and left.code > _BY_SIGNAL:
            _end_children()
        raise
    finally:
        # What ends with the process is not taken apart first, a fifth of the time of a command.
        gc.freeze()


def _end_children() -> None:
    """Ignore Ctrl-C from now on, and end the processes that it has kept us from ending."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if "multiprocessing" in sys.modules:
        for child in sys.modules["multiprocessing"].active_children():
            child.kill()


if __name__ == "__main__":
    main()
