"""The commands as their user meets them: what is printed, where, and the exit code."""

import functools
import json
import os
import pty
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import netCDF4
import pytest
from study_text import study_text

from uqpen.checkpoints.make_archive import make_archive
from uqpen.study.load import load_study, parse_study

pytestmark = pytest.mark.slow

STUDIES = Path(__file__).parents[2] / "studies"

SMALL = study_text(
    "ishigami",
    title="Small [bold]study[/bold]",
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": 1},
    outputs={"y": {"exceeds": [5], "hold": [0.95]}},
    designs={
        "monte_carlo": {"kind": "monte-carlo", "runs": 100},
        "latin_hypercube": {"kind": "latin-hypercube", "runs": 100},
    },
)


@pytest.fixture
def uqpen(command_line, tmp_path):
    """The command line beside a small study."""
    (tmp_path / "small.toml").write_text(SMALL, encoding="utf-8")
    return command_line


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """The archive of the small study."""
    path = tmp_path_factory.mktemp("small") / "small.nc"
    make_archive(parse_study(SMALL, name="small"), path)
    return path.read_bytes()


class TestStudy:
    def test_it_writes_an_archive_and_shows_its_tables_on_80_columns(self, uqpen):
        done = uqpen("study", "small.toml", "--all")
        assert done.code == 0
        assert Path("archives/small.nc").is_file()
        assert "archive: archives/small.nc" in done.out
        for word in ("monte_carlo", "latin_hypercube", "mean", "median", "P(> 5)", "±"):
            assert word in done.out
        assert "monte_carlo: 100 runs" in done.err
        assert max(map(len, done.out.splitlines())) <= 80
        assert "Small [bold]study[/bold]" in done.out, "a title is text and no markup"

    def test_a_mistake_leaves_with_2_and_writes_nothing(self, uqpen):
        Path("wrong.toml").write_text(SMALL.replace("runs = 100", "runs = 0"), encoding="utf-8")
        done = uqpen("study", "wrong.toml")
        assert done.code == 2
        assert done.out == ""
        assert "wrong.toml: 2 mistakes; nothing was run" in done.err
        assert "wrong.toml:14  designs.monte_carlo.runs" in done.err
        assert "Traceback" not in done.err
        assert sorted(path.name for path in Path().iterdir()) == ["small.toml", "wrong.toml"]

    def test_a_destination_that_is_none_is_reported_before_any_run(self, uqpen):
        Path("thesis.nc").write_text("years of work")
        done = uqpen("study", "small.toml", "-o", "thesis.nc")
        assert (done.code, done.out) == (2, "")
        assert "not overwritten" in done.err
        assert Path("thesis.nc").read_text() == "years of work"

    def test_a_model_that_goes_elsewhere_does_not_take_the_archive_along(self, uqpen, tmp_path):
        name = "maximum_principal_stress_at_the_left_support_of_the_beam_under_load_case_two"
        (tmp_path / "slow.py").write_text(
            f"import os\ndef f(x):\n    os.chdir('/')\n    return {{'{name}': 2 + x / 10}}"
        )
        study = SLOW_STUDY.replace("100000", "10").replace("{ y =", f"{{ {name} =")
        (tmp_path / "slow.toml").write_text(study)
        done = uqpen("study", "slow.toml", "--all")
        assert done.code == 0
        assert (tmp_path / "archives" / "slow.nc").is_file()
        # Figures are shown however long the names are.
        assert name in done.out
        assert re.search(r"mean +\d\.\d+ \(\d\.\d+ … \d\.\d+\)", done.out)

    def test_a_design_that_lost_every_run_leaves_with_3_and_says_why(self, uqpen, tmp_path):
        (tmp_path / "slow.py").write_text("def f(x):\n    raise ValueError('why \\x1b[31m oh why')")
        (tmp_path / "slow.toml").write_text(SLOW_STUDY.replace("100000", "10"))
        done = uqpen("study", "slow.toml")
        assert done.code == 3
        assert "All 10 runs failed." in done.out
        shown = uqpen("show", "archives/slow.nc").out
        assert "10 failed" in shown
        assert "ValueError: why \\x1b[31m oh why" in shown, (
            "with its control characters spelled out"
        )
        assert "all runs of a design failed" in done.err
        assert (tmp_path / "archives" / "slow.nc").is_file(), "failed runs are data"

    @pytest.mark.parametrize(
        "arguments", [("study",), ("study", "a", "b"), ("frob",), ("study", "--frob")]
    )
    def test_a_wrong_call_leaves_with_2(self, command_line, arguments):
        done = command_line(*arguments)
        assert done.code == 2
        assert "Usage" in done.err


