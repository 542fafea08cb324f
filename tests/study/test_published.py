"""Published figures: read with their units, kept apart from our own, never given an interval."""

import numpy as np
import pytest

import uqpen
from uqpen.core.errors import StudyError
from uqpen.results.output_tables import output_tables

DESIGNS = """
[designs.blocks]
kind = "saltelli"
base = 256
"""
PUBLISHED = """
[published.report]
source = "a report"
[published.report.y]
mean = 1.5
std = 0.25
response = { a = 0.4 }
largest_contribution = "b"
"""


def study(study_of, published=PUBLISHED):
    return study_of("a + b", DESIGNS + published, a=(0, 1), b=(0, 1))


def test_they_stand_beside_our_own(study_of):
    tree = uqpen.run(study(study_of))
    mean = tree["statistics/report/y"]["mean"]
    assert mean.values[0] == 1.5
    assert np.isnan(mean.values[1:]).all()
    assert mean.attrs["note"] == "published in a report"
    assert tree["statistics/report/y"]["response"].sel(input="a").values[0] == 0.4
    assert tree["statistics/report/y"].attrs["largest_contribution"] == "b"


def test_they_are_shown_beside_them(study_of):
    tables = {table.title: table for table in output_tables(uqpen.run(study(study_of)))}
    assert tables["y"].columns == ["blocks", "report"]
    shares = tables["y: shares of its variance"]
    assert shares.columns[-1] == "the largest to\nreport"
    assert [cells[-1] for _, cells in shares.rows] == ["–", "this"]


@pytest.mark.parametrize(
    ("old", "new", "key", "found"),
    [
        ("mean = 1.5", 'mean = "1.5 m"', "published.report.y.mean", "1.5 m"),
        ("[published.report.y]", "[published.report.z]", "published.report.z", "unknown output"),
        ("{ a = 0.4 }", "{ c = 0.4 }", "published.report.y.response.c", "unknown input"),
        ('"b"', '"c"', "published.report.y.largest_contribution", '"c"'),
        ("report", "blocks", "published.blocks", '"blocks"'),
        ('source = "a report"', "", "published.report.source", "nothing"),
    ],
)
def test_mistakes_are_met(study_of, old, new, key, found):
    with pytest.raises(StudyError) as caught:
        study(study_of, PUBLISHED.replace(old, new))
    assert any(p.key == key and found in p.found for p in caught.value.problems), caught.value
