"""Colours and markers of sources: by their kind, the same on all pages of a study."""

import pytest
import xarray as xr

from uqpen.charts.marks import DASHES, MARKERS
from uqpen.core.labels import BENCHMARK, KIND
from uqpen.results.archive_view import ArchiveView
from uqpen.results.method_comparison import MethodComparison
from uqpen.results.source_style import STYLES, source_slots, source_style

STUDY = """
[designs.first]
kind = "latin-hypercube"
[designs.second]
kind = "monte-carlo"
[designs.third]
kind = "latin-hypercube"
[surrogates.chaos]
kind = "polynomial-chaos"
[published.report]
source = "a report"
"""


def test_a_kind_has_its_place_whatever_stands_before_it():
    found = source_slots(STUDY, ["first", "second"])
    alone = source_slots('[designs.other]\nkind = "monte-carlo"', ["other"])
    assert found["second"] == alone["other"] == 0
    assert found["first"] == 1
    assert (found["chaos"], found["report"]) == (7, 8)


def test_two_designs_of_a_kind_differ():
    assert len(set(source_slots(STUDY, []).values())) == 5


def test_a_source_looks_the_same_whichever_others_are_shown():
    every = source_slots(STUDY, ["first", "second", "third", "chaos", "report"])
    assert source_slots(STUDY, ["third"])["third"] == every["third"]


@pytest.mark.parametrize("text", ["", "no TOML", "designs = 3", "[designs]\na = 1"])
def test_a_text_that_names_no_source_leaves_no_source_without_a_place(text):
    names = [f"design_{number}" for number in range(STYLES + 3)]
    found = source_slots(text, names)
    assert len({found[name] for name in names}) == STYLES
    assert set(found.values()) <= set(range(STYLES))


def test_there_are_as_many_styles_on_the_page_as_in_figures():
    assert len(MARKERS) == len(DASHES) == STYLES
    assert len({source_style(place).marker for place in range(STYLES)}) == STYLES


def test_study_page_and_comparison_page_agree(archives):
    view = ArchiveView(archives["rods"], "original")
    budgets = {"budget": [16], "runs": ("budget", [16]), "replicates": ("budget", [1])}
    root = {"study_text": view.archive.attrs["study_text"], KIND: BENCHMARK}
    groups = {"/": xr.Dataset(attrs=root)}
    for source in view.sources[::-1]:
        attributes = {"source": source, "variants": "single"}
        groups[f"/statistics/{source}"] = xr.Dataset(attrs=attributes)
        groups[f"/statistics/{source}/y"] = xr.Dataset(coords=budgets)
    comparison = xr.DataTree.from_dict({**groups, "/comparison/y": xr.Dataset()})
    methods = MethodComparison.of(comparison).methods
    assert [method.source for method in methods] == view.sources[::-1]
    for method in methods:
        assert method.series == view.series(method.source)
