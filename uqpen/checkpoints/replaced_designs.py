"""Designs of an archive that is made again: the runs that those in their places do not keep."""

from __future__ import annotations

import tomllib
from typing import Any

import xarray as xr

from uqpen.archive.groups import model_trees, read_group
from uqpen.core.errors import StudyError
from uqpen.core.labels import RUN, RUNS
from uqpen.designs.design import Design
from uqpen.designs.extension import Extension
from uqpen.designs.unloaded import UnloadedDesign
from uqpen.study.designs_section import read_designs
from uqpen.study.document import parse_document
from uqpen.study.study import ValidatedStudy
from uqpen.study.table_reader import TableReader

__all__ = ["runs_not_kept"]

# Where one of these has changed, the points or the model have, whatever the designs are.
_DECISIVE = ("seed", "model", "models", "inputs", "joint", "dependence", "constraints")


def runs_not_kept(study: ValidatedStudy, archive: xr.DataTree) -> dict[str, str]:
    """Return what becomes of the runs of an archive that the designs of a study do not keep.

    Each text has the number of runs, and the settings nearest to the study's that keep them. Of
    a study with another model, other inputs or another seed there is none.

    Parameters
    ----------
    study : ValidatedStudy
        The study that is going to replace the archive.
    archive : DataTree
        An archive without faults.

    Returns
    -------
    dict of str to str
        By the name of a design.
    """
    try:
        document = parse_document(str(archive.attrs.get("study_text", "")), study.name)
    except StudyError:
        return {}
    before, now = document.content, tomllib.loads(study.text)
    if any(before.get(key) != now.get(key) for key in _DECISIVE):
        return {}
    # Without trust, no code that the archive names is executed.
    table = TableReader(document, study.folder, trust=False, content=before).table("designs")
    designs, _ = read_designs(table)
    first = next(iter(model_trees(archive).values()))
    found = {}
    for name, settings in table.content.items():
        runs = read_group(first, RUNS, name).sizes.get(RUN, 0)
        text = _text(
            study, name, settings, now.get("designs", {}).get(name), designs.get(name), runs
        )
        if runs and text:
            found[name] = text
    return found


def _text(
    study: ValidatedStudy,
    name: str,
    before: dict[str, Any],
    now: dict[str, Any] | None,
    earlier: Design | None,
    runs: int,
) -> str:
    """Return what becomes of the runs of a design, given its tables; empty if all are kept."""
    if before == now:
        return ""
    if now is None:
        return f"its {runs} earlier runs are not used: the study has no design of this name"
    if before.get("kind") != now.get("kind"):
        return f"its {runs} earlier runs are not used: it is of another kind"
    design = study.designs[name]
    if earlier is None or isinstance(earlier, UnloadedDesign):
        return Extension(None).text(runs, design.run_count(study.joint))
    # A design that redraws points has made more runs than its settings say, one that stops fewer.
    settled = min(runs, earlier.run_count(study.joint))
    return design.extension(earlier, study.joint).text(settled, design.run_count(study.joint))
