"""Programs as models: every way in, every way out, and every way to fail."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

import uqpen
from uqpen.core.errors import ModelError, StudyError
from uqpen.core.status import Status
from uqpen.execution import Evaluator
from uqpen.execution.processes import processes
from uqpen.models.command.model import remove_variable_parts
from uqpen.models.command.output_readers import (
    CsvReader,
    JsonReader,
    NetcdfReader,
    RunFiles,
    TextReader,
    UnreadableError,
)
from uqpen.models.command.program import fill
from uqpen.models.command.program import find_mistakes as mistakes_in
from uqpen.study.load import parse_study

pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="programs run on POSIX only"),
    pytest.mark.slow,
]

STUDY = """\
seed = 5
[model]
{model}
[model.inputs]
width = "cm"
load = "kN"
[model.outputs]
stress = "MPa"
[inputs]
width = "(4 ± 0.1) cm"
load = "(2 ± 0.2) kN"
[designs.some]
kind = "monte-carlo"
runs = {runs}
"""

WIDTH, LOAD = 0.04, 2000.0


def program(folder, text, name="solver"):
    """A shell script of that name, beside the study."""
    file = folder / name
    file.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    file.chmod(0o755)


def model_of(folder, model, *, trust=True):
    text = STUDY.format(model=model, runs=10)
    return parse_study(text, name="beam", folder=folder, trust=trust).model


def run(model, runs=1):
    inputs = {"width": np.full(runs, WIDTH), "load": np.full(runs, LOAD)}
    return Evaluator(model)(inputs)


def outcome(folder, script, model=""):
    """The status and reason of a run of a script that is handed its inputs as arguments."""
    program(folder, script)
    results = run(model_of(folder, f'command = ["./solver", "{{width}}", "{{load}}"]\n{model}'))
    return Status(results.status[0]), results.reasons.get(0, "")


def stress(model):
    """The output of a run that must be good, in MPa."""
    results = run(model)
    assert not results.reasons, results.reasons
    return float(results.outputs["stress"][0]) / 1e6


def mistakes(folder, model):
    with pytest.raises(StudyError) as caught:
        model_of(folder, model)
    return str(caught.value)


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A folder for a study, beside one for temporary files that must be empty in the end."""
    (tmp_path / "temporary").mkdir()
    (tmp_path / "study").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    return tmp_path / "study"


@pytest.fixture(autouse=True)
def _nothing_is_left(home):
    yield
    # Pools have a folder there as well.
    assert list((home.parent / "temporary").glob("uqpen-*")) == []


# --- ways in and out -----------------------------------------------------------------------------

C_SOURCE = r"""
#include <stdio.h>
#include <string.h>
int main(int count, char **words) {
    char text[4096]; double width, load;
    FILE *in = fopen(words[1], "r"); text[fread(text, 1, 4095, in)] = 0;
    sscanf(strstr(text, "\"width\":"), "\"width\": %lf", &width);
    sscanf(strstr(text, "\"load\":"), "\"load\": %lf", &load);
    FILE *out = fopen(words[2], "w");
    fprintf(out, "{\"stress\": %.17g}", width * load / 100);
    return fclose(out);
}
"""


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler here")
def test_a_compiled_program_reads_and_writes_json(home):
    (home / "solver.c").write_text(C_SOURCE)
    subprocess.run(["cc", "-o", "solver", "solver.c"], cwd=home, check=True)
    model = model_of(home, 'command = ["./solver", "{inputs}", "{outputs}"]')
    assert stress(model) == pytest.approx(0.08, rel=1e-15)


def test_inputs_come_as_json_in_the_declared_units_and_outputs_go_to_standard_output(home):
    script = 'sed \'s/.*"width": \\([^,]*\\),.*/{"stress": \\1, "more": []}/\' "$1"'
    program(home, script)
    model = model_of(home, 'command = ["./solver", "{inputs}"]')
    width = 0.0123456789012345678
    results = model.evaluate({"width": np.array([width]), "load": np.array([1.0])})
    # As a number of centimetres, to the last bit.
    assert results.outputs["stress"][0] == width / 0.01 * 1e6


