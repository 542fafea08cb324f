"""Every run ends with a status and a reason, and how runs are batched changes nothing."""

from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from uqpen.core.model import POSITIVE, Category, Input, Model, Output, Results
from uqpen.core.status import Status
from uqpen.distributions.constraints import parse_constraint
from uqpen.execution import (
    EvaluationOptions,
    Evaluator,
    Progress,
    batching,
    evaluate,
    join_rounds,
)
from uqpen.models.python_function import PythonFunction

INPUTS = (Input("x", "m", bounds=POSITIVE), Input("y", "m"))
OUTPUTS = (Output("z", "m"), Output("w", "m"))


def model(function, *, vectorized=False, unit_of=None):
    units = {"x": "m", "y": "m", "z": "m", "w": "m", **(unit_of or {})}
    return PythonFunction(function, "mine", INPUTS, OUTPUTS, units, vectorized)


def runs_of(function, x, y=1.0, **options):
    points = xr.Dataset({"x": ("run", np.array(list(x))), "y": ((), y)})
    points = points.assign_coords(run=np.arange(points.sizes["run"]))
    constraints = options.pop("constraints", ())
    return evaluate(Evaluator(model(function, **options), constraints), points, {})


class Recorded(Progress):
    """Progress as it was reported."""

    def __init__(self):
        self.runs = []

    def advance(self, runs, failed, in_progress):
        self.runs.append(runs)


def good(x, y):
    return {"z": x + y, "w": x * y}


def reasons(runs):
    if "lost_run" not in runs:
        return {}
    return dict(zip(runs["lost_run"].values.tolist(), runs["lost_reason"].values, strict=True))


@pytest.mark.parametrize("vectorized", [True, False])
def test_outputs_stand_beside_the_inputs_and_say_what_they_are(vectorized):
    runs = runs_of(good, [1.0, 2.0], vectorized=vectorized)
    assert runs["z"].values.tolist() == [2.0, 3.0]
    assert runs["x"].values.tolist() == [1.0, 2.0]
    assert runs["status"].values.tolist() == [0, 0]
    assert reasons(runs) == {}
    assert (runs["x"].attrs["role"], runs["z"].attrs["role"]) == ("input", "output")
    assert runs["z"].attrs["units"] == "m"
    assert runs["status"].attrs["flag_meanings"].split()[:2] == ["ok", "inadmissible"]


@pytest.mark.parametrize("vectorized", [True, False])
def test_values_go_in_and_come_out_in_the_units_of_the_function(vectorized):
    unit_of = {"x": "cm", "z": "mm"}
    runs = runs_of(lambda x, y: {"z": x, "w": y}, [0.5], vectorized=vectorized, unit_of=unit_of)
    # 0.5 m goes in as 50 cm; 50 mm come out.
    assert runs["z"].values.tolist() == [pytest.approx(0.05, rel=1e-15)]


@pytest.mark.parametrize("vectorized", [True, False])
def test_one_bad_run_is_lost_and_no_other(vectorized):
    def fails_at_three(x, y):
        if np.any(x == 3.0):
            raise ZeroDivisionError("three")
        return good(x, y)

    runs = runs_of(fails_at_three, range(1, 9), vectorized=vectorized)
    assert runs["status"].values.tolist() == [0, 0, Status.FAILED, 0, 0, 0, 0, 0]
    assert reasons(runs) == {2: "ZeroDivisionError: three"}
    assert np.flatnonzero(np.isnan(runs["z"].values)).tolist() == [2]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_value_that_is_not_finite_is_a_lost_run(value):
    runs = runs_of(lambda x, y: {"z": value if x == 2 else x, "w": y}, [1.0, 2.0])
    assert runs["status"].values.tolist() == [Status.OK, Status.NOT_FINITE]
    assert reasons(runs) == {1: f"z is {value}"}
    assert np.isnan(runs["w"].values[1]), "no output of a lost run is kept"


def test_inputs_outside_their_bounds_are_inadmissible_and_not_run():
    called = []

    def counting(x, y):
        called.append(x)
        return good(x, y)

    runs = runs_of(counting, [1.0, -1.0, 0.0, 2.0])
    assert runs["status"].values.tolist() == [0, Status.INADMISSIBLE, Status.INADMISSIBLE, 0]
    assert reasons(runs)[1] == "x > 0"
    assert called == [1.0, 2.0]


def test_points_outside_a_constraint_are_inadmissible():
    constraint = parse_constraint("x < 2 * y", {"x": "m", "y": "m"})
    runs = runs_of(good, [1.0, 3.0], constraints=(constraint,))
    assert runs["status"].values.tolist() == [0, Status.INADMISSIBLE]
    assert reasons(runs) == {1: "x < 2 * y"}