class TestCheck:
    def test_it_says_what_would_run_and_runs_nothing(self, uqpen):
        done = uqpen("check", "small.toml")
        assert done.code == 0
        assert "200 runs in all" in done.out
        assert "uniform: lower -3, upper 3" in done.out
        assert "P(> 5)" in done.out
        assert not Path("archives").exists()

    def test_it_says_what_runs_may_take_and_what_becomes_of_lost_ones(self, uqpen):
        Path("limited.py").write_text("def f(a):\n    return {'y': a}\n")
        Path("limited.toml").write_text(
            """
            seed = 1
            failures = { retry = 2, at_most = "5 %" }
            inputs.a = { uniform = { lower = 0, upper = 1 } }
            designs.some = { kind = "monte-carlo", runs = 10 }
            [model]
            python = "limited.py:f"
            time_limit = "90 s"
            inputs.a = "1"
            outputs.y = "1"
            """
        )
        said = uqpen("check", "limited.toml").out
        assert "each run may take 90 s" in said
        assert "a failed run is repeated at most 2 times" in said
        assert "the study stops if more than 5 % of a design's runs fail" in said
        assert "each run may take" not in uqpen("check", "small.toml").out

    def test_a_trial_run_shows_outputs_in_the_units_of_the_study(self, uqpen):
        Path("tried.py").write_text(
            "def f(a):\n"
            "    if a > 4:\n"
            "        raise ValueError('too long')\n"
            "    return {'y': a / 2}\n"
        )
        text = """
            seed = 1
            inputs.a = "(MEDIAN ± 0.1) m"
            outputs.y.unit = "cm"
            designs.some = { kind = "monte-carlo", runs = 10 }
            [model]
            python = "tried.py:f"
            inputs.a = "m"
            outputs.y = "m"
            """
        Path("tried.toml").write_text(text.replace("MEDIAN", "3"))
        done = uqpen("check", "tried.toml", "--try")
        assert done.code == 0
        assert re.search(r"trial run at the nominal inputs, \S+ s\n\n.*\n.*\ny +150 +cm", done.out)
        Path("tried.toml").write_text(text.replace("MEDIAN", "5"))
        failed = uqpen("check", "tried.toml", "--try")
        assert failed.code == 3
        assert "trial run at the nominal inputs: failed\n  ValueError: too long" in failed.out


class TestShow:
    @pytest.fixture(autouse=True)
    def archive(self, uqpen, small):
        Path("archives").mkdir()
        Path("archives/small.nc").write_bytes(small)

    def test_it_shows_what_the_study_showed(self, uqpen):
        shown = uqpen("show", "archives/small.nc")
        assert shown.code == 0
        assert shown.out in uqpen("study", "small.toml", "--all", "--fresh").out

    def test_json_is_for_scripts(self, uqpen):
        found = json.loads(uqpen("show", "archives/small.nc", "--json").out)
        mean = found["designs"]["monte_carlo"]["outputs"]["y"]["mean"]
        assert mean["lower"] < mean["estimate"] < mean["upper"]
        assert "0.05" in found["designs"]["latin_hypercube"]["outputs"]["y"]["quantiles"]

    def test_a_damaged_archive_leaves_with_2_and_says_where(self, uqpen):
        with netCDF4.Dataset("archives/small.nc", "a") as dataset:
            dataset["statistics/latin_hypercube/y"].renameVariable("bound", "limit")
        done = uqpen("show", "archives/small.nc")
        assert done.code == 2
        assert (
            "is damaged: /statistics/latin_hypercube/y: mean: not the bounds of an estimate"
            in done.err
        )

    def test_a_title_cannot_command_the_terminal(self, uqpen):
        with netCDF4.Dataset("archives/small.nc", "a") as dataset:
            dataset.title = "\x1b]0;taken\x07"
        assert "\x1b" not in uqpen("show", "archives/small.nc").out
        # JSON escapes the first 32 characters of itself; the others stood as they were.
        title = "\x9b31m \u202e\u2066 \U000e0041 é °"
        with netCDF4.Dataset("archives/small.nc", "a") as dataset:
            dataset.title = title
        written = uqpen("show", "archives/small.nc", "--json").out
        assert json.loads(written)["title"] == title
        assert r'"\u009b31m \u202e\u2066 \udb40\udc41 é °"' in written