def test_inputs_come_as_arguments_with_and_without_a_format(home):
    program(home, 'echo "$1|$2|$3" >&2; echo "$4 $5" >&2; exit 1')
    words = (
        f'"{{width}}", "w={{width:.3e}}", "{{{{}}}}", "{{load:08.2f}}", "$(id); *", "{300 * "x"}"'
    )
    results = run(model_of(home, f'command = ["./solver", {words}]'))
    assert results.reasons[0] == "exit code 1: 00002.00 $(id); *"
    kept = next((home / "beam_runs").iterdir())
    assert (kept / "stderr").read_text().splitlines()[0] == "4.0|w=4.000e+00|{}"


def test_templates_are_rendered_into_the_folder_of_the_run(home):
    (home / "deck.template").write_text("W {width:.17e}\r\nL {load} # {{µ}}\n", newline="")
    program(home, 'awk \'{ v[$1] = $2 } END { print "{\\"stress\\": " v["W"] / 50 "}" }\' $1')
    study = 'command = ["./solver", "deck/beam.dat"]\n[model.templates]\n"deck/beam.dat" = '
    model = model_of(home, f'{study}"deck.template"')
    assert stress(model) == pytest.approx(0.08)
    program(home, "exit 1")
    run(model)
    kept = next((home / "beam_runs").iterdir())
    deck = (kept / "deck" / "beam.dat").read_bytes().decode()
    assert deck == "W 4.00000000000000000e+00\r\nL 2.0 # {µ}\n"


def test_words_and_files_beside_the_study_are_found_from_the_folder_of_the_run(home):
    (home / "tables").mkdir()
    (home / "tables" / "factor").write_text("0.02")
    program(
        home, 'echo "{\\"stress\\": $(cat tables/factor)}"; echo broken > tables/factor', "s.sh"
    )
    words = 'command = ["sh", "s.sh", "{inputs}"]\nfiles = ["tables/factor"]'
    model = model_of(home, words)
    assert stress(model) == stress(model) == pytest.approx(0.02)


READINGS = {
    "json": ("""echo '{"a.b": [1, {"c": 3}]}' > o""", '{ json = "o", key = "a.b" }', None),
    "json path": ("""echo '{"a": [1, {"c": 3}]}' > o""", '{ json = "o", key = "a.1.c" }', 3.0),
    "csv": ("printf 't, stress\\n1, 2\\n\\n2,3\\n' > o", '{ csv = "o" }', 3.0),
    "csv row": ("printf 't,s\\n1,2\\n2,3\\n' > o", '{ csv = "o", column = "s", row = 0 }', 2.0),
    "csv below comments": ("printf '# R 4.2\\n# of today\\nt,stress\\n1,2\\n# more\\n2,3\\n' > o",
                           '{ csv = "o" }', 3.0),
    "csv with commented headings": ("printf '# numpy\\n# t,stress\\n1,2\\n2,3\\n' > o",
        '{ csv = "o" }', 3.0),
    "csv after": ("printf 'stress\\n7\\nRESULTS: all\\nt,stress\\n1,2\\n2,3\\n' > o",
                  '{ csv = "o", after = "RESULTS" }', 3.0),
    "text": ("echo s = 1; echo s = 3.0D+00",
             "{ text = 'stdout', pattern = '^s = (.+)$', match = 'last' }", 3.0),
    "group": ("echo at 1 s = 3 >&2", "{ text = 'stderr', pattern = 'at (\\d) s = (?P<stress>.+)' }",
              3.0),
}  # fmt: skip


@pytest.mark.parametrize(("script", "reading", "value"), READINGS.values(), ids=READINGS)
def test_outputs_are_read_from(home, script, reading, value):
    status, reason = outcome(home, script, f"read.stress = {reading}")
    if value is None:
        assert reason == '"a.b" in o is no number'
    else:
        assert (status, reason) == (Status.OK, "")
        assert stress(model_of_reading(home, reading)) == value


def model_of_reading(home, reading):
    words = 'command = ["./solver", "{width}", "{load}"]'
    return model_of(home, f"{words}\nread.stress = {reading}")


