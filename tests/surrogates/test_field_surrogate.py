"""Surrogates of fields: principal components, the scores in their place, and what is left."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from campbell import CURVE, JOINT, exact
from hypothesis import given, settings
from hypothesis import strategies as st
from study_text import study_text

import uqpen
from uqpen.core.labels import BOUND, INTERVAL_LABEL, NOTE
from uqpen.core.model import Dimension, Input, Model, Output, Results
from uqpen.core.streams import Stream
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quadrature import Quadrature
from uqpen.distributions.joint_distribution import JointDistribution, RandomInput
from uqpen.distributions.univariate import Normal
from uqpen.execution import Evaluator, evaluate
from uqpen.models.known_functions import Campbell
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.surrogate.surrogate_draws import SurrogateDraws
from uqpen.statistics.surrogate.surrogate_statistics import surrogate_statistics
from uqpen.surrogates.archived_surrogate import restore_surrogate
from uqpen.surrogates.best_surrogate import FixedChoice
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos
from uqpen.surrogates.field_surrogate import FieldSurrogate
from uqpen.surrogates.fitted_surrogate import Prediction
from uqpen.surrogates.fitting import fit_surrogate
from uqpen.surrogates.gaussian_process import GaussianProcess
from uqpen.surrogates.gaussian_process_fit import GaussianProcessFit
from uqpen.surrogates.output_surrogate import OutputSurrogate
from uqpen.surrogates.principal_components import PrincipalComponents, score_name
from uqpen.surrogates.separate_fits import OutputFit
from uqpen.verification.check_result import CheckOutcome

TIME = Dimension("time", "s", values=tuple(np.linspace(0, 3, 21)))
DEPTH = Dimension("depth", "m", values=(0.0, 1.0, 1.5, 4.0))


class RankTwo(Model):
    """A field, linear in x and z at each place, with outputs that surrogates fit or do not fit."""

    name = "rank-two"
    inputs = (Input("x", "1"), Input("z", "1"))
    outputs = (
        Output("field", "K", dims=(TIME, DEPTH)),
        Output("steady", "K", dims=(TIME,)),
        Output("peak", "K"),
        Output("course", "m", dims=(TIME,), may_end=True),
    )

    def evaluate(self, inputs):
        time, depth = np.meshgrid(TIME.values, DEPTH.values, indexing="ij")
        x, z = (inputs[name][:, None, None] for name in ("x", "z"))
        fields = {
            "field": 5 + x * np.sin(time) * depth + z * time,
            "steady": np.ones((len(x), len(TIME.values))),
            "peak": 9 * (inputs["x"] + inputs["z"]),
            "course": np.ones((len(x), len(TIME.values))),
        }
        return Results.all_ok(fields)


NORMALS = JointDistribution(
    tuple(RandomInput(each, Normal(0.0, 1.0), "1") for each in RankTwo.inputs), RankTwo.inputs
)


@dataclass(frozen=True, eq=False)
class LineFit(OutputFit):
    slopes: np.ndarray

    def predict(self, points):
        mean = self.slopes[0] + points @ self.slopes[1:]
        return Prediction(mean, np.full(len(points), 0.1))


@dataclass(frozen=True)
class Line(OutputSurrogate):
    """A user-defined surrogate: a plane, with a standard deviation."""

    output_fit = LineFit
    least: float = 0.0

    def fit_output(self, points, values, rng):
        if values.std() < self.least:
            return "its values are too small"
        columns = np.column_stack([np.ones(len(points)), points])
        return LineFit(np.linalg.lstsq(columns, values, rcond=None)[0])


def runs_of(model, joint, design, seed=1):
    points = next(iter(design.rounds(joint, Stream(seed, "designs", "some"))))
    return evaluate(Evaluator(model), points, {})


def fitted(surrogate, design, model=None):
    model = model or RankTwo()
    joint = JOINT if isinstance(model, Campbell) else NORMALS
    runs = runs_of(model, joint, design)
    found = fit_surrogate(surrogate, "pce", runs, model, joint, Stream(1, "surrogates"))
    assert isinstance(found, FieldSurrogate)
    return found


OTHERS = runs_of(RankTwo(), NORMALS, MonteCarlo(runs=30), seed=2)
SETTINGS = {
    "sparse": (PolynomialChaos(design="t", order=2), MonteCarlo(runs=40)),
    "projection": (PolynomialChaos(design="t", order=2, method="projection"), Quadrature(order=2)),
    "sparse grid": (
        PolynomialChaos(design="t", order=2, method="projection"),
        Quadrature(order=2, grid="sparse"),
    ),
    "outside": (Line(design="t"), MonteCarlo(runs=40)),
}


@pytest.mark.parametrize(("surrogate", "design"), SETTINGS.values(), ids=list(SETTINGS))
def test_a_field_of_rank_two_is_reproduced(surrogate, design):
    found = fitted(surrogate, design)
    inputs, completed = found.completed_runs(OTHERS)
    np.testing.assert_allclose(
        found.predict(inputs)["field"].mean, completed["field"].values, rtol=0, atol=1e-9
    )
    assert [output.name for output in found.outputs] == ["field", "peak"]
    assert found.fields["field"].components.count == 2
    assert found.reasons == {
        "steady": "it does not vary: it is the same in every run",
        "course": "it does not vary: it is the same in every run",
    }


CHOICE = dict.fromkeys(("peak", *(score_name("field", i) for i in (0, 1))), "gaussian-process")


@pytest.mark.parametrize(
    "surrogate", [GaussianProcess(design="t"), FixedChoice("t", choice=CHOICE)]
)
def test_values_are_evaluated_without_deviations(surrogate, monkeypatch):
    found = fitted(surrogate, MonteCarlo(runs=40))
    inputs, _ = found.completed_runs(OTHERS)
    predicted = found.predict(inputs)
    monkeypatch.delattr(GaussianProcessFit, "predict")
    for name, values in found.evaluate(inputs).outputs.items():
        assert np.array_equal(values, predicted[name].mean)


@pytest.mark.parametrize(("surrogate", "design"), SETTINGS.values(), ids=list(SETTINGS))
def test_its_group_alone_predicts_the_same_bits(surrogate, design):
    found = fitted(surrogate, design).with_check(OTHERS)
    tree = found.to_tree()
    whole = xr.DataTree.from_dict({f"/pce{node.path}": node.dataset for node in tree.subtree})
    restored = restore_surrogate(whole.children["pce"], "pce", loaded=type(surrogate))
    assert restored.to_tree().identical(tree)
    assert restored.reasons.keys() == found.reasons.keys()
    assert restored.identity()["components_sha256"] == found.identity()["components_sha256"]
    inputs, _ = found.completed_runs(OTHERS)
    for name, prediction in found.predict(inputs).items():
        again = restored.predict(inputs)[name]
        assert np.array_equal(again.mean, prediction.mean)
        assert (again.std is None) == (prediction.std is None)
    row = {name: values[3:4] for name, values in inputs.items()}
    alone = found.predict(row)["field"].mean
    if not isinstance(surrogate, Line):  # a product of matrices has other last bits
        assert np.array_equal(alone[0], found.predict(inputs)["field"].mean[3])


def test_a_scalar_output_is_fitted_as_without_fields():
    class Scalar(RankTwo):
        outputs = (Output("peak", "K"),)

        def evaluate(self, inputs):
            return Results.all_ok({"peak": super().evaluate(inputs).outputs["peak"]})

    surrogate, design = SETTINGS["sparse"]
    runs = runs_of(Scalar(), NORMALS, design)
    alone = fit_surrogate(surrogate, "pce", runs, Scalar(), NORMALS, Stream(1, "surrogates"))
    beside = fitted(surrogate, design).to_tree()
    assert alone.to_tree()["peak"].to_dataset().identical(beside["peak"].to_dataset())


def test_a_standard_deviation_adds_those_of_the_scores_and_the_truncation():
    surrogate = dataclasses.replace(SETTINGS["outside"][0], components=1)
    found = fitted(surrogate, SETTINGS["outside"][1])
    inputs, _ = found.completed_runs(OTHERS)
    std = found.predict(inputs)["field"].std
    parts = found.fields["field"].components
    assert std is not None
    variance = 0.1**2 * parts.components[0] ** 2 + parts.truncated
    np.testing.assert_allclose(std[5].ravel() ** 2, variance)


def test_a_field_without_one_of_its_scores_has_a_reason():
    surrogate = dataclasses.replace(SETTINGS["outside"][0], least=1.3)
    found = fitted(surrogate, SETTINGS["outside"][1], RankTwo())
    assert [output.name for output in found.outputs] == ["peak"]
    assert found.reasons["field"] == "principal component 2: its values are too small"
    restored = restore_surrogate(found.to_tree(), "pce", loaded=Line)
    assert restored.reasons.keys() == found.reasons.keys()


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 6), st.booleans())
def test_the_truncation_is_the_share_that_the_components_leave(seed, count, is_weighted):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(12, 7)) @ rng.normal(size=(7, 7)) + rng.normal(size=7)
    grid = np.sort(rng.uniform(size=7)).tolist()
    weights = Dimension("time", "s", values=tuple(grid)).weights
    runs = rng.uniform(0.1, 1, size=12) if is_weighted else np.ones(12)
    runs /= runs.sum()
    found = PrincipalComponents.of_runs(values, weights, count, runs)
    gram = (found.components * weights) @ found.components.T
    np.testing.assert_allclose(gram, np.eye(count), atol=1e-8)
    left = values - found.fields(found.scores(values))
    whole = runs @ (values - runs @ values) ** 2 @ weights
    assert found.variance == pytest.approx(whole)
    assert found.truncation == pytest.approx(runs @ left**2 @ weights / whole)
    share = 1 - found.truncation
    assert PrincipalComponents.of_runs(values, weights, share * 0.999, runs).count <= count
    assert (found.components.max(axis=1) >= -found.components.min(axis=1)).all()


def test_a_place_that_never_varies_has_no_scatter_of_rounding():
    values = np.column_stack([np.full(9, 0.1), np.arange(9.0), np.sqrt(np.arange(9.0))])
    weights = Dimension("time", "s", values=(0.0, 1.0, 2.0)).weights
    found = PrincipalComponents.of_runs(values, weights, 0.5)
    assert (found.fields(found.scores(values))[:, 0] == 0.1).all()


@pytest.fixture(scope="module")
def found():
    surrogate = PolynomialChaos(design="t", components=6, order=8, truncation=0.75)
    fit = fitted(surrogate, LatinHypercube(runs=200, replicates=1), Campbell())
    return fit.with_check(runs_of(Campbell(), JOINT, MonteCarlo(runs=500), seed=3))


@pytest.fixture(scope="module")
def statistics(found):
    draws = SurrogateDraws(found, JOINT, (), {}, Stream(1, "draws"))
    quantity = QuantityOfInterest(CURVE, "1")
    groups = ["moments", "sensitivity"]
    return dict(surrogate_statistics(draws, [quantity], only=groups).fields[CURVE.name])


class TestCampbell:
    """Campbell's curve, fitted to 200 runs."""

    def test_few_components_have_nearly_all_of_the_variance(self):
        runs = runs_of(Campbell(), JOINT, LatinHypercube(runs=200, replicates=1))
        values, weights = runs[CURVE.name].values, CURVE.place_weights
        shares = {0.9: 2, 0.95: 2, 0.99: 3, 0.999: 6, 0.9999: 10}
        for share, expected in shares.items():
            count = PrincipalComponents.of_runs(values, weights, share).count
            assert abs(count - expected) <= 1, share

    def test_it_leaves_little_more_than_its_truncation_and_says_so(self, found):
        fit = found.fields[CURVE.name]
        assert fit.components.truncation == pytest.approx(8e-4, rel=0.2)
        assert fit.check is not None
        assert fit.check.truncation < fit.check.left < 1.5 * fit.check.truncation
        assert fit.text.startswith("6 principal components leave 0.0007")
        assert "; at 500 check runs the surrogate leaves 0.0009" in fit.text
        assert fit.text.endswith("% of that by the truncation")
        assert np.median(fit.check.q2) > 0.998

    def test_its_statistics_are_those_of_the_curve(self, statistics):
        known = exact()
        for name, error in (
            ("mean", 0.03),
            ("std", 0.05),
            ("first_order", 0.02),
            ("total_order", 0.02),
            ("generalized_first_order", 0.005),
            ("generalized_total_order", 0.005),
        ):
            found = statistics[name].sel({BOUND: "estimate"}).values
            np.testing.assert_allclose(found, getattr(known, name), atol=error, err_msg=name)
        shapley = statistics["shapley"].sel({BOUND: "estimate"})
        np.testing.assert_allclose(shapley.sum("input"), 1)

    def test_they_say_what_the_surrogate_leaves(self, found, statistics):
        for array in statistics.values():
            assert np.isnan(array.values[..., 1:]).all()
            assert set(array.coords[INTERVAL_LABEL].values.ravel()) == {"none"}
            assert set(array.coords[NOTE].values.ravel()) == {found.fields[CURVE.name].text}


