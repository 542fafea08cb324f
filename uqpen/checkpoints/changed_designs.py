"""Designs that have been changed so that none of their earlier runs is of use."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import xarray as xr

from uqpen.checkpoints.earlier_runs import RunSource
from uqpen.checkpoints.reused_runs import ReusedRuns
from uqpen.core.blocks import LoadedDataset
from uqpen.core.labels import RUN
from uqpen.core.streams import BLOCK, Stream
from uqpen.designs.rounds import draw_rounds
from uqpen.study.study import ValidatedStudy

__all__ = ["unusable_runs_notes"]


def unusable_runs_notes(
    study: ValidatedStudy, sources: Mapping[str, Sequence[RunSource]], reused: ReusedRuns
) -> Iterator[str]:
    """Yield a note for each changed design of whose earlier runs none is at its first points.

    Parameters
    ----------
    study : ValidatedStudy
        The study.
    sources : mapping of str to sequence of RunSource
        The sources of runs by the name of a model.
    reused : ReusedRuns
        The same runs.
    """
    for name in study.designs:
        for model, found in sources.items():
            runs = sum(len(each.runs.runs) for each in found if each.changed_design == name)
            if runs and not _finds_any(study, name, model, reused):
                yield unusable_runs_note(name, runs)
                break


def unusable_runs_note(name: str, runs: int) -> str:
    """Return the note on a changed design of whose earlier runs none can be taken."""
    return f"{name}: none of its {runs} earlier runs is at a point of the changed design"


def _finds_any(study: ValidatedStudy, name: str, model: str, reused: ReusedRuns) -> bool:
    """Check whether one of the first points of a design has an earlier run."""
    stream = Stream(study.seed, "designs", name)
    drawn = next(draw_rounds(study.designs[name], study.joint, stream))
    points = drawn.assign(study.models[model].given)
    blocked = LoadedDataset(points) if isinstance(points, xr.Dataset) else points
    head = blocked.read(0, min(blocked.size, BLOCK))
    runs = head.sizes[RUN]
    columns = {str(key): head[key].broadcast_like(head[RUN]).values for key in head.data_vars}
    earlier = reused.earlier_runs(model, columns)
    return earlier is not None and bool((reused.find(earlier, columns, 0, runs) >= 0).any())