def test_outputs_are_read_from_netcdf(home):
    program(home, 'cp "$(dirname "$0")/out.nc" .')
    xr.Dataset(
        {
            "stress": 3.0,
            "course": ("t", [1.0, np.nan, 4.0]),
            "label": ("t", ["a", "b", "c"]),
            "table": (("t", "u"), np.zeros((3, 2))),
        }
    ).to_netcdf(home / "out.nc")
    found = {
        "": 3.0,
        ', variable = "course", row = -1': 4.0,
        ', variable = "course", row = 1': "stress is nan",
        ', variable = "course", row = 3': 'there is no row 3 of "course" in out.nc',
        ', variable = "course"': '"course" in out.nc is of shape (3,), not a single number',
        ', variable = "table", row = 0': (
            '"table" in out.nc is of shape (3, 2), not numbers along one dimension'
        ),
        ', variable = "label", row = 0': '"label" in out.nc holds str in place of a number',
        ', variable = "none"': 'out.nc has no "none"',
        ', variable = "none/none"': 'out.nc has no "none/none"',
    }
    for keys, expected in found.items():
        results = run(model_of_reading(home, f'{{ netcdf = "out.nc"{keys} }}'))
        value = results.outputs["stress"][0] / 1e6
        assert results.reasons.get(0, value) == expected
    program(home, "head -c 3000 /dev/urandom > out.nc")
    results = run(model_of_reading(home, '{ netcdf = "out.nc" }'))
    assert results.reasons[0] == "out.nc cannot be read as NetCDF: it is no NetCDF file"


def test_one_table_can_say_for_all_outputs_where_they_stand(home):
    program(home, "printf 'time,stress\\n0,7\\n' > out.csv")
    words = 'command = ["./solver", "{inputs}"]'
    assert stress(model_of(home, f'{words}\n[model.read]\ncsv = "out.csv"\nrow = 0')) == 7


# --- ways to fail --------------------------------------------------------------------------------

DEEP = "awk 'BEGIN { for (i = 0; i < 200000; i++) printf \"[\" }'"

MANY_NINES = """echo "{\\"stress\\": $(printf '%0Nd' 0 | tr 0 9)}" """

FAILURES = {
    "exit code": ("exit 3", Status.FAILED, "exit code 3"),
    "last words": (
        'echo 1 >&2; echo "$PWD/out: no $(dirname "$0")/mesh at 12:30:01" >&2; echo >&2; exit 1',
        Status.FAILED,
        "exit code 1: out: no mesh at …",
    ),
    "signal": ("kill -SEGV $$", Status.CRASHED, "ended by SIGSEGV"),
    "nothing": ("true", Status.FAILED, "stdout is empty"),
    "no JSON": ("echo stress = 3", Status.FAILED, "stdout is not JSON"),
    "nested": (DEEP, Status.FAILED, "stdout is not JSON"),
    "binary": ("head -c 100000 /dev/urandom", Status.FAILED, "stdout is not JSON"),
    "another output": ("echo '{\"s\": 1}'", Status.FAILED, 'stdout has no "stress"'),
    "a list": ("echo '[1]'", Status.FAILED, 'stdout has no "stress"'),
    "text": ('echo \'{"stress": "3"}\'', Status.FAILED, '"stress" in stdout is no number'),
    "flag": ("echo '{\"stress\": true}'", Status.FAILED, '"stress" in stdout is no number'),
    "nan": ("echo '{\"stress\": NaN}'", Status.NOT_FINITE, "stress is nan"),
    "huge": ("echo '{\"stress\": -1e999}'", Status.NOT_FINITE, "stress is -inf"),
    "long": (MANY_NINES.replace("N", "999"), Status.NOT_FINITE, "stress is inf"),
    "longer": (MANY_NINES.replace("N", "9999"), Status.FAILED, "stdout is not JSON"),
    "overlong": ("truncate -s 70M stdout", Status.FAILED, "stdout is larger than 64 MiB"),
}


@pytest.mark.parametrize(("script", "status", "reason"), FAILURES.values(), ids=FAILURES)
def test_a_run_that_fails_says_how(home, script, status, reason):
    assert outcome(home, script) == (status, reason)


