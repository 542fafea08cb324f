"""What a view of an archive costs, counted."""

from unittest.mock import Mock

import uqpen
from uqpen.results import archive_view, source_statistics
from uqpen.results.archive_view import ArchiveView

DESIGN = """
[designs.mc]
kind = "monte-carlo"
runs = 20
"""


def test_a_view_lists_the_outputs_once(study_of, monkeypatch):
    # Many outputs cost their square where each of them looks for all.
    tree = uqpen.run(study_of("a + b", DESIGN, a=(0, 1), b=(0, 1)))
    first_runs = Mock(wraps=source_statistics.first_runs)
    monkeypatch.setattr(source_statistics, "first_runs", first_runs)
    view = ArchiveView(tree, "")
    for _ in range(3):
        assert (view.numeric_outputs, view.fields, view.categorical_outputs) == (["y"], [], [])
        assert view.unit("y") == "1"
    assert first_runs.call_count == 1


def test_a_view_takes_the_shown_runs_once(study_of, monkeypatch):
    view = ArchiveView(uqpen.run(study_of("a + b", DESIGN, a=(0, 1), b=(0, 1))), "")
    taken = Mock(wraps=archive_view.input_sample)
    monkeypatch.setattr(archive_view, "input_sample", taken)
    for _ in range(3):
        assert view.design("mc").completed_values("y").size == 20
    assert taken.call_count == 1
    assert view.input_titles == {"a": "a", "b": "b"}
