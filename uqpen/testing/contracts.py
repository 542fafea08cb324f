"""Contract tests of models, distributions, statistics and surrogates, figures and sections."""

from __future__ import annotations

import pickle
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TypeVar

import numpy as np
import xarray as xr

from uqpen.archive.netcdf import read_groups, write_tree
from uqpen.core.arrays import FloatArray
from uqpen.core.errors import StudyError, UqpenError
from uqpen.core.labels import ROLE, RUN, SAMPLING, STATUS
from uqpen.core.model import Category, Input, Model, Output, Results
from uqpen.core.netcdf.opening import open_own
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.core.units import si_unit
from uqpen.designs.latin_hypercube import LatinHypercube
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.quadrature import Quadrature
from uqpen.designs.rounds import first_round
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.joint_distribution import FixedInput, JointDistribution, RandomInput
from uqpen.distributions.univariate import Normal, Uniform
from uqpen.execution import Evaluator, evaluate
from uqpen.figures.page import figure
from uqpen.figures.style import figure_bytes
from uqpen.figures.user_defined_figures import FigureFunction
from uqpen.report.page import SectionFunction, report_page
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.run_samples import sample_of
from uqpen.statistics.sample import Sample
from uqpen.statistics.user_defined import user_defined_statistics
from uqpen.statistics.user_defined_analysis import Analysis, UserDefinedAnalysis
from uqpen.surrogates.fitted_surrogate import FittedSurrogate, Prediction
from uqpen.surrogates.surrogate import Surrogate

# An example.

# The output that an adaptive design and a stopping rule are sent.
EXAMPLE_OUTPUT = QuantityOfInterest(Output("y", "1"), "1")


def example_joint_distribution() -> JointDistribution:
    """Return a joint distribution of two independent random inputs and a fixed one."""
    length, mass, share = Input("length", "m"), Input("mass", "kg"), Input("share", "1")
    entries = (
        RandomInput(length, Uniform(1.0, 3.0), "m"),
        FixedInput(mass, 5.0, "kg"),
        RandomInput(share, Normal(0.0, 1.0), "1"),
    )
    return JointDistribution(entries, (length, mass, share))


def sum_runs(points: xr.Dataset, joint: JointDistribution, output: str) -> xr.Dataset:
    """Return runs of a model whose output is the sum of the random inputs."""
    total = sum(points[entry.variable.name] for entry in joint.random)
    status = np.full(points.sizes[RUN], Status.OK, dtype=np.int8)
    return points.assign({output: total, STATUS: (RUN, status)})


# Models.


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
    assert set(whole.outputs) == {output.name for output in model.outputs}
    for run in np.flatnonzero(whole.status != Status.OK).tolist():
        assert whole.reasons.get(run), f"the failed run {run} has a reason"
    for output in model.outputs:
        values = whole.outputs[output.name]
        assert values.shape == (len(whole.status), *output.shape), f"{output.name} has its shape"
        invalid = output.invalid(values[whole.status == Status.OK])
        assert not invalid.any(), f"{output.name} is finite"
    runs = len(whole.status)
    for run in range(runs):
        alone = evaluator({name: values[run : run + 1] for name, values in inputs.items()})
        _check_same(whole, alone, [run], "a run does not depend on its batch")
    backwards = evaluator({name: values[::-1].copy() for name, values in inputs.items()})
    _check_same(whole, backwards, list(range(runs))[::-1], "a run does not depend on the order")
    again = Evaluator(pickle.loads(pickle.dumps(model)))(dict(inputs))
    _check_same(whole, again, list(range(runs)), "a pickled copy is the same model")


def _check_same(whole: Results, part: Results, runs: list[int], rule: str) -> None:
    assert np.array_equal(whole.status[runs], part.status), rule
    for name, values in whole.outputs.items():
        assert np.array_equal(values[runs], part.outputs[name], equal_nan=True), f"{rule}: {name}"


# Distributions, and the joint distribution of the inputs.

# Contract test of the distribution of one input.

_PROBABILITIES = np.array([1e-9, 1e-3, 0.1, 0.5, 0.77, 0.999, 1 - 1e-9])

# A quantile rounded to double precision moves the probability by the density times an ulp.
_ROUNDING = 1e-9
# Differences of rounded probabilities, over their distance.
_DERIVATIVE = 1e-8