UNREADABLE = {
    "missing": ("true", '{ json = "out/o" }', "wrote no out/o"),
    "folder": ("mkdir o", '{ json = "o" }', "o is no file"),
    "pipe": ("mkfifo o", '{ json = "o" }', "o is no file"),
    "ragged": ("printf 'a,stress\\n1\\n' > o", '{ csv = "o" }',
               'there is no row -1 of column "stress" in o'),
    "headings only": ("echo stress > o", '{ csv = "o" }',
                      'there is no row -1 of column "stress" in o'),
    "no column": ("echo t,a > o", '{ csv = "o" }', 'o has no column "stress"; it has t, a'),
    "no column of a table": ("echo '# t a' > o", '{ table = "o" }',
                             'o has no column "stress"; it has t, a'),
    "empty": ("echo > o", '{ csv = "o" }', "o is empty"),
    "no number": ("printf 'stress\\nhigh\\n' > o", '{ csv = "o" }',
                  'row -1 of column "stress" in o is no number'),
    "no CSV": ("head -c 200000 /dev/zero | tr '\\0' x > o", '{ csv = "o" }', "o is not CSV"),
    "no match": ("echo high", "{ text = 'stdout', pattern = 'stress = (\\S+)' }",
                 'no match for "stress = (\\\\S+)" in stdout'),
    "a match that is no number": ("echo stress = high",
        "{ text = 'stdout', pattern = 'stress = (\\S+)' }",
        'what "stress = (\\\\S+)" matches in stdout is no number'),
}  # fmt: skip


@pytest.mark.parametrize(("script", "reading", "reason"), UNREADABLE.values(), ids=UNREADABLE)
def test_an_output_that_cannot_be_read_is_a_failed_run(home, script, reading, reason):
    found = outcome(home, script, f"read.stress = {reading}")
    assert found == (Status.FAILED, reason)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"#!/no/such/python3\n", "what its first line names to run it with is not there"),
        (b"\x7fELF for another machine", "Exec format error"),
    ],
)
def test_a_program_that_cannot_be_started_is_a_failed_run(home, content, reason):
    (home / "solver").write_bytes(content)
    (home / "solver").chmod(0o755)
    results = run(model_of(home, 'command = ["./solver", "{inputs}"]'))
    assert results.reasons[0] == f"cannot be started: {reason}"


@pytest.mark.skipif(sys.platform != "linux", reason="limits on memory are kept by Linux")
def test_a_run_that_wants_too_much_memory_fails_by_itself(home):
    (home / "s.py").write_text("import sys; x = bytes(10**9); print('{\"stress\": 1}')")
    python = json.dumps([sys.executable, "-I", "-S", "s.py", "{inputs}"])
    (home / "s.py").chmod(0o644)
    results = run(model_of(home, f'command = {python}\nmemory_limit = "0.3 GB"'))
    assert results.reasons[0] == "exit code 1: MemoryError"
    assert stress(model_of(home, f'command = {python}\nmemory_limit = "2 GiB"')) == 1


def is_running(process):
    """Whether a process runs; a zombie that nobody has waited for yet does not."""
    try:
        os.kill(process, 0)
        # It may end between any two of these.
        stat = Path(f"/proc/{process}/stat").read_text()
    except ProcessLookupError:
        return False
    except FileNotFoundError:
        return sys.platform != "linux"
    return stat.rpartition(")")[2].split()[0] != "Z"


def ends(process):
    """Whether a process ends before the 300 s that it would sleep."""
    deadline = time.monotonic() + 100
    while is_running(process) and time.monotonic() < deadline:
        time.sleep(0.01)
    return not is_running(process)


# The child is in a process group of its own and holds what the program prints to open.
HANGING = 'set -m; sleep 300 & echo $! > "{log}"; sleep 300 & echo $! >> "{log}"; {then}'


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not tell of sessions")
@pytest.mark.parametrize("grouped", [True, False])
def test_a_run_that_hangs_is_ended_with_all_its_children(home, grouped):
    script = HANGING.format(log=home / "log", then="wait")
    script = script if grouped else script.removeprefix("set -m; ")
    begun = time.monotonic()
    found = outcome(home, script, 'time_limit = "0.5 s"')
    assert found == (Status.TIMED_OUT, "took longer than 0.5 s")
    assert time.monotonic() - begun < 100  # not the 300 s that the children would take
    for process in (home / "log").read_text().split():
        assert ends(int(process))


LIMITED = """\
command = ["./solver", "{width}", "{load}"]
time_limit = "0.5 s"
read.stress = { text = "stdout", pattern = '(a+)+$' }
"""


