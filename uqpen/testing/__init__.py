"""Contract tests for distributions, designs and models from outside the package.

Each function raises an `AssertionError` that names the broken rule. A test of your own calls it:

>>> from uqpen import Uniform
>>> from uqpen.testing import check_distribution
>>> check_distribution(Uniform(1.0, 3.0))
"""

from __future__ import annotations

import pickle
from collections.abc import Mapping

import numpy as np
import xarray as xr

from uqpen.core.arrays import FloatArray
from uqpen.core.labels import RUN, STATUS
from uqpen.core.model import Input, Model, Results
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.core.units import si_unit
from uqpen.designs.design import Design
from uqpen.distributions.continuous import Normal, Uniform
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.joint_distribution import FixedInput, JointDistribution, RandomInput
from uqpen.execution import Evaluator
from uqpen.testing.charts import check_figure, check_section
from uqpen.testing.statistics import check_statistic, example_samples

__all__ = [
    "check_design",
    "check_distribution",
    "check_figure",
    "check_model",
    "check_section",
    "check_statistic",
    "example_joint_distribution",
    "example_samples",
]


_PROBABILITIES = np.array([1e-9, 1e-3, 0.1, 0.5, 0.77, 0.999, 1 - 1e-9])

# A quantile rounded to double precision moves the probability by the density times an ulp.
_ROUNDING = 1e-9

# Number of standard errors within which a mean of draws is expected: 1 of 16 000 is outside.
_ERRORS = 4.0


def check_distribution(distribution: Distribution) -> None:
    """Check the contract of a distribution of one input.

    Its four functions keep the shape of their argument, are inverse to each other, add up to 1, and
    are accurate in both tails. It survives pickling, as worker processes need it.

    Parameters
    ----------
    distribution : Distribution
        With any parameters.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    p = _PROBABILITIES
    assert distribution.is_finite, "every draw is finite, and draws differ"
    values = distribution.ppf(p)
    assert values.dtype == np.float64
    for function in (distribution.ppf, distribution.isf):
        assert function(p.reshape(7, 1)).shape == (7, 1), "functions keep the shape of an array"
    assert np.all(np.diff(values) >= 0), "ppf does not decrease"
    np.testing.assert_allclose(
        distribution.isf(p[::-1]),
        distribution.ppf(1 - p[::-1]),
        rtol=1e-6,
        err_msg="isf(p) = ppf(1 - p)",
    )
    inner = np.unique(values)
    below, above = distribution.cdf(inner), distribution.sf(inner)
    np.testing.assert_allclose(below + above, 1.0, rtol=_ROUNDING, err_msg="cdf + sf = 1")
    np.testing.assert_allclose(
        distribution.cdf(distribution.ppf(p)),
        p,
        rtol=1e-6,
        atol=_ROUNDING,
        err_msg="cdf(ppf(p)) = p",
    )
    np.testing.assert_allclose(
        distribution.sf(distribution.isf(p)), p, rtol=1e-6, atol=_ROUNDING, err_msg="sf(isf(p)) = p"
    )
    again = pickle.loads(pickle.dumps(distribution))
    assert np.array_equal(again.ppf(p), values), "a pickled copy is the same distribution"


def example_joint_distribution() -> JointDistribution:
    """Return a joint distribution of two independent random inputs and a fixed one."""
    length, mass, share = Input("length", "m"), Input("mass", "kg"), Input("share", "1")
    entries = (
        RandomInput(length, Uniform(1.0, 3.0), "m"),
        FixedInput(mass, 5.0, "kg"),
        RandomInput(share, Normal(0.0, 1.0), "1"),
    )
    return JointDistribution(entries, (length, mass, share))


def check_design(design: Design, joint: JointDistribution | None = None) -> None:
    """Check the contract of a design.

    The same stream gives the same points; it makes no more runs than it states; a point has all
    inputs, along ``run`` or as scalars; points that are a sample follow the joint distribution. An
    adaptive design is sent runs without failures.

    Parameters
    ----------
    design : Design
        With any settings.
    joint : JointDistribution, optional
        The inputs; by default `example_joint_distribution`.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    joint = joint or example_joint_distribution()
    assert isinstance(design.sampling, Sampling)
    assert not list(design.check_inputs(joint)), "the design takes these inputs"
    rounds, again = (_points(design, joint, Stream(1, "designs", "one")) for _ in range(2))
    assert len(rounds) == len(again)
    for one, other in zip(rounds, again, strict=True):
        assert one.identical(other), "the same stream gives the same points"
    runs = sum(points.sizes[RUN] for points in rounds)
    assert 0 < runs <= design.run_count(joint), "run_count is the number of runs, or the largest"
    for points in rounds:
        for entry in joint.inputs:
            assert entry.variable.name in points, f"a point has {entry.variable.name}"
        for entry in joint.random:
            assert points[entry.variable.name].dims == (RUN,), "a random input is along run"
            assert np.isfinite(points[entry.variable.name]).all(), "points are finite"
    if design.sampling.is_sample and design.sampling is not Sampling.USER_SUPPLIED:
        _check_sample(rounds, joint)