def check_distribution(distribution: Distribution) -> None:
    """Check the contract of a distribution of one input.

    Its four functions keep the shape of their argument, are inverse to each other, add up to 1, and
    are accurate in both tails. Its density, if it has one, is the derivative of its probabilities.
    It survives pickling, as worker processes need it.

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
    again = pickle.loads(pickle.dumps(distribution))
    assert np.array_equal(again.ppf(p), values), "a pickled copy is the same distribution"
    if distribution.is_discrete:
        values = distribution.ppf(p)
        below, above = distribution.cdf(values), distribution.sf(values)
        np.testing.assert_allclose(below + above, 1.0, rtol=_ROUNDING, err_msg="cdf + sf = 1")
        assert np.all(below >= p * (1 - _ROUNDING)), "cdf(ppf(p)) is p or more"
        assert np.all(above <= (1 - p) + _ROUNDING), "sf(ppf(p)) is 1 - p or less"
        before = distribution.cdf(values - _ROUNDING * (1 + np.abs(values)))
        assert np.all(before <= p + _ROUNDING), "ppf(p) is the smallest value with a cdf of p"
        _check_probabilities(distribution)
        return
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
    _check_density(distribution)


def _check_probabilities(distribution: Distribution) -> None:
    """Check the probabilities of the values of a discrete distribution against its cdf."""
    atoms = distribution.atoms()
    if atoms is None:
        return
    values, shares = atoms
    gaps = np.diff(np.concatenate([[0.0], distribution.cdf(values)]))
    np.testing.assert_allclose(shares, gaps, rtol=0, atol=_ROUNDING, err_msg="atoms and cdf")
    logarithms = distribution.log_density(values)
    if logarithms is not None:
        likely = shares > 1e-300
        np.testing.assert_allclose(
            np.exp(logarithms[likely]), shares[likely], rtol=1e-8, err_msg="probability of a value"
        )


# Places and weights of a derivative by eight differences: its error is of the ninth order.
_PLACES = np.array([-4, -3, -2, -1, 1, 2, 3, 4])
_WEIGHTS = np.array([3, -32, 168, -672, 672, -168, 32, -3]) / 840
_STEP = 2e-3  # of the distance to the nearer end of the half of the probability around a value


def _check_density(distribution: Distribution) -> None:
    """Check the density against the derivative of the probability in the nearer tail."""
    p = np.array([1e-6, 1e-3, 0.03, 0.21, 0.43, 0.61, 0.88, 0.9987])
    far = np.array([1e-4 if distribution.least_upper_tail else 1e-12])
    values = np.concatenate([distribution.ppf(p), distribution.isf(far)])
    if (logarithms := distribution.log_density(values)) is None:
        return
    assert logarithms.shape == values.shape, "log_density keeps the shape of an array"
    is_low = np.concatenate([p, 1 - far]) < 0.5
    tail = np.where(is_low, distribution.cdf(values), distribution.sf(values))
    around = np.where(is_low, distribution.ppf(tail / 2), distribution.isf(tail / 2))
    step = _STEP * np.abs(values - around)
    # Near an end that is not 0, doubles are few.
    is_fine = step > 1e4 * np.finfo(np.float64).eps * np.abs(values)
    assert is_fine.sum() > len(values) / 2, "values of the middle are finer than their distances"
    values, logarithms, step, is_low = (
        each[is_fine] for each in (values, logarithms, step, is_low)
    )
    places = values[:, None] + step[:, None] * _PLACES
    step = (places[:, -1] - places[:, 0]) / (_PLACES[-1] - _PLACES[0])  # as it is rounded
    tails = np.where(is_low[:, None], distribution.cdf(places), distribution.sf(places))
    derivative = np.abs(tails @ _WEIGHTS) / step
    error = np.abs(np.exp(logarithms) / derivative - 1)
    rounding = np.finfo(np.float64).eps * np.abs(values) / step
    assert np.all(error <= _DERIVATIVE + 4 * rounding), f"the density is a derivative: {error}"


# Contract test of the joint distribution of the inputs.


# Number of standard errors within which a mean of draws is expected: 1 of 16 000 is outside.
_STANDARD_ERRORS = 4.0


def check_joint(joint: JointDistribution) -> None:
    """Check the contract of the joint distribution of a study's inputs.

    Every draw is finite and depends on its own point of the unit cube alone; the nominal point has
    all inputs; each input follows its own distribution, where that is known; independent inputs
    depend on their own coordinates alone. It survives pickling.

    Parameters
    ----------
    joint : JointDistribution
        With at least one random input.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    names = [entry.variable.name for entry in joint.random]
    unit = np.random.default_rng(1).random((4_000, len(names)))
    values = _draws(joint, unit)
    for name in names:
        assert np.isfinite(values[name]).all(), f"draws of {name} are finite"
    assert joint.nominal().keys() == {entry.variable.name for entry in joint.inputs}
    assert all(map(np.isfinite, joint.nominal().values())), "the nominal point is finite"
    for rows in (slice(7), slice(1_500, 1_501), slice(None, None, -1)):
        for name, part in _draws(joint, unit[rows]).items():
            assert np.array_equal(part, values[name][rows]), f"a draw of {name} depends on others"
    again = _draws(pickle.loads(pickle.dumps(joint)), unit)
    assert all(np.array_equal(again[name], values[name]) for name in names), "a copy is the same"
    for entry in joint.random:
        if entry.variable.name not in joint.implicit_inputs:
            _check_margin(entry, values[entry.variable.name])
    assert joint.is_independent == (not joint.dependence_text), "dependence has a text"
    moved = unit.copy()
    moved[:, 0] = 1 - unit[:, 0]
    if joint.is_independent:
        others = _draws(joint, moved)
        for name in [*values][1:]:
            assert np.array_equal(others[name], values[name]), f"{name} depends on others"
    if not joint.conditional_reason:
        given = {0: unit[:, 0]}
        found = joint.conditional_probabilities(moved, given)
        assert np.array_equal(found[:, 0], unit[:, 0]), "a given input is unchanged"


