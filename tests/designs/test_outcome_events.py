"""Events of rare-event designs in models whose runs may end as an outcome, without numbers."""

import numpy as np
import pytest
import xarray as xr
from rare_event_studies import INPUTS, half_space, probability

import uqpen
from uqpen.designs.rare_events.limit_state import parse_limit_state

CROSS_ENTROPY = {"samples": 200, "replicates": 3, "start": "cross-entropy"}
METHODS = [
    (uqpen.SubsetSimulation, {"samples": 200, "replicates": 3}),
    (uqpen.ImportanceSampling, CROSS_ENTROPY),
]


class EndedError(Exception):
    """The run ends without numbers."""


class OtherError(Exception):
    """It ends so in another way."""


def ends_far_beyond(a, b):
    found = half_space(a, b)
    if found["depth"] > 5:
        raise EndedError
    return found


def ends_elsewhere(a, b):
    found = half_space(a, b)
    if found["depth"] < -1:
        raise OtherError
    return found


def study(design, function, **outcomes):
    model = uqpen.PythonModel(
        function, {"a": "1", "b": "1"}, {"depth": "m", "speed": "m/s"}, outcomes=outcomes
    )
    settings = {"seed": 4, "confidence_level": 0.999}
    return uqpen.Study(model, INPUTS, designs={"rare": design}, **settings)


@pytest.mark.parametrize(("method", "settings"), METHODS)
def test_a_run_beyond_all_limits_is_as_one_with_its_number(method, settings):
    plain = uqpen.run(study(method(event="depth > 4 m", **settings), half_space))
    event = "depth > 4 m or ended"
    named = uqpen.run(study(method(event=event, **settings), ends_far_beyond, ended=EndedError))
    assert (named["runs/rare"]["outcome"].values == 1).any()
    assert np.array_equal(probability(named).values, probability(plain).values)
    assert str(probability(named)["event_condition"].values) == event
    assert "in which all its outputs" not in probability(named).attrs["note"]


@pytest.mark.parametrize(("method", "settings"), METHODS)
def test_an_outcome_that_is_no_event_is_outside_and_one_that_it_does_not_name_is_left_out(
    method, settings
):
    event = "depth > 3 m and not other"
    outside, left_out = (
        probability(
            uqpen.run(study(method(event=each, **settings), ends_elsewhere, other=OtherError))
        )
        for each in (event, "depth > 3 m")
    )
    plain = uqpen.run(study(method(event="depth > 3 m", **settings), half_space))
    exact, others = 0.0169474, 0.2397501  # the probabilities of both sides
    assert outside[1] < exact < outside[2]
    assert left_out[1] < exact / (1 - others) < left_out[2]
    assert left_out[0] > probability(plain)[0]
    assert "in which all its outputs have a value" in left_out.attrs["note"]


def test_a_limit_state_puts_outcomes_infinitely_far_away():
    flags = {"flag_values": [-1, 0, 1, 2], "flag_meanings": "lost completed ended other"}
    runs = xr.Dataset(
        {
            "depth": ("run", [1.0, 5.0, np.nan, np.nan, np.nan], {"units": "m"}),
            "outcome": ("run", np.array([0, 0, 1, 2, -1]), flags),
            "status": ("run", np.array([0, 0, 0, 0, 2])),
        }
    )

    def found(text):
        event = parse_limit_state(text)
        outcomes = event.outcomes(runs)
        performance = event.performance(outcomes, event.scales(outcomes))
        return outcomes.belongs.tolist(), outcomes.occurs.tolist(), performance.tolist()

    yes, no, far = True, False, np.inf
    # The failed run may have been anything; the distances are in units of 1 m, of the median.
    assert found("depth > 2 m or ended") == (
        [yes, yes, yes, no, yes],
        [no, yes, yes, no, no],
        [-1, 3, far, -far, far],
    )
    assert found("depth < 2 m and not ended and not other") == (
        [yes] * 5,
        [yes, no, no, no, no],
        [1, -3, -far, -far, far],
    )
    assert found("depth > 2 m or not completed")[2] == [-1, 3, far, far, far]
    assert found("ended")[1] == [no, no, yes, no, no]


@pytest.mark.parametrize(
    ("design", "expected"),
    [
        (uqpen.SubsetSimulation(event="depth > 3 m or endet"), "or an outcome, ended"),
        (uqpen.SubsetSimulation(event="ended"), "or importance-sampling: no run comes nearer"),
        (uqpen.ImportanceSampling(event="depth > 3 m and ended"), "a run that ends so has no"),
        (uqpen.ImportanceSampling(event="depth > 3 m or not ended"), "every run that has the"),
        (uqpen.Form(event="depth > 3 m or ended"), "runs that end so have no numbers to follow"),
    ],
)
def test_mistakes_are_met_before_any_run(design, expected):
    with pytest.raises(uqpen.StudyError, match=expected):
        study(design, ends_far_beyond, ended=EndedError)


def test_subset_simulation_says_which_outcome_no_level_leads_to():
    def ends_rarely_elsewhere(a, b):
        found = half_space(a, b)
        if found["depth"] < -3:
            raise OtherError
        return found

    design = uqpen.SubsetSimulation(event="depth > 4 m or other", samples=200)
    tree = uqpen.run(study(design, ends_rarely_elsewhere, other=OtherError))
    note = probability(tree).attrs["note"]
    assert "only a few independent draws ended as “other”, and no level leads there" in note
