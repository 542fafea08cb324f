"""Surrogates of curves that end: the two ways, the choice between them, and the end itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner

import uqpen
from uqpen.cli.predict import predict
from uqpen.cli.show import show
from uqpen.core.labels import SAMPLING
from uqpen.core.model import Dimension, Input, Model, Output, Results
from uqpen.core.streams import Stream
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quadrature import Quadrature
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.distributions.univariate import Uniform
from uqpen.execution import Evaluator, evaluate
from uqpen.surrogates.archived_surrogate import restore_surrogate
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos
from uqpen.surrogates.fitting import fit_surrogate

PLACES = np.linspace(0.0, 12.0, 601)
TIME = Dimension("time", "s", values=tuple(PLACES))
STEP = PLACES[1]


@dataclass(frozen=True, eq=False)
class Family(Model):
    """Curves of height x over a time until z: of t/z, a decay that is cut, or of a fixed event."""

    family: str
    name = "family"
    inputs = (Input("x", "1"), Input("z", "s"))
    outputs = (Output("curve", "V", "course", "V", dims=(TIME,), may_end=True),)

    def curves(self, x, z, time):
        if self.family == "scaled":
            return x[:, None] * (2 + np.cos(3 * time / z[:, None])) + (time / z[:, None]) ** 3
        if self.family == "decay":
            return 5 * np.exp(-time / 4) + 0.1 * x[:, None] * (1 + 0.1 * x[:, None] * time)
        return x[:, None] * (1 + np.tanh((time - 4) / 0.2)) + 0.05 * time

    def evaluate(self, inputs):
        found = self.curves(inputs["x"], inputs["z"], PLACES)
        ended = inputs["z"][:, None] < PLACES
        return Results.all_ok({"curve": np.where(ended, np.nan, found)})


UNIFORMS = JointDistribution(
    tuple(
        RandomInput(variable, Uniform(*ends), variable.unit)
        for variable, ends in zip(Family.inputs, ((0.5, 1.5), (7.0, 11.0)), strict=True)
    ),
    Family.inputs,
)
CHAOS = PolynomialChaos(design="t", order=3, components=0.999999)


def runs_of(model, design, seed=1):
    points = next(iter(design.rounds(UNIFORMS, Stream(seed, "designs", "some"))))
    return evaluate(Evaluator(model), points, {}).assign_attrs({SAMPLING: str(design.sampling)})


def fitted(family, surrogate=CHAOS, design=None):
    model = Family(family)
    runs = runs_of(model, design or LatinHypercube(runs=100))
    return fit_surrogate(surrogate, "pce", runs, model, UNIFORMS, Stream(1, "surrogates"))


@pytest.fixture(scope="module", params=["scaled", "decay", "event"])
def found(request):
    return request.param, fitted(request.param)


# The end of a curve is known to a step of the grid, 0.02 of 9: that moves a curve of t/z by 0.2 %,
# and its end by that. Curves at fixed places are sums of two shapes, fitted without any error.
LARGEST_ERROR = {"scaled": 0.01, "decay": 1e-6, "event": 1e-6}


def test_the_way_is_that_of_the_curves_and_reproduces_them(found):
    family, surrogate = found
    parts = surrogate.fields["curve"].components
    assert parts.is_scaled == (family == "scaled")
    other = runs_of(Family(family), MonteCarlo(runs=100), seed=2)
    inputs, completed = surrogate.completed_runs(other)
    truth, mean = completed["curve"].values, surrogate.predict(inputs)["curve"].mean
    spread = truth[:, : parts.common_places].std(axis=0).max()
    known = np.isfinite(truth) & np.isfinite(mean)
    assert np.abs(np.where(known, mean - truth, 0)).max() < LARGEST_ERROR[family] * spread
    # Up to the place that all curves reach, nothing is missing.
    assert known[:, : parts.common_places].all()
    assert known[:, parts.common_places :].any() == (family == "scaled")


def test_the_end_is_predicted_to_a_step_of_the_grid(found):
    _, surrogate = found
    points = {"x": np.linspace(0.6, 1.4, 9), "z": np.linspace(7.2, 10.8, 9)}
    predicted = surrogate.predict(points)
    ends = predicted["curve_end"].mean
    # The last place before the end: on average half a step before.
    assert np.abs(ends - (points["z"] - STEP / 2)).max() < STEP
    if surrogate.fields["curve"].components.is_scaled:
        counts = np.isfinite(predicted["curve"].mean).sum(axis=1)
        assert np.abs(PLACES[counts - 1] - ends).max() <= STEP / 2 + 1e-9


def test_it_says_which_way_and_why(found):
    family, surrogate = found
    text = surrogate.fields["curve"].text
    if family == "scaled":
        assert "; along time scaled by the end of each curve; up to time = 7" in text
    else:
        assert "; up to time = 7 s, which all training curves reach; up to time = 7" in text
    assert "at runs left out, and the other way" in text
    q2 = {
        each: float(surrogate.to_tree()[f"curve/diagnostics/{each}"]) for each in ("q2", "end_q2")
    }
    assert min(q2.values()) > 0.999


def test_its_group_alone_predicts_the_same_bits(found):
    family, surrogate = found
    checked = surrogate.with_check(runs_of(Family(family), MonteCarlo(runs=50), seed=3))
    assert checked.fields["curve"].check.left < 1e-4
    tree = checked.to_tree()
    whole = xr.DataTree.from_dict({f"/pce{node.path}": node.dataset for node in tree.subtree})
    restored = restore_surrogate(whole.children["pce"], "pce")
    assert restored.to_tree().identical(tree)
    points = {"x": np.linspace(0.6, 1.4, 7), "z": np.linspace(7.2, 10.8, 7)}
    for name, prediction in surrogate.predict(points).items():
        again = restored.predict(points)[name].mean
        assert np.array_equal(again, prediction.mean, equal_nan=True)
    alone = restored.predict({name: values[3:4] for name, values in points.items()})
    everything = restored.predict(points)
    assert np.array_equal(alone["curve"].mean[0], everything["curve"].mean[3], equal_nan=True)


def test_a_scaled_curve_that_is_good_enough_is_taken_for_its_whole_length():
    class Straight(Family):
        def curves(self, x, z, time):
            return x[:, None] * (2 + time)

    model = Straight("decay")
    runs = runs_of(model, LatinHypercube(runs=40))
    found = fit_surrogate(CHAOS, "pce", runs, model, UNIFORMS, Stream(1, "surrogates"))
    assert found.fields["curve"].components.is_scaled
    text = found.fields["curve"].text
    assert "and the other way none, but nothing is known beyond" in text


def test_without_runs_that_can_be_left_out_curves_are_taken_as_they_are():
    surrogate = fitted("scaled", PolynomialChaos(design="t", order=4), Quadrature(order=5))
    parts = surrogate.fields["curve"].components
    assert not parts.is_scaled
    assert "as no fit without some runs says which way is better" in surrogate.fields["curve"].text


def test_curves_that_all_end_at_one_place_have_no_end_to_fit():
    class Cut(Family):
        def evaluate(self, inputs):
            return super().evaluate({**inputs, "z": np.full(len(inputs["x"]), 6.0)})

    model = Cut("decay")
    runs = runs_of(model, LatinHypercube(runs=40))
    found = fit_surrogate(CHAOS, "pce", runs, model, UNIFORMS, Stream(1, "surrogates"))
    predicted = found.predict({"x": np.array([1.0]), "z": np.array([8.0])})
    assert list(predicted) == ["curve"]
    assert np.isfinite(predicted["curve"].mean[0]).sum() == 301


def test_a_curve_that_is_the_same_up_to_where_all_get_is_scaled():
    class Flat(Family):
        def curves(self, x, z, time):
            return np.where(time < 8.0, 1.0, time - 7.0) * np.ones_like(x)[:, None]

    model = Flat("decay")
    runs = runs_of(model, LatinHypercube(runs=40))
    found = fit_surrogate(CHAOS, "pce", runs, model, UNIFORMS, Stream(1, "surrogates"))
    text = found.fields["curve"].text
    assert ", as it does not vary up to time = 7" in text


MODEL = """\
import numpy as np

