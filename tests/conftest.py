"""What holds for all tests."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from hypothesis import settings

from uqpen.cli.main import main
from uqpen.study.load import parse_study
from uqpen.study.study import Study

# The same examples each time: a test that fails now and then says nothing.
settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")


@pytest.fixture
def study_of(tmp_path: Path) -> Callable[..., Study]:
    """Makes a study of y, a line of NumPy in its inputs.

    An input is given as the ends of a uniform law, or as a study file has it.
    """

    def make(body: str, text: str = "", **inputs: Any) -> Study:
        names = ", ".join(inputs)
        source = f"import numpy as np\ndef f({names}):\n    return {{'y': {body}}}\n"
        (tmp_path / "line.py").write_text(source)
        laws = [f"{name} = {_law(law)}" for name, law in inputs.items()]
        units = [f'{name} = "1"' for name in inputs]
        designs = '[designs.some]\nkind = "monte-carlo"\nruns = 10'
        lines = [
            "seed = 1",
            '[model]\npython = "line.py:f"\nvectorized = true',
            *("[model.inputs]", *units),
            '[model.outputs]\ny = "1"',
            *("[inputs]", *laws),
            text if "[designs" in text else f"{text}\n{designs}",
        ]
        return parse_study("\n".join(lines), folder=tmp_path)

    return make


def _law(law: Any) -> str:
    if isinstance(law, tuple):
        return f"{{ uniform = {{ lower = {law[0]!r}, upper = {law[1]!r} }} }}"
    if isinstance(law, float):
        return repr(law)
    return law if law.startswith("{") else f'"{law}"'


class Outcome(NamedTuple):
    """What became of a call of the command line."""

    code: int
    out: str
    err: str

    @property
    def said(self) -> str:
        """What was printed, its lines joined."""
        return " ".join(self.out.split())


@pytest.fixture
def command_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> Callable[..., Outcome]:
    """The command line in a folder of its own, on a screen of 80 columns."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")

    def call(*arguments: str) -> Outcome:
        monkeypatch.setattr(sys, "argv", ["uqpen", *arguments])
        code = 0
        try:
            main()
        except SystemExit as left:
            code = int(left.code or 0)
        return Outcome(code, *capsys.readouterr())

    return call
