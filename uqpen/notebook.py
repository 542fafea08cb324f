"""Progress of a study in a notebook."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterator
from html import escape
from typing import Any

from uqpen.core.progress import Progress, ProgressRecord
from uqpen.results.texts import runs_text, step_text

# Shortest time between two updates of the bar, in seconds: each is a message to the browser.
_PERIOD = 0.2


@contextlib.contextmanager
def notebook_progress() -> Iterator[Progress]:
    """Provide a progress bar in a notebook; elsewhere, progress is not shown."""
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    if getattr(shell, "kernel", None) is None:
        yield Progress()
        return
    from IPython.display import display

    bar = NotebookProgress(display({"text/plain": ""}, raw=True, display_id=True))
    try:
        yield bar
    finally:
        bar.finish()


class NotebookProgress(ProgressRecord):
    """Progress bar in the output of a notebook's cell, over all designs of a study.

    Parameters
    ----------
    handle : DisplayHandle
        Display that is updated; IPython makes it.
    """

    def __init__(self, handle: Any) -> None:
        super().__init__()
        self._handle = handle
        self._shown = 0.0

    def start_step(self, name: str, number: int = 0, total: int = 0) -> None:
        super().start_step(name, number, total)
        self._show()

    def start_design(self, name: str, runs: int) -> None:
        super().start_design(name, runs)
        self._show()

    def count_restored(self, runs: int) -> None:
        super().count_restored(runs)
        self._show()

    def count_reused(self, runs: int, place: str) -> None:
        super().count_reused(runs, place)
        self._show()

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        super().advance(runs, failed, in_progress)
        if time.monotonic() - self._shown >= _PERIOD:
            self._show()

    def finish(self) -> None:
        """Clear the bar."""
        self._handle.update({"text/plain": "", "text/html": ""}, raw=True)

    def _show(self) -> None:
        state, text = self.state, step_text(self.state)
        # A step that is under way is not done yet.
        done, total = max(state.step_number - 1, 0), state.steps
        if not state.step:
            done, total = state.done, state.runs
            text = f"{text}; {runs_text(state)}"
        share = f' value="{done}" max="{total}"' if total else ""
        html = f"<progress{share}></progress> {escape(text)}"
        self._handle.update({"text/plain": text, "text/html": html}, raw=True)
        self._shown = time.monotonic()
