"""Statistics of a design's runs as a whole are shown by the declaration of their group alone."""

import pytest
from study_text import study_text

import uqpen
from uqpen.archive.groups import DESIGN_GROUPS, GROUPS, Group
from uqpen.archive.structure import find_faults
from uqpen.core.catalogue import FAILURE_STATISTICS
from uqpen.results.json import archive_json
from uqpen.results.long_table import long_table
from uqpen.results.output_tables import output_tables

STUDY = study_text(
    {"python": "model.py:simulate", "inputs": {"a": "m", "b": "1"}, "outputs": {"y": "m"}},
    inputs={"a": ("0 m", "10 m"), "b": (0, 1)},
    designs={
        "one": {"kind": "monte-carlo", "runs": 40},
        "other": {"kind": "monte-carlo", "runs": 30},
    },
)
MODEL = """
def simulate(a, b):
    if a > 8:
        raise ValueError("too long")
    return {"y": a}
"""


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """Archive with a further group, which has what the group of failures has."""
    folder = tmp_path_factory.mktemp("groups")
    (folder / "model.py").write_text(MODEL, encoding="utf-8")
    declared = Group(
        levels=("design",),
        statistics=FAILURE_STATISTICS,
        writer="uqpen.workflow.model_groups:failure_statistics",
        title="a further group",
    )
    with pytest.MonkeyPatch.context() as patch:
        for groups in (GROUPS, DESIGN_GROUPS):
            patch.setitem(groups, "further", declared)  # type: ignore[arg-type]
        yield uqpen.run(uqpen.parse_study(STUDY, folder=folder))


def test_it_is_written_and_checked(tree):
    for design in ("one", "other"):
        written = tree["further"][design].to_dataset()
        assert written.identical(tree["failures"][design].to_dataset())
    assert list(find_faults(tree)) == []
    changed = tree.copy(deep=True)
    node = changed["further/one"]
    node.dataset = node.to_dataset().assign_coords(input=["a", "c"])
    assert list(find_faults(changed)) == ["/further/one: of c, which is no input of the runs"]
    node.dataset = node.to_dataset().assign(lowest=((), 1.0))
    assert "/further/one: lowest is not of numbers along input" in list(find_faults(changed))


def test_it_has_a_table_with_a_row_for_each_entry(tree):
    table = next(each for each in output_tables(tree) if each.title == "a further group")
    assert table.columns == ["one", "other"]
    cells = dict(table.rows)
    lowest = tree["further/one"]["lowest"].sel(input="a").item()
    assert cells["lowest value in a failed run, a"][0] == f"{lowest:.4g}"
    assert "…" in cells["probability that a run ends so, failed"][0]


def test_it_is_in_json_and_in_the_long_table(tree):
    design = archive_json(tree)["designs"]["one"]
    assert design["further"]["larger"]["a"] == design["where_lost"]["a"]["larger"]
    assert design["further"]["lowest"]["a"] == design["where_lost"]["a"]["lowest"]
    rows = long_table(tree).query("source == 'one' and statistic == 'lowest' and input == 'a'")
    assert rows["unit"].tolist() == ["m", "m"]
    assert rows["estimate"].nunique() == 1