def _points(design: Design, joint: JointDistribution, stream: Stream) -> list[xr.Dataset]:
    """Return the points of all rounds; every run succeeds."""
    found = []
    rounds = design.rounds(joint, stream)
    points = next(rounds)
    while True:
        found.append(points)
        status = np.full(points.sizes[RUN], Status.OK, dtype=np.int8)
        try:
            points = rounds.send(points.assign({STATUS: (RUN, status)}))
        except StopIteration:
            return found


def _check_sample(rounds: list[xr.Dataset], joint: JointDistribution) -> None:
    """Check that the share of points below each input's median is a half, within its error."""
    for entry in joint.random:
        values = np.concatenate([points[entry.variable.name].values for points in rounds])
        share = float((entry.distribution.cdf(values) < 0.5).mean())
        error = 0.5 / np.sqrt(len(values))
        found = f"{share:.3f} of the points of {entry.variable.name} lie below its median"
        assert abs(share - 0.5) <= _ERRORS * error, found


def check_model(model: Model, inputs: Mapping[str, FloatArray]) -> None:
    """Check the contract of a model.

    Names are unique, units are coherent SI, a run does not depend on the others in its batch, runs
    are repeatable to the bit, and a failed run has a reason.

    Parameters
    ----------
    model : Model
        The model.
    inputs : mapping of str to ndarray, shape (run,)
        Inputs of at least two runs, in SI units.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    variables = [*model.inputs, *model.outputs]
    names = [variable.name for variable in variables]
    assert len(set(names)) == len(names), "names are unique"
    for variable in variables:
        assert si_unit(variable.unit) == variable.unit, f"{variable.name} has a coherent SI unit"
    model.prepare()
    evaluator = Evaluator(model)
    whole = evaluator(dict(inputs))
    _check_results(model, whole)
    runs = len(whole.status)
    for run in range(runs):
        alone = evaluator({name: values[run : run + 1] for name, values in inputs.items()})
        _check_same(whole, alone, [run], "a run does not depend on its batch")
    backwards = evaluator({name: values[::-1].copy() for name, values in inputs.items()})
    _check_same(whole, backwards, list(range(runs))[::-1], "a run does not depend on the order")
    again = Evaluator(pickle.loads(pickle.dumps(model)))(dict(inputs))
    _check_same(whole, again, list(range(runs)), "a pickled copy is the same model")


def _check_results(model: Model, results: Results) -> None:
    assert set(results.outputs) == {output.name for output in model.outputs}
    for run in np.flatnonzero(results.status != Status.OK).tolist():
        assert results.reasons.get(run), f"the failed run {run} has a reason"
    for name, values in results.outputs.items():
        assert np.isfinite(values[results.status == Status.OK]).all(), f"{name} is finite"


def _check_same(whole: Results, part: Results, runs: list[int], rule: str) -> None:
    assert np.array_equal(whole.status[runs], part.status), rule
    for name, values in whole.outputs.items():
        assert np.array_equal(values[runs], part.outputs[name], equal_nan=True), f"{rule}: {name}"
