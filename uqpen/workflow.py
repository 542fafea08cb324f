"""The main path: a study in, a tree of datasets out."""

from __future__ import annotations

from collections.abc import Iterator

import xarray as xr

from uqpen.analyses.analyze import analyze
from uqpen.archive.provenance import CONVENTIONS, SCHEMA, provenance
from uqpen.archive.read import SCHEMA_ATTRIBUTE
from uqpen.designs.design import Design
from uqpen.errors import TrajectoryError
from uqpen.evaluation import Evaluator, Map, evaluate, join
from uqpen.labels import RUNS, SAMPLING, TRAJECTORY
from uqpen.streams import Stream
from uqpen.study.study import Study

__all__ = ["Progress", "run"]


class Progress:
    """Who wants to know how far a study is; this one does not."""

    def preparing(self, model: str) -> None:
        """The model is being made ready; the first time, that may mean compiling it."""

    def design(self, name: str, runs: int) -> None:
        """A design begins, with this many runs at most."""

    def advance(self, runs: int) -> None:
        """So many runs more are done."""


def run(study: Study, *, map: Map = map, progress: Progress | None = None) -> xr.DataTree:
    """Make all the runs of a study and analyse them.

    Parameters
    ----------
    study : Study
        What `load_study` returns.
    map : callable
        Like the built-in: where batches of runs are made. It cannot change a result.
    progress : Progress, optional
        Told how far it is.

    Returns
    -------
    DataTree
        The archive's content: ``/runs/<design>``, ``/moments/<design>`` and so on.
    """
    progress = progress or Progress()
    progress.preparing(study.model.name)
    study.model.prepare()
    groups = {"/": xr.Dataset(attrs=_root_attributes(study))}
    for name, design in study.designs.items():
        progress.design(name, design.size(study.law))
        runs = join(list(_rounds(study, name, design, map, progress)))
        groups[f"/{RUNS}/{name}"] = runs.assign_attrs({SAMPLING: str(design.sampling)})
    for name in study.designs:
        for analysis, statistics in analyze(groups[f"/{RUNS}/{name}"], study.questions).items():
            groups[f"/{analysis}/{name}"] = statistics
    course = _trajectory(study)
    if course is not None:
        groups[f"/{TRAJECTORY}"] = course
    return xr.DataTree.from_dict(groups)


def _rounds(
    study: Study, name: str, design: Design, map: Map, progress: Progress
) -> Iterator[xr.Dataset]:
    """The runs of a design, round by round; each round may depend on the one before."""
    evaluator = Evaluator(study.model, study.constraints)
    display_units = {entry.variable.name: entry.display_unit for entry in study.law.inputs}
    display_units |= {question.output.name: question.display_unit for question in study.questions}
    rounds = design.rounds(study.law, Stream(study.seed, "designs", name))
    points = next(rounds)
    while True:
        runs = evaluate(evaluator, points, display_units, map=map, advance=progress.advance)
        yield runs
        try:
            points = rounds.send(runs)
        except StopIteration:
            return


def _trajectory(study: Study) -> xr.Dataset | None:
    """The model's course at the nominal inputs, where it has one and all are given."""
    nominal = study.law.nominal()
    if next(study.model.missing(nominal), None) is not None:
        return None
    try:
        course = study.model.trajectory(nominal)
    except TrajectoryError as error:
        # The one run at the nominal inputs failed, which is data as any run's failure is.
        course = xr.Dataset(attrs={"reason": str(error)})
    if course is None:
        return None
    return course.assign_attrs({f"nominal_{name}": value for name, value in nominal.items()})


def _root_attributes(study: Study) -> dict[str, str | int]:
    """What decides the numbers, at the root of the archive."""
    identity = study.model.identity()
    return {
        "title": study.title,
        "Conventions": CONVENTIONS,
        SCHEMA_ATTRIBUTE: SCHEMA,
        "study_name": study.name,
        "study_text": study.text,
        "study_sha256": study.sha256,
        # As text: a seed may be larger than any integer of NetCDF's.
        "seed": str(study.seed),
        **{f"model_{key}": value for key, value in identity.items()},
        **provenance(),
    }
