"""Progress reports: their interface, for one receiver or several."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Progress", "ProgressBroadcast"]

# Interface of progress reports.


class Progress:
    """Receiver of progress reports of a study; this base class ignores them."""

    def start_step(self, name: str, number: int = 0, total: int = 0) -> None:
        """Report the start of a step other than runs, such as the fit of a surrogate.

        Parameters
        ----------
        name : str
            The step in words: "fitting polynomial_chaos".
        number, total : int
            Its number among the steps of the analysis, from 1, and their total; 0 for other steps.
        """

    def start_preparation(self, model: str) -> None:
        """Report that the model is being prepared; the first time, it may be compiled."""

    def announce_designs(self, runs: Mapping[str, int]) -> None:
        """Report the approximate number of runs of each design, before the first one starts."""

    def start_design(self, name: str, runs: int) -> None:
        """Report the start of a design, with its approximate number of runs."""

    def start_runs(self, model: str, finished_runs: Callable[[], list[xr.Dataset]]) -> None:
        """Report that the runs of a model at the points of a round start.

        Parameters
        ----------
        model : str
            The name of the model in a study with several; empty for the only one.
        finished_runs : callable
            Returns the finished runs of each block under way when it is called, with their numbers
            along ``run``. It is called in the thread of the reports.
        """

    def end_block(self, model: str, runs: xr.Dataset) -> None:
        """Report that all runs of the next block of a model's round are finished."""

    def count_restored(self, runs: int) -> None:
        """Report a number of runs that were made before, and are not made again."""

    def report_trial(self, text: str) -> None:
        """Report at once that the trial run of a model has failed, and how."""

    def count_reused(self, runs: int, place: str) -> None:
        """Report a number of runs of the design that are taken from an archive, or another place.

        They are not made again. There may be several reports of one design.
        """

    def inform(self, text: str) -> None:
        """Report what else a user should know now, such as which runs cannot be taken."""

    def advance(self, runs: int, failed: int, in_progress: int) -> None:
        """Report finished runs, the missing ones among them, and the runs in progress."""

    def start_analysis(self) -> None:
        """Report that all runs are done, and that their analysis begins."""

    def warn(self, text: str) -> None:
        """Report a warning, which changes no result."""
        warnings.warn(text, RuntimeWarning, stacklevel=2)


# Progress reports for several receivers.


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
