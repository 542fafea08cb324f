"""Error models of samples."""

from __future__ import annotations

from enum import StrEnum

__all__ = ["ErrorModel"]


class ErrorModel(StrEnum):
    """Error model: basis on which the error of a sample's statistics is estimated."""

    INDEPENDENT = "independent draws"
    REPLICATED = "independent replicates"
    SINGLE_STRATIFIED_SET = "one stratified set"
    WEIGHTED = "weighted independent draws"
    UNKNOWN = "points of unknown origin"
