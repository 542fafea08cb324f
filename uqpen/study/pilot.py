"""Pilot of a study: the same study with a few independent runs as its only design."""

from __future__ import annotations

import tomllib
from typing import Any

import tomli_w

from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.study.load import parse_study
from uqpen.study.study import ValidatedStudy

__all__ = ["pilot_study"]


def pilot_study(study: ValidatedStudy, runs: int) -> ValidatedStudy:
    """Return the pilot of a study.

    Its runs are the first of those of the study's first `monte-carlo` design, if it has one.

    Parameters
    ----------
    study : ValidatedStudy
        Read from a file.
    runs : int
        Number of runs.
    """
    independent = (name for name, each in study.designs.items() if isinstance(each, MonteCarlo))
    name = next(independent, "pilot")
    content: dict[str, Any] = tomllib.loads(study.text)
    content.pop("surrogates", None)
    content["designs"] = {name: {"kind": "monte-carlo", "runs": runs}}
    return parse_study(tomli_w.dumps(content), name=study.name, folder=study.folder)
