"""Lock that lets one process at a time make an archive."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from uqpen.core.errors import ArchiveError

__all__ = ["lock_archive"]


@contextmanager
def lock_archive(path: Path) -> Iterator[None]:
    """Lock the archive at `path` against other processes within this context.

    The operating system holds the lock, and releases it when this process ends in any way;
    the file that it is on may stay behind, and means nothing.

    Raises
    ------
    ArchiveError
        If another process is at it.
    """
    from filelock import FileLock, Timeout

    # Through a link it is the same archive.
    real = path.resolve()
    file = real.with_name(f".{real.name}.lock")
    lock = FileLock(file, blocking=False)
    try:
        lock.acquire()
    except Timeout:
        raise ArchiveError(f"{path}: another process is making it right now") from None
    except OSError as error:
        raise ArchiveError(f"{file}: cannot be locked: {error.strerror}") from None
    try:
        yield
    finally:
        # Before it is let go, so that nobody who waits for it gets a file that is no longer there.
        with contextlib.suppress(OSError):
            file.unlink()
        lock.release()
