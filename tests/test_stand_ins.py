"""A study whose cheap models stand for a dear one: its keys, its runs, its statistics."""

import numpy as np
import pytest
from study_text import study_text

import uqpen
from uqpen.archive.read import open_archive
from uqpen.archive.write import write
from uqpen.core.errors import StudyError
from uqpen.results.json import archive_json
from uqpen.results.output_tables import statistics_tables
from uqpen.verification.check_result import CheckOutcome
from uqpen.verification.verify import verify

STUDY = study_text(
    seed=5,
    models={
        "dear": {"use": "ishigami", "a": 5.0},
        "close": {"use": "ishigami", "a": 4.75, "stands_for": "dear", "cost": 0.05},
        "rough": {"use": "ishigami", "a": 3.0, "stands_for": "close", "cost": 0.2},
    },
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": (-3, 3)},
    outputs={"y": {"exceeds": [5], "below": [0]}},
    designs={"budgeted": {"kind": "multifidelity", "budget": 150, "pilot": 40}},
)


@pytest.fixture(scope="module")
def tree():
    return uqpen.run(uqpen.parse_study(STUDY))


def runs(tree, model):
    return tree[f"models/{model}/runs/budgeted"].to_dataset()


def cost_of_runs(tree):
    costs = {"dear": 1.0, "close": 0.05, "rough": 0.01}
    return sum(cost * runs(tree, name).sizes["run"] for name, cost in costs.items())


def test_cheap_models_run_more_points_and_all_share_the_pilot(tree):
    dear, close, rough = (runs(tree, name) for name in ("dear", "close", "rough"))
    assert dear.sizes["run"] < close.sizes["run"] < rough.sizes["run"]
    for each in (dear, close, rough):
        assert (each["round"].values[:40] == 0).all()
        assert (each["x1"].values[:40] == dear["x1"].values[:40]).all()


def test_no_more_is_spent_than_the_budget_and_nearly_all_of_it(tree):
    spent = cost_of_runs(tree)
    assert 147 < spent <= 150
    assert tree["models/dear/statistics/budgeted"].attrs["cost_spent"] == pytest.approx(spent)


def test_the_dear_models_statistics_are_worth_many_more_runs(tree):
    estimates = tree["models/dear/statistics/budgeted/y"]
    mean = estimates["mean"]
    # The mean over x3 of the term with x1 is 0, as sin is odd.
    true = 5 * (0.5 - np.sin(6) / 12)
    assert mean.values[1] < true < mean.values[2]
    assert estimates["mean_equivalent_runs"] > 500
    assert estimates["exceedance_equivalent_runs"].dims == ("threshold",)
    assert "as narrow as from about" in mean.attrs["note"]
    assert "close, rough" in mean.attrs["interval"]
    for name in ("quantile", "percentile", "exceedance", "below"):
        values = estimates[name].values
        assert ((values[..., 1] <= values[..., 0]) | np.isnan(values[..., 1])).all()
        assert ((values[..., 0] <= values[..., 2]) | np.isnan(values[..., 2])).all()


def test_a_stand_ins_statistics_are_its_own(tree):
    estimates = tree["models/rough/statistics/budgeted/y"]
    mean = estimates["mean"]
    assert mean.values[0] == pytest.approx(runs(tree, "rough")["y"].values.mean())
    assert "mean_equivalent_runs" not in estimates


def test_what_it_cost_and_what_it_is_worth_are_shown(tree):
    dear, close = (
        archive_json(tree)["models"][name]["designs"]["budgeted"] for name in ("dear", "close")
    )
    cost = cost_of_runs(tree)
    assert dear["cost_spent"] == pytest.approx(cost)
    assert dear["outputs"]["y"]["exceedance"]["5"]["equivalent_runs"] > 0
    assert "cost_spent" not in close
    table = next(statistics_tables(tree))
    assert f"with the runs of the stand-ins, the cost of {cost:.4g} runs" in table.notes


def test_differences_are_of_common_points(tree):
    common = runs(tree, "dear").sizes["run"]
    assert tree["differences/rough/budgeted/y"]["mean"].attrs["runs_used"] == common


@pytest.mark.slow
def test_its_archive_is_verified(tree, tmp_path):
    write(tree, tmp_path / "a.nc")
    assert {result.verdict for result in verify(tmp_path / "a.nc")} == {CheckOutcome.EQUAL}
    assert open_archive(tmp_path / "a.nc")["models/dear/runs/budgeted"].sizes["run"] < 150


def test_a_larger_budget_keeps_the_points(tree):
    more = uqpen.run(uqpen.parse_study(STUDY.replace("150", "220")))
    for name in ("dear", "close", "rough"):
        assert set(runs(tree, name)["x1"].values) <= set(runs(more, name)["x1"].values)


@pytest.mark.parametrize(
    ("old", "new", "reported"),
    [
        ('"close"\ncost', '"closer"\ncost', ["models.rough.stands_for", "did you mean"]),
        ('"close"\ncost', '"rough"\ncost', ["models.rough.stands_for", "another model"]),
        ('"dear"\ncost', '"rough"\ncost', ["models.close.stands_for", "in its turn"]),
        ("cost = 0.05", "cost = 2", ["study.toml:9", "models.close.cost", "below 1"]),
        ("cost = 0.05\n", "", ["models.close.cost", "nothing"]),
        ("pilot = 40", "pilot = 149", ["designs.budgeted.budget", "enough for a pilot of 149"]),
        ("pilot = 40", 'output = "z"', ["designs.budgeted.output", "a number"]),
        ('stands_for = "close"\ncost = 0.2\n', "", ["designs.budgeted.kind", "rough"]),
    ],
)
def test_a_mistake_is_reported_with_its_key(old, new, reported):
    assert old in STUDY
    with pytest.raises(StudyError) as caught:
        uqpen.parse_study(STUDY.replace(old, new))
    for text in reported:
        assert text in str(caught.value)


def test_a_study_without_stand_ins_has_no_such_design():
    study = STUDY.replace('stands_for = "close"\ncost = 0.2\n', "")
    with pytest.raises(StudyError, match="no model stands for another"):
        uqpen.parse_study(study.replace('stands_for = "dear"\ncost = 0.05\n', ""))