def test_indices_by_draws_agree_with_the_exact_ones():
    """The surrogate of a user's own has no coefficients; here it is linear, as the field is."""
    found = fitted(*SETTINGS["outside"])
    draws = SurrogateDraws(found, NORMALS, (), {}, Stream(1, "draws"))
    output = RankTwo.outputs[0]
    quantity = QuantityOfInterest(output, "K")
    groups = ["moments", "sensitivity"]
    statistics = surrogate_statistics(draws, [quantity], only=groups).fields["field"]
    time, depth = np.meshgrid(TIME.values, DEPTH.values, indexing="ij")
    parts = np.stack([(np.sin(time) * depth) ** 2, time**2], axis=-1)
    estimates = {name: array.values[..., 0] for name, array in statistics.items()}
    np.testing.assert_allclose(estimates["std"], np.sqrt(parts.sum(-1)), rtol=2e-3)
    shares = parts[1:] / parts[1:].sum(-1, keepdims=True)
    for name in ("first_order", "total_order", "shapley"):
        np.testing.assert_allclose(estimates[name][1:], shares, atol=5e-3, err_msg=name)
        assert np.isnan(estimates[name][0]).all()
        assert set(statistics[name].coords[NOTE].values[0].ravel()) == {
            "it is the same at all draws"
        }
    whole = np.tensordot(output.place_weights, parts.reshape(-1, 2), 1)
    expected = whole / whole.sum()
    np.testing.assert_allclose(estimates["generalized_first_order"], expected, atol=5e-3)
    np.testing.assert_allclose(estimates["generalized_total_order"], expected, atol=5e-3)