@pytest.mark.parametrize("is_main", [True, False])
def test_a_pattern_that_takes_too_long_is_a_run_that_has_timed_out(home, is_main):
    # There are 2^60 ways in which the pattern does not match.
    program(home, f"echo s = 7; [ $1 = 4.0 ] && echo {'a' * 60}b || echo aaa")
    model = model_of(home, LIMITED)
    inputs = {"width": np.array([0.04, 0.05]), "load": np.full(2, LOAD)}
    with ThreadPoolExecutor(1) as pool:
        evaluate = Evaluator(model)
        results = evaluate(inputs) if is_main else pool.submit(evaluate, inputs).result()
    assert results.status.tolist() == [Status.TIMED_OUT, Status.FAILED]
    assert results.reasons == {
        0: 'reading what "(a+)+$" matches in stdout took longer than 0.5 s',
        1: 'what "(a+)+$" matches in stdout is no number',
    }
    kept = model_of(home, LIMITED.replace("(a+)+$", "s = (.+)")).reading_again()
    assert Evaluator(kept)(inputs).outputs["stress"].tolist() == [7e6, 7e6]


def test_what_a_good_run_leaves_running_is_ended(home):
    script = f"sleep 300 & echo $! > {home / 'log'}; echo '{{\"stress\": 1}}'"
    assert outcome(home, script) == (Status.OK, "")
    assert ends(int((home / "log").read_text()))


JUST_STARTED = """\
import shutil, subprocess, sys
from pathlib import Path
from uqpen.models.command.process import guard_folder

folder = Path(sys.argv[1])
try:
    with guard_folder(folder):
        print(subprocess.Popen(["sleep", "300"], cwd=folder, start_new_session=True).pid)
        raise KeyboardInterrupt
finally:
    shutil.rmtree(folder)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not tell of folders")
def test_a_program_ends_that_was_just_being_started(tmp_path):
    folder = tmp_path / "a run"
    folder.mkdir()
    words = [sys.executable, "-c", JUST_STARTED, str(folder)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert "KeyboardInterrupt" in done.stderr
    assert ends(int(done.stdout))


KILLED = """\
import os, re, signal, sys, tempfile
import numpy as np
import uqpen
tempfile.tempdir = sys.argv[1]
model = uqpen.load_study("beam.toml").model
re.finditer = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
model.evaluate({"width": np.ones(1), "load": np.ones(1)})
"""


def test_no_folder_is_left_of_a_run_that_is_killed_while_its_output_is_read(home):
    program(home, f"pwd > {home / 'log'}")
    (home / "beam.toml").write_text(STUDY.format(model=LIMITED, runs=10), encoding="utf-8")
    words = [sys.executable, "-c", KILLED, str(home.parent / "temporary")]
    assert subprocess.run(words, cwd=home, check=False).returncode == -signal.SIGKILL
    folder = Path((home / "log").read_text().strip())
    deadline = time.monotonic() + 100
    while folder.exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not folder.exists()


STOPPED = """\
import sys, tempfile
import uqpen
tempfile.tempdir = sys.argv[1]
uqpen.run(uqpen.load_study("beam.toml"))
"""


def write_sleeping(home):
    """Write a study whose program tells its process and its child's; the file it tells them to."""
    log = home / "log"
    program(home, f"sleep 300 & echo $$ $! >> {log}; wait")
    (home / "beam.toml").write_text(
        STUDY.format(model='command = ["./solver", "{inputs}"]', runs=10)
        + "[failures]\ntrial = false\n",
        encoding="utf-8",
    )
    return log


def wait_for(log, count, is_over):
    """Wait until so many processes have been told, or none will be."""
    while not log.exists() or len(log.read_text().split()) < count:
        assert not is_over(), "the study does not start"
        time.sleep(0.002)  # so that some of the programs have only just been started


def all_have_ended(home):
    """Whether all processes end, and their folders with them."""
    temporary, deadline = home.parent / "temporary", time.monotonic() + 100
    have_ended = all(ends(int(process)) for process in (home / "log").read_text().split())
    while any(temporary.glob("uqpen-*")) and time.monotonic() < deadline:
        time.sleep(0.01)
    return have_ended and not (home / "beam_runs").exists()


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_who_stops_the_study_stops_its_programs(home, how):
    log = write_sleeping(home)
    words = [sys.executable, "-c", STOPPED, str(home.parent / "temporary")]
    precious = home / "precious"
    precious.mkdir()
    # What the shell that outlives the study has variables for.
    variables = os.environ | {"folder": str(precious), "group": "0"}
    with subprocess.Popen(words, cwd=home, env=variables, stderr=subprocess.DEVNULL) as study:
        wait_for(log, 2, lambda: study.poll() is not None)
        study.send_signal(how)
    assert all_have_ended(home)
    assert precious.exists()