class TestModels:
    def test_it_lists_the_models(self, uqpen):
        done = uqpen("models")
        assert done.code == 0
        assert all(name in done.out for name in ("walker-anderson", "rigid-penetration"))

    def test_it_describes_one(self, uqpen):
        done = uqpen("models", "walker-anderson")
        for word in ("projectile_density", "kg m-3", "penetration_depth", "v = u, u = 0, rigid"):
            assert word in done.out
        assert max(map(len, done.out.splitlines())) <= 80

    def test_installed_ones_are_listed_without_being_imported(self, uqpen, install):
        points = "[uqpen.models]\nown = uqpen_test_{0}:Own\nishigami = uqpen_test_{0}:Own\n"
        install("broken", "import sys; sys.exit(4)", points.format("broken"))
        done = uqpen("models")
        assert done.code == 0
        rows = [" ".join(line.split()) for line in done.out.splitlines()]
        assert "own of the installed package uqpen-test-broken 1.2" in rows
        assert done.out.count("ishigami") == 1
        named = uqpen("models", "own")
        assert named.code == 2
        assert 'the installed package "uqpen-test-broken", which provides "own"' in named.err
        assert uqpen("models", "ishigami").code == 0

    def test_an_installed_one_is_described(self, uqpen, install):
        page = Path(__file__).parents[2] / "docs" / "extending" / "model.md"
        source = re.findall(r"```python\n(# my_model.py.*?)```", page.read_text(), re.DOTALL)[0]
        unmade = "class Unmade(Spring):\n    def __init__(self): 1 / 0\n"
        points = "[uqpen.models]\n" + "".join(
            f"{name.lower()} = uqpen_test_members:{name}\n"
            for name in ("Spring", "Unmade", "Faulty")
        )
        faulty = f"{unmade}class Faulty(Spring):\n    outputs = ()\n"
        install("members", source + faulty, points)
        done = uqpen("models", "spring")
        assert done.code == 0
        assert "Static deflection of a mass on a spring that hardens." in done.out
        assert "hardening" in done.out
        assert '"unmade" without settings: ZeroDivisionError' in uqpen("models", "unmade").err
        assert '"faulty" has no outputs' in uqpen("models", "faulty").err
        assert "known: walker-anderson" in uqpen("models", "sprung").err


class TestRun:
    NOMINAL = (
        "projectile_density=17.5 g/cm^3",
        "projectile_yield_limit=1.65 GPa",
        "projectile_length=16 cm",
        "impact_velocity=1400 m/s",
        "projectile_sound_speed=3071 m/s",
        "target_density=2.5 g/cm^3",
        "target_yield_limit=400 MPa",
        "plasticity_radius=100 mm",
        "crater_radius=17 mm",
    )

    def settings(self, *more):
        return [part for text in (*self.NOMINAL, *more) for part in ("--set", text)]

    def test_the_nominal_rod_goes_as_deep_as_it_should(self, uqpen):
        done = uqpen("run", "walker-anderson", *self.settings())
        assert done.code == 0
        values = {line.split()[0]: line.split()[1] for line in done.out.splitlines()[2:]}
        assert float(values["penetration_depth"]) == pytest.approx(0.4615719, abs=1e-7)
        assert float(values["projectile_residue"]) == pytest.approx(0.02327912, abs=1e-8)
        assert "v = u" in done.out

    def test_what_makes_a_model_of_several_what_it_is_is_not_set(self, uqpen, tmp_path):
        text = (STUDIES / "concrete.toml").read_text(encoding="utf-8")
        models = (
            '[models.sharp]\nuse = "walker-anderson"\n'
            '[models.smoothed]\nuse = "walker-anderson"\nwith = { smoothing = 1.0 }'
        )
        study = tmp_path / "two.toml"
        study.write_text(text.replace('[model]\nuse = "walker-anderson"', models))
        done = uqpen("run", str(study), "--set", "smoothing=0.5")
        depths = [line.split()[1] for line in done.out.splitlines() if "penetration" in line]
        assert list(map(float, depths)) == pytest.approx([0.4664426, 0.4755823], abs=1e-6)

    @pytest.mark.parametrize(
        ("more", "complaint"),
        [
            (("smoothing=2",), "inadmissible: smoothing >= 0 and < 2"),
            (("crater_radius=17 kg",), "--set crater_radius: found"),
            (("crater_radios=17 mm",), 'did you mean "crater_radius"'),
            (("crater_radius",), 'expected the form name="value unit"'),
            (("crater_radius=170 mm",), "inadmissible: plasticity_radius > crater_radius"),
        ],
    )
    def test_a_wrong_input_is_reported(self, uqpen, more, complaint):
        done = uqpen("run", "walker-anderson", *self.settings(*more))
        assert done.code == 2
        assert complaint in done.err

    def test_a_name_of_something_else_is_no_built_in_model(self, uqpen):
        said = uqpen("run", "beam.py:bend").err
        assert said.startswith('no built-in model "beam.py:bend"; known: walker-anderson, ')

    def test_missing_inputs_are_reported_with_their_units(self, uqpen):
        done = uqpen("run", "rigid-penetration")
        assert done.code == 2
        assert '--set projectile_density="… kg m-3"' in done.err