def _draws(joint: JointDistribution, unit: FloatArray) -> dict[str, FloatArray]:
    points = joint.points(unit, {})
    return {entry.variable.name: points[entry.variable.name].values for entry in joint.random}


def _check_margin(entry: RandomInput, values: FloatArray) -> None:
    """Check the share of draws at or below three quantiles of an input's own distribution."""
    quantiles = entry.distribution.ppf(np.array([0.1, 0.5, 0.8]))
    expected = entry.distribution.cdf(quantiles)
    found = (values[:, None] <= quantiles).mean(axis=0)
    error = np.sqrt(expected * (1 - expected) / len(values))
    rule = f"draws of {entry.variable.name} follow its own distribution"
    assert np.all(np.abs(found - expected) <= _STANDARD_ERRORS * error + _ROUNDING), rule


# Statistics.

_RUNS = 200


def example_samples() -> list[tuple[Sample, QuantityOfInterest]]:
    """Return samples of a number and of a category, each with its quantity of interest.

    Of the 200 independent runs, two have failed.
    """
    number = Output("deflection", "m")
    kinds = Output(
        "state", "1", categories=(Category("elastic", "elastic"), Category("bent", "bent"))
    )
    generator = np.random.default_rng(1)
    load = generator.random(_RUNS)
    deflection = load**2 + 0.1 * generator.random(_RUNS)
    status = np.full(_RUNS, Status.OK, dtype=np.int8)
    status[[3, 150]] = Status.FAILED
    runs = xr.Dataset(
        {
            "load": (RUN, load, {ROLE: "input", "units": "N"}),
            number.name: (RUN, np.where(status == Status.OK, deflection, np.nan)),
            kinds.name: (RUN, (deflection > 0.5).astype(np.float64)),
            STATUS: (RUN, status),
        },
        attrs={SAMPLING: str(Sampling.INDEPENDENT)},
    )
    return [
        (sample_of(runs, output.name), QuantityOfInterest(output, output.unit))
        for output in (number, kinds)
    ]


