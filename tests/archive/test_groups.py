"""Each group of an archive is declared once, and all that handle groups read the declaration."""

from pathlib import Path

import pytest
from study_text import study_text

import uqpen
from uqpen.archive.groups import DESIGN_GROUPS, GROUPS, group_place, innermost_groups
from uqpen.core.lookup import resolve

DOCS = (Path(__file__).parents[2] / "docs" / "archive.md").read_text(encoding="utf-8")

STUDY = study_text(
    models={"fine": {"use": "ishigami"}, "coarse": {"use": "ishigami", "with": {"x3": 0.5}}},
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": 1},
    designs={"first": {"kind": "monte-carlo", "runs": 30}},
    surrogates={"chaos": {"kind": "polynomial-chaos", "design": "first", "order": 2}},
)
STUDY += '[joint_probabilities]\nboth = ["y > 1", "y < 2"]'


@pytest.mark.parametrize("name", GROUPS)
def test_a_declaration_names_what_there_is(name):
    group = GROUPS[name]
    for reference in filter(None, (group.check, group.writer, group.tables, group.json)):
        assert callable(resolve(reference))
    assert f"`/{name}" in DOCS


def test_groups_of_designs_have_records():
    for group in DESIGN_GROUPS.values():
        assert group.is_of_model
        assert group.levels == ("design",)
        assert group.statistics


def test_all_groups_of_an_archive_are_declared():
    tree = uqpen.run(uqpen.parse_study(STUDY))
    found = {group_place(node.path)[0] for node in tree.subtree}
    # Bounds are of a design for intervals, without surrogates: see `test_interval_bounds`. Noise
    # is seen in a model of one's own. Two groups need measurements: see `test_least_squares` and
    # `test_measurements`.
    absent = {"trajectory", "files", "noise", "bounds", "calibrations", "validation"}
    assert found == GROUPS.keys() - absent | {""}
    for name, group in GROUPS.items():
        for level in [tree, *tree["models"].children.values()]:
            for path, node in (
                innermost_groups(level[name], len(group.levels)) if (name in level.children) else ()
            ):
                place, names = group_place(node.path)
                assert (place, tuple(names)) == (name, group.levels)
                assert path == "".join(f"/{each}" for each in names.values())


def test_the_place_of_a_group_is_that_of_its_levels():
    assert group_place("/") == ("", {})
    assert group_place("/models/fine") == ("", {})
    assert group_place("/runs/mc") == ("runs", {"design": "mc"})
    assert group_place("/models/fine/surrogates/chaos/y/score_1") == (
        "surrogates",
        {"surrogate": "chaos", "output": "y"},
    )
    assert group_place("/differences/coarse/mc/y") == (
        "differences",
        {"model": "coarse", "design": "mc", "output": "y"},
    )
    assert group_place("/of_others/mc") == ("of_others", {})
