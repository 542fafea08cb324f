"""The first runs of a study: a trial run, and an end where all of them fail alike."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from study_text import ONE_INPUT as STUDY
from study_text import study_text

import uqpen
from uqpen.core.errors import FirstRunsFailedError
from uqpen.core.model import Results
from uqpen.core.progress import Progress
from uqpen.core.status import Status
from uqpen.execution.batch import BatchResult
from uqpen.execution.failures import FailurePolicy
from uqpen.execution.first_runs import FirstRuns
from uqpen.execution.processes import processes
from uqpen.models.known_functions import Ishigami

ALL_FAIL = "def simulate(x):\n    raise ValueError(f'no convergence at {x}')\n"
HALF_FAIL = "def simulate(x):\n    if x < 0:\n        raise ValueError('negative')\n    return x\n"

# Outcomes of a run: most fail alike.
OUTCOMES = st.sampled_from(
    [
        *[(Status.FAILED, f"stuck after {steps} steps") for steps in (7, 12, 90)],
        (Status.INADMISSIBLE, "x > 0"),
        (Status.FAILED, "no licence"),
        (Status.CRASHED, "stuck after 7 steps"),
        (Status.OK, ""),
    ]
)


def study_of(folder, model, text=""):
    (folder / "model.py").write_text(model)
    return uqpen.parse_study(STUDY + text, folder=folder)


def batch_result(start, outcomes):
    status = np.array([status for status, _ in outcomes], dtype=np.int8)
    reasons = {run: reason for run, (_, reason) in enumerate(outcomes) if reason}
    return BatchResult(start, Results({}, status, reasons))


def is_stopped(outcomes, order):
    """Whether a study of these runs stops at 3 alike, which complete by stretches in an order."""
    first = FirstRuns(Ishigami(), FailurePolicy(stop_after=3))
    first.start_round(len(outcomes) + 1)
    try:
        for start, stop in order:
            inputs = {"x1": np.arange(float(start), float(stop))}
            first.add(inputs, batch_result(start, outcomes[start:stop]))
    except FirstRunsFailedError:
        return True
    return False


@given(data=st.data(), outcomes=st.lists(OUTCOMES, min_size=1, max_size=12))
def test_whether_a_study_stops_depends_on_its_runs_in_order_alone(data, outcomes):
    cuts = sorted(data.draw(st.sets(st.integers(1, len(outcomes)), max_size=5)) | {len(outcomes)})
    stretches = list(zip([0, *cuts], cuts, strict=False))
    made = [each for each in outcomes if each[0] is not Status.INADMISSIBLE]
    alike = len(made) >= 3 and all(
        status is Status.FAILED and reason.startswith("stuck") for status, reason in made[:3]
    )
    same = len(made) >= 3 and len(set(made[:3])) == 1 and made[0][0] is not Status.OK
    assert is_stopped(outcomes, data.draw(st.permutations(stretches))) == (alike or same)


class Recorder(Progress):
    """What is reported of a trial run, and the warnings."""

    def __init__(self):
        self.reported = []

    def report_trial(self, text):
        self.reported.append(text)


class RecordedMap:
    """A map that records the first runs and the numbers of runs of its batches, call by call."""

    def __init__(self):
        self.calls = []

    def __call__(self, work, batches):
        self.calls.append([])
        for batch in batches:
            self.calls[-1].append((batch.start, len(batch)))
            yield work(batch)


def test_the_first_run_of_a_model_of_ones_own_is_made_alone(tmp_path):
    recorded = RecordedMap()
    uqpen.run(study_of(tmp_path, HALF_FAIL), map=recorded)
    assert recorded.calls[0] == [(0, 1)]
    assert len(recorded.calls) == 2
    at_once = RecordedMap()
    uqpen.run(study_of(tmp_path, HALF_FAIL, "[failures]\ntrial = false\n"), map=at_once)
    assert len(at_once.calls) == 1


def test_inadmissible_runs_are_no_trial(tmp_path):
    recorded, reported = RecordedMap(), Recorder()
    text = '[constraints]\nkeep = ["x < -1"]\n'
    runs = uqpen.run(study_of(tmp_path, HALF_FAIL, text), map=recorded, progress=reported)[
        "runs/some"
    ]
    first = int(np.flatnonzero(runs["x"].values < -1)[0])
    assert [call[0][0] for call in recorded.calls] == list(range(first + 2))
    assert len(reported.reported) == 1


def test_a_built_in_model_needs_no_trial_and_no_more_do_runs_that_are_there():
    recorded = RecordedMap()
    inputs = dict.fromkeys(("x1", "x2", "x3"), (-3, 3))
    design = {"kind": "monte-carlo", "runs": 2000}
    text = study_text("ishigami", inputs=inputs, designs={"some": design})
    uqpen.run(uqpen.parse_study(text), map=recorded)
    first = FirstRuns(Ishigami(), FailurePolicy())
    first.start_round(10, restored=1)
    assert len(recorded.calls[0]) > 1
    assert not first.is_trial_due


@pytest.mark.slow
def test_a_study_stops_after_ten_runs_that_failed_alike_with_any_workers(tmp_path):
    study = study_of(tmp_path, ALL_FAIL)
    with processes(2) as pool, pytest.raises(FirstRunsFailedError) as by_two:
        uqpen.run(study, map=pool)
    reported = Recorder()
    with pytest.raises(FirstRunsFailedError) as alone:
        uqpen.run(study, progress=reported)
    assert str(by_two.value) == str(alone.value)
    assert str(alone.value).startswith("some: the first 10 runs have all failed alike, for example")
    assert reported.reported[0].startswith(
        "the trial run has failed:\n  ValueError: no convergence at "
    )
    runs = uqpen.run(study_of(tmp_path, ALL_FAIL, "[failures]\nstop_after = 0\n"))["runs/some"]
    assert runs.sizes["lost_run"] == 50


def test_a_study_goes_on_where_no_run_is_left_or_first_runs_fail_in_two_ways(tmp_path):
    study = study_of(tmp_path, ALL_FAIL)
    short = uqpen.parse_study(study.text.replace("runs = 50", "runs = 10"), folder=tmp_path)
    assert uqpen.run(short)["runs/some"].sizes["lost_run"] == 10
    fails = "def simulate(x):\n    raise ValueError('negative' if x < 0 else 'positive')\n"
    assert uqpen.run(study_of(tmp_path, fails))["runs/some"].sizes["lost_run"] == 50


def test_the_command_shows_a_failed_trial_at_once_and_logs_it(tmp_path, command_line):
    (tmp_path / "model.py").write_text(ALL_FAIL)
    (tmp_path / "study.toml").write_text(STUDY)
    done = command_line("study", str(tmp_path / "study.toml"), "-o", str(tmp_path / "study.nc"))
    assert done.code == 3
    trial = "some: the trial run has failed:\n  ValueError: no convergence at "
    stopped = "some: the first 10 runs have all failed alike, for example\n  ValueError: no conv"
    assert 0 <= done.err.index(trial) < done.err.index(stopped)
    # Batches that were under way are kept too: how many depends on the time that runs take.
    kept = re.search(r"^(\d+) runs are kept\. After a correction of the model,", done.err, re.M)
    assert kept is not None
    assert int(kept[1]) >= 10
    log = (tmp_path / "study.nc.log").read_text()
    assert "some: the trial run has failed: ValueError: no convergence at " in log
