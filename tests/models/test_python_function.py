"""A user's Python function may raise anything, return anything, fork or stop the program."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from uqpen.core.interrupts import is_user_interrupt, record_interrupts
from uqpen.core.model import Input, Output
from uqpen.core.status import Status
from uqpen.models.python_function import PythonFunction


def evaluate(function):
    model = PythonFunction(function, "f", (Input("x", "1"),), (Output("y", "1"),), UNITS)
    return model.evaluate({"x": np.array([0.5])})


UNITS = {"x": "1", "y": "1"}


class TextExitsError(Exception):
    def __str__(self):
        sys.exit(0)


class NameRaises(type):
    @property
    def __name__(cls):  # type: ignore[override]
        raise RuntimeError("no name")


class NamelessError(Exception, metaclass=NameRaises):
    pass


class Lazy(dict[str, Any]):
    def __init__(self, error):
        super().__init__(y=1.0)
        self.error = error

    def __getitem__(self, name):
        raise self.error


class Number:
    def __array__(self, *arguments, **options):
        sys.exit(0)


def raising(error):
    def function(x):
        raise error

    return function


@pytest.mark.parametrize(
    ("function", "reason"),
    [
        (raising(SystemExit(0)), "SystemExit: 0"),
        (raising(TextExitsError()), "TextExitsError"),
        (raising(NamelessError("lost")), "NamelessError: lost"),
        (raising(GeneratorExit()), "GeneratorExit"),
        (lambda x: Lazy(LookupError("not yet")), "LookupError: not yet"),
        (lambda x: Lazy(SystemExit(0)), "SystemExit: 0"),
        (lambda x: {"y": Number()}, "SystemExit: 0"),
    ],
)
def test_whatever_it_raises_is_the_reason_of_a_failed_run(function, reason):
    results = evaluate(function)
    assert results.status.tolist() == [Status.FAILED]
    assert results.reasons == {0: reason}


def test_the_streams_are_there_after_the_run():
    def function(x):
        sys.stdout = sys.stderr = None  # type: ignore[assignment]
        return {"y": x}

    streams = sys.stdout, sys.stderr
    assert evaluate(function).status.tolist() == [Status.OK]
    assert (sys.stdout, sys.stderr) == streams


class TestInterrupts:
    def test_one_that_a_model_raises_is_a_failed_run_where_ctrl_c_is_recorded(self):
        with record_interrupts():
            results = evaluate(raising(KeyboardInterrupt()))
        assert results.reasons == {0: "KeyboardInterrupt"}

    def test_ctrl_c_stops_the_study(self):
        def function(x):
            os.kill(os.getpid(), signal.SIGINT)
            signal.pause()

        with record_interrupts(), pytest.raises(KeyboardInterrupt):
            evaluate(function)

    def test_without_a_record_it_may_be_ctrl_c(self):
        with pytest.raises(KeyboardInterrupt):
            evaluate(raising(KeyboardInterrupt()))

    def test_the_handler_of_before_is_there_again(self):
        before = signal.getsignal(signal.SIGINT)
        with record_interrupts():
            assert signal.getsignal(signal.SIGINT) is not before
        assert signal.getsignal(signal.SIGINT) is before
        assert not is_user_interrupt(ValueError())


FORKING = """
import os, sys
sys.path.insert(0, {tests!r})
from test_python_function import evaluate

for ending in {endings!r}:
    names = {{"os": os, "sys": sys}}
    exec(
        "def function(x):\\n    child = os.fork()\\n    if child:\\n"
        "        ended = os.waitpid(child, 0)[1]\\n"
        "        return {{'y': os.waitstatus_to_exitcode(ended)}}\\n"
        f"    {{ending}}\\n",
        names,
    )
    outputs = evaluate(names["function"]).outputs["y"].tolist()
    sys.stdout.write(f"{{ending}}: {{outputs}}\\n")
    sys.stdout.flush()
"""
ENDINGS = {
    "sys.exit(0)": 0,
    "sys.exit(3)": 3,
    "sys.exit('stop')": 1,
    "raise ValueError": 1,
    "return {'y': x}": 0,
    "return 'nothing of use'": 0,
}


@pytest.mark.slow
def test_a_forked_child_never_goes_on_with_the_study():
    program = FORKING.format(tests=str(Path(__file__).parent), endings=[*ENDINGS])
    printed = subprocess.check_output([sys.executable, "-c", program], text=True)
    assert printed.splitlines() == [f"{each}: [{code:.1f}]" for each, code in ENDINGS.items()]