@pytest.mark.parametrize(
    ("returned", "reason"),
    [
        (3.0, 'returned float, not a mapping of outputs; expected return {"z": z, "w": w}'),
        (None, 'returned NoneType, not a mapping of outputs; expected return {"z": z, "w": w}'),
        ({}, 'returned no "z"'),
        ({"z": 1.0, 3: 2.0}, 'returned no "w", but "z", "3"'),
        (dict.fromkeys("zabcd", 1.0), 'returned no "w", but "z", "a", "b", "c", …'),
        ({"z": 1.0, "w": "3.0"}, 'returned a "w" of text in place of numbers'),
        ({"z": 1.0, "w": b"3.0"}, 'returned a "w" of bytes in place of numbers'),
        ({"z": 1.0, "w": 1j}, 'returned a "w" of complex numbers in place of numbers'),
        (
            {"z": 1.0, "w": np.complex128(1)},
            'returned a "w" of complex numbers in place of numbers',
        ),
        ({"z": 1.0, "w": None}, 'returned a "w" of NoneType in place of a number'),
        (
            {"z": 1.0, "w": np.datetime64("2000-01-01")},
            'returned a "w" of dates in place of numbers',
        ),
        (
            {"z": 1.0, "w": [1.0, 2.0]},
            'returned a "w" of shape (2,), not (); expected one number; an output with several is '
            "declared with along",
        ),
        (
            {"z": 1.0, "w": [[1.0]]},
            'returned a "w" of shape (1, 1), not (); expected one number, such as w.item()',
        ),
    ],
)
def test_an_answer_that_makes_no_sense_is_a_failed_run(returned, reason):
    runs = runs_of(lambda x, y: returned, [1.0])
    assert runs["status"].values.tolist() == [Status.FAILED]
    assert reasons(runs) == {0: reason}


def test_a_vectorised_answer_without_runs_is_reported_with_what_to_return():
    runs = runs_of(lambda x, y: {"z": 1.0, "w": y}, [1.0, 2.0], vectorized=True)
    expected = 'returned a "z" of shape (), not (1,); expected an array with a number for each run'
    assert set(reasons(runs).values()) == {expected}
    runs = runs_of(lambda x, y: x, [1.0, 2.0], vectorized=True)
    expected = 'returned ndarray, not a mapping of outputs; expected return {"z": z, "w": w} with '
    assert set(reasons(runs).values()) == {f"{expected}arrays along the runs"}


def test_a_masked_value_is_not_finite():
    def masks(x, y):
        return {"z": np.ma.masked_greater(x, 1.5), "w": y}

    runs = runs_of(masks, [1.0, 2.0], vectorized=True)
    assert runs["status"].values.tolist() == [0, Status.NOT_FINITE]


@pytest.mark.parametrize("value", [10**400, Fraction(1, 3), True, np.float32(2), np.int64(3)])
def test_any_real_number_is_a_number(value):
    runs = runs_of(lambda x, y: {"z": value, "w": y}, [1.0])
    expected = Status.NOT_FINITE if isinstance(value, int) and value > 1 else Status.OK
    assert runs["status"].values.tolist() == [expected]


class _Malicious:
    def __array__(self, *arguments, **options):
        raise ZeroDivisionError


class _SpeechlessError(Exception):
    def __str__(self):
        raise ValueError


def test_an_answer_that_raises_when_it_is_read_is_a_failed_run():
    runs = runs_of(lambda x, y: {"z": _Malicious(), "w": y}, [1.0])
    assert runs["status"].values.tolist() == [Status.FAILED]


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (_SpeechlessError(), "_SpeechlessError"),
        (ValueError("half \ud800 a character"), "ValueError: half ? a character"),
        (GeneratorExit(), "GeneratorExit"),
    ],
)
def test_any_exception_has_a_reason_that_can_be_kept(error, reason):
    def raises(x, y):
        raise error

    assert reasons(runs_of(raises, [1.0])) == {0: reason.strip()}


def test_a_function_that_leaves_python_loses_its_run_only():
    def leaves(x, y):
        if x == 1.0:
            raise SystemExit(3)
        return good(x, y)

    assert runs_of(leaves, [1.0, 2.0])["status"].values.tolist() == [Status.FAILED, 0]


def test_an_interrupt_is_not_a_failed_run():
    def interrupted(x, y):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        runs_of(interrupted, [1.0])


def test_a_reason_is_one_line_of_bounded_length():
    def verbose(x, y):
        raise ValueError("first\nsecond " * 100)

    (reason,) = reasons(runs_of(verbose, [1.0])).values()
    assert "\n" not in reason
    assert len(reason) <= 200


