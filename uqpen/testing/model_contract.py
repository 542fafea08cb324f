"""Contract test of a model."""

from __future__ import annotations

import pickle
from collections.abc import Mapping

import numpy as np

from uqpen.core.arrays import FloatArray
from uqpen.core.model import Model, Results
from uqpen.core.status import Status
from uqpen.core.units import si_unit
from uqpen.execution import Evaluator

__all__ = ["check_model"]


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
