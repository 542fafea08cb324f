"""An adaptive design is sent the runs of each round, and estimates where it asks for them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.core.errors import UnknownNameError
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count
from uqpen.designs.design import Design
from uqpen.designs.feedback import Feedback
from uqpen.designs.rounds import no_estimates
from uqpen.statistics import running_estimates
from uqpen.testing import check_design

MODELS = """
[models.plain]
use = "ishigami"
[models.other]
use = "ishigami"
a = 5.0
with = { x3 = 1.5 }
"""
STUDY = """
seed = 3
{model}
[inputs]
x1 = {{ uniform = {{ lower = -3, upper = 3 }} }}
x2 = {{ uniform = {{ lower = -3, upper = 3 }} }}
x3 = 1
[constraints]
keep = ["x1 < 2.9"]
[outputs.y]
exceeds = [5]
[designs.one]
kind = "monte-carlo"
runs = 10
"""


@dataclass(frozen=True)
class Listening(Design):
    """Monte Carlo draws in rounds; it keeps what it is sent."""

    sampling = Sampling.INDEPENDENT
    heard: ClassVar[list[Feedback]] = []

    number: int = count(default=3)

    def rounds(self, joint, stream):
        self.heard.clear()
        for part in range(self.number):
            unit = stream.generator("points", part).random((50, len(joint.random)))
            self.heard.append((yield joint.points(unit, {})))

    def run_count(self, joint):
        return 50 * self.number


def listen(model='[model]\nuse = "ishigami"'):
    study = uqpen.parse_study(STUDY.format(model=model))
    tree = uqpen.run(replace(study, designs={"one": Listening()}))
    return tree, list(Listening.heard)


def test_it_is_sent_the_runs_of_the_last_round():
    tree, heard = listen()
    runs = tree["runs/one"]
    assert [each.runs[""].sizes["run"] for each in heard] == [50, 50, 50]
    for name in ("x1", "y", "status"):
        sent = np.concatenate([each.runs[""][name].values for each in heard])
        assert np.array_equal(sent, runs[name].values, equal_nan=True)


@pytest.mark.processor
def test_the_estimates_of_all_rounds_are_those_of_the_archive():
    tree, heard = listen()
    found = heard[-1].estimates("", "y")
    archived = tree["statistics/one/y"]
    assert {"mean", "quantile", "exceedance", "first_order", "cdf"} <= set(found)
    for name, array in found.items():
        assert np.array_equal(array.values, archived[name].values, equal_nan=True)
        assert array.attrs["units"] == archived[name].attrs["units"]
        assert array.attrs["runs"] == archived[name].attrs["runs"] == 150


def test_the_estimates_of_an_earlier_round_stay_those_of_that_round():
    _, heard = listen()
    means = [each.estimates("", "y", only=["moments"])["mean"] for each in heard]
    assert [mean.attrs["runs"] for mean in means] == [50, 100, 150]
    values = np.concatenate([each.runs[""]["y"].values for each in heard[:2]])
    assert float(means[1][0]) == pytest.approx(np.nanmean(values), rel=1e-12)


def test_only_the_analyses_that_it_asks_for_are_made():
    _, heard = listen()
    assert set(heard[0].estimates("", "y", only=["exceedance"])) == {"exceedance"}


def test_a_design_that_asks_for_no_estimates_costs_no_analysis(monkeypatch):
    def refuse(*_, **__):
        raise AssertionError("nobody asked")

    monkeypatch.setattr(running_estimates, "analyze", refuse)
    monkeypatch.setattr(running_estimates, "join_rounds", refuse)
    _, heard = listen()
    assert len(heard) == 3


def test_of_several_models_it_is_sent_all():
    tree, heard = listen(MODELS)
    for name in ("plain", "other"):
        sent = np.concatenate([each.runs[name]["y"].values for each in heard])
        assert np.array_equal(sent, tree[f"models/{name}/runs/one"]["y"].values, equal_nan=True)
        mean = heard[-1].estimates(name, "y", only=["moments"])["mean"]
        archived = tree[f"models/{name}/statistics/one/y"]["mean"]
        assert np.array_equal(mean.values, archived.values)


def test_a_run_that_one_of_several_models_refuses_is_refused():
    statuses = {"plain": [0, 2, 0, 2], "picky": [1, 0, 0, 1]}
    runs = {
        name: xr.Dataset({"status": ("run", np.array(status, dtype=np.int8))})
        for name, status in statuses.items()
    }
    assert Feedback(runs, no_estimates).status.tolist() == [1, 2, 0, 1]


def test_a_name_that_is_unknown_is_reported_with_the_nearest():
    _, heard = listen()
    with pytest.raises(UnknownNameError, match=r"no output 'z'; .*y"):
        heard[0].estimates("", "z")
    with pytest.raises(UnknownNameError, match="no model 'other'"):
        heard[0].estimates("other", "y")
    with pytest.raises(UnknownNameError, match=r"no analysis 'mean'; .*moments"):
        heard[0].estimates("", "y", only=["mean"])


@dataclass(frozen=True)
class Altering(Listening):
    """Rounds of which the second alone has a coordinate."""

    name: ClassVar[str] = "replicate"

    def rounds(self, joint, stream):
        points = joint.points(stream.generator("points").random((5, len(joint.random))), {})
        yield points
        yield points.assign_coords({self.name: ("run", np.ones(5))})


def test_rounds_with_other_coordinates_are_refused():
    study = uqpen.parse_study(STUDY.format(model='[model]\nuse = "ishigami"'))
    with pytest.raises(uqpen.StudyError, match="some of its rounds have a replicate, others none"):
        uqpen.run(replace(study, designs={"one": Altering()}))
    with pytest.raises(uqpen.StudyError, match="some of its rounds have a replicate, others none"):
        check_design(Altering())
