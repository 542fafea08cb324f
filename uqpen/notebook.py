"""Progress of a study in a notebook."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator
from html import escape
from typing import Any

from uqpen.execution import Progress

__all__ = ["NotebookProgress", "notebook_progress"]

# Shortest time between two updates of the bar, in seconds: each is a message to the browser.
_PERIOD = 0.2


@contextlib.contextmanager
def notebook_progress() -> Iterator[Progress]:
    """Provide a progress bar in a notebook; elsewhere, progress is not shown."""
    if not _is_notebook():
        yield Progress()
        return
    from IPython.display import display

    bar = NotebookProgress(display({"text/plain": ""}, raw=True, display_id=True))
    try:
        yield bar
    finally:
        bar.finish()


def _is_notebook() -> bool:
    """Check that this process is the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    return getattr(shell, "kernel", None) is not None


class NotebookProgress(Progress):
    """Progress bar in the output of a notebook's cell.

    Parameters
    ----------
    handle : DisplayHandle
        Display that is updated; IPython makes it.
    """

    def __init__(self, handle: Any) -> None:
        self._handle = handle
        self._design, self._runs, self._done, self._failed = "", 0, 0, 0
        self._shown = 0.0

    def start_preparation(self, model: str) -> None:
        self._show(f"preparing {model}")

    def start_design(self, name: str, runs: int) -> None:
        self._design, self._runs, self._done, self._failed = name, runs, 0, 0
        self._show_runs()

    def count_restored(self, runs: int) -> None:
        self._done += runs
        self._show_runs()

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        self._done += runs
        self._failed += failed
        if time.monotonic() - self._shown >= _PERIOD:
            self._show_runs()

    def start_analysis(self) -> None:
        self._show("analysing")

    def finish(self) -> None:
        """Clear the bar."""
        self._handle.update({"text/plain": "", "text/html": ""}, raw=True)

    def _show_runs(self) -> None:
        failed = f", {self._failed} failed" if self._failed else ""
        text = f"{self._design}: {self._done} of {self._runs} runs{failed}"
        share = f' value="{self._done}" max="{max(self._runs, 1)}"'
        self._show(text, share)

    def _show(self, text: str, share: str = "") -> None:
        html = f"<progress{share}></progress> {escape(text)}"
        self._handle.update({"text/plain": text, "text/html": html}, raw=True)
        self._shown = time.monotonic()
