"""Sources of a rehearsal: the designs of a study, as they stand and at equal numbers of runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import median

import xarray as xr

from uqpen.benchmark.statistics import Estimates
from uqpen.core.blocks import LoadedDataset
from uqpen.core.labels import EQUAL, EXCEEDANCE, MOMENTS, QUANTILES, RUN, SAMPLING, STATED
from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.core.threads import one_blas_thread
from uqpen.designs.design import Design
from uqpen.designs.unloaded import UnloadedDesign
from uqpen.execution import Progress
from uqpen.statistics.absent_values import runs_with_value
from uqpen.statistics.analyze import analyze
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.sensitivity.sobol_indices import sobol_indices
from uqpen.study.study import ONLY_MODEL, ValidatedStudy
from uqpen.workflow import run_design

__all__ = [
    "RehearsedSource",
    "equal_runs",
    "is_drawn",
    "run_estimates",
    "run_once",
    "study_sources",
]

_DRAWN = (Sampling.INDEPENDENT, Sampling.STRATIFIED, Sampling.PICK_FREEZE)


@dataclass(frozen=True)
class RehearsedSource:
    """Source of estimates that is repeated with fresh random numbers.

    Parameters
    ----------
    name : str
        The name of its design in the study.
    size : str
        `STATED` or `EQUAL`.
    design : Design
        The design of its runs.
    """

    name: str
    size: str
    design: Design

    def estimates(self, study: ValidatedStudy, repeat: int) -> tuple[int, Estimates]:
        """Return the number of runs and the estimates of one repeat.

        Parameters
        ----------
        study : ValidatedStudy
            Of a single model.
        repeat : int
            The number of the repeat, which is the key of its random numbers.
        """
        stream = Stream(study.seed, "rehearsal", self.name, self.size, repeat)
        runs = run_once(study, self.design, stream)
        return runs.sizes[RUN], run_estimates(runs, study.quantities_of_interest)


def run_once(study: ValidatedStudy, design: Design, stream: Stream) -> xr.Dataset:
    """Return new runs of a design by the only model of a study, made in this process."""
    return run_design(study, design, stream, map=map, progress=Progress())[ONLY_MODEL]


def run_estimates(runs: xr.Dataset, quantities: Sequence[QuantityOfInterest]) -> Estimates:
    """Return the estimates that a rehearsal is about, by output and statistic.

    Parameters
    ----------
    runs : Dataset
        Runs of a design.
    quantities : sequence of QuantityOfInterest
        Of scalar outputs.
    """
    found = analyze(runs, quantities, only=(MOMENTS, QUANTILES, EXCEEDANCE))
    if Sampling(runs.attrs[SAMPLING]) is Sampling.PICK_FREEZE:
        handle = LoadedDataset.of(runs)
        with one_blas_thread():
            for quantity in quantities:
                name = quantity.output.name
                found[name] |= sobol_indices(runs_with_value(handle, name), quantity)
    return found


def study_sources(study: ValidatedStudy, runs: int | None = None) -> tuple[RehearsedSource, ...]:
    """Return the designs of a study whose points are drawn, and their forms of equal size.

    Parameters
    ----------
    study : ValidatedStudy
        Its other designs have the same points each time, or are no sample.
    runs : int, optional
        The largest number of runs of the forms of equal size; by default as `equal_runs`.
    """
    drawn = {name: each for name, each in study.designs.items() if is_drawn(each)}
    stated = [RehearsedSource(name, STATED, design) for name, design in drawn.items()]
    limit = runs or equal_runs(study)
    return (*stated, *_equal_sources(study, drawn, limit))


def equal_runs(study: ValidatedStudy) -> int:
    """Return a number of runs to compare designs at: a power of two, which is fair to all."""
    counts = [each.run_count(study.joint) for each in study.designs.values() if is_drawn(each)]
    return 1 << (int(median(counts)).bit_length() - 1) if counts else 0


def is_drawn(design: Design) -> bool:
    """Check that a design draws other points each time, so that it can be repeated."""
    return design.sampling in _DRAWN and not isinstance(design, UnloadedDesign)


def _equal_sources(
    study: ValidatedStudy, drawn: dict[str, Design], runs: int
) -> Iterator[RehearsedSource]:
    for name, design in drawn.items():
        replicated = design.replicate_count > 1
        scaled = design.scaled(study.joint, runs, replicated=replicated)
        if scaled is not None:
            yield RehearsedSource(name, EQUAL, scaled)
