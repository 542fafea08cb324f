"""Contract test of user-defined statistics."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.core.errors import StudyError
from uqpen.core.labels import ROLE, RUN, SAMPLING, STATUS
from uqpen.core.model import Category, Output
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.run_samples import sample_of
from uqpen.statistics.sample import Sample
from uqpen.statistics.user_defined import user_defined_statistics
from uqpen.statistics.user_defined_analysis import Analysis, UserDefinedAnalysis

__all__ = ["check_statistic", "example_samples"]

_RUNS = 200


def example_samples() -> list[tuple[Sample, QuantityOfInterest]]:
    """Return samples of a number and of a category, each with its quantity of interest.

    Of the 200 independent runs, two have failed.
    """
    number = Output("deflection", "m")
    kinds = Output(
        "state", "1", categories=(Category("elastic", "elastic"), Category("bent", "bent"))
    )
    generator = np.random.default_rng(1)
    load = generator.random(_RUNS)
    deflection = load**2 + 0.1 * generator.random(_RUNS)
    status = np.full(_RUNS, Status.OK, dtype=np.int8)
    status[[3, 150]] = Status.FAILED
    runs = xr.Dataset(
        {
            "load": (RUN, load, {ROLE: "input", "units": "N"}),
            number.name: (RUN, np.where(status == Status.OK, deflection, np.nan)),
            kinds.name: (RUN, (deflection > 0.5).astype(np.float64)),
            STATUS: (RUN, status),
        },
        attrs={SAMPLING: str(Sampling.INDEPENDENT)},
    )
    return [
        (sample_of(runs, output.name), QuantityOfInterest(output, output.unit))
        for output in (number, kinds)
    ]


def check_statistic(
    analysis: Analysis, sample: Sample | None = None, quantity: QuantityOfInterest | None = None
) -> None:
    """Check the contract of an analysis that yields statistics of an output.

    Names are free, and all else is an estimate array that an archive can contain. Its record, if it
    has one, is of what it yields, and all its words are known. The same sample gives the same to
    the bit, and is not written to. An output with categories is accepted.

    Parameters
    ----------
    analysis : callable
        Takes a `Sample` and a `QuantityOfInterest`, and yields names with estimate arrays.
    sample, quantity : optional
        The only sample to test with, and what is asked of it; by default `example_samples`.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    own = UserDefinedAnalysis("", analysis)
    fault, yielded = own.record_fault, set()
    assert not fault, f"{fault[0]}, but it can have {fault[1]}" if fault else ""
    samples = example_samples()
    if sample is not None:
        samples = [(sample, quantity or samples[0][1])]
    for each, asked in samples:
        before = each.values.copy(), each.points.copy()
        first, second = (dict(_statistics(analysis, each, asked)) for _ in range(2))
        yielded |= {*first}
        assert list(first) == list(second), "the same sample gives the same statistics"
        for name, array in first.items():
            assert array.identical(second[name]), f"the same sample gives the same {name}"
        after = each.values, each.points
        for one, other in zip(before, after, strict=True):
            assert np.array_equal(one, other, equal_nan=True), "a sample is not written to"
    for record in own.records:
        assert record.name in yielded, f"the record of {record.name} is of a statistic it yields"


def _statistics(
    analysis: Analysis, sample: Sample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Yield the statistics of a sample; what a study would refuse is an AssertionError."""
    name = getattr(analysis, "__name__", "the analysis")
    try:
        yield from user_defined_statistics(
            [UserDefinedAnalysis(name, analysis)], sample, quantity, {}
        ).items()
    except StudyError as error:
        raise AssertionError(str(error)) from None
