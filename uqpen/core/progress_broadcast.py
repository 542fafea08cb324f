"""Progress reports for several receivers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from uqpen.core.progress import Progress

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["ProgressBroadcast"]


class ProgressBroadcast(Progress):
    """Receiver that passes each report on to several others, in their order."""

    def __init__(self, *receivers: Progress) -> None:
        self._receivers = receivers

    def start_step(self, name: str, number: int = 0, total: int = 0) -> None:
        for each in self._receivers:
            each.start_step(name, number, total)

    def start_preparation(self, model: str) -> None:
        for each in self._receivers:
            each.start_preparation(model)

    def announce_designs(self, runs: Mapping[str, int]) -> None:
        for each in self._receivers:
            each.announce_designs(runs)

    def start_design(self, name: str, runs: int) -> None:
        for each in self._receivers:
            each.start_design(name, runs)

    def start_runs(self, model: str, finished_runs: Callable[[], list[xr.Dataset]]) -> None:
        for each in self._receivers:
            each.start_runs(model, finished_runs)

    def end_block(self, model: str, runs: xr.Dataset) -> None:
        for each in self._receivers:
            each.end_block(model, runs)

    def count_restored(self, runs: int) -> None:
        for each in self._receivers:
            each.count_restored(runs)

    def report_trial(self, text: str) -> None:
        for each in self._receivers:
            each.report_trial(text)

    def count_reused(self, runs: int, place: str) -> None:
        for each in self._receivers:
            each.count_reused(runs, place)

    def inform(self, text: str) -> None:
        for each in self._receivers:
            each.inform(text)

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        for each in self._receivers:
            each.advance(runs, failed, in_progress)

    def start_analysis(self) -> None:
        for each in self._receivers:
            each.start_analysis()

    def warn(self, text: str) -> None:
        for each in self._receivers:
            each.warn(text)
