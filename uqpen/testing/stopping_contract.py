"""Contract test of a stopping rule."""

from __future__ import annotations

import pickle

from uqpen.core.sampling import Sampling
from uqpen.core.streams import Stream
from uqpen.designs.drawn_points import points_in_memory
from uqpen.designs.feedback import Feedback
from uqpen.designs.monte_carlo import MonteCarlo
from uqpen.designs.rounds import first_round
from uqpen.designs.stopping.stopping_rule import StoppingRule
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.statistics.running_estimates import RunningEstimates
from uqpen.testing.example import EXAMPLE_OUTPUT, example_joint_distribution, sum_runs

__all__ = ["check_stopping_rule"]


def check_stopping_rule(rule: StoppingRule, requested: QuantityOfInterest | None = None) -> None:
    """Check the contract of a stopping rule.

    It describes itself in one line, takes the output, decides the same at the same estimates, as a
    pickled copy does, and is never satisfied where there is no interval.

    Parameters
    ----------
    rule : StoppingRule
        With any settings.
    requested : QuantityOfInterest, optional
        The output that it looks at, here the sum of the inputs of `example_joint_distribution`; by
        default ``y``, a plain number.

    Raises
    ------
    AssertionError
        If one of these is broken.
    """
    requested = requested or EXAMPLE_OUTPUT
    assert len(str(rule).splitlines()) == 1, "str of a rule is one line"
    assert not list(rule.check_outputs([requested])), "the rule takes this output"
    again = pickle.loads(pickle.dumps(rule))
    for runs in (1, 512, 2048):
        feedback = _sum_feedback(runs, requested)
        decisions = [each.is_satisfied(feedback) for each in (rule, rule, again)]
        assert all(type(each) is bool for each in decisions), "a decision is True or False"
        assert len(set(decisions)) == 1, "the same estimates give the same decision"
        assert runs > 1 or not decisions[0], "an estimate without an interval is not precise"


def _sum_feedback(runs: int, requested: QuantityOfInterest) -> Feedback:
    """Return the feedback of a round of independent draws."""
    joint = example_joint_distribution()
    points = first_round(MonteCarlo(runs), joint, Stream(1, "designs", "one"))
    made = {"": sum_runs(points_in_memory(points), joint, requested.output.name)}
    return Feedback(made, RunningEstimates((made,), Sampling.INDEPENDENT, {"": [requested]}))
