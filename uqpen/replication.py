"""Figures of a publication tested with the runs of an archive, and the readings that fit them."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from uqpen.archive.read import group_names, model_trees, open_archive, read_group
from uqpen.checkpoints.make_archive import make_archive
from uqpen.core.errors import ArchiveError, SettingsError, UnknownNameError
from uqpen.core.labels import RUNS, STATISTICS_GROUP
from uqpen.core.lookup import choices
from uqpen.core.streams import Stream
from uqpen.distributions.orthogonal_polynomials import recurrence
from uqpen.execution import Map, Progress
from uqpen.results.table import json_value
from uqpen.statistics.published import (
    Publication,
    Reading,
    TableComparison,
    compare_moments,
    independent_runs,
)
from uqpen.study.load import reading_study
from uqpen.study.study import ValidatedStudy
from uqpen.verification.archived_study import restored_study

# A kurtosis above which a sample underestimates its own noise.
_HEAVY = 4.5
# A reading whose figures are less probable than this is rejected.
LEVEL = 0.05


class PrintedFigure(NamedTuple):
    """Published figure without noise beside that found here, for one input."""

    output: str  # empty for the uncertainty of an input
    input: str
    published: float
    half_digit: float
    found: float

    @property
    def agrees(self) -> bool:
        """True if the figure found here rounds to the printed one."""
        # A cell of the print has both of its ends, and a value at an end is computed with rounding.
        return abs(self.found - self.published) <= self.half_digit * (1 + 1e-9)


@dataclass(frozen=True)
class ReadingResult:
    """A reading of a publication compared with all of its figures; the stated one has no name."""

    name: str
    note: str
    moments: TableComparison
    responses: tuple[PrintedFigure, ...]
    uncertainties: tuple[PrintedFigure, ...]

    @property
    def is_rejected(self) -> bool:
        """True if chance alone seldom makes the figures so different."""
        return self.moments.p < LEVEL

    @property
    def contradictions(self) -> list[str]:
        """Inputs whose printed uncertainty is another one."""
        return [each.input for each in self.uncertainties if not each.agrees]

    @property
    def fits(self) -> bool:
        """True if no printed figure with noise, and none of an input, speaks against it."""
        return not self.is_rejected and not self.contradictions

    @property
    def same_responses(self) -> int:
        """Number of responses that agree to the printed digit."""
        return sum(each.agrees for each in self.responses)


@dataclass(frozen=True)
class Replication:
    """Publication tested with the runs of an archive.

    Readings are there only where the stated one does not give the figures.
    """

    publication: str
    source: str
    stated: ReadingResult
    readings: tuple[ReadingResult, ...]
    published_runs: int | None = None

    @property
    def has_few_runs(self) -> bool:
        """True if a tail is heavy and the runs are fewer than ten times those of the publication.

        The kurtosis follows from the error of a standard deviation, as far as these runs show it.
        """
        runs = self.stated.moments.runs
        figures = self.stated.moments.figures
        deviations = [each for each in figures if each.figure == "std" and each.found]
        kurtosis = [1 + 4 * runs * (each.found_error / each.found) ** 2 for each in deviations]
        is_heavy = not kurtosis or max(kurtosis) > _HEAVY
        return is_heavy and self.published_runs is not None and runs < 9 * self.published_runs

    @property
    def chance_agreements(self) -> float:
        """Number of readings expected to agree by chance in as many responses as the best does.

        A response falls into its printed cell with the share that the cell has of the range over
        the readings; all are independent.
        """
        results = (self.stated, *self.readings)
        most = max(each.same_responses for each in results)
        counts = np.ones(1)
        for same in zip(*(each.responses for each in results), strict=True):
            found = [each.found for each in same]
            extent = max(found) - min(found)
            share = min(1.0, 2 * same[0].half_digit / extent) if extent else 1.0
            counts = np.convolve(counts, [1 - share, share])
        return len(results) * float(counts[most:].sum())


def replicate(
    path: Path,
    publication: str = "",
    *,
    runs: int | None = None,
    folder: Path | None = None,
    trust: bool = False,
    map: Map = map,
    progress: Progress | None = None,
) -> Replication:
    """Test the figures of a publication with the runs of an archive.

    Means and standard deviations are tested together, with the noise of both samples and the
    rounding of the print. Only where the stated reading is rejected at 5 %, or a response does not
    agree to its printed digit, the declared readings are tested. The test of the stated reading
    alone decides if anything is said; so the number of readings does not make a claim against a
    right publication more probable.

    Parameters
    ----------
    path : Path
        The archive of a study with ``[published.<name>]``. The runs of a reading are an archive
        beside it, and are taken again by the next call.
    publication : str
        Name of the publication; empty for the only one.
    runs : int, optional
        Number of independent runs of the study and of each reading; by default those of the
        archive. With heavy tails, ten times the number of the publication are needed.
    folder : Path, optional
        Folder with the files that the study names; by default the archived files.
    trust : bool
        True if code that the study names may be executed.
    map : callable
        As the built-in; it makes the batches of runs.
    progress : Progress, optional
        Receives reports of progress.

    Raises
    ------
    UnknownNameError
        If the study has no such publication.
    ArchiveError
        If the archive has no independent runs.
    """
    tree = open_archive(path)
    with restored_study(tree, folder, trust=trust) as restored:
        study = restored.study
        name = _publication_name(study, path, publication)
        figures = study.published[name]
        rng = Stream(study.seed, "replication").generator
        first = next(iter(model_trees(tree).values()))

        def result(
            label: str, note: str, own: xr.DataTree, read_as: ValidatedStudy, lost: Any
        ) -> ReadingResult:
            made = {each: read_group(own, RUNS, each) for each in group_names(own, RUNS)}
            sample = independent_runs(made)
            if sample is None:
                raise ArchiveError(f"{path}: has no design of independent runs (monte-carlo)")
            moments = compare_moments(figures, sample, rng(), lost)
            responses = tuple(_responses(figures, own))
            return ReadingResult(
                label, note, moments, responses, tuple(_uncertainties(figures, read_as))
            )

        def run(label: str, changed: ValidatedStudy) -> xr.DataTree:
            place = path.with_name(f"{path.stem}_{name}_{label}.nc")
            made = make_archive(changed, place, map=map, progress=progress or Progress())
            return next(iter(model_trees(made).values()))

        if runs is not None:
            study = reading_study(study, Reading("", {}, {}), runs)
            first = run("stated", study)
        stated = result("", "as stated", first, study, {})
        is_done = not stated.is_rejected and stated.same_responses == len(stated.responses)
        found: list[ReadingResult] = []
        for label, reading in {} if is_done else figures.readings.items():
            own, changed = first, study
            if reading.changes:
                changed = reading_study(study, reading, runs)
                own = run(label, changed)
            found.append(result(label, reading.note, own, changed, reading.lost))
        return Replication(name, figures.source, stated, tuple(found), figures.runs)


def _publication_name(study: ValidatedStudy, path: Path, publication: str) -> str:
    """Return the name of the publication that is meant."""
    if not study.published:
        raise UnknownNameError(f"{path}: its study has no publication; [published.<name>] is one")
    if not publication and len(study.published) > 1:
        raise UnknownNameError(f"--publication: expected one of {', '.join(study.published)}")
    name = publication or next(iter(study.published))
    if name not in study.published:
        raise UnknownNameError(f'no publication "{name}"; {choices(name, study.published)}')
    return name


def _responses(publication: Publication, tree: xr.DataTree) -> Iterator[PrintedFigure]:
    """Yield the responses whose rounding is known beside those of the first design with any."""
    for estimates in publication.estimates:
        if not estimates.response_rounding:
            continue
        output = estimates.output.name
        for source in group_names(tree, RUNS):
            statistics = read_group(tree, STATISTICS_GROUP, source, output)
            if "response" not in statistics:
                continue
            array = statistics["response"]
            known = set(map(str, array["input"].values))
            for name, half in estimates.response_rounding.items():
                value = math.nan
                if name in known:
                    value = float(array.sel(input=name).values[0])
                value = abs(value) if publication.magnitudes else value
                yield PrintedFigure(output, name, estimates.response[name], half, value)
            break


def _uncertainties(publication: Publication, study: ValidatedStudy) -> Iterator[PrintedFigure]:
    """Yield the printed uncertainties of inputs beside those that the study gives them."""
    deviations: dict[str, float] = {}
    for entry in study.joint.random:
        if entry.nominal:
            with contextlib.suppress(SettingsError):  # a distribution without a finite one
                std = recurrence(entry.distribution, 1).std
                deviations[entry.variable.name] = std / abs(entry.nominal)
    for name, printed in publication.uncertainties.items():
        half = publication.uncertainty_rounding.get(name, 0.0)
        yield PrintedFigure("", name, printed, half, deviations.get(name, 0.0))


# As tables and as JSON.


def replication_json(found: Replication) -> dict[str, Any]:
    """Return a replication as JSON has it, in SI units."""
    return {
        "publication": found.publication,
        "source": found.source,
        "level": LEVEL,
        "stated": _result_json(found.stated),
        "readings": {each.name: _result_json(each) for each in found.readings},
        "fitting": [each.name for each in found.readings if each.fits],
        "readings_with_as_many_responses_by_chance": found.chance_agreements,
    }


def _result_json(result: ReadingResult) -> dict[str, Any]:
    return {
        "note": result.note,
        "runs": result.moments.runs,
        "p": result.moments.p,
        "is_rejected": result.is_rejected,
        "figures": [{**each._asdict(), "z": json_value(each.z)} for each in result.moments.figures],
        "responses": _printed_json(result.responses),
        "uncertainties": _printed_json(result.uncertainties),
        "contradictions": result.contradictions,
    }


def _printed_json(figures: Sequence[PrintedFigure]) -> list[Mapping[str, Any]]:
    return [
        {**each._asdict(), "found": json_value(each.found), "agrees": each.agrees}
        for each in figures
    ]