def test_an_interrupt_stops_the_programs_of_workers(home, monkeypatch):
    log, study_is_over = write_sleeping(home), threading.Event()
    monkeypatch.setenv("TMPDIR", str(home.parent / "temporary"))

    def interrupt():
        wait_for(log, 4, study_is_over.is_set)
        os.kill(os.getpid(), signal.SIGINT)

    study, thread = uqpen.load_study(home / "beam.toml"), threading.Thread(target=interrupt)
    with processes(2) as pool:
        thread.start()
        try:
            with pytest.raises(KeyboardInterrupt):
                uqpen.run(study, map=pool)
        finally:
            study_is_over.set()
            thread.join()
    assert all_have_ended(home)


# --- what is kept, and what tells one model from another -----------------------------------------


def test_folders_of_failed_runs_are_kept_under_names_that_follow_from_the_inputs(home):
    program(home, 'echo out; echo oh no >&2; echo 1 > mesh; [ "$1" = 4.0 ] || exit 3; echo')
    words = 'command = ["./solver", "{width}", "{load}"]'
    inputs = {"width": np.array([0.04, 0.05, 0.05]), "load": np.array([1.0, 2.0, 2.0])}
    Evaluator(model_of(home, words))(inputs)
    kept = sorted((home / "beam_runs").iterdir())
    assert len(kept) == 2
    texts = {folder: (folder / "outcome.txt").read_text().splitlines() for folder in kept}
    failed = next(folder for folder, text in texts.items() if "exit" in text[0])
    assert texts[failed] == ["failed: exit code 3: oh no", f"{home}/solver 5.0 0.002"]
    assert (failed / "stdout").read_text() == "out\n"
    assert json.loads((failed / "inputs.json").read_text()) == {"width": 5.0, "load": 0.002}
    assert (failed / "mesh").exists()
    Evaluator(model_of(home, words))(inputs)
    assert sorted((home / "beam_runs").iterdir()) == kept


@pytest.mark.parametrize(("keep", "count"), [("all", 2), ("failed", 1), ("none", 0)])
def test_a_study_says_which_folders_are_kept(home, keep, count):
    program(home, 'echo "{\\"stress\\": $1}"; [ "$1" = 4.0 ]')
    words = f'command = ["./solver", "{{width}}", "{{load}}"]\nkeep = "{keep}"'
    inputs = {"width": np.array([0.04, 0.05]), "load": np.array([1.0, 2.0])}
    Evaluator(model_of(home, words))(inputs)
    place = home / "beam_runs"
    kept = list(place.iterdir()) if place.exists() else []
    assert len(kept) == count
    if keep == "all":
        texts = [(folder / "outcome.txt").read_text() for folder in kept]
        assert f"ok\nstress = 4.0\n{home}/solver 4.0 0.001\n" in texts


def test_a_model_that_keeps_its_runs_elsewhere_is_as_the_study_has_it(home):
    program(home, "echo 1")
    command = 'command = ["./solver", "{width}", "{load}"]\nnoise = true'
    text = STUDY.format(model=command, runs=10) + '[outputs.twice]\nformula = "2 * stress"\n'
    model = parse_study(text, name="beam", folder=home).model
    for other in (model.with_folder(home / "elsewhere"), model.reading_again()):
        assert [each.name for each in other.all_outputs] == ["stress", "twice"]
        assert other.noise.is_unseeded


def test_a_folder_that_cannot_be_kept_changes_no_result(home):
    (home / "beam_runs").write_text("in the way")
    assert outcome(home, "exit 3") == (Status.FAILED, "exit code 3")


def test_a_model_is_distinguished_from_another_by_its_files(home):
    (home / "deck").write_text("{width} {load}")
    (home / "table").write_text("1")
    program(home, "true", "s.sh")
    words = 'command = ["sh", "s.sh"]\nfiles = ["table"]\ntemplates = { input = "deck" }'
    before = model_of(home, words).identity()
    assert before.keys() == {"name", "source_sha256", "program_sha256"}
    assert before["name"] == "sh s.sh"
    for file, content in (("s.sh", "false"), ("table", "2"), ("deck", "{load} {width}")):
        held = (home / file).read_text()
        (home / file).write_text(content)
        after = model_of(home, words).identity()
        assert after["source_sha256"] != before["source_sha256"], file
        assert after["program_sha256"] == before["program_sha256"]
        (home / file).write_text(held)
    assert model_of(home, words).identity() == before
    program(home, "true")
    own = model_of(home, 'command = ["./solver", "{inputs}"]').identity()
    assert own.keys() == {"name", "source_sha256"}


