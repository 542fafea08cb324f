"""Runs on a real Dask cluster on this machine: the same bytes, whatever becomes of a worker."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from study_text import study_text

import uqpen
from uqpen.archive.write import write
from uqpen.core.errors import ClusterError
from uqpen.core.status import Status
from uqpen.core.streams import BLOCK
from uqpen.execution import Evaluator
from uqpen.execution.batch import Batch
from uqpen.execution.cluster import cluster
from uqpen.execution.evaluator import EvaluatorWork
from uqpen.execution.processes import processes
from uqpen.models.known_functions import Ishigami

pytestmark = pytest.mark.slow

# A run raises, gives no number, hangs, or kills the process that makes it.
MODEL = """\
import math, os, time
def simulate(x, kind):
    kind = int(kind)
    if kind == 1:
        raise ValueError("one that raises")
    if kind == 2:
        return {"y": math.nan}
    if kind == 3:
        time.sleep(60)
    if kind == 4:
        os.kill(os.getpid(), 9)
    return {"y": x**2}
"""
STUDY = study_text(
    {
        "python": "model.py:simulate",
        "time_limit": "1 s",
        "inputs": {"x": "1", "kind": "1"},
        "outputs": {"y": "m"},
    },
    seed=5,
    inputs={"x": "0 ± 1", "kind": (0, 5)},
    designs={"some": {"kind": "table", "file": "points.csv"}},
)
BUILT_IN = study_text(
    "ishigami",
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": "1 ± 1"},
    designs={"monte_carlo": {"kind": "monte-carlo", "runs": 2_500}},
)
SLOW = study_text(
    {"python": "slow.py:simulate", "inputs": {"x": "1"}, "outputs": {"y": "m"}},
    seed=5,
    inputs={"x": "0 ± 1"},
    designs={"some": {"kind": "monte-carlo", "runs": 60}},
)

# It tells how many runs have begun, and takes its time while somebody waits for that.
COUNTED = """\
import pathlib, time
here = pathlib.Path(__file__).parent

def simulate(x):
    with (here / "calls").open("a") as calls:
        calls.write("call\\n")
    if not (here / "hurry").exists():
        time.sleep(0.05)
    return {"y": x**3}
"""


@pytest.fixture
def mixed(tmp_path):
    """A folder with a study of 100 runs of which four go wrong, each in its own way."""
    kinds = np.zeros(100)
    kinds[[11, 37, 62, 93]] = [1, 2, 3, 4]
    rows = [f"{run / 100},{kind}" for run, kind in enumerate(kinds)]
    (tmp_path / "points.csv").write_text("\n".join(["x,kind", *rows]))
    (tmp_path / "model.py").write_text(MODEL)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


def archive(folder, map, name="study.toml"):
    """The bytes of a study's archive."""
    write(uqpen.run(uqpen.load_study(folder / name), map=map), folder / "study.nc")
    return (folder / "study.nc").read_bytes()


