"""What holds for all tests."""

from __future__ import annotations

import gc
import gzip
import importlib
import json
import os
import pickle
import signal
import subprocess
import sys
from collections import UserDict
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import xarray as xr
from filelock import FileLock
from hypothesis import settings
from study_text import study_text

import uqpen
from uqpen.cli.main import main
from uqpen.core.processors import processors
from uqpen.study.load import parse_study
from uqpen.study.study import ValidatedStudy

# What a shell starts in the background ignores Ctrl-C, and so does all that it starts; here some of
# that is to be interrupted.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Processes that tests start keep what they have compiled: there are many, and each would compile
# all of uqpen again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# Workers of the tests have linear algebra in one thread: on busy processors, threads wait for each
# other far longer than they work. Tests of processors compare bits with those of two threads.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# The same examples each time: a test that fails now and then says nothing.
settings.register_profile("fixed", derandomize=True, deadline=None, max_examples=50)
settings.load_profile("fixed")


def pytest_xdist_auto_num_workers() -> int | None:
    """One process more than there are processors, as some tests wait for other processes."""
    if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ:
        return None  # what a user says there
    return processors() + 1


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collect the tests without a search for garbage: nearly all that is made is kept.

    Later searches leave it out, and are fewer, as commands have them.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.set_threshold(50_000, 20, 50)
        gc.enable()


# One process of the tests compiles what all of them use, while others wait for a cluster or for
# processes. If all of them began with studies, each would compile the same.
FIRST = {
    Path(__file__).parent / "archive" / "test_archive.py",
    Path(__file__).parent / "execution" / "test_cluster.py",
    Path(__file__).parent / "execution" / "test_processes.py",
}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the files that take long, so that none is left to one worker in the end."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: (item.path not in FIRST, item.path not in slow))


@pytest.fixture
def study_of(tmp_path: Path) -> Callable[..., ValidatedStudy]:
    """Makes a study of y, a line of NumPy in its inputs.

    An input is given as the ends of a uniform law, or as a study file has it.
    """
    return _study_maker(tmp_path)


@pytest.fixture(scope="module")
def module_study_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., ValidatedStudy]:
    """Makes the same for an archive that all tests of a module read."""
    return _study_maker(tmp_path_factory.mktemp("study"))


def _study_maker(folder: Path) -> Callable[..., ValidatedStudy]:
    def make(body: str, text: str = "", **inputs: Any) -> ValidatedStudy:
        names = ", ".join(inputs)
        source = f"import numpy as np\ndef f({names}):\n    return {{'y': {body}}}\n"
        (folder / "line.py").write_text(source)
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
        return parse_study("\n".join(lines), folder=folder)

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


FRESH = """
import contextlib, io, json, sys
from uqpen.cli.main import main
outcomes = []
for arguments in json.loads(sys.argv[1]):
    sys.argv = ["uqpen", *arguments]
    with contextlib.redirect_stdout(io.StringIO()) as out:
        with contextlib.redirect_stderr(io.StringIO()) as err:
            try:
                code = main() or 0
            except SystemExit as left:
                code = int(left.code or 0)
    outcomes.append((code, out.getvalue(), err.getvalue()))
print(json.dumps(outcomes))
"""


@pytest.fixture(scope="session")
def fresh_process() -> Callable[..., list[Outcome]]:
    """Calls command lines one after another in one process that has imported nothing before.

    To start a process takes longer than most of what it does.
    """

    def call(
        folder: Path, *lines: list[str], variables: Mapping[str, str] | None = None
    ) -> list[Outcome]:
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", FRESH, json.dumps(lines)],
            cwd=folder,
            env={**os.environ, **(variables or {})},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return [Outcome(*reported) for reported in json.loads(done.stdout)]

    return call


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Path]]:
    """Installs a package of one module, with its metadata, for the time of a test."""
    modules = []

    def make(name: str, source: str, entry_points: str) -> Path:
        module, site = f"uqpen_test_{name}", tmp_path / f"site_{name}"
        metadata = site / f"{module}-1.2.dist-info"
        metadata.mkdir(parents=True, exist_ok=True)
        (site / f"{module}.py").write_text(source)
        head = f"Metadata-Version: 2.1\nName: {module.replace('_', '-')}\nVersion: 1.2\n"
        (metadata / "METADATA").write_text(head)
        (metadata / "entry_points.txt").write_text(entry_points)
        (metadata / "top_level.txt").write_text(module)
        if str(site) not in sys.path:
            monkeypatch.syspath_prepend(site)
        modules.append(module)
        sys.modules.pop(module, None)
        importlib.invalidate_caches()
        return site

    yield make
    for module in modules:
        sys.modules.pop(module, None)


