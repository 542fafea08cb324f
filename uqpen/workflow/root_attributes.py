"""Attributes of the root of an archive, which determine its numbers."""

from __future__ import annotations

from uqpen.archive.provenance import CONVENTIONS, SCHEMA, of_python_functions, provenance
from uqpen.archive.read import SCHEMA_ATTRIBUTE
from uqpen.core.catalogue import INTERVAL_RECIPE
from uqpen.core.labels import CONFIDENCE_LEVEL, DEPENDENCIES, RECIPE
from uqpen.core.model import Model
from uqpen.statistics.estimate import LEVEL
from uqpen.study import SECTIONS
from uqpen.study.study import ValidatedStudy

__all__ = ["level_attribute", "model_identity", "root_attributes"]


def root_attributes(study: ValidatedStudy) -> dict[str, str | int]:
    """Return the attributes of an archive's root, which determine its numbers."""
    return {
        "title": study.title,
        "Conventions": CONVENTIONS,
        SCHEMA_ATTRIBUTE: SCHEMA,
        RECIPE: INTERVAL_RECIPE,
        "study_name": study.name,
        "study_text": study.text,
        "study_sha256": study.sha256,
        # As text: a seed may be larger than any integer of NetCDF.
        "seed": str(study.seed),
        **_section_attributes(study),
        **({} if study.has_several_models else model_identity(study.model)),
        **provenance(),
        **of_python_functions(),
    }


def _section_attributes(study: ValidatedStudy) -> dict[str, str]:
    """Return what sections of the study state at the root."""
    sections = [each for each in SECTIONS.values() if each.attribute]
    stated = {each.attribute: getattr(study, each.field) for each in sections}
    return {
        name: ", ".join(value) if isinstance(value, tuple) else str(value)
        for name, value in stated.items()
        if value
    }


def level_attribute(study: ValidatedStudy) -> dict[str, float]:
    """Return the confidence level of a study that states another than the default."""
    level = study.confidence_level
    return {} if level == LEVEL else {CONFIDENCE_LEVEL: level}


def model_identity(model: Model) -> dict[str, str]:
    """Return the identity of a model, and what its runs depend on, as attributes of its group."""
    lines = sorted(model.dependencies())
    return {
        **{f"model_{key}": value for key, value in model.identity().items()},
        **({DEPENDENCIES: "\n".join(lines)} if lines else {}),
    }
