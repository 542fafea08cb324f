"""Runs on real processes: the same bytes, whatever becomes of the workers."""

import functools
import math
import os
import select
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import xarray as xr
from study_text import study_text

import uqpen
from uqpen.archive.write import write
from uqpen.cli.main import main
from uqpen.core.errors import ModelError, SettingsError
from uqpen.core.model import Input, Output
from uqpen.core.status import Status
from uqpen.execution import EvaluationOptions, Evaluator, evaluate
from uqpen.execution.batch import Batch
from uqpen.execution.evaluator import EvaluatorWork
from uqpen.execution.processes import processes
from uqpen.models.python_function import PythonFunction

pytestmark = pytest.mark.slow

BUILT_IN = study_text(
    "ishigami",
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": "1 ± 1"},
    constraints={"keep": ["x1 > x2 - 3"]},
    designs={"monte_carlo": {"kind": "monte-carlo", "runs": 2_500}},
)

# What it needs is imported where it is needed, so that only a run can tell.
FUNCTION = """\
import math

def f(x):
    from helper import twice
    if x > 1.5:
        raise ValueError(f"{x:.3f} is too much")
    return {"y": math.nan if x < -1.5 else twice(x)}
"""

STUDY = """\
seed = 3
{models}
[inputs]
x = "0 ± 1"
[designs.some]
kind = "monte-carlo"
runs = {runs}
"""
MODEL = """\
python = "function.py:f"
inputs = { x = "1" }
outputs = { y = "m" }
"""

SEVERAL = f"""\
[models.one]
{MODEL}
[models.other]
{MODEL.replace(":f", ":g")}
vectorized = true
noise = false  # it depends on the whole batch
"""


def study(folder, source, *, runs=100, models="[model]\n" + MODEL):
    """The text of a study of a function in its folder."""
    (folder / "function.py").write_text(source)
    return STUDY.format(models=models, runs=runs)


def archive(folder, text, map=map):
    """The bytes of a study's archive."""
    write(uqpen.run(uqpen.parse_study(text, folder=folder), map=map), folder / "study.nc")
    return (folder / "study.nc").read_bytes()


UQPEN = ("-m", "uqpen")


def python(folder, *arguments):
    """What became of a call of Python in a folder."""
    words = [sys.executable, *arguments]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def two():
    """Two workers, for all tests that leave them as they were."""
    with processes(2) as pool:
        yield pool


@pytest.mark.processor
def test_any_number_of_workers_writes_the_same_bytes(tmp_path):
    (tmp_path / "helper.py").write_text("def twice(x): return 2 * x")
    several = FUNCTION + "\ndef g(x):\n    return {'y': x / abs(x).max()}"
    texts = {"built-in": BUILT_IN, "several": study(tmp_path, several, runs=1100, models=SEVERAL)}
    here = {name: archive(tmp_path, text) for name, text in texts.items()}
    for workers in (1, 3):
        with processes(workers) as pool:
            for name, text in texts.items():
                assert archive(tmp_path, text, pool) == here[name], (name, workers)


def points(*x):
    return xr.Dataset({"x": ("run", np.array(x))}, {"run": np.arange(len(x))})


def test_a_worker_loads_what_runs_need_and_no_datasets(tmp_path):
    source = """
import sys
def f(x):
    return {"y": len({"pandas", "scipy", "xarray"} & sys.modules.keys())}
"""
    model = uqpen.parse_study(study(tmp_path, source), folder=tmp_path).model
    with processes(1) as one:
        runs = evaluate(Evaluator(model), points(0.0), {}, EvaluationOptions(map=one))
    assert runs["y"].values.tolist() == [0.0]


def test_results_keep_the_order_of_the_runs(tmp_path, two):
    text = study(tmp_path, "import time\ndef f(x): time.sleep(x); return {'y': x}")
    model = uqpen.parse_study(text, folder=tmp_path).model
    runs = evaluate(Evaluator(model), points(0.3, 0, 0.1, 0), {}, EvaluationOptions(map=two))
    assert runs["y"].values.tolist() == [0.3, 0, 0.1, 0]


