"""Which runs of an archive were lost, and why."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import group, models_in, names_in
from uqpen.evaluation import status_counts
from uqpen.labels import LOST, REASON, RUN, RUNS, STATUS, Status

__all__ = ["Loss", "has_lost_all", "losses"]


class Loss(NamedTuple):
    """Runs of one design that were lost for one reason.

    Attributes
    ----------
    design : str
    status : Status
    reason : str
    runs : int
        How many.
    """

    design: str
    status: Status
    reason: str
    runs: int


def losses(tree: xr.DataTree, design: str) -> Iterator[Loss]:
    """What was lost of a design, the most frequent reason first.

    Parameters
    ----------
    tree : DataTree
        An archive.
    design : str
        Its name.
    """
    runs = group(tree, RUNS, design)
    if REASON in runs:
        at = np.searchsorted(runs[RUN].values, runs[LOST].values)
        statuses = runs[STATUS].values[at].tolist()
        counted = Counter(zip(statuses, runs[REASON].values.tolist(), strict=True))
        for (status, reason), count in counted.most_common():
            yield Loss(design, Status(status), str(reason), count)


def has_lost_all(tree: xr.DataTree) -> bool:
    """Whether some design has no run that came back."""
    designs = (
        group(model, RUNS, design)
        for model in models_in(tree).values()
        for design in names_in(model, RUNS)
    )
    return any(not status_counts(runs)[Status.OK] for runs in designs)
