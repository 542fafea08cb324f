"""The contract tests that user-defined members of a family can be held to."""

from __future__ import annotations

from dataclasses import dataclass

import chaospy
import numpy as np
import pytest
import xarray as xr
from scipy import stats

import uqpen
from uqpen.core.labels import RUN
from uqpen.core.lookup import resolve
from uqpen.core.model import Input, Model, Output, Results
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count, text
from uqpen.designs import DESIGNS
from uqpen.designs.design import Design
from uqpen.distributions.frozen import FrozenDistribution
from uqpen.figures.panel import Panel
from uqpen.report.blocks import Text
from uqpen.statistics.estimate import Estimate
from uqpen.surrogates import SURROGATES
from uqpen.surrogates.fitted_surrogate import Prediction
from uqpen.surrogates.output_surrogate import OutputSurrogate
from uqpen.surrogates.separate_fits import OutputFit
from uqpen.testing import (
    check_design,
    check_distribution,
    check_figure,
    check_model,
    check_section,
    check_statistic,
    check_surrogate,
)

pytestmark = pytest.mark.processor


@pytest.mark.parametrize(
    "distribution",
    [
        uqpen.Normal(2.0, 0.5),
        uqpen.Truncated(uqpen.Normal("2 m", "0.5 m"), "1.2 m", "2.9 m"),
        uqpen.LogUniform(0.1, 30.0),
        FrozenDistribution(stats.genextreme(-0.1, loc=10, scale=2), "kN"),
        FrozenDistribution(chaospy.Normal(2, 1) + 1, "degC"),
    ],
    ids=lambda distribution: type(getattr(distribution, "frozen", distribution)).__name__,
)
def test_distributions_meet_theirs(distribution):
    check_distribution(distribution)


DESIGN_SETTINGS = {
    "monte-carlo": {"runs": 1024},
    "latin-hypercube": {"runs": 1000},
    "sobol-sequence": {"runs": 1024},
    "halton": {"runs": 1024},
    "quadrature": {"order": 4},
    "full-factorial": {"levels": 7},
    "saltelli": {"base": 64},
    "morris": {"trajectories": 20},
    "one-at-a-time": {},
    "multifidelity": {"budget": 1000},
    "active-learning": {"event": "y > 5", "learning": 20, "correction": 60},
    "subset-simulation": {"event": "y > 5", "samples": 100, "levels": 4},
    "form": {"event": "y > 5"},
    "salib:fast_sampler": {"N": 65},
    "salib:finite_diff": {"N": 64},
    "salib:ff": {},
    "importance-sampling": {"event": "y > 5", "samples": 200},
}


# One for intervals, which the inputs of the contract are not: see `test_interval_bounds`. Three
# need the measurements of a study: see `test_least_squares` and the tests of posteriors.
ELSEWHERE = {"table", "data", "interval-bounds", "least-squares", "posterior"}
ELSEWHERE |= {"posterior-by-surrogate"}


@pytest.mark.parametrize("kind", sorted(DESIGNS.keys() - ELSEWHERE))
def test_designs_meet_theirs(kind):
    check_design(resolve(DESIGNS[kind])(**DESIGN_SETTINGS[kind]))


SURROGATE_SETTINGS = {
    "polynomial-chaos": [
        {},
        {"order": 4, "method": "least-squares"},
        {"method": "projection"},
        {"transform": {"smooth": "log"}},
    ],
    "gaussian-process": [
        {},
        {"kernel": "matern-3/2", "trend": "linear", "nugget": 0.0},
        {"transform": {"smooth": "log"}},
    ],
    "best": [{}],
}


@pytest.mark.parametrize(
    ("kind", "settings"), [(kind, each) for kind in SURROGATES for each in SURROGATE_SETTINGS[kind]]
)
def test_surrogates_meet_theirs(kind, settings):
    check_surrogate(resolve(SURROGATES[kind])(design="training", **settings))


def test_models_meet_theirs():
    inputs = {name: np.linspace(-3, 3, 5) for name in ("x1", "x2", "x3")}
    check_model(uqpen.Ishigami(), inputs)


@dataclass(frozen=True, eq=False)
class MeanFit(OutputFit):
    """A plane through the mean, with a fault."""

    fault: str
    mean: float

    def predict(self, points):
        is_backwards = bool(points[0, 0] > points[-1, 0])
        shift = {"batch": len(points), "order": 100 * is_backwards}.get(self.fault, 0)
        slope = 0 if self.fault == "mean" else 4
        return Prediction(self.mean + slope * (points[:, 0] - 2) + 0.001 * shift)