class Dask:
    """A scheduler and workers that the tests have started, and end."""

    def __init__(self, folder):
        self.file = folder / "scheduler.json"
        self.workers = {}
        self._processes = []
        self._start("scheduler", "--port", "0", "--scheduler-file", str(self.file))

    def worker(self, nanny):
        """Start a worker; its process is known by that option."""
        where = ("--scheduler-file", str(self.file), "--nthreads", "1")
        options = ("--local-directory", str(self.file.parent), nanny)
        self.workers[nanny] = self._start("worker", *where, *options)

    def end(self):
        """Kill them with their children, as nobody waits for what they would still do."""
        for process in self._processes:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
        for process in self._processes:
            process.wait()

    def _start(self, what, *options):
        quiet = ("--host", "127.0.0.1", "--no-dashboard")
        process = subprocess.Popen(
            [sys.executable, "-m", "dask", what, *quiet, *options],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        self._processes.append(process)
        return process.pid


@contextmanager
def quietly():
    """What Dask's own connections leave to be collected is no fault of a test."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ResourceWarning)
        yield


@pytest.fixture(scope="module")
def dask(tmp_path_factory):
    """A scheduler, which has no worker at first."""
    started = Dask(tmp_path_factory.mktemp("dask"))
    try:
        while not started.file.exists():
            time.sleep(0.05)
        yield started
    finally:
        started.end()


@pytest.fixture(scope="module")
def two(dask):
    """A cluster of two workers, one of them with a nanny, which makes it a daemon."""
    for nanny in {"--nanny", "--no-nanny"} - dask.workers.keys():
        dask.worker(nanny)
    with quietly(), cluster(str(dask.file)) as found:
        found._client.wait_for_workers(2, timeout=60)
        yield found


# First, while there is none.
def test_a_study_without_a_worker_says_so_and_uses_one_that_joins(tmp_path, monkeypatch, dask):
    monkeypatch.setattr("uqpen.execution.cluster._FIRST_REPORT", 0.1)
    (tmp_path / "slow.py").write_text(COUNTED)
    (tmp_path / "hurry").touch()
    (tmp_path / "study.toml").write_text(SLOW)
    texts = list[str]()

    def report(text):
        if not texts:
            dask.worker("--no-nanny")
        texts.append(text)

    with quietly(), cluster(str(dask.file), report) as found:
        joined = archive(tmp_path, found)
    assert joined == archive(tmp_path, map)
    assert texts[0].startswith("the cluster has had no worker for 0:00:0")
    assert texts[-1].startswith("the cluster has workers again, after 0:00:")


def test_a_cluster_writes_the_bytes_of_a_single_process(tmp_path, two):
    (tmp_path / "study.toml").write_text(BUILT_IN)
    assert archive(tmp_path, two) == archive(tmp_path, map)


def test_large_batches_of_a_fast_model_give_no_warning(two):
    names = ("x1", "x2", "x3")
    batches = [
        Batch(number * BLOCK, {name: np.full(BLOCK, 0.5) for name in names}) for number in range(8)
    ]
    assert 8 * 3 * 8 * BLOCK > 10e6, "Dask warns from there"
    made = two(EvaluatorWork(Evaluator(Ishigami())), batches)
    assert sum(map(len, made)) == 8 * BLOCK


def test_runs_that_go_wrong_in_any_way_cost_themselves_only(mixed, two):
    with processes(2) as pool:
        on_processes = archive(mixed, pool)
    runs = uqpen.open_archive(mixed / "study.nc")["runs/some"]
    lost = {11: Status.FAILED, 37: Status.NOT_FINITE, 62: Status.TIMED_OUT, 93: Status.CRASHED}
    status = runs["status"].values
    assert {run: Status(status[run]) for run in np.flatnonzero(status).tolist()} == lost
    assert runs["lost_reason"].values.tolist() == [
        'ValueError: one that raises (model.py, line 5: raise ValueError("one that raises"))',
        "y is nan",
        "took longer than 1 s",
        "the run ended its process: Killed",
    ]
    kept = status == Status.OK
    assert (runs["y"].values[kept] == runs["x"].values[kept] ** 2).all()
    statistics = uqpen.open_archive(mixed / "study.nc")["statistics/some/y"]["mean"].attrs
    assert statistics["runs_used"] == 96
    assert archive(mixed, two) == on_processes
    assert archive(mixed, map) == on_processes, "one process supervises another"


def test_a_model_that_cannot_be_loaded_there_is_reported(tmp_path, two):
    (tmp_path / "slow.py").write_text("def simulate(x): return {'y': x}")
    (tmp_path / "study.toml").write_text(SLOW)
    study = uqpen.load_study(tmp_path / "study.toml")
    (tmp_path / "slow.py").unlink()
    with pytest.raises(uqpen.UqpenError, match="no file"):
        uqpen.run(study, map=two)


@pytest.mark.parametrize(
    ("scheduler", "reported"),
    [
        ("none.json", "--scheduler: found none.json; expected an address such as tcp://host:8786"),
        ("tcp://127.0.0.1:1", "no Dask scheduler responds at tcp://127.0.0.1:1"),
        ("http://127.0.0.1:1", "no Dask scheduler responds at http://127.0.0.1:1"),
    ],
)
def test_a_scheduler_that_is_not_there_leaves_with_2(
    command_line, monkeypatch, scheduler, reported
):
    monkeypatch.setattr("uqpen.execution.cluster._PATIENCE", 0.5)
    Path("study.toml").write_text(BUILT_IN)
    with quietly():
        outcome = command_line("study", "study.toml", "--scheduler", scheduler)
    assert outcome.code == 2
    assert reported in outcome.err


def test_a_study_on_a_cluster_from_the_command_line(command_line, dask):
    Path("study.toml").write_text(BUILT_IN)
    with quietly():
        outcome = command_line("study", "study.toml", "--scheduler", str(dask.file))
    assert outcome.code == 0
    both = command_line("study", "study.toml", "--scheduler", "x", "--workers", "2")
    assert both.code == 2
    assert "--workers and --scheduler exclude each other" in both.err


def test_without_dask_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ClusterError, match=r'pip install "uqpen\[cluster\]"'), cluster("tcp://x:1"):
        pass


# The last two: of the worker without a nanny, and of the scheduler.
def test_a_worker_that_is_killed_in_mid_study_loses_nothing(tmp_path, dask, two):
    (tmp_path / "slow.py").write_text(COUNTED)
    (tmp_path / "study.toml").write_text(SLOW)

    def kill():
        calls = tmp_path / "calls"
        while not calls.exists() or len(calls.read_text().split()) < 15:
            time.sleep(0.01)
        os.kill(dask.workers["--no-nanny"], signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    killed = archive(tmp_path, two)
    killer.join()
    (tmp_path / "hurry").touch()
    assert killed == archive(tmp_path, map)


def test_a_scheduler_that_goes_away_costs_no_finished_run(tmp_path, dask, two):
    calls = tmp_path / "calls"
    (tmp_path / "slow.py").write_text(COUNTED)
    (tmp_path / "study.toml").write_text(SLOW)
    line = [sys.executable, "-m", "uqpen", "study", "study.toml", "--scheduler", str(dask.file)]
    with subprocess.Popen(line, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as study:
        while not calls.exists() or len(calls.read_text().split()) < 30:
            time.sleep(0.01)
        dask.end()
        said = study.communicate(timeout=60)[1].splitlines()
    assert study.returncode == 2
    assert said[-2] == "the Dask scheduler has gone away, or dropped the runs it was given"
    assert re.fullmatch(r"\d+ runs are kept; the same command continues from there", said[-1])
    assert [line for line in said if "distributed" in line] == []
