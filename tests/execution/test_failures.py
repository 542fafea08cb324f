"""What a study does about runs that are lost: again, at most so many, and not for ever."""

import re

import numpy as np
import pytest
from study_text import ONE_INPUT as STUDY

import uqpen
from uqpen.core.errors import StudyError, TooManyFailedError
from uqpen.core.model import Results
from uqpen.core.status import Status
from uqpen.execution import Evaluator
from uqpen.execution.batch import BatchResult
from uqpen.execution.failures import FailureCount
from uqpen.execution.memory_limit import CAN_LIMIT
from uqpen.execution.processes import processes

# Fails at first; the second or third time it is called with the same input it may not.
FLAKY = """\
import pathlib
def simulate(x):
    calls = pathlib.Path(__file__).with_name("calls")
    with calls.open("a") as stream:
        stream.write(f"{x!r}\\n")
    times = calls.read_text().split().count(repr(x))
    if x > 1 and times < 3:
        raise OSError(f"no licence, time {times}")
    if x < -1.5:
        raise ValueError("too small")
    return {"y": x}
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "model.py").write_text(FLAKY)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


def runs_of(folder, text="", **options):
    study = uqpen.parse_study(STUDY + text, folder=folder)
    return uqpen.run(study, **options)["runs/some"]


@pytest.mark.parametrize(("retry", "flaky"), [(0, 5), (1, 5), (2, 0), (5, 0)])
def test_lost_runs_are_made_again_as_often_as_asked(folder, retry, flaky):
    runs = runs_of(folder, f"[failures]\nretry = {retry}\n")
    reasons = runs["lost_reason"].values.tolist()
    hopeless = int((runs["x"].values < -1.5).sum())
    assert (runs["status"].values == Status.FAILED).sum() == flaky + hopeless
    assert (
        reasons.count('ValueError: too small (model.py, line 10: raise ValueError("too small"))')
        == hopeless
        == 2
    )
    # The reason is that of the last time.
    assert sum(f"OSError: no licence, time {retry + 1} (" in reason for reason in reasons) == flaky
    calls = (folder / "calls").read_text().split()
    assert max(calls.count(x) for x in calls) == retry + 1


@pytest.mark.slow
def test_hanging_and_crashing_runs_are_made_again_too(tmp_path):
    (tmp_path / "model.py").write_text("""\
import os, pathlib, time
def simulate(x):
    mark = pathlib.Path(__file__).with_name(f"{x!r}")
    if x < -1.5 and not mark.exists():
        mark.touch()
        time.sleep(60)
    return {"y": x}