SLOW = """\
import time
def f(x):
    time.sleep(0.02)
    return {"y": x}
"""
SLOW_STUDY = study_text(
    {"python": "slow.py:f", "inputs": {"x": "1"}, "outputs": {"y": "1"}},
    inputs={"x": "0 ± 1"},
    designs={"slow": {"kind": "monte-carlo", "runs": 100_000}},
)


class TestProcess:
    """The program itself, in a process of its own."""

    def command(self, *arguments):
        return [sys.executable, "-m", "uqpen", *arguments]

    def done(self, folder, *arguments, stdout=subprocess.PIPE, **variables):
        """The program in a folder, when it has ended."""
        return subprocess.run(
            self.command(*arguments),
            cwd=folder,
            stdout=stdout,
            stderr=subprocess.PIPE,
            check=False,
            env={**os.environ, **variables},
        )

    @pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGHUP])
    def test_an_interrupt_leaves_with_its_code_and_no_traceback(self, tmp_path, sent):
        (tmp_path / "slow.py").write_text(SLOW)
        (tmp_path / "slow.toml").write_text(SLOW_STUDY)
        controller, terminal = pty.openpty()
        with subprocess.Popen(
            self.command("study", "slow.toml"),
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=terminal,
            env={**os.environ, "TERM": "xterm", "COLUMNS": "80"},
            preexec_fn=functools.partial(signal.signal, sent, signal.SIG_DFL),
        ) as process:
            os.close(terminal)
            seen = b""
            while b"slow" not in seen:  # the bar of the design: its runs are being made
                seen += os.read(controller, 1000)
            while not list((tmp_path / "archives").rglob("*.npz")):
                time.sleep(0.01)
            process.send_signal(sent)
            code = process.wait(timeout=60)
        while chunk := _read(controller):
            seen += chunk
        os.close(controller)
        assert code == 128 + sent
        assert b"runs are kept; the same command continues from there" in seen
        assert b"Traceback" not in seen
        left = {path.name for path in (tmp_path / "archives").iterdir()}
        assert left == {"slow.nc.log", "slow.nc.parts"}

    def test_a_reader_that_has_seen_enough_changes_no_exit_code(self, tmp_path):
        (tmp_path / "slow.py").write_text("def f(x): raise ValueError")
        (tmp_path / "slow.toml").write_text(SLOW_STUDY)
        for arguments, code in ((("models",), 0), (("check", "slow.toml", "--try"), 3)):
            with subprocess.Popen(
                self.command(*arguments),
                cwd=tmp_path,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            ) as process:
                process.stdout.close()
                assert process.stderr.read() == b""
                assert process.wait() == code

    def test_a_study_does_not_depend_on_who_reads_its_output(self, tmp_path):
        (tmp_path / "slow.py").write_text("def f(x):\n    print('x' * 999)\n    return {'y': x}")
        (tmp_path / "slow.toml").write_text(SLOW_STUDY.replace("100000", "30"))
        heard = make_archive(load_study(tmp_path / "slow.toml"), tmp_path / "heard.nc")
        assert heard["runs/slow"].sizes["run"] == 30
        for workers in ("1", "2"):
            arguments = ("study", "slow.toml", "-o", f"{workers}.nc", "--workers", workers)
            with subprocess.Popen(
                self.command(*arguments),
                cwd=tmp_path,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
            ) as process:
                process.stdout.close()
                assert process.wait() == 0
            unheard = (tmp_path / f"{workers}.nc").read_bytes()
            assert unheard == (tmp_path / "heard.nc").read_bytes()

    @pytest.mark.parametrize(
        ("arguments", "closed", "code"),
        [(("study", "small.toml"), ">&- 2>&-", 0), (("check", "none.toml"), "2>&-", 2)],
        ids=["study", "check"],
    )
    def test_closed_streams_change_no_exit_code(self, tmp_path, arguments, closed, code):
        (tmp_path / "small.toml").write_text(SMALL)
        line = f"{shlex.join(self.command(*arguments))} {closed}"
        assert subprocess.run(line, shell=True, cwd=tmp_path, check=False).returncode == code
        assert (tmp_path / "archives" / "small.nc").is_file() == (arguments[0] == "study")

    def test_a_model_that_closes_the_output_closes_it_for_itself(self, tmp_path):
        (tmp_path / "slow.py").write_text(
            "import sys\ndef f(x):\n    sys.stdout.close()\n    return {'y': x}"
        )
        (tmp_path / "slow.toml").write_text(SLOW_STUDY.replace("100000", "30"))
        done = self.done(tmp_path, "study", "slow.toml")
        assert done.returncode == 0
        assert b"archive: archives/slow.nc" in done.stdout.splitlines()

    @pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has it")
    def test_a_full_disk_below_the_output_costs_no_archive(self, tmp_path):
        (tmp_path / "small.toml").write_text(SMALL)
        with Path("/dev/full").open("w") as full:
            done = self.done(tmp_path, "study", "small.toml", stdout=full)
        assert done.returncode == 2
        message = b"standard output cannot be written: No space left on device"
        assert done.stderr.splitlines()[-1] == message
        assert (tmp_path / "archives" / "small.nc").is_file()

    def test_a_terminal_without_unicode_gets_question_marks(self, tmp_path, small):
        (tmp_path / "small.nc").write_bytes(small)
        ascii_alone = {"PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
        done = self.done(tmp_path, "show", "small.nc", **ascii_alone)
        assert done.returncode == 0, done.stderr
        assert b"+/-" in done.stdout
        assert b"?" not in done.stdout


def _read(descriptor):
    try:
        return os.read(descriptor, 10_000)
    except OSError:  # the other end is closed
        return b""


@pytest.mark.parametrize(
    "module",
    [
        "raise KeyboardInterrupt\n",
        "class Interrupts:\n    def __set_name__(self, owner, name):\n"
        "        raise KeyboardInterrupt\n\nclass Some:\n    member = Interrupts()\n",
    ],
)
def test_ctrl_c_before_the_program_is_loaded_leaves_with_130(tmp_path, module):
    (tmp_path / "click.py").write_text(module)
    done = subprocess.run(
        [sys.executable, "-m", "uqpen", "study", "some.toml"],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")


def test_a_folder_that_has_been_removed_is_reported(command_line, tmp_path):
    tmp_path.rmdir()
    outcome = command_line("study", "some.toml")
    assert outcome.code == 2
    assert outcome.err == "the current folder does not exist any more\n"


def test_ctrl_c_again_and_again_leaves_with_130_and_no_traceback(tmp_path):
    """Some of them come while workers are ended, and while Python itself ends."""
    (tmp_path / "model.py").write_text(
        "import time\ndef f(x):\n    print('run', flush=True)\n    time.sleep(0.05)\n"
        "    return {'y': x}\n"
    )
    (tmp_path / "study.toml").write_text(
        'seed = 1\n[model]\npython = "model.py:f"\ninputs = { x = "1" }\noutputs = { y = "1" }\n'
        '[inputs]\nx = "0 ± 1"\n[designs.some]\nkind = "monte-carlo"\nruns = 1000\n'
    )
    line = [sys.executable, "-m", "uqpen", "study", "study.toml", "--workers", "2"]
    with subprocess.Popen(
        line, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        # What two workers print at once may stand on one line.
        assert process.stdout.readline().startswith("run")
        while process.poll() is None:
            process.send_signal(signal.SIGINT)
            time.sleep(0.01)
        said = process.stderr.read() if process.stderr is not None else ""
    assert process.returncode == 130
    # A busy machine takes so long to prepare the model that it is reported.
    assert said.removeprefix("preparing model.py:f\n").startswith("interrupted")
    assert "Traceback" not in said


def test_a_misspelt_command_is_reported_with_the_nearest_one(command_line):
    outcome = command_line("stduy", "study.toml")
    assert outcome.code == 2
    assert "Did you mean 'study'?" in outcome.err
    assert "Did you mean" not in command_line("xyz").err


@pytest.mark.parametrize(
    "arguments", ["report .", "report . .", "rerun .", "reweight . small.toml"]
)
def test_a_folder_in_place_of_an_archive_is_named(uqpen, arguments):
    outcome = uqpen(*arguments.split())
    assert outcome.code == 2
    assert outcome.err.endswith(".: is not an archive of uqpen's: it is not a file\n")