STUDY = study_text(
    {
        "python": "model.py:simulate",
        "inputs": {"x": "m"},
        "outputs": {
            "curve": {"unit": "cm", "along": {"time": {"unit": "min", "values": [0, 1, 4]}}},
            "y": "mm",
        },
    },
    seed=11,
    inputs={"x": "(2 ± 1) cm"},
    outputs={"curve": {"exceeds": ["2 cm"]}},
    designs={"mc": {"kind": "monte-carlo", "runs": 30}},
    surrogates={"pce": {"kind": "polynomial-chaos", "design": "mc", "order": 1, "components": 1}},
)
MODEL = """\
def simulate(x):
    return {"curve": [100 * x, 200 * x, 300 * x], "y": 1000 * x}
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fields")
    (folder / "model.py").write_text(MODEL)
    uqpen.write(uqpen.run(uqpen.parse_study(STUDY, folder=folder)), folder / "study.nc")
    return folder / "study.nc"


class TestArchive:
    """An archive with a surrogate of a field."""

    def test_it_predicts_fields_with_their_coordinates(self, path):
        pce = uqpen.open_archive(path).surrogate("pce")
        found = pce(x=["1 cm", "3 cm"])
        assert found["curve"].dims == ("run", "time")
        np.testing.assert_allclose(found["curve"], [[0.01, 0.02, 0.03], [0.03, 0.06, 0.09]])
        assert found["time"].values.tolist() == [0, 60, 240]
        assert found["time"].attrs["units"] == "s"
        assert found["curve"].attrs["display_units"] == "cm"
        with pytest.raises(uqpen.UqpenError, match="inputs along time, a dimension of an output"):
            pce(x=xr.DataArray([0.01], dims="time"))

    def test_a_long_table_is_the_same_by_parts(self, path, command_line, monkeypatch):
        Path("points.csv").write_text("x [cm]\n1\n3\n2\n")
        words = ["predict", f"{path}:pce", "points.csv"]
        whole = command_line(*words)
        monkeypatch.setattr("uqpen.core.blocks.BLOCK", 2)
        parts = command_line(*words)
        assert (parts.out, parts.err) == (whole.out, whole.err)
        assert len(parts.out.splitlines()) == 1 + 3 + 9

    def test_it_predicts_a_long_table_or_a_file(self, path, command_line):
        Path("points.csv").write_text("x [cm]\n1\n3\n")
        command_line("predict", f"{path}:pce", "points.csv", "-o", "out.csv")
        table = pd.read_csv("out.csv")
        names = ["point", "x [cm]", "y [mm]", "time [min]", "curve [cm]", "extrapolated"]
        assert list(table.columns) == names
        assert table["point"].tolist() == [1, 2, 1, 1, 1, 2, 2, 2]
        np.testing.assert_allclose(table["y [mm]"].dropna(), [10, 30])
        np.testing.assert_allclose(table["curve [cm]"].dropna(), [1, 2, 3, 3, 6, 9])
        np.testing.assert_allclose(table["time [min]"].dropna(), [0, 1, 4, 0, 1, 4])
        assert command_line("predict", f"{path}:pce", "points.csv", "-o", "out.nc").code == 0
        with xr.open_dataset("out.nc") as written:
            assert written["curve"].sizes == {"run": 2, "time": 3}

    def test_it_is_reported_in_short(self, path, command_line):
        shown = command_line("show", str(path)).out
        assert "curve   1            " in shown
        assert "1 principal component leaves none of the variance" in " ".join(shown.split())
        reported = json.loads(command_line("show", str(path), "--json").out)
        fit = reported["surrogates"]["pce"]["outputs"]["curve"]["fit"]
        assert fit["components"] == 1
        assert fit["truncation"] == pytest.approx(0, abs=1e-12)

    def test_its_statistics_lie_along_the_field(self, path):
        group = uqpen.open_archive(path)["statistics/pce/curve"]
        assert group["exceedance"].dims == ("time", "threshold", BOUND)
        np.testing.assert_allclose(group["exceedance"].values[0, 0, 0], 0.5, atol=0.1)
        assert group["generalized_first_order"].dims == ("input", BOUND)

    def test_verify_computes_it_again_to_the_bit(self, path):
        results = uqpen.verify(path, folder=path.parent, trust=True)
        assert {each.verdict for each in results} == {CheckOutcome.EQUAL}


@pytest.mark.parametrize("wrong", [0, 0.0, 1.0, -2, True, "all"])
def test_a_wrong_number_of_components_is_refused(wrong):
    with pytest.raises(uqpen.UqpenError, match="a share of the variance between 0 and 1, or"):
        PolynomialChaos(design="t", components=wrong)
