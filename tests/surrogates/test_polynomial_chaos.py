"""Polynomial chaos: exact where it can be, a model like any other, and never a crash."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
import xarray as xr

from uqpen.core.arrays import Arrays
from uqpen.core.errors import UnknownNameError
from uqpen.core.labels import STATUS
from uqpen.core.model import Category, Input, Model, Output, Results
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import points_in_memory
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quadrature import Quadrature
from uqpen.distributions.constraints import parse_constraint
from uqpen.distributions.joint_distribution import FixedInput, JointDistribution, RandomInput
from uqpen.distributions.univariate import Gamma, Lognormal, Normal, Uniform
from uqpen.execution import Evaluator, evaluate
from uqpen.models.known_functions import Ishigami
from uqpen.surrogates import SURROGATES
from uqpen.surrogates.archived_surrogate import restore_surrogate
from uqpen.surrogates.chaos.expansion import (
    PolynomialChaosModel,
    input_shares,
    mean,
    standard_deviation,
)
from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos

pytestmark = pytest.mark.processor

ISHIGAMI = (0.31390519114781146, 0.4424111447900409, 0.0)
ISHIGAMI_TOTAL = (0.5575888552099592, 0.4424111447900409, 0.24368366406214773)
ISHIGAMI_SHAPLEY = (0.4357470231788853, 0.4424111447900409, 0.12184183203107386)


@dataclass(frozen=True)
class Formula(Model):
    """A model of formulas, one an output, whose first input must stay below a limit."""

    formulas: Mapping[str, Callable[[Arrays], Any]]
    inputs: tuple[Input, ...]
    limit: float = math.inf
    kinds: tuple[str, ...] = ()

    name = "formula"

    @property
    def outputs(self):  # type: ignore[override]
        kinds = (Category("low", "low"), Category("high", "high"))
        return tuple(
            Output(name, "m", categories=kinds if name in self.kinds else ())
            for name in self.formulas
        )

    def conditions(self, inputs):
        first = self.inputs[0].name
        yield inputs[first] < self.limit, f"{first} < {self.limit:g}"

    def evaluate(self, inputs):
        runs = len(inputs[self.inputs[0].name])
        return Results.all_ok(
            {
                name: np.broadcast_to(f(inputs), runs).astype(float)
                for name, f in self.formulas.items()
            }
        )


def law_of(*distributions, **fixed):
    random = [
        RandomInput(Input(f"x{number}", "1"), distribution, "1")
        for number, distribution in enumerate(distributions, start=1)
    ]
    others = [FixedInput(Input(name, "1"), value, "1") for name, value in fixed.items()]
    entries = (*random, *others)
    return JointDistribution(entries, tuple(entry.variable for entry in entries))


def runs_of(model, joint, design, seed=1, keep=()):
    units = {variable.name: variable.unit for variable in joint.variables}
    points = next(design.rounds(joint, Stream(seed, "designs", "training")))
    constraints = [parse_constraint(text, units) for text in keep]
    return evaluate(Evaluator(model, constraints), points, {})


def fitted(formula, joint, design, *, seed=1, keep=(), **settings):
    model = Formula({"y": formula}, joint.variables)
    runs = runs_of(model, joint, design, seed, keep)
    surrogate = PolynomialChaos(design="training", **settings)
    return surrogate.fit("pce", runs, model, joint, Stream(seed, "surrogates", "pce"))


def rosenbrock(x):
    return 100 * (x["x2"] - x["x1"] ** 2) ** 2 + (1 - x["x1"]) ** 2


SQUARE = law_of(Uniform(-2.0, 2.0), Uniform(-2.0, 2.0))


@pytest.mark.parametrize(
    ("design", "settings"),
    [
        (LatinHypercube(60, 1), {"order": 4}),
        (LatinHypercube(60, 1), {}),
        (MonteCarlo(30), {"order": 4, "method": "least-squares"}),
        (LatinHypercube(60, 1), {"method": "least-squares"}),
        (Quadrature(4), {"order": 4, "method": "projection"}),
        (Quadrature(4, "sparse"), {"method": "projection"}),
        (Quadrature(4, rule="leja"), {"order": 4, "method": "projection"}),
        (Quadrature(4, "sparse", "clenshaw-curtis"), {"order": 4, "method": "projection"}),
        (Quadrature(4), {"order": 4}),
    ],
    ids=str,
)
def test_rosenbrocks_function_is_exact(design, settings):
    found = fitted(rosenbrock, SQUARE, design, **settings).expansions["y"]
    terms = found.indices, found.coefficients
    # The term of degrees 2 and 1 is of order 3, and of a higher one by a truncation below 1.
    assert found.order == 4 or found.truncation < 1
    assert found.indices.sum(axis=1).max() == 4
    assert mean(*terms) == pytest.approx(455 + 2 / 3, rel=1e-12)
    assert standard_deviation(*terms) == pytest.approx(606.5602418425781, rel=1e-12)
    exact = 0.49746891382737685, 0.29636448671718796
    np.testing.assert_allclose(input_shares(*terms).first, exact, rtol=0, atol=1e-12)


def test_any_polynomial_is_reproduced():
    joint = law_of(Normal(3.0, 0.5), Lognormal(2.0, 0.3), Gamma(2.0, 0.7))
    found = fitted(
        lambda x: 5e3 * (x["x1"] ** 2 * np.log(x["x2"]) - x["x3"] ** 3 + x["x1"] * x["x3"]),
        joint,
        LatinHypercube(60, 1),
        order=3,
    )
    fresh = points_in_memory(next(MonteCarlo(500).rounds(joint, Stream(9, "fresh"))))
    inputs = {str(name): fresh[name].values for name in fresh.data_vars}
    truth = 5e3 * (
        inputs["x1"] ** 2 * np.log(inputs["x2"]) - inputs["x3"] ** 3 + inputs["x1"] * inputs["x3"]
    )
    error = np.abs(found.evaluate(inputs).outputs["y"] - truth)
    assert error.max() < 1e-12 * np.abs(truth).max()


@pytest.mark.slow
def test_ishigami_from_two_hundred_runs():
    side = Uniform(-math.pi, math.pi)
    model, joint = Ishigami(), law_of(side, side, side)
    runs = runs_of(model, joint, LatinHypercube(200, 1))
    found = PolynomialChaos(design="t").fit("pce", runs, model, joint, Stream(1, "s"))
    terms = found.expansions["y"].indices, found.expansions["y"].coefficients
    indices = input_shares(*terms)
    # The project's target is 1e-4.
    np.testing.assert_allclose(indices.first, ISHIGAMI, rtol=0, atol=1e-7)
    np.testing.assert_allclose(indices.total, ISHIGAMI_TOTAL, rtol=0, atol=1e-7)
    np.testing.assert_allclose(indices.shapley, ISHIGAMI_SHAPLEY, rtol=0, atol=1e-7)
    assert mean(*terms) == pytest.approx(3.5, abs=1e-7)
    check = found.with_check(runs_of(model, joint, MonteCarlo(300), 77)).expansions["y"].check
    assert check.runs == 300
    assert check.q2 == check.q2_of_output > 1 - 1e-9
    assert found.expansions["y"].q2 > 1 - 1e-9
    assert found.expansions["y"].noise.first.max() < 1e-4


def test_closed_forms_of_many_terms_are_exact():
    joint = law_of(*[Uniform(-1.0, 1.0)] * 6)
    found = fitted(
        lambda x: sum(x[f"x{i}"] for i in range(1, 7)) ** 4,
        joint,
        LatinHypercube(500, 1),
        order=4,
        method="least-squares",
    ).expansions["y"]
    terms = found.indices, found.coefficients
    assert len(found.coefficients) == 210
    # Of six inputs with second and fourth moments 1/3 and 1/5: 6 / 5 + 3 * 6 * 5 / 9.
    assert mean(*terms) == pytest.approx(11.2, rel=1e-12)
    np.testing.assert_allclose(input_shares(*terms).shapley, np.full(6, 1 / 6), rtol=1e-9)


def test_a_logarithm_is_fitted_where_it_is_asked_for():
    joint = law_of(Normal(0.0, 1.0), Normal(0.0, 1.0))
    found = fitted(
        lambda x: np.exp(1 + x["x1"] + 0.5 * x["x2"] ** 2),
        joint,
        LatinHypercube(40, 1),
        transform={"y": "log"},
    )
    expansion = found.expansions["y"]
    assert mean(expansion.indices, expansion.coefficients) == pytest.approx(1.5, abs=1e-12)
    assert found.closed_form_problem("y") == "its logarithm was expanded"
    some = {"x1": np.array([0.3, 300.0]), "x2": np.array([-1.0, 60.0])}
    results = Evaluator(found)(some)
    assert results.outputs["y"][0] == pytest.approx(math.exp(1.8), rel=1e-12)
    # Far outside its runs an expansion may overflow, which is data.
    assert results.status.tolist() == [Status.OK, Status.NOT_FINITE]


def test_it_admits_what_its_model_admits():
    joint = law_of(Uniform(0.0, 1.0), Uniform(0.0, 1.0), c=2.5)
    model = Formula({"y": lambda x: x["x1"] * x["c"] + x["x2"]}, joint.variables, limit=0.9)
    runs = runs_of(model, joint, LatinHypercube(50, 1))
    found = PolynomialChaos(design="t", order=2).fit("pce", runs, model, joint, Stream(1, "s"))
    assert found.closed_form_problem("y").startswith("some draws are inadmissible")
    assert not found.has_closed_form("y")
    assert found.training.counts[Status.INADMISSIBLE] == 5
    half = np.full(3, 0.5)
    points = {"x1": np.array([0.5, 0.95, 0.5]), "x2": half, "c": np.array([2.5, 2.5, 2.6])}
    results = Evaluator(found)(points)
    assert results.status.tolist() == [Status.OK, Status.INADMISSIBLE, Status.INADMISSIBLE]
    assert results.reasons == {1: "x1 < 0.9", 2: "c = 2.5, as in the runs it was fitted to"}
    assert results.outputs["y"][0] == pytest.approx(1.75, rel=1e-12)
    assert list(found.missing_inputs({"x1"})) == ["x2"]


def test_what_cannot_be_fitted_says_why():
    joint = law_of(Uniform(0.0, 1.0), Uniform(0.0, 1.0))
    formulas = {
        "good": lambda x: x["x1"],
        "constant": lambda x: 4.0,
        "negative": lambda x: x["x1"] - 0.5,
        "kind": lambda x: x["x1"] > 0.5,
        "huge": lambda x: 1e155 * (1 + x["x1"]),
        "tiny": lambda x: 1e-200 * (1 + x["x1"]),
        "large": lambda x: 1e130 * (1 + x["x1"]),
    }
    model = Formula(formulas, joint.variables, kinds=("kind",))
    surrogate = PolynomialChaos(design="t", transform={"negative": "log"})
    runs = runs_of(model, joint, LatinHypercube(20, 1))
    found = surrogate.fit("pce", runs, model, joint, Stream(1, "s"))
    assert [output.name for output in found.outputs] == ["good", "large"]
    for name in ("huge", "tiny"):
        assert "its squares are too large or too small" in found.reasons[name]
    assert found.reasons["constant"] == "it does not vary: it is 4 in every run"
    assert found.reasons["negative"].startswith("it has no logarithm where it is not positive")
    assert found.reasons["kind"] == "it has kinds, not numbers"
    assert found.has_closed_form("good")
    broken = runs.assign(good=runs["good"].where(runs["run"] > 1))
    again = surrogate.fit("pce", broken, model, joint, Stream(1, "s"))
    assert again.reasons["good"] == "it is not finite in 2 runs that came back"
    assert [output.name for output in again.outputs] == ["large"]
    assert again.to_tree()["good"].attrs["not_fitted"] == again.reasons["good"]


@pytest.mark.parametrize(
    ("design", "settings", "reason"),
    [
        (MonteCarlo(5), {}, "5 runs came back, and 2 random inputs need at least 6"),
        (
            MonteCarlo(15),
            {"order": 4, "method": "least-squares"},
            "15 runs came back, and least squares need more of them than order 4 has terms, 15",
        ),
        (
            Quadrature(3),
            {"order": 4, "method": "projection"},
            "its rule is too coarse for order 4; the highest that it is exact for is 3",
        ),
        (
            # Up to eight nodes of an input; some weights are negative.
            Quadrature(3, "sparse", "leja"),
            {"order": 4, "method": "projection"},
            "its rule is too coarse for order 4; the highest that it is exact for is 3",
        ),
    ],
)
def test_too_few_runs_are_reported(design, settings, reason):
    assert fitted(rosenbrock, SQUARE, design, **settings).reasons == {"y": reason}


def test_an_order_beyond_memory_is_reported():
    joint = law_of(*[Uniform(0.0, 1.0)] * 30)
    found = fitted(lambda x: x["x1"], joint, MonteCarlo(100), order=9, truncation=1)
    assert found.reasons["y"].startswith("order 9 has more than 100_000 terms, too many for")


def test_a_rule_that_lost_nodes_is_no_rule():
    found = fitted(
        rosenbrock, SQUARE, Quadrature(6), method="projection", keep=("x1 < 1.8",), order=4
    )
    expansion = found.expansions["y"]
    assert expansion.method == "least-squares, as nodes of its rule were lost"
    assert mean(expansion.indices, expansion.coefficients) == pytest.approx(455 + 2 / 3, rel=1e-11)


def test_no_runs_and_other_inputs_are_reported():
    joint = law_of(Uniform(0.0, 1.0), c=1.0)
    model = Formula({"y": lambda x: x["x1"]}, joint.variables)
    runs = runs_of(model, joint, MonteCarlo(20))
    fit = PolynomialChaos(design="t").fit
    lost = runs.assign({STATUS: xr.full_like(runs[STATUS], Status.FAILED)})
    assert fit("p", lost, model, joint, Stream(1)).reasons["y"] == "none of its runs came back"
    varied = runs.assign(c=runs["x1"] * 2)
    varied["c"].attrs = runs["c"].attrs
    reason = fit("p", varied, model, joint, Stream(1)).reasons["y"]
    assert reason == "its design varies c, which has no distribution"


def test_fit_noise_shrinks_with_runs_and_is_keyed():
    def rough(x):
        return np.abs(x["x1"]) + x["x2"]

    few, many = (
        fitted(rough, SQUARE, MonteCarlo(runs), order=2).expansions["y"].noise
        for runs in (50, 5000)
    )
    assert few.refits == many.refits == 50
    assert 0 < many.mean < few.mean < 1
    assert (many.first < few.first).all()
    again = fitted(rough, SQUARE, MonteCarlo(50), order=2).expansions["y"].noise
    assert (again.mean, again.std) == (few.mean, few.std)
    rule = fitted(rough, SQUARE, Quadrature(3), order=2).expansions["y"].noise
    assert rule.refits == 0
    assert math.isnan(rule.mean)


@pytest.mark.slow
def test_it_comes_back_from_an_archive(tmp_path):
    joint = law_of(Lognormal(2.0, 0.5), Uniform(0.0, 1.0), c=3.0)
    formulas = {
        "y": lambda x: np.exp(x["x1"] * x["x2"]),
        "z": lambda x: x["c"] * x["x1"] + x["x2"] ** 2,
        "w": lambda x: 1.0,
    }
    model = Formula(formulas, joint.variables)
    runs = runs_of(model, joint, LatinHypercube(80, 1))
    surrogate = PolynomialChaos(design="training", transform={"y": "log"})
    found = surrogate.fit("pce", runs, model, joint, Stream(1, "s")).with_check(runs)
    path = tmp_path / "pce.nc"
    found.to_tree().to_netcdf(path, engine="netcdf4")
    with xr.open_datatree(path) as tree:
        again = restore_surrogate(tree.load(), "pce")
    assert isinstance(again, PolynomialChaosModel)
    inputs = {name: runs[name].values for name in ("x1", "x2")}
    for name, values in found.evaluate(inputs).outputs.items():
        np.testing.assert_array_equal(again.evaluate(inputs).outputs[name], values)
    assert again.reasons == found.reasons
    assert again.fixed == found.fixed
    assert again.training.counts == found.training.counts
    for name, expansion in found.expansions.items():
        other = again.expansions[name]
        for kept in ("order", "method", "check", "q2"):
            assert getattr(other, kept) == getattr(expansion, kept), kept
        assert other.output.unit == "m"
    assert again.to_tree().identical(found.to_tree())
    assert again.identity()["coefficients_sha256"] == found.identity()["coefficients_sha256"]


def test_it_can_be_sent_to_a_worker():
    model, joint = Ishigami(), law_of(*[Uniform(-1.0, 1.0)] * 3)
    runs = runs_of(model, joint, LatinHypercube(60, 1))
    found = PolynomialChaos(design="t").fit("pce", runs, model, joint, Stream(1, "s"))
    again = pickle.loads(pickle.dumps(found))
    inputs = {name: runs[name].values for name in ("x1", "x2", "x3")}
    np.testing.assert_array_equal(
        again.evaluate(inputs).outputs["y"], found.evaluate(inputs).outputs["y"]
    )


def test_dependent_inputs_have_no_closed_form():
    found = fitted(rosenbrock, SQUARE, LatinHypercube(60, 1), order=4)
    assert found.closed_form_problem("y") == ""
    dependent = replace(found, training=replace(found.training, is_independent=False))
    assert dependent.closed_form_problem("y") == "the random inputs depend on each other"
    again = restore_surrogate(dependent.to_tree(), "pce")
    assert not again.has_closed_form("y")


def test_an_output_may_have_any_name():
    names = ("x1_recurrence", "fixed_c", "x1_degree", "term", "kind", "coefficient")
    joint = law_of(Uniform(0.0, 1.0), c=3.0)
    model = Formula({name: lambda x: x["x1"] ** 2 for name in names}, joint.variables)
    runs = runs_of(model, joint, LatinHypercube(40, 1))
    found = PolynomialChaos(design="training").fit("pce", runs, model, joint, Stream(1, "s"))
    assert set(names) < set(found.to_tree().children)


def test_the_kind_that_is_named_decides_what_is_restored():
    tree = fitted(rosenbrock, SQUARE, LatinHypercube(60, 1), order=4).to_tree()
    assert tree.attrs["kind"] in SURROGATES
    tree.attrs["kind"] = "polynomial-caos"
    with pytest.raises(UnknownNameError, match='no kind of surrogate "polynomial-caos"; did you'):
        restore_surrogate(tree, "pce")