def _shared_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that all processes of the tests share."""
    folder = tmp_path_factory.getbasetemp()
    return folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder


@pytest.fixture(scope="session")
def made_once(
    tmp_path_factory: pytest.TempPathFactory,
) -> Callable[[str, Callable[[], xr.DataTree]], xr.DataTree]:
    """Gives a tree by its name: one process of the tests makes it, and the others read it."""
    folder = _shared_folder(tmp_path_factory)

    def made(name: str, make: Callable[[], xr.DataTree]) -> xr.DataTree:
        file = folder / f"{name}.pickle"
        with FileLock(file.with_suffix(".lock")):
            if not file.exists():
                file.write_bytes(pickle.dumps(make()))
        return pickle.loads(file.read_bytes())

    return made


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

BEAM = study_text(
    {
        "python": "beam.py:bend",
        "inputs": {"load": "N", "span": "m"},
        "outputs": {"deflection": "m"},
    },
    title="$5 and $6: \\frac{1}{0} \x1b[31m --> <script> 中",
    inputs={"load": ("10 kN", "20 kN"), "span": "(3 ± 0.1) m"},
    outputs={"deflection": {"unit": "mm", "exceeds": ["2 mm"]}},
    designs={"only": {"kind": "monte-carlo", "runs": 120}},
)

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
    text = BEAM if limit else f"{BEAM}[failures]\nstop_after = 0\n"
    return uqpen.run(uqpen.parse_study(text, folder=folder))


class Archives(UserDict[str, xr.DataTree]):
    """Archives by their names, each made when it is asked for."""

    def __init__(self, folder: Path, made_once: Callable[..., xr.DataTree]) -> None:
        super().__init__(dict.fromkeys([*KEPT, "rods", "beam", "lost"]))
        self._folder = folder
        self._made_once = made_once

    def __getitem__(self, name: str) -> xr.DataTree:
        if self.data[name] is None:
            self.data[name] = self._opened(name)
        return self.data[name]

    def _opened(self, name: str) -> xr.DataTree:
        if name in KEPT:
            return _kept(name, self._folder)
        return self._made_once(name, lambda: self._made(name))

    def _made(self, name: str) -> xr.DataTree:
        if name == "rods":
            return uqpen.run(uqpen.parse_study(ROD_MODELS))
        return _beam(self._folder, 0 if name == "lost" else 18e3)


@pytest.fixture(scope="session")
def archives(
    tmp_path_factory: pytest.TempPathFactory, made_once: Callable[..., xr.DataTree]
) -> Archives:
    """All of them, by name."""
    return Archives(tmp_path_factory.mktemp("archives"), made_once)


# The runs of the concrete study, and as many as tests need.
FEWER = {
    "runs = 10_000": "runs = 400",
    "runs = 8_192": "runs = 256",
    "base = 8_192": "base = 64",
    "trajectories = 50": "trajectories = 6",
    "runs = 500": "runs = 80",
}


@pytest.fixture(scope="session")
def concrete_text() -> str:
    """The file of the concrete study, with fewer runs."""
    text = (Path(__file__).parents[1] / "studies" / "concrete.toml").read_text(encoding="utf-8")
    for many, few in FEWER.items():
        assert many in text
        text = text.replace(many, few)
    return text


@pytest.fixture(scope="session")
def concrete(concrete_text: str, made_once: Callable[..., xr.DataTree]) -> xr.DataTree:
    """The archive of the concrete study with fewer runs."""
    return made_once("concrete", lambda: uqpen.run(uqpen.parse_study(concrete_text)))


@pytest.fixture(scope="session")
def whole_concrete(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The archive of the concrete study as it is, in a file that all processes read."""
    path = _shared_folder(tmp_path_factory) / "concrete.nc"
    with FileLock(path.with_suffix(".lock")):
        if not path.exists():
            study = Path(__file__).parents[1] / "studies" / "concrete.toml"
            uqpen.make_archive(uqpen.load_study(study), path)
    return path
