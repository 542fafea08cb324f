"""What another uqpen has made otherwise is left out: surrogates, and intervals of estimates."""

from dataclasses import replace

import numpy as np
import pytest
from study_text import study_text

import uqpen
from uqpen.core.catalogue import INTERVAL_RECIPE
from uqpen.core.labels import RECIPE
from uqpen.verification import unrepeated
from uqpen.verification.check_result import CheckOutcome
from uqpen.verification.unrepeated import leave_out
from uqpen.verification.verify import verify

STUDY = study_text(
    "ishigami",
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": 1},
    designs={"hypercubes": {"kind": "latin-hypercube", "runs": 40, "replicates": 4}},
)
GROUP = "statistics/hypercubes/y"
OF_STATISTICS_ALONE = f"""\
{STUDY}keep = "statistics"
[designs.rule]
kind = "quadrature"
order = 3
[joint_probabilities]
between = ["y > 3", "y < 8"]
"""
SURROGATE = """
[designs.training]
kind = "monte-carlo"
runs = 20
[surrogates.pce]
kind = "polynomial-chaos"
design = "training"
order = 1
"""


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    path = tmp_path_factory.mktemp("recipes") / "now.nc"
    uqpen.write(uqpen.run(uqpen.parse_study(STUDY)), path)
    return path


@pytest.fixture
def tree(archive):
    return uqpen.open_archive(archive)


@pytest.fixture
def of_later_means(monkeypatch):
    """This uqpen makes the intervals of means by another recipe than the archive's."""
    recipe, statistics = INTERVAL_RECIPE + 1, unrepeated._STATISTICS
    mean = replace(statistics["mean"], recipe=recipe)
    monkeypatch.setattr(unrepeated, "INTERVAL_RECIPE", recipe)
    monkeypatch.setattr(unrepeated, "_STATISTICS", {**statistics, "mean": mean})


def checks_in_order(tree, folder):
    """What `verify` says of an archive."""
    uqpen.write(tree, folder / "changed.nc")
    return list(verify(folder / "changed.nc", runs=5))


def checks(tree, folder):
    """What `verify` says of an archive, by part."""
    return {each.name: each for each in checks_in_order(tree, folder)}


def move_bounds(tree, statistic):
    tree[GROUP][statistic].values[..., 1:] *= 1.5
    tree[GROUP][statistic].attrs["interval"] = "another rule"


def test_an_archive_states_the_recipe_of_its_intervals(tree, tmp_path):
    assert tree.attrs[RECIPE] == INTERVAL_RECIPE
    found = checks(tree, tmp_path)
    assert "intervals" not in found
    assert found["statistics"].verdict is CheckOutcome.EQUAL


@pytest.mark.usefixtures("of_later_means")
def test_intervals_of_an_earlier_recipe_are_no_difference(tree, tmp_path):
    move_bounds(tree, "mean")
    found = checks(tree, tmp_path)
    assert found["statistics"].verdict is CheckOutcome.EQUAL
    assert found["intervals"].verdict is CheckOutcome.UNCHECKED
    made = "those of mean are made by an earlier recipe (1, here 2)"
    assert found["intervals"].text == f"{made}; only the estimates are compared"


def test_the_same_intervals_of_this_recipe_are_a_difference(tree, tmp_path):
    move_bounds(tree, "mean")
    assert checks(tree, tmp_path)["statistics"].verdict is CheckOutcome.DIFFERENT


@pytest.mark.usefixtures("of_later_means")
@pytest.mark.parametrize("statistic", ["mean", "quantile"])
def test_estimates_of_an_earlier_recipe_are_compared(tree, tmp_path, statistic):
    values = tree[GROUP][statistic].values
    values[..., 0] = np.nextafter(values[..., 0], np.inf)
    assert checks(tree, tmp_path)["statistics"].verdict is CheckOutcome.DIFFERENT


@pytest.mark.usefixtures("of_later_means")
def test_intervals_that_no_recipe_has_changed_are_compared(tree, tmp_path):
    tree[GROUP]["quantile"].values[..., 1:] *= 1.5
    assert checks(tree, tmp_path)["statistics"].verdict is CheckOutcome.DIFFERENT


def test_intervals_of_a_later_recipe_are_not_compared(tree, tmp_path):
    tree.attrs[RECIPE] = INTERVAL_RECIPE + 1
    tree[GROUP]["quantile"].values[..., 1:] *= 1.5
    tree["failures/hypercubes"]["probability"].values[..., 1:] *= 1.5
    found = checks(tree, tmp_path)
    assert found["statistics"].verdict is CheckOutcome.EQUAL
    assert found["intervals"].text == "made by a later recipe (2, here 1): not compared"


def test_a_recipe_that_is_no_number_is_damage(tree, tmp_path):
    tree.attrs[RECIPE] = "new"
    found = checks(tree, tmp_path)
    assert found["structure"].text == "damaged: /: interval_recipe is no count"


def test_an_archive_without_a_recipe_is_damage(tree, tmp_path):
    del tree.attrs[RECIPE]
    assert checks(tree, tmp_path)["structure"].text == "damaged: no interval_recipe at its root"


def test_only_surrogates_of_the_recipe_of_today_are_repeated(study_of):
    study = study_of("a + b", SURROGATE, a=(0, 1), b=(0, 1))
    tree = uqpen.run(study)
    assert leave_out(study, tree, trust=True) == (study, tree, [])
    tree["statistics/pce"].attrs["surrogate_recipe"] += 1
    bare, kept, (result,) = leave_out(study, tree, trust=True)
    assert bare.surrogates == {}
    assert result.text == "not checked: pce; another uqpen has fitted and corrected them"
    assert not [path for path in kept.groups if "pce" in path]
    assert "/statistics/training/y" in kept.groups


def test_a_group_of_designs_without_runs_is_no_difference(tmp_path):
    tree = uqpen.run(uqpen.parse_study(OF_STATISTICS_ALONE))
    assert set(tree["failures"].children) == set(tree["joint_probabilities"].children)
    assert "rule" not in tree["failures"].children
    found = [each for each in checks_in_order(tree, tmp_path) if each.name == "statistics"]
    assert [each.verdict for each in found] == [CheckOutcome.UNCHECKED, CheckOutcome.EQUAL]
