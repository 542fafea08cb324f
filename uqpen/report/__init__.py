"""The report: one page for a person, made of an archive alone.

A page is made of sections, each a family member that takes a part of an archive and yields the
blocks that this has something for. What a block looks like is the template's affair, what a chart
does under a pointer that of the page's script; the chart itself is data.
"""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["SECTIONS", "Section"]


class Section(NamedTuple):
    """What stands in the page's contents.

    Attributes
    ----------
    title : str
    lead : str
        A paragraph that says what is seen, and how to read it.
    make : str
        What yields its blocks.
    """

    title: str
    lead: str
    make: str


# In the order of the page, by the names that links have.
SECTIONS = {
    "distributions": Section(
        "How it is distributed",
        "How likely each output is to be at most a value, with a band that holds for all values at "
        "once; move the threshold to read it off. Below it, the runs themselves and their "
        "quantiles.",
        "uqpen.report.distributions:distributions",
    ),
}