def check_statistic(
    analysis: Analysis, sample: Sample | None = None, quantity: QuantityOfInterest | None = None
) -> None:
    """Check the contract of an analysis that yields statistics of an output.

    Names are free, and all else is an estimate array that an archive can contain. Its record, if it
    has one, is of what it yields, and all its words are known. The same sample gives the same to
    the bit, and is not written to. An output with categories is accepted.

    Parameters
    ----------
    analysis : callable
        Takes a `Sample` and a `QuantityOfInterest`, and yields names with estimate arrays.
    sample, quantity : optional
        The only sample to test with, and what is asked of it; by default `example_samples`.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    own = UserDefinedAnalysis("", analysis)
    fault, yielded = own.record_fault, set()
    assert not fault, f"{fault[0]}, but it can have {fault[1]}" if fault else ""
    samples = example_samples()
    if sample is not None:
        samples = [(sample, quantity or samples[0][1])]
    for each, asked in samples:
        before = each.values.copy(), each.points.copy()
        first, second = (dict(_statistics(analysis, each, asked)) for _ in range(2))
        yielded |= {*first}
        assert list(first) == list(second), "the same sample gives the same statistics"
        for name, array in first.items():
            assert array.identical(second[name]), f"the same sample gives the same {name}"
        after = each.values, each.points
        for one, other in zip(before, after, strict=True):
            assert np.array_equal(one, other, equal_nan=True), "a sample is not written to"
    for record in own.records:
        assert record.name in yielded, f"the record of {record.name} is of a statistic it yields"


def _statistics(
    analysis: Analysis, sample: Sample, quantity: QuantityOfInterest
) -> Iterator[tuple[str, xr.DataArray]]:
    """Yield the statistics of a sample; what a study would refuse is an AssertionError."""
    name = getattr(analysis, "__name__", "the analysis")
    try:
        yield from user_defined_statistics(
            [UserDefinedAnalysis(name, analysis)], sample, quantity, {}
        ).items()
    except StudyError as error:
        raise AssertionError(str(error)) from None


# Surrogates.


def check_surrogate(surrogate: Surrogate) -> None:
    """Check the contract of a surrogate, with a smooth function of two inputs.

    It is fitted to 80 runs, or to a quadrature if it needs one. It predicts other runs better than
    their mean does. Predictions depend neither on the batch nor on the order of points, and their
    standard deviations, if any, are not negative. The same stream gives the same predictions. An
    output that cannot be fitted has a reason. It survives pickling and an archive, to the bit.

    Parameters
    ----------
    surrogate : Surrogate
        With any settings; its design and its check may have any names.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    joint, model = example_joint_distribution(), _Smooth()
    design = Quadrature(order=6) if surrogate.needs_quadrature else LatinHypercube(80, 1)
    training, others = (
        evaluate(
            Evaluator(model), first_round(each, joint, Stream(1, "designs", str(number))), {}
        ).assign_attrs({SAMPLING: str(each.sampling)})
        for number, each in enumerate((design, MonteCarlo(100)))
    )
    fitted, repeated = (
        surrogate.fit("example", training, model, joint, Stream(1, "surrogates", "example"))
        for _ in range(2)
    )
    _check_description(fitted, training)
    inputs = {name: others[name].values for name in fitted.random_inputs}
    found = _check_prediction(fitted, inputs)
    _check_same_prediction(found, _check_prediction(repeated, inputs), "the same stream fits alike")
    error = found.mean - others["smooth"].values
    assert np.mean(error**2) < np.var(others["smooth"].values), "it predicts other runs"
    scale = float(np.ptp(found.mean))
    for rows, rule in (
        (slice(3, 4), "a prediction does not depend on the batch"),
        (slice(None, None, -1), "a prediction does not depend on the order of points"),
    ):
        part = _check_prediction(fitted, {name: v[rows].copy() for name, v in inputs.items()})
        # A product of matrices has other last bits for another number of rows.
        np.testing.assert_allclose(found.mean[rows], part.mean, atol=1e-6 * scale, err_msg=rule)
        assert (found.std is None) == (part.std is None), rule
        if found.std is not None and part.std is not None:
            # A variance near 0 is what is left of large numbers.
            one, other = found.std[rows] ** 2, part.std**2
            np.testing.assert_allclose(one, other, atol=1e-8 * scale**2, err_msg=rule)
    again = pickle.loads(pickle.dumps(fitted))
    rule = "a pickled copy is the same surrogate"
    _check_same_prediction(found, _check_prediction(again, inputs), rule)
    tree = fitted.with_check(others).to_tree()
    restored = type(surrogate).restore(_from_file(tree), "example", None)
    rule = "a restored surrogate is the same"
    _check_same_prediction(found, _check_prediction(restored, inputs), rule)
    _check_description(restored, training)
    assert restored.to_tree().identical(tree), rule