""")
    text = STUDY.replace("[model]", '[model]\ntime_limit = "1 s"')
    study = uqpen.parse_study(f"{text}[failures]\nretry = 1\n", folder=tmp_path)
    with processes(2) as pool:
        runs = uqpen.run(study, map=pool)["runs/some"]
    assert len([*tmp_path.glob("*[0-9]")]) == 2, "these took too long at first"
    assert (runs["status"].values == Status.OK).all()


def test_more_losses_than_allowed_end_a_study_that_can_go_on(command_line, tmp_path):
    (tmp_path / "model.py").write_text(FLAKY)
    (tmp_path / "study.toml").write_text(STUDY + '[failures]\nat_most = "5 %"\n')
    outcome = command_line("study", "study.toml")
    assert outcome.code == 3
    reported = outcome.err.splitlines()
    allowed = r"more than the 5 % that \[failures\] at_most allows"
    # How many are made before it is seen is a matter of pace.
    assert re.fullmatch(
        rf"some: (\d) of 50 runs have failed so far \(\1 failed\), {allowed}", reported[-4]
    )
    assert "the most frequent reason, " in outcome.err
    assert reported[-1] == "with --lost-again, it repeats the failed ones"
    assert not (tmp_path / "archives" / "study.nc").exists()
    again = ("study", "study.toml", "--no-recheck")
    assert command_line(*again).code == 3, "as long as nothing changes"
    (tmp_path / "study.toml").write_text(STUDY + '[failures]\nat_most = "40 %"\n')
    outcome = command_line(*again)
    assert outcome.code == 0
    assert "of 50 runs already done" in outcome.err
    assert "some: inputs of failed runs" in command_line("show", "archives/study.nc").out
    assert len((tmp_path / "calls").read_text().split()) <= 50 + 2 * 4


def test_of_several_models_the_one_that_loses_too_many_is_named(command_line, tmp_path):
    source = "def simulate(x): return {'y': x}\ndef broken(x): return {}\n"
    (tmp_path / "model.py").write_text(source)
    declared = STUDY[STUDY.index("[model]") : STUDY.index("[inputs]")]
    good, poor = (declared.replace("[model]", f"[models.{name}]") for name in ("good", "poor"))
    both = good + poor.replace("simulate", "broken")
    text = STUDY.replace(declared, both) + '[failures]\nat_most = "5 %"\n'
    (tmp_path / "study.toml").write_text(text)
    assert "some: by poor, " in command_line("study", "study.toml").err


def test_inadmissible_points_are_no_losses(folder):
    text = STUDY.replace("[designs", '[constraints]\nkeep = ["x < 1", "x > -1.5"]\n[designs')
    text += '[failures]\nat_most = "0 %"\n'
    runs = uqpen.run(uqpen.parse_study(text, folder=folder))["runs/some"]
    assert (runs["status"].values == Status.INADMISSIBLE).sum() == 7


@pytest.mark.slow
@pytest.mark.skipif(not CAN_LIMIT, reason="only Linux keeps a limit on memory")
def test_a_run_that_wants_too_much_memory_costs_itself_only(tmp_path):
    (tmp_path / "model.py").write_text(
        "def simulate(x):\n    return {'y': x + len(bytearray(2_000_000_000 if x > 1.5 else 9))}\n"
    )
    text = STUDY.replace("[model]", '[model]\nmemory_limit = "500 MB"')
    runs = uqpen.run(uqpen.parse_study(text, folder=tmp_path))["runs/some"]
    lost = runs["x"].values > 1.5
    assert lost.any()
    assert ((runs["status"].values == Status.FAILED) == lost).all()
    [reason] = set(runs["lost_reason"].values.tolist())
    assert reason.startswith("MemoryError (model.py, line 2: return {'y': x + len(bytearray(")


@pytest.mark.parametrize(
    ("table", "text", "found", "expected"),
    [
        (
            "failures",
            'at_most = "120 %"',
            '"120 %"',
            'the share of runs that may fail, such as "5 %"',
        ),
        ("failures", 'at_most = "5 m"', '"5 m"', "a plain number"),
        ("failures", "retry = -1", "-1", "a whole number from 0 to 100"),
        ("failures", "retry = 1.5", "1.5", "a whole number from 0 to 100"),
        ("failures", "often = 2", "an unknown key", "retry"),
        ("model", 'time_limit = "10 m"', '"10 m"', "a time"),
        ("model", 'time_limit = "0 s"', '"0 s"', 'a time such as "10 s"'),
        ("model", 'memory_limit = "2"', '"2"', 'a size such as "2 GB"'),
        ("model", 'memory_limit = "1 kB"', '"1 kB"', "at least 1 MB"),
        (
            "model",
            'time_limit = "1 s"\nvectorized = true',
            "a limit of one run",
            "vectorized = false",
        ),
    ],
)
def test_a_mistake_is_reported(folder, table, text, found, expected):
    study = f"{STUDY}[failures]\n".replace(f"[{table}]", f"[{table}]\n{text}")
    with pytest.raises(StudyError) as message:
        uqpen.parse_study(study, folder=folder)
    said = " ".join(str(message.value).split())
    assert f"found {found} expected" in said
    assert expected in said


@pytest.mark.slow
def test_a_limit_is_kept_wherever_a_run_is_made(folder, command_line):
    (folder / "model.py").write_text("import time\ndef simulate(x): time.sleep(60)\n")
    (folder / "study.toml").write_text(STUDY.replace("[model]", '[model]\ntime_limit = "0.3 s"'))
    outcome = command_line("run", "study.toml")
    assert outcome.code == 2
    assert "the run is timed out: took longer than 0.3 s" in outcome.err
    model = uqpen.load_study(folder / "study.toml").model
    results = Evaluator(model)({"x": np.array([1.0, 2.0])})
    assert results.status.tolist() == [Status.TIMED_OUT] * 2


def test_a_share_is_not_exceeded_by_rounding():
    status = np.full(29, Status.FAILED, dtype=np.int8)
    batch_result = BatchResult(
        0, Results({"y": np.full(29, np.nan)}, status, dict.fromkeys(range(29), "no"))
    )
    assert 0.29 * 100 < 29
    assert FailureCount(0.29, 100).add(batch_result) == 29
    with pytest.raises(TooManyFailedError, match="29 of 100 runs have failed so far"):
        FailureCount(0.28, 100).add(batch_result)


def test_a_run_that_comes_twice_is_lost_once():
    status = np.array([Status.FAILED, Status.OK], dtype=np.int8)
    batch_results = [BatchResult(start, Results({}, status, {0: "why"})) for start in (0, 0, 2)]
    losses = FailureCount(0.5, 4)
    assert [losses.add(batch_result) for batch_result in batch_results] == [1, 0, 1]
    assert losses.statuses == {Status.FAILED: 2}


def test_lost_runs_are_made_again_when_their_cause_has_passed(command_line, tmp_path):
    source = "import pathlib\ndef simulate(x):\n    if pathlib.Path(__file__).with_name('down')"
    source += ".exists() and x > 0:\n        raise OSError('no licence')\n    return {'y': x}\n"
    (tmp_path / "model.py").write_text(source)
    (tmp_path / "study.toml").write_text(STUDY + '[failures]\nat_most = "5 %"\n')
    (tmp_path / "down").touch()
    assert command_line("study", "study.toml").code == 3
    (tmp_path / "down").unlink()
    assert command_line("study", "study.toml").code == 3, "they are kept as they were"
    outcome = command_line("study", "study.toml", "--lost-again")
    assert outcome.code == 0
    runs = uqpen.open_archive(tmp_path / "archives" / "study.nc")["runs/some"]
    assert (runs["status"].values == Status.OK).all()