TIME, SEVERAL = np.linspace(0.0, 12.0, 61), np.linspace(0.0, 12.0, 16)


def simulate(x, z):
    moving = x * (2 + np.cos(3 * TIME / z)) + (TIME / z) ** 3
    decay = 5 * np.exp(-SEVERAL / 4) + 0.1 * x
    return {
        "moving": np.where(TIME > z, np.nan, moving),
        "decay": np.where(SEVERAL > z, np.nan, decay),
    }
"""
STUDY = """\
seed = 4
[model]
python = "model.py:simulate"
inputs = { x = "1", z = "s" }
[model.dimensions]
time = { unit = "s", from_model = "TIME" }
several = { unit = "s", from_model = "SEVERAL" }
[model.outputs]
moving = { unit = "V", along = ["time"], may_end = true }
decay = { unit = "V", along = ["several"], may_end = true }
[inputs]
x = { uniform = { lower = 0.5, upper = 1.5 } }
z = { uniform = { lower = "7 s", upper = "11 s" } }
[outputs.moving]
exceeds = ["1 V"]
[designs.lhs]
kind = "latin-hypercube"
runs = 100
[surrogates.pce]
kind = "polynomial-chaos"
design = "lhs"
order = 4
"""


# The places of the study: fewer, as all statistics are computed at each.
FEWER, SEVERAL = np.linspace(0.0, 12.0, 61), np.linspace(0.0, 12.0, 16)
HALF = FEWER[1] / 2  # the last place before an end is half a step before it on average


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ending")
    (folder / "model.py").write_text(MODEL)
    uqpen.make_archive(uqpen.parse_study(STUDY, folder=folder), folder / "one.nc")
    return folder / "one.nc"


def test_an_archive_predicts_curves_with_their_ends(archive, tmp_path):
    surrogate = uqpen.open_archive(archive).surrogate("pce")
    found = surrogate(x=[1.0, 1.2], z=["8 s", "10 s"])
    ends = found["moving_end"]
    assert ends.attrs["units"] == "s"
    assert ends.values == pytest.approx([8 - HALF, 10 - HALF], abs=HALF)
    there = found["moving"].notnull()
    assert found["time"].values[there.values.sum(axis=1) - 1] == pytest.approx(
        ends.values, abs=HALF
    )
    (tmp_path / "points.csv").write_text("x,z [s]\n1,8\n1.2,10\n")
    shown = CliRunner().invoke(predict, [f"{archive}:pce", str(tmp_path / "points.csv")])
    head, first, *_ = shown.output.splitlines()
    row = dict(zip(head.split(","), first.split(","), strict=True))
    assert float(row["moving_end [s]"]) == ends.values[0]


def test_statistics_at_a_place_are_of_the_curves_that_get_there(archive):
    tree = uqpen.open_archive(archive)
    moving = tree["statistics/pce/moving"].to_dataset().sel(bound="estimate")
    later = {"time": 45}  # 9 s, which half of the curves reach
    assert float(moving["reached"][later]) == pytest.approx(0.5, abs=0.01)
    z, x = np.meshgrid(np.linspace(9, 11, 400), np.linspace(0.5, 1.5, 400))
    truth = x * (2 + np.cos(27 / z)) + (9 / z) ** 3
    # Half a step of the grid moves the curves by 0.5 %.
    assert float(moving["mean"][later]) == pytest.approx(truth.mean(), rel=1e-2)
    assert float(moving["std"][later]) == pytest.approx(truth.std(), rel=2e-2)
    assert moving["reached"].attrs.keys() >= {"estimator"}
    assert moving["mean"].attrs["conditional_on"] == "the curve's reaching the place"
    # Sobol' indices are of places that all curves reach.
    first = moving["first_order"]
    last = int(np.flatnonzero(first.notnull().all("input"))[-1])
    assert FEWER[last] == pytest.approx(7, abs=2 * HALF)
    z, x = np.meshgrid(np.linspace(7, 11, 801)[1::2], np.linspace(0.5, 1.5, 801)[1::2])
    curve = x * (2 + np.cos(18 / z)) + (6 / z) ** 3
    share = curve.mean(axis=0).var() / curve.var()
    assert float(first.sel(input="z")[30]) == pytest.approx(share, abs=0.01)
    assert float(moving["total_order"].sel(input="x")[30]) == pytest.approx(1 - share, abs=0.01)
    shown = CliRunner().invoke(show, [str(archive), "--output", "moving", "--at", "time=9"])
    text = " ".join(shown.output.split())
    assert "some curves end before, and the inputs of the others depend on each other" in text
    whole = moving["generalized_first_order"]
    assert f"up to time = {FEWER[last]:g} s" in whole.attrs["long_name"]
    assert 0.9 < float(whole.sum()) < 1
    decay = tree["statistics/pce/decay"].to_dataset()
    mean = decay["mean"].sel(bound="estimate")
    known = np.isfinite(mean.values)
    assert known.sum() == int(tree["surrogates/pce/decay"].attrs["common_places"])
    expected = 5 * np.exp(-SEVERAL / 4) + 0.1
    np.testing.assert_allclose(mean.values[known], expected[known], rtol=1e-6)
    shown = CliRunner().invoke(show, [str(archive), "--output", "decay", "--at", "several=12"])
    assert "some training curves end after several = 6" in shown.output
    assert decay["first_order"].sel(bound="estimate", input="x").values[1] == pytest.approx(1)


def test_the_variance_of_a_scaled_curve_has_that_of_its_end_by_the_slope():
    parts = fitted("scaled", design=LatinHypercube(runs=40)).fields["curve"].components
    scores = np.column_stack([np.full((3, parts.count), 0.3), [8.0, 9.0, 10.0]])
    alone = np.zeros_like(scores)
    found = parts.field_variances(scores, alone)
    truncated = np.where(np.isnan(found), np.nan, found)
    deviations = alone.copy()
    deviations[:, -1] = 0.01
    later, sooner = (parts.fields(scores + sign * deviations, is_cut=False) for sign in (1.0, -1.0))
    expected = ((later - sooner) / 2) ** 2
    # The curve is linear between the places of its grid. A difference across one mixes two slopes,
    # which differ by 1 to 3 %.
    inner = slice(1, 395)
    gained = (parts.field_variances(scores, deviations) - truncated)[:, inner]
    np.testing.assert_allclose(gained, expected[:, inner], rtol=0, atol=0.03 * expected.max())
    deviations[:, 0] = 0.2
    both = parts.field_variances(scores, deviations)[:, 0] - truncated[:, 0]
    np.testing.assert_allclose(both, 0.04 * parts.components[0, 0] ** 2)