def _check_description(fitted: FittedSurrogate, training: xr.Dataset) -> None:
    """Check what a fitted surrogate says of itself and of its training runs."""
    assert isinstance(fitted, FittedSurrogate), "fit returns a FittedSurrogate"
    assert [output.name for output in fitted.outputs] == ["smooth"], "it fits what can be fitted"
    rule = "an output that cannot be fitted has a reason"
    assert {name for name, reason in fitted.reasons.items() if reason} == {"constant", "sign"}, rule
    assert set(fitted.random_inputs) == {"length", "share"}, "random_inputs are those that vary"
    assert dict(fitted.fixed) == {"mass": 5.0}, "fixed has the values of the other inputs"
    values = training["smooth"].values
    limits = float(values.min()), float(values.max())
    assert fitted.training_range("smooth") == limits, "training_range is that of the runs"


class _Smooth(Model):
    """Model with an output of each sort: smooth, constant and categorical."""

    name = "smooth"
    inputs = (Input("length", "m"), Input("mass", "kg"), Input("share", "1"))
    outputs = (
        Output("smooth", "m"),
        Output("constant", "m"),
        Output("sign", "1", categories=(Category("minus", "minus"), Category("plus", "plus"))),
    )

    def evaluate(self, inputs: Mapping[str, FloatArray]) -> Results:
        length, share = inputs["length"], inputs["share"]
        smooth = length**2 + np.sin(share) + 0.1 * inputs["mass"]
        sign = (share > 0).astype(np.float64)
        return Results.all_ok({"smooth": smooth, "constant": np.ones_like(share), "sign": sign})


def _check_prediction(fitted: FittedSurrogate, inputs: Mapping[str, FloatArray]) -> Prediction:
    """Return the prediction of the smooth output at some points."""
    found = fitted.predict(inputs)
    assert set(found) == {output.name for output in fitted.outputs}, "it predicts its outputs"
    prediction = found["smooth"]
    runs = len(next(iter(inputs.values())))
    assert prediction.mean.shape == (runs,), "a mean for each point"
    assert np.isfinite(prediction.mean).all(), "predictions are finite"
    if prediction.std is not None:
        assert prediction.std.shape == (runs,), "a std for each point, or None"
        assert (prediction.std >= 0).all(), "a std is not negative"
    return prediction


def _check_same_prediction(one: Prediction, other: Prediction, rule: str) -> None:
    assert np.array_equal(one.mean, other.mean), rule
    assert (one.std is None) == (other.std is None), rule
    if one.std is not None and other.std is not None:
        assert np.array_equal(one.std, other.std), rule


def _from_file(tree: xr.DataTree) -> xr.DataTree:
    """Return a group as it is read from an archive."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "surrogate.nc"
        write_tree(tree, path)
        with open_own(path) as root:
            return read_groups(root)


# Figures, and sections of the page.

DrawnT = TypeVar("DrawnT")


def check_figure(function: FigureFunction, tree: xr.DataTree) -> None:
    """Check the contract of a figure.

    It has panels for the archive, which can be drawn; they are the same each time; and the archive
    is not changed.

    Parameters
    ----------
    function : callable
        Takes an `ArchiveView`, and yields panels.
    tree : DataTree
        An archive that it has something to show of.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    _check_repetition(lambda: figure_bytes(figure(tree, function), "svg"), tree, "a figure")


def check_section(function: SectionFunction, tree: xr.DataTree) -> None:
    """Check the contract of a section of the report.

    It has blocks for the archive, which can be put on a page; they are the same each time; and the
    archive is not changed.

    Parameters
    ----------
    function : callable
        Takes an `ArchiveView`, and yields blocks.
    tree : DataTree
        An archive that it has something to show of.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    page = _check_repetition(lambda: report_page(tree, [function]), tree, "a section")
    assert 'id="own-1"' in page, "a section has something for this archive"


def _check_repetition(draw: Callable[[], DrawnT], tree: xr.DataTree, what: str) -> DrawnT:
    """Draw twice, check that both are the same and the archive is unchanged, and return one."""
    before = tree.copy(deep=True)
    try:
        first, second = draw(), draw()
    except UqpenError as error:
        raise AssertionError(str(error)) from None
    assert tree.identical(before), f"{what} does not change the archive"
    assert first == second, f"{what} is the same each time"
    return first