# --- mistakes in a study -------------------------------------------------------------------------

MISTAKES = {
    'command = "./solver {inputs}"': ('found     "./solver {inputs}"',
        'expected  a program and its arguments, such as ["./solver", "{inputs}"]'),
    "command = []": ("found     an empty list",),
    'command = ["./solver", 3]': ("beam.toml:3  model.command[1]", "expected  a word in quotes"),
    'command = ["{width}", "{load}"]': ("expected  a program, without placeholders",),
    'command = ["./solvr", "{inputs}"]': (
        'found     there is no program "./solvr" beside the study',),
    'command = ["solver", "{inputs}"]': (
        'found     there is no program "solver" in the PATH; the one beside '
        'the study is "./solver"', "expected  a program that can be executed"),
    'command = ["./deck", "{inputs}"]': ('found     "./deck" is not executable',),
    'command = ["./solver", "{wdth}", "{inputs}"]': (
        'beam.toml:3  model.command[1]\n    found     {wdth} in "{wdth}"',
        'an input of the model; did you mean "width"? known: width, load, inputs, outputs'),
    'command = ["./solver", "{width:s}", "{inputs}"]': ('found     {width:s} in "{width:s}"',
        "expected  a format such as {width:.6e}"),
    'command = ["./solver", "{inputs:s}"]': ("expected  {inputs}: a path has no format",),
    'command = ["./solver", "{", "{inputs}"]': ('found     a single { in "{"',
        "expected  {name} or {name:.6e}, and {{ or }} for a brace"),
    'command = ["./solver", "{width}"]': (
        "model.inputs.load\n    found     an input that the program does not get",
        "expected  {inputs} or {load} in the command, or in a template"),
    'command = ["./solver", "{inputs}"]\ntemplates = { a = "none" }': (
        'model.templates.a\n    found     no file "none" beside the study',
        "expected  the name of a file beside the study"),
    'command = ["./solver", "{inputs}"]\ntemplates = { a = "deck" }': (
        'found     {hight} in "deck", line 2',),
    'command = ["./solver", "{inputs}"]\ntemplates = { a = "latin" }': (
        'found     "latin", which is not UTF-8',),
    'command = ["./solver", "{inputs}"]\ntemplates = { "../a" = "deck", stdout = "deck" }': (
        "a path relative to the folder of the run, none of inputs.json, outputs.json, outcome.txt, "
        "run.json, stdout, stderr",),
    'command = ["./solver", "{inputs}"]\nfiles = ["none", "../beam", "stdout"]': (
        'found     no file "none" beside the study', "beam.toml:4  model.files[1]",
        "expected  a name that nothing else has"),
    'command = ["./solver", "{inputs}"]\ntime_limit = "0 s"': ('expected  a time such as "10 s"',),
    'command = ["./solver", "{inputs}"]\nmemory_limit = "2 Gb"': ('found     "2 Gb"',
        'expected  a size such as "2 GB" or "512 MiB", at least 1 MB'),
    'command = ["./solver", "{inputs}"]\nkeep = "some"': (
        'which folders of runs are kept: "failed", "all" or "none"',),
    'command = ["./solver", "{inputs}"]\nkept = "all"': ('did you mean "keep"?',),
    'command = ["./solver", "{inputs}"]\nread = { strss = { json = "o" } }': (
        "model.read.strss\n    found     an unknown output",
        'did you mean "stress"? known: stress'),
    'command = ["./solver", "{inputs}"]\nread.stress = "out.json"': (
        'found     "out.json"\n    expected  a table',),
    'command = ["./solver", "{inputs}"]\nread.stress = { file = "out.json" }': (
        "found     nothing that names a file",
        "expected  one of json, csv, table, netcdf, text, with the name of a file"),
    'command = ["./solver", "{inputs}"]\nread.stress = { json = "/out.json" }': (
        "expected  the name of a file in the folder of the run, relative to it",),
    'command = ["./solver", "{inputs}"]\nread.stress = { json = "o", column = "a" }': (
        "model.read.stress.column\n    found     an unknown key",),
    'command = ["./solver", "{inputs}"]\nread.stress = { csv = "o", row = 1.5 }': (
        "expected  a whole number: rows count from 0, and back from -1",),
    "command = ['./solver', '{inputs}']\nread.stress = { text = 'stdout', pattern = '(' }": (
        'found     "(": missing ), unterminated subpattern at position 0',
        "expected  a regular expression with one group, or one called stress: 'stress = (\\S+)'"),
    "command = ['./solver', '{inputs}']\nread.stress = { text = 'stdout', pattern = 'a' }": (
        'found     "a", with no groups',),
}  # fmt: skip