def test_batches_are_taken_as_they_are_needed(two):
    work = EvaluatorWork(Evaluator(uqpen.parse_study(BUILT_IN).model))
    taken = []

    def batches():
        for number in range(1000):
            taken.append(number)
            inputs = {name: np.array([0.1 * number % 3]) for name in ("x1", "x2", "x3")}
            yield Batch(number, inputs)

    results = iter(two(work, batches()))
    next(results)
    assert len(taken) < 50
    results.close()  # type: ignore[attr-defined]
    assert len(list(two(work, batches()))) == 1000, "the workers can be used again"


def test_noise_is_not_the_same_in_every_worker(tmp_path, two):
    source = "import numpy as np\ndef f(x): return {'y': np.random.normal()}"
    text = study(tmp_path, source, models=f"[model]\nnoise = true\n{MODEL}")
    tree = uqpen.run(uqpen.parse_study(text, folder=tmp_path), map=two)
    assert len(set(tree["runs/some"]["y"].values.tolist())) == 100


@pytest.mark.parametrize("vectorized", [False, True])
def test_a_worker_that_is_killed_once_loses_nothing(tmp_path, vectorized):
    source = """
import os, pathlib, signal
marker = pathlib.Path(__file__).with_name("marker")
def f(x):
    if not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"y": 2 * x}
"""
    models = "[model]\n" + MODEL + "vectorized = true\n" * vectorized
    text = study(tmp_path, source, runs=1100, models=models)
    with processes(2) as pool:
        killed = archive(tmp_path, text, pool)
    assert (tmp_path / "marker").exists()
    assert killed == archive(tmp_path, text)


def single_runs(folder, source, x):
    """A function as work for a map, and a batch for each of its runs."""
    model = uqpen.parse_study(study(folder, source), folder=folder).model
    batches = [Batch(run, {"x": np.array([value])}) for run, value in enumerate(x)]
    return EvaluatorWork(Evaluator(model)), batches


@pytest.fixture
def any_task_is_short(monkeypatch):
    """No task takes so long that it is sent alone, however busy the machine."""
    monkeypatch.setattr("uqpen.execution.worker._LONG", math.inf)


@pytest.mark.usefixtures("any_task_is_short")
def test_a_worker_begins_its_next_short_batch_while_the_results_are_stored(tmp_path):
    source = """
import pathlib
def f(x):
    pathlib.Path(__file__).with_name(f"run_{x:.0f}").touch()
    return {"y": x}
"""
    work, batches = single_runs(tmp_path, source, range(20))
    with processes(1) as one:
        results = iter(one(work, batches))
        known = [next(results).start for _ in range(12)]
        assert known == list(range(12))
        until = time.monotonic() + 60
        while not (tmp_path / "run_12").exists():
            assert time.monotonic() < until
            time.sleep(0.01)


@pytest.mark.usefixtures("any_task_is_short")
def test_a_batch_behind_one_that_kills_its_worker_is_made_once(tmp_path):
    source = """
import os, pathlib
log = pathlib.Path(__file__).with_name("log")
def f(x):
    with log.open("a") as file:
        print(round(x), file=file)
    if x == 12:
        os._exit(3)
    return {"y": x}
"""
    work, batches = single_runs(tmp_path, source, range(20))
    with processes(1) as one:
        results = sorted(one(work, batches), key=lambda result: result.start)
    statuses = [result.results.status[0] for result in results]
    assert statuses == [Status.CRASHED if run == 12 else Status.OK for run in range(20)]
    made = (tmp_path / "log").read_text().split()
    assert sorted(map(int, made)) == sorted([*range(20), 12, 12])


@pytest.mark.usefixtures("any_task_is_short")
def test_large_batches_and_their_results_pass_each_other(tmp_path):
    models = f"[model]\n{MODEL}vectorized = true"
    text = study(tmp_path, "def f(x): return {'y': x}", models=models)
    work = EvaluatorWork(Evaluator(uqpen.parse_study(text, folder=tmp_path).model))
    x = np.linspace(0, 1, 500_000)
    with processes(1) as one:
        results = list(one(work, [Batch(number * x.size, {"x": x}) for number in range(20)]))
    assert all((each.results.outputs["y"] == x).all() for each in results)
    assert len(results) == 20


