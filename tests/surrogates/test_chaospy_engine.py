"""An expansion that chaospy fits is the same as one's own, and needs no chaospy afterwards."""

import sys

import chaospy
import numpy as np
import pytest
from study_text import study_text

import uqpen
from uqpen.core.errors import StudyError
from uqpen.core.model import Input, Model, Output, Results
from uqpen.core.streams import Stream
from uqpen.distributions.joint_distribution import FixedInput, JointDistribution, RandomInput
from uqpen.execution import Evaluator, evaluate
from uqpen.surrogates.archived_surrogate import restore_surrogate
from uqpen.surrogates.chaos import chaospy_engine
from uqpen.testing import check_surrogate
from uqpen.verification.verify import verify

# Both solve the same well-conditioned equations: a condition number of 1e3 and rounding of 1e-16
# leave 1e-13 of the largest coefficient.
TOLERANCE = 1e-11

SEVERAL = (
    uqpen.Normal(4e8, 4e7),
    uqpen.Uniform(1e-3, 3e-3),
    uqpen.Gamma(3.0, 2.0),
    uqpen.Beta(2.0, 3.0, -1.0, 4.0),
    uqpen.Lognormal(2.0, 0.5),
    uqpen.LogUniform(0.1, 30.0),
)
SQUARE = (uqpen.Uniform(-2.0, 2.0), uqpen.Normal(1.0, 0.5))


class Smooth(Model):
    """A function of all inputs, each over its size."""

    name = "smooth"
    outputs = (Output("y", "m"),)

    def __init__(self, joint):
        self.inputs = joint.variables
        self.sizes = joint.nominal()

    def evaluate(self, inputs):
        parts = [values / (self.sizes[name] or 1.0) for name, values in inputs.items()]
        return Results.all_ok({"y": np.exp(sum(parts) / len(parts)) + parts[0] * parts[-1]})


def joint_of(*distributions):
    entries = (
        *(RandomInput(Input(f"x{i}", "1"), each, "1") for i, each in enumerate(distributions, 1)),
        FixedInput(Input("c", "1"), 3.0, "1"),
    )
    return JointDistribution(entries, tuple(entry.variable for entry in entries))


def fitted(distributions, design, engine, **settings):
    joint = joint_of(*distributions)
    model = Smooth(joint)
    points = next(design.rounds(joint, Stream(1, "designs", "training")))
    runs = evaluate(Evaluator(model), points, {})
    surrogate = uqpen.PolynomialChaos(design="training", engine=engine, **settings)
    return surrogate.fit("pce", runs, model, joint, Stream(1, "surrogates", "pce"))


@pytest.mark.parametrize(
    ("distributions", "design", "settings"),
    [
        (SEVERAL, uqpen.LatinHypercube(200, 1), {"order": 2, "method": "least-squares"}),
        (SQUARE, uqpen.MonteCarlo(80), {"method": "least-squares"}),
        (SQUARE, uqpen.MonteCarlo(80), {"order": 6, "truncation": 0.6, "method": "least-squares"}),
        (SQUARE[:1], uqpen.MonteCarlo(40), {"order": 5, "method": "least-squares"}),
        (SQUARE, uqpen.Quadrature(5), {"order": 5, "method": "projection"}),
        (SEVERAL[2:4], uqpen.Quadrature(4), {"method": "projection"}),
        (
            (SEVERAL[2], SEVERAL[4]),
            uqpen.MonteCarlo(80),
            {"order": 3, "method": "least-squares", "transform": {"y": "log"}},
        ),
    ],
)
def test_coefficients_are_those_of_uqpen(distributions, design, settings):
    ours, theirs = (
        fitted(distributions, design, engine, **settings).expansions["y"]
        for engine in ("uqpen", "chaospy")
    )
    np.testing.assert_array_equal(theirs.indices, ours.indices)
    scale = np.abs(ours.coefficients).max()
    np.testing.assert_allclose(theirs.coefficients, ours.coefficients, atol=TOLERANCE * scale)
    assert theirs.method == f"{ours.method}, by chaospy"
    assert theirs.leave_one_out == pytest.approx(ours.leave_one_out, rel=1e-6, nan_ok=True)