@pytest.mark.parametrize(("model", "messages"), MISTAKES.items(), ids=range(len(MISTAKES)))
def test_a_mistake_is_reported_before_anything_runs(home, model, messages):
    program(home, "exit 99")
    (home / "deck").write_text("{width} {load}\n{hight}\n")
    (home / "latin").write_bytes(b"\xe6")
    reported = mistakes(home, model)
    for message in messages:
        assert message in reported, reported


def test_no_input_can_be_called_as_a_file(home):
    program(home, "true")
    text = STUDY.format(model='command = ["./solver", "{inputs}"]', runs=1)
    with pytest.raises(StudyError, match="are files"):
        parse_study(text.replace("width", "inputs"), folder=home)


def test_without_trust_nothing_is_looked_for_and_nothing_runs(home):
    words = 'command = ["./none", "{inputs}"]\nfiles = ["none"]\ntemplates = { a = "none" }'
    model = model_of(home, words, trust=False)
    assert model.identity() == {"name": "./none {inputs}"}
    with pytest.raises(ModelError, match="is not executed without --trust"):
        run(model)


# --- words of a program in a reason --------------------------------------------------------------

STEADY = {
    "solver[4711]: bad mesh": "solver…: bad mesh",
    "==4711== Invalid read at 0x7ffd3a": "… Invalid read at 0x…",
    "process 4711 failed, PID=12": "process … failed, PID=…",
    "2026-01-31 12:30:01.5 diverged": "… … diverged",
    "cannot open /scratch/u/job/mesh.dat": "cannot open mesh.dat",
    "see https://example.org/a/b": "see https://example.org/a/b",
    "residual 1.5e-3 after 300 iterations": "residual 1.5e-3 after 300 iterations",
    "\x1b[31mred\x1b[0m\tand\x00 more": "[31mred [0m and more",
    "x" * 300: "x" * 199 + "…",
}


@pytest.mark.parametrize(("said", "reported"), STEADY.items(), ids=range(len(STEADY)))
def test_a_reason_is_the_same_each_time(said, reported):
    assert remove_variable_parts(said, [Path("/"), Path("/tmp/run")]) == reported


# --- whatever stands there -----------------------------------------------------------------------

ANY_READING = st.sampled_from(
    [
        JsonReader("o", "a.0"),
        CsvReader("o", "a", 0),
        TextReader("o", "(.)", match="last"),
        TextReader("o", "^a(b)?", 1, match="first"),
        NetcdfReader("o", "a"),
    ]
)
PIECES = [*(b'a { } [ " : , 1 e9 \xff NaN'.split()), b"\n", b"\r", b"\0"]
ANY_BYTES = st.binary() | st.lists(st.sampled_from(PIECES)).map(b"".join)


@given(content=ANY_BYTES, reading=ANY_READING)
def test_whatever_a_program_writes_is_a_number_or_a_reason(tmp_path_factory, content, reading):
    folder = tmp_path_factory.getbasetemp()
    (folder / "o").write_bytes(content)
    with contextlib.suppress(UnreadableError):
        assert isinstance(reading.value(RunFiles(folder)), float)


@given(st.text("ab{}:.3e%<\n d", max_size=12))
def test_a_text_without_mistakes_can_be_filled(text):
    found = list(mistakes_in(text, ["a"], ["b"]))
    for line, _, _ in found:
        assert 1 <= line <= text.count("\n") + 1
    if not found:
        fill(text, {"a": 1.5, "b": "path"})


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_placeholder_keeps_every_bit(value):
    assert float(fill("{a}", {"a": value})) == value