def test_a_run_that_kills_its_worker_is_the_only_one_lost(tmp_path, two):
    source = """
import os
def f(x):
    if (x > 2.9).any():
        os.kill(os.getpid(), 9)
    if (x > 2.5).any():
        os._exit(3)
    return {"y": 2 * x}
"""
    text = study(tmp_path, source, models=f"[model]\n{MODEL}vectorized = true")
    model = uqpen.parse_study(text, folder=tmp_path).model
    x = np.tile([*np.linspace(-3, 2, 59), 2.7, *np.linspace(-3, 2, 59), 3.0], 2)
    runs = evaluate(Evaluator(model), points(*x), {}, EvaluationOptions(map=two))
    assert (runs["status"].values == np.where(x > 2.5, Status.CRASHED, Status.OK)).all()
    assert (runs["y"].values[x < 2.5] == 2 * x[x < 2.5]).all()
    ends = ["exit code 3", "Killed"] * 2
    assert runs["lost_reason"].values.tolist() == [f"the run ended its process: {e}" for e in ends]


def test_a_long_path_of_temporary_files_is_no_hindrance(tmp_path, monkeypatch):
    temporary = tmp_path / ("long" * 30)
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    text = study(tmp_path, "def f(x): return {'y': x}")
    with processes(1) as pool:
        assert archive(tmp_path, text, pool)


def test_a_function_that_exists_in_this_process_only_is_refused(two):
    lock = threading.Lock()

    def locked(x):
        with lock:
            return {"y": x}

    units = {"x": "1", "y": "1"}
    model = PythonFunction(locked, "mine", (Input("x", "1"),), (Output("y", "1"),), units)
    with pytest.raises(ModelError, match="cannot be sent to another process"):
        evaluate(Evaluator(model), points(1.0), {}, EvaluationOptions(map=two))


def test_there_is_at_least_one_worker():
    with pytest.raises(SettingsError, match="1 or more"), processes(0):
        pass


def test_what_goes_wrong_in_a_worker_is_reported(tmp_path, two):
    loaded = uqpen.parse_study(study(tmp_path, "def f(x): return {'y': x}"), folder=tmp_path)
    (tmp_path / "function.py").unlink()
    with pytest.raises(ModelError, match="no file"):
        uqpen.run(loaded, map=two)


SCRIPT = """\
import uqpen
from uqpen.execution.processes import processes
with processes(1) as pool:
    uqpen.run(uqpen.load_study("mine.toml"), map=pool)
"""


def test_a_script_that_would_start_itself_again_is_reported(tmp_path):
    (tmp_path / "mine.toml").write_text(study(tmp_path, "def f(x): return {'y': x}"))
    (tmp_path / "script.py").write_text(SCRIPT)
    done = python(tmp_path, "script.py")
    assert 'under if __name__ == "__main__"' in done.stderr
    assert done.returncode == 1


SLOW = "import time\ndef f(x):\n    print('run', flush=True)\n    time.sleep(60)\n"


