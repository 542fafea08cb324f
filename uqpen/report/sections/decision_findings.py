"""Findings on claims that designs decided."""

from __future__ import annotations

from collections.abc import Iterator

from uqpen.report.blocks import Finding
from uqpen.results.archive_view import ArchiveView
from uqpen.results.texts import capitalized, plain_text

__all__ = ["decision_findings"]


def decision_findings(view: ArchiveView) -> Iterator[Finding]:
    """Yield the verdict of each design on its claim, with its probability of being wrong."""
    for design in view.designs:
        if decision := view.statistics.decision(design):
            verdict = f"{capitalized(decision.verdict_text)} of {design}"
            yield Finding(plain_text(decision.claim), f"{verdict}: {decision.guarantee}.")
