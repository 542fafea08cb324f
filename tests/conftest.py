"""What holds for all tests."""

from __future__ import annotations

import gzip
import signal
import sys
from collections import UserDict
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import xarray as xr
from hypothesis import settings

import uqpen
from uqpen.cli.main import main
from uqpen.study.load import parse_study
from uqpen.study.study import Study

# What a shell starts in the background ignores Ctrl-C, and so does all that it starts; here some of
# that is to be interrupted.
signal.signal(signal.SIGINT, signal.default_int_handler)

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
        distributions = [f"{name} = {_law(law)}" for name, law in inputs.items()]
        units = [f'{name} = "1"' for name in inputs]
        designs = '[designs.some]\nkind = "monte-carlo"\nruns = 10'
        lines = [
            "seed = 1",
            '[model]\npython = "line.py:f"\nvectorized = true',
            *("[model.inputs]", *units),
            '[model.outputs]\ny = "1"',
            *("[inputs]", *distributions),
            text if "[designs" in text else f"{text}\n{designs}",
        ]
        return parse_study("\n".join(lines), folder=tmp_path)

    return make


def _law(distribution: Any) -> str:
    if isinstance(distribution, tuple):
        return f"{{ uniform = {{ lower = {distribution[0]!r}, upper = {distribution[1]!r} }} }}"
    if isinstance(distribution, float):
        return repr(distribution)
    return distribution if distribution.startswith("{") else f'"{distribution}"'


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


# Archives to draw and to report on: those that are kept, and small ones of what is not among them.

DATA = Path(__file__).parent / "data"
RODS = (DATA / "rods.toml").read_text().split("[inputs]")[1].replace("(60 ± 25)", "(100 ± 25)")

KEPT = sorted(path.name.removesuffix(".nc.gz") for path in DATA.glob("archives/*.nc.gz"))

ROD_MODELS = f"""
title = "Three rods"
seed = 1
[models.original]
use = "walker-anderson"
[models.smoothed]
use = "walker-anderson"
with = {{ smoothing = 1 }}
[models.rigid]
use = "rigid-penetration"
[inputs]{RODS}
[outputs.penetration_depth]
unit = "cm"
exceeds = ["60 cm", "90 cm"]
[designs.latin]
kind = "latin-hypercube"
runs = 100
"""

BEAM = """
title = "$5 and $6: \\\\frac{1}{0} \\u001b[31m --> <script> 中"
seed = 1
[model]
python = "beam.py:bend"
[model.inputs]
load = "N"
span = "m"
[model.outputs]
deflection = "m"
[inputs]
load = { uniform = { lower = "10 kN", upper = "20 kN" } }
span = "(3 ± 0.1) m"
[outputs.deflection]
unit = "mm"
exceeds = ["2 mm"]
[designs.only]
kind = "monte-carlo"
runs = 120
"""

SOURCE = """
def bend(load, span):
    if load > LIMIT:
        raise ValueError("too heavy")
    return {"deflection": load * span**3 / 1e8}
"""


def _kept(name: str, folder: Path) -> xr.DataTree:
    """An archive that is kept, unpacked."""
    path = folder / f"{name}.nc"
    path.write_bytes(gzip.decompress((DATA / "archives" / f"{name}.nc.gz").read_bytes()))
    return uqpen.open_archive(path)


def _beam(folder: Path, limit: float) -> xr.DataTree:
    """A study whose title means harm, and whose heavy loads are lost."""
    folder = folder / str(limit)
    folder.mkdir()
    (folder / "beam.py").write_text(SOURCE.replace("LIMIT", str(limit)))
    return uqpen.run(uqpen.parse_study(BEAM, folder=folder))


class Archives(UserDict[str, xr.DataTree]):
    """Archives by their names, each made when it is asked for."""

    def __init__(self, folder: Path) -> None:
        super().__init__(dict.fromkeys([*KEPT, "rods", "beam", "lost"]))
        self.folder = folder

    def __getitem__(self, name: str) -> xr.DataTree:
        if self.data[name] is None:
            self.data[name] = self._made(name)
        return self.data[name]

    def _made(self, name: str) -> xr.DataTree:
        if name in KEPT:
            return _kept(name, self.folder)
        if name == "rods":
            return uqpen.run(uqpen.parse_study(ROD_MODELS))
        return _beam(self.folder, 0 if name == "lost" else 18e3)


@pytest.fixture(scope="session")
def archives(tmp_path_factory: pytest.TempPathFactory) -> Archives:
    """All of them, by name."""
    return Archives(tmp_path_factory.mktemp("archives"))