# As a terminal interrupts all processes, and as a cluster ends the one it knows.
@pytest.mark.parametrize(
    ("sent", "send"), [(signal.SIGINT, os.killpg), (signal.SIGTERM, os.kill)], ids=["all", "one"]
)
def test_an_interrupt_leaves_no_process_and_no_file(tmp_path, sent, send):
    folder = tmp_path / "temporary"
    folder.mkdir()
    (tmp_path / "mine.toml").write_text(study(tmp_path, SLOW))
    with subprocess.Popen(
        [sys.executable, *UQPEN, "study", "mine.toml", "--workers", "2"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
        env={**os.environ, "TMPDIR": str(folder)},
        preexec_fn=functools.partial(signal.signal, sent, signal.SIG_DFL),
    ) as process:
        assert process.stdout.readline().startswith(b"run")
        send(process.pid, sent)
        # Nothing ends before the last process that could write to it.
        said = process.communicate(timeout=60)[1]
    assert process.returncode == 128 + sent
    assert said == b"interrupted: nothing was written\n"
    assert not list(folder.iterdir())


# It has a child, and neither a thread nor a handler of Python's gets a turn meanwhile.
BUSY_IN_C = """\
import subprocess

def f(x):
    print("run", flush=True)
    subprocess.Popen(["sleep", "600"])
    7 ** 3**18
"""
# Its child holds a pipe open.
LAUNCHER = """\
import pathlib, subprocess

def f(x):
    with pathlib.Path(__file__).with_name("pipe").open("w") as pipe:
        subprocess.run(["sleep", "600"], stdout=pipe)
"""


def test_what_a_run_has_started_ends_with_its_time(tmp_path, two):
    os.mkfifo(tmp_path / "pipe")
    pipe = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    models = f'[model]\ntime_limit = "0.3 s"\n{MODEL}'
    model = uqpen.parse_study(study(tmp_path, LAUNCHER, models=models), folder=tmp_path).model
    runs = evaluate(Evaluator(model), points(0.0), {}, EvaluationOptions(map=two))
    assert runs["lost_reason"].values.tolist() == ["took longer than 0.3 s"]
    # Its end comes with that of the last process that could write to it.
    assert select.select([pipe], [], [], 60)[0]
    assert os.read(pipe, 1) == b""
    os.close(pipe)


IMPORTS = """\
import pathlib, time
started = []
def f(x):
    import slow_module
    started.append(x)
    if x > 1.5:
        time.sleep(60)
    return {"y": x, "calls": started.count(x)}
"""


def test_imports_are_no_part_of_the_time_of_a_run(tmp_path):
    (tmp_path / "slow_module.py").write_text("import time\ntime.sleep(1.1)\n")
    models = f'[model]\ntime_limit = "1 s"\n{MODEL}'.replace(
        'outputs = { y = "m" }', 'outputs = { y = "m", calls = "1" }'
    )
    text = study(tmp_path, IMPORTS, models=models)
    model = uqpen.parse_study(text, folder=tmp_path).model
    x = np.array([0.25, 0.5, 2.0, 0.75, 1.0])
    with processes(1) as pool:
        runs = evaluate(Evaluator(model), points(*x), {}, EvaluationOptions(map=pool))
    lost = x > 1.5
    assert (runs["status"].values == np.where(lost, Status.TIMED_OUT, Status.OK)).all()
    assert runs["lost_reason"].values.tolist() == ["took longer than 1 s"]
    # The first run is made again when its module is loaded: only then it shows what time it takes.
    assert runs["calls"].values[0] == 2


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere it ends when the run does")
def test_a_run_and_its_child_end_with_a_program_that_is_killed(tmp_path):
    models = f'[model]\ntime_limit = "50 s"\n{MODEL}'
    (tmp_path / "mine.toml").write_text(study(tmp_path, BUSY_IN_C, runs=2, models=models))
    line = [sys.executable, *UQPEN, "study", "mine.toml"]
    with subprocess.Popen(
        line, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout.readline().startswith(b"run")
        process.kill()
        # Nothing ends before the last process that could write to it.
        process.communicate(timeout=60)


@pytest.mark.parametrize("workers", ["0", "-1", "two", "1.5"])
def test_a_number_of_workers_that_is_none_leaves_with_2(command_line, workers):
    outcome = command_line("study", "mine.toml", "--workers", workers)
    assert outcome.code == 2
    assert "--workers" in outcome.err


def test_methods_are_compared_on_processes_too(tmp_path, monkeypatch):
    text = study(tmp_path, "def f(x): return {'y': x}")
    text += '[designs.more]\nkind = "latin-hypercube"\nruns = 100\n'
    (tmp_path / "mine.toml").write_text(text)
    monkeypatch.chdir(tmp_path)
    short = ("--budget", "16", "--repeats", "10", "--reference", "64")
    for workers in ("1", "2"):
        options = (*short, "-o", f"{workers}.nc", "--workers", workers)
        monkeypatch.setattr(sys, "argv", ["uqpen", "compare", "mine.toml", *options])
        with pytest.raises(SystemExit) as left:
            main()
        assert not left.value.code
    assert (tmp_path / "1.nc").read_bytes() == (tmp_path / "2.nc").read_bytes()
