"""A study of fields is interrupted, killed, and made on two processes: the same archive."""

import numpy as np
import pytest
from study_calls import StudyCalls
from study_text import study_text

import uqpen
from uqpen.checkpoints.stored_runs import FinishedRuns, read_runs, write_runs
from uqpen.core.errors import CheckpointError
from uqpen.core.model import Results
from uqpen.execution.batch import BatchResult

pytestmark = pytest.mark.slow

MODEL = """\
import pathlib
here = pathlib.Path(__file__).parent
def simulate(x):
    with (here / "calls").open("a") as stream:
        stream.write("call\\n")
    if (here / "stop").exists() and len((here / "calls").read_text().split()) == 12:
        raise KeyboardInterrupt
    curve = [x, x + 1, float("nan") if x > 1 else x + 2]
    return {"curve": curve, "sheet": [[x, 0], [1, float("inf") if x < -1 else 2]]}
"""
STUDY = study_text(
    {
        "python": "model.py:simulate",
        "noise": False,  # the calls are counted
        "inputs": {"x": "1"},
        "outputs": {
            "curve": {
                "unit": "cm",
                "along": {"time": {"unit": "s", "values": [0, 1, 4]}},
                "may_end": True,
            },
            "sheet": {"unit": "1", "along": {"a": {"values": [1, 2]}, "b": {"values": [3, 4]}}},
        },
    },
    seed=11,
    inputs={"x": "0 ± 1"},
    designs={"mc": {"kind": "monte-carlo", "runs": 30}},
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr("uqpen.execution.evaluation.WORTH_SENDING", 0.0)
    (tmp_path / "model.py").write_text(MODEL)
    (tmp_path / "study.toml").write_text(STUDY)
    return tmp_path


def make(folder, name="study.nc", workers=1):
    study = uqpen.load_study(folder / "study.toml")
    reported = StudyCalls(folder / "calls")
    uqpen.make_archive(study, folder / name, workers=workers, progress=reported)
    return (folder / name).read_bytes()


def calls(folder):
    return len((folder / "calls").read_text().split())


@pytest.mark.processor
def test_interrupted_or_on_two_processes_it_has_the_same_bytes(folder):
    (folder / "stop").touch()
    with pytest.raises(KeyboardInterrupt, match="11 runs are kept"):
        make(folder)
    (folder / "stop").unlink()
    resumed = make(folder)
    assert calls(folder) == 31, "only the run that was interrupted is made twice"
    assert make(folder, "whole.nc") == resumed
    assert make(folder, "two.nc", workers=2) == resumed
    status = uqpen.open_archive(folder / "study.nc")["runs/mc"]["status"].values
    assert 0 < (status == 3).sum() < 30


def test_large_parts_are_written_as_they_come(folder, monkeypatch):
    bytes_of_a_run = 8 * (3 + 4)
    monkeypatch.setattr("uqpen.checkpoints.stored_runs._MOST_BYTES", 5 * bytes_of_a_run)
    (folder / "stop").touch()
    with pytest.raises(KeyboardInterrupt, match="11 runs are kept"):
        make(folder)
    parts = sorted((folder / "study.nc.parts").rglob("*.npz"))
    assert [len(read_runs(part).runs) for part in parts] == [5, 5, 1]
    (folder / "stop").unlink()
    assert make(folder) == make(folder, "whole.nc")


def test_runs_of_other_coordinates_are_refused(folder):
    (folder / "stop").touch()
    with pytest.raises(KeyboardInterrupt):
        make(folder)
    (folder / "study.toml").write_text(STUDY.replace("[0, 1, 4]", "[0, 1, 5]"))
    with pytest.raises(CheckpointError, match="time"):
        make(folder)


def test_a_file_of_runs_keeps_fields_to_the_bit(tmp_path):
    outputs = {"y": np.array([1.0, -0.0]), "v": np.array([[1.0, np.nan], [np.inf, -0.0]])}
    results = Results(outputs, np.zeros(2, dtype=np.int8))
    runs = FinishedRuns.from_batch_results([({"x": np.arange(2.0)}, BatchResult(1, results))])
    write_runs(tmp_path / "runs.npz", runs)
    again = read_runs(tmp_path / "runs.npz").results
    for name, values in outputs.items():
        assert again.outputs[name].shape == values.shape
        assert again.outputs[name].tobytes() == values.tobytes()