@dataclass(frozen=True)
class Mean(OutputSurrogate):
    fault: str = text(expected="a fault")

    output_fit = MeanFit

    def fit_output(self, points, values, rng):
        if self.fault == "output":
            return "none is fitted"
        shift = np.random.default_rng().random() if self.fault == "random" else 0
        far = 10.0 if self.fault == "mean" else 0.0
        return MeanFit(self.fault, float(values.mean()) + far + 0.01 * shift)


@dataclass(frozen=True, eq=False)
class RoundedFit(MeanFit):
    """A fit that an archive keeps with fewer digits."""

    @classmethod
    def from_dataset(cls, dataset):
        return cls("", round(float(dataset.attrs["field_mean"]), 3))


@dataclass(frozen=True)
class Forgetting(OutputSurrogate):
    output_fit = RoundedFit

    def fit_output(self, points, values, rng):
        return RoundedFit("", float(values.mean()))


class TestBrokenRules:
    """A member that breaks a rule gets a message that names it."""

    def test_of_a_distribution(self):
        @dataclass(frozen=True)
        class Shifted(uqpen.Normal):
            def isf(self, probability):
                return self.ppf(probability)

        with pytest.raises(AssertionError, match=r"isf\(p\) = ppf\(1 - p\)"):
            check_distribution(Shifted(0.0, 1.0))

    def test_of_a_design(self):
        @dataclass(frozen=True)
        class Halves(Design):
            runs: int = count()
            sampling = Sampling.INDEPENDENT

            def rounds(self, joint, stream):
                u = np.random.default_rng().random((self.runs, len(joint.random))) / 2
                yield _points(joint, u)

            def run_count(self, joint):
                return self.runs

        with pytest.raises(AssertionError, match="the same stream gives the same points"):
            check_design(Halves(200))

    @pytest.mark.parametrize(
        ("fault", "rule"),
        [
            ("batch", "a prediction does not depend on the batch"),
            ("order", "a prediction does not depend on the order of points"),
            ("mean", "it predicts other runs"),
            ("random", "the same stream fits alike"),
            ("output", "it fits what can be fitted"),
        ],
    )
    def test_of_a_surrogate(self, fault, rule):
        with pytest.raises(AssertionError, match=rule):
            check_surrogate(Mean(design="training", fault=fault))

    def test_of_a_surrogate_that_comes_back_another(self):
        with pytest.raises(AssertionError, match="a restored surrogate is the same"):
            check_surrogate(Forgetting(design="training"))

    def test_of_a_model(self):
        class Drifting(Model):
            name = "drifting"
            inputs = (Input("x", "m"),)
            outputs = (Output("y", "m"),)

            def evaluate(self, inputs):
                return Results.all_ok({"y": inputs["x"] - inputs["x"].mean()})

        with pytest.raises(AssertionError, match="a run does not depend on its batch: y"):
            check_model(Drifting(), {"x": np.arange(3.0)})

    def test_of_a_statistic(self):
        def shaken(sample, quantity):
            value = float(np.random.default_rng().random())
            estimate = Estimate.without_bounds(value, "none")
            yield "shaken", estimate.to_array(units="1", long_name="shaken")

        with pytest.raises(AssertionError, match="the same sample gives the same shaken"):
            check_statistic(shaken)

        def named(sample, quantity):
            yield "mean", xr.DataArray(1.0)

        with pytest.raises(AssertionError, match="a name that no built-in statistic has"):
            check_statistic(named)

        def sorted_in_place(sample, quantity):
            sample.values.sort()
            yield from ()

        with pytest.raises(AssertionError, match="sorted_in_place of deflection: ValueError"):
            check_statistic(sorted_in_place)

    def test_of_a_chart(self, study_of):
        tree = uqpen.run(study_of("a", a=(0, 1)))
        calls = []

        def counted(view):
            calls.append("call")
            yield Panel(f"title {len(calls)}", lambda axes: [])

        with pytest.raises(AssertionError, match="a figure is the same each time"):
            check_figure(counted, tree)

        def changing(view):
            view.tree["runs/some"]["a"].values[0] = 0.5
            yield Text("changed")

        with pytest.raises(AssertionError, match="a section does not change the archive"):
            check_section(changing, tree)


def _points(joint, u):
    columns = iter(u.T)
    return xr.Dataset(
        {
            entry.variable.name: (RUN, entry.distribution.ppf(next(columns)))
            for entry in joint.random
        }
        | {"mass": ((), 5.0)}
    )