@pytest.mark.filterwarnings("ignore:.newshape. keyword:DeprecationWarning")
def test_indices_in_closed_form_are_those_of_chaospy():
    found = fitted(SQUARE, uqpen.MonteCarlo(60), "chaospy", order=3, method="least-squares")
    joint = chaospy.J(chaospy.Uniform(-2, 2), chaospy.Normal(1, 0.5))
    x = joint.sample(200, seed=1)
    values = found.evaluate({"x1": x[0], "x2": x[1]}).outputs["y"]
    expansion = chaospy.generate_expansion(3, joint, normed=True)
    theirs = chaospy.fit_regression(expansion, x, values)
    indices = found.closed_form_indices("y")
    np.testing.assert_allclose(indices.first, chaospy.Sens_m(theirs, joint), atol=1e-9)
    np.testing.assert_allclose(indices.total, chaospy.Sens_t(theirs, joint), atol=1e-9)
    mean, std = found.closed_form_moments("y")
    assert mean == pytest.approx(float(chaospy.E(theirs, joint)), rel=1e-9)
    assert std == pytest.approx(float(chaospy.Std(theirs, joint)), rel=1e-9)


def test_it_keeps_the_contract():
    settings = {"design": "training", "order": 4, "method": "least-squares"}
    check_surrogate(uqpen.PolynomialChaos(engine="chaospy", **settings))


@pytest.fixture
def without_chaospy(monkeypatch):
    """A function from whose call on chaospy is not installed."""

    def remove():
        monkeypatch.setitem(sys.modules, "chaospy", None)

    return remove


def test_it_is_restored_without_chaospy(without_chaospy):
    found = fitted(SQUARE, uqpen.MonteCarlo(60), "chaospy", order=3, method="least-squares")
    inputs = {"x1": np.linspace(-2, 2, 9), "x2": np.linspace(0, 2, 9)}
    expected = found.predict(inputs)["y"].mean
    without_chaospy()
    again = restore_surrogate(found.to_tree(), "pce")
    np.testing.assert_array_equal(again.predict(inputs)["y"].mean, expected)


STUDY = study_text(
    "ishigami",
    inputs={"x1": (-1, 1), "x2": {"normal": {"mean": 0, "std": 0.3}}, "x3": 0.5},
    designs={"training": {"kind": "latin-hypercube", "runs": 40, "replicates": 1}},
    surrogates={
        "pce": {
            "kind": "polynomial-chaos",
            "design": "training",
            "method": "least-squares",
            "engine": "chaospy",
            "order": 3,
        }
    },
)


def test_a_study_names_it_and_its_archive_is_verified(tmp_path):
    tree = uqpen.run(uqpen.parse_study(STUDY))
    assert tree["surrogates/pce/y"].attrs["method"] == "least-squares, by chaospy"
    uqpen.write(tree, tmp_path / "a.nc")
    assert {check.verdict.name for check in verify(tmp_path / "a.nc")} == {"EQUAL"}


def test_the_fits_of_the_correction_share_one_expansion(monkeypatch):
    """To build it takes most of a fit."""
    chaospy_engine._expansion.cache_clear()
    built, build = [], chaospy.generate_expansion
    monkeypatch.setattr(
        chaospy, "generate_expansion", lambda *a, **k: built.append(a) or build(*a, **k)
    )
    uqpen.run(uqpen.parse_study(STUDY))
    assert len(built) == 1
    assert chaospy_engine._expansion.cache_info().hits > 1


@pytest.mark.parametrize(
    ("before", "after", "key", "expected"),
    [
        ('"least-squares"', '"sparse"', "surrogates.pce.method", "which chaospy has"),
        ('method = "least-squares"\n', "", "surrogates.pce.method", "which chaospy has"),
        ('"chaospy"', '"numpoly"', "surrogates.pce.engine", 'one of "uqpen", "chaospy"'),
        (
            "normal = { mean = 0, std = 0.3 }",
            "weibull = { shape = 2, scale = 1 }",
            "surrogates.pce.engine",
            "or whose logarithm is normal or uniform",
        ),
    ],
)
def test_a_mistake_is_reported(before, after, key, expected):
    with pytest.raises(StudyError) as caught:
        uqpen.parse_study(STUDY.replace(before, after))
    (problem,) = caught.value.problems
    assert key in problem.key
    assert expected in problem.expected
