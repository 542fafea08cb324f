"""Two archives side by side: what changed in the study, and how its answers moved.

The first archive is called A on the page, the second B. They need not be of the same study: what
only one of them has is named.
"""

from __future__ import annotations

from uqpen.report import ReportSection

__all__ = ["REVISION_SECTIONS"]

# In the order of the page. The functions take a `uqpen.report.revisions.revision_page.ArchivePair`.
REVISION_SECTIONS = {
    "estimates": ReportSection(
        "How the answers moved",
        "Estimates of A and of B by the same design or surrogate, and their difference. It has no "
        "interval of its own: the two intervals are apart, or they overlap.",
        "uqpen.report.revisions.revision_page:estimate_changes",
        absence_note="common estimates",
    ),
    "distributions": ReportSection(
        "Distribution functions",
        "The probability that an output is at most a value, in A and in B. Each shade is a band "
        "that is valid for all values at once, for one archive by itself.",
        "uqpen.report.revisions.revision_page:cdf_charts",
        absence_note="common outputs with distribution functions",
    ),
    "changes": ReportSection(
        "What changed in the study",
        "The settings, inputs, models and versions that differ. Everything else is the same.",
        "uqpen.report.revisions.revision_page:study_changes",
    ),
    "others": ReportSection(
        "What only one of them has",
        "Models, outputs, designs and surrogates without a counterpart are not compared.",
        "uqpen.report.revisions.revision_page:unpaired",
    ),
}