def test_a_function_may_change_the_arrays_it_is_given():
    def destructive(x, y):
        z = x + y
        x[:] = np.nan
        if np.any(z == 4.0):
            raise ValueError
        return {"z": z, "w": y}

    runs = runs_of(destructive, [1.0, 2.0, 3.0], vectorized=True)
    assert runs["x"].values.tolist() == [1.0, 2.0, 3.0]
    assert runs["status"].values.tolist() == [0, 0, Status.FAILED]


class _Kinds(Model):
    """Whether x is above 2, and x itself."""

    name = "kinds"
    inputs = INPUTS
    outputs = (
        Output("kind", "1", categories=(Category("low", "is low"), Category("high", "high"))),
    )

    def evaluate(self, inputs):
        return Results.all_ok({"kind": (inputs["x"] > 2).astype(float)})


def test_kinds_are_whole_numbers_with_their_meanings():
    points = xr.Dataset({"x": ("run", [1.0, 3.0, -1.0]), "y": ((), 0.0)}, {"run": [0, 1, 2]})
    kind = evaluate(Evaluator(_Kinds()), points, {})["kind"]
    assert kind.dtype == np.int8
    assert kind.values.tolist() == [0, 1, -1]
    assert kind.attrs["flag_meanings"] == "lost low high"
    assert kind.attrs["flag_values"].tolist() == [-1, 0, 1]


def test_batches_may_be_computed_in_any_order():
    points = xr.Dataset({"x": ("run", np.linspace(-1, 9, 500)), "y": ((), 1.0)})
    points = points.assign_coords(run=np.arange(500))

    def backwards(function, batches):
        return [function(batch) for batch in reversed(list(batches))]

    plain = evaluate(Evaluator(model(good)), points, {})
    options = EvaluationOptions(map=backwards)
    assert evaluate(Evaluator(model(good)), points, {}, options).identical(plain)


def test_batches_of_a_function_do_not_depend_on_the_number_of_runs():
    def numbered(x, y):
        return {"z": np.arange(len(x)), "w": np.full(len(x), len(x))}

    some = runs_of(numbered, np.linspace(1, 2, 3_000), vectorized=True)
    more = runs_of(numbered, np.linspace(1, 2, 40_000), vectorized=True)
    assert np.array_equal(some["z"].values, more["z"].values[:3_000])
    assert set(more["w"].values[:39_936]) == {1024}
    # Only the last batch can be smaller.
    assert np.array_equal(some["w"].values[:2_048], more["w"].values[:2_048])


def test_batches_of_a_model_that_is_the_same_in_any_grow_with_the_runs():
    sizes = []

    class Sized(_Kinds):
        def evaluate(self, inputs):
            sizes.append(len(inputs["x"]))
            return super().evaluate(inputs)

    points = xr.Dataset({"x": ("run", np.linspace(1, 2, 40_000))})
    evaluate(Evaluator(Sized()), points.assign_coords(run=np.arange(40_000)), {})
    assert set(sizes) == {2_500}


@pytest.mark.parametrize(("seconds", "size"), [(4.0, 1), (0.125, 4), (2.0**-20, 1024)])
def test_as_many_runs_are_sent_at_once_as_take_the_intended_time(monkeypatch, seconds, size):
    instants = iter([0.0, seconds])
    monkeypatch.setattr(batching, "time", SimpleNamespace(monotonic=lambda: next(instants)))
    pace = batching.Pace(worth_sending=0.5)
    for _ in range(2):
        assert pace.size == 1, "nothing is known of the first two"
        pace.record(1)
    assert pace.size == size


def test_progress_counts_every_run_once():
    points = xr.Dataset({"x": ("run", np.ones(1000)), "y": ((), 1.0)}, {"run": np.arange(1000)})
    reported = Recorded()
    evaluate(Evaluator(model(good)), points, {}, EvaluationOptions(progress=reported))
    assert sum(reported.runs) == 1000
    assert reported.runs[0] == 1, "the first report must not wait for many slow runs"


def test_rounds_are_numbered_through():
    first, second = runs_of(good, [1.0, -1.0]), runs_of(good, [2.0, 3.0, -2.0])
    both = join_rounds([first, second])
    assert both["run"].values.tolist() == [0, 1, 2, 3, 4]
    assert both["round"].values.tolist() == [0, 0, 1, 1, 1]
    assert both["x"].values.tolist() == [1.0, -1.0, 2.0, 3.0, -2.0]
    assert both["y"].dims == ()
    assert reasons(both) == {1: "x > 0", 4: "x > 0"}
