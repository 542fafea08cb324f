"""A derived output costs no run, however often a study is made again."""

import pytest
from study_calls import StudyCalls
from study_text import study_text

import uqpen

pytestmark = pytest.mark.slow

MODEL = """\
import pathlib
here = pathlib.Path(__file__).parent

def simulate(x):
    with (here / "calls").open("a") as stream:
        stream.write("call\\n")
    if (here / "stop").exists() and len((here / "calls").read_text().split()) == 12:
        raise KeyboardInterrupt
    return {"curve": [x, 2 * x, 0.0]}
"""
STUDY = study_text(
    {
        "python": "model.py:simulate",
        "noise": False,  # the calls are counted
        "inputs": {"x": "1"},
        "outputs": {"curve": {"unit": "1", "along": {"time": {"unit": "s", "values": [0, 1, 4]}}}},
    },
    seed=11,
    inputs={"x": ("0", "1")},
    designs={"mc": {"kind": "monte-carlo", "runs": 30}},
)
PEAK = '[outputs.peak]\nof = "curve"\ntake = "max"\n'
CROSSING = '[outputs.crossing]\nof = "curve"\ntake = "first_above"\nthreshold = 1\n'


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr("uqpen.execution.evaluation.WORTH_SENDING", 0.0)
    (tmp_path / "model.py").write_text(MODEL)
    return tmp_path


def calls(folder, text, name="study.nc", *, fresh=False):
    """Return the number of runs that the archive of a study takes."""
    (folder / "calls").write_text("")
    (folder / "study.toml").write_text(text)
    study, reported = uqpen.load_study(folder / "study.toml"), StudyCalls(folder / "calls")
    uqpen.make_archive(study, folder / name, fresh=fresh, progress=reported)
    return len((folder / "calls").read_text().split())


def test_a_new_or_another_one_takes_the_runs_of_the_archive(folder):
    assert calls(folder, STUDY) == 30
    assert calls(folder, STUDY + PEAK) == 0
    text = STUDY + PEAK.replace("max", "min") + CROSSING
    assert calls(folder, text) == 0
    assert calls(folder, text, "afresh.nc", fresh=True) == 30
    assert (folder / "afresh.nc").read_bytes() == (folder / "study.nc").read_bytes()


def test_a_model_that_was_looked_at_is_not_again(folder):
    text = STUDY.replace("noise = false\n", "")
    assert calls(folder, text) == 30 + 3  # one run in 20, and the trial
    assert calls(folder, text + PEAK) == 0
    assert calls(folder, text + PEAK, "afresh.nc", fresh=True) == 30 + 3
    assert (folder / "afresh.nc").read_bytes() == (folder / "study.nc").read_bytes()


def test_one_that_is_new_after_an_interruption(folder):
    (folder / "stop").touch()
    with pytest.raises(KeyboardInterrupt):
        calls(folder, STUDY)
    (folder / "stop").unlink()
    assert calls(folder, STUDY + PEAK) == 30 - 11
    tree = uqpen.open_archive(folder / "study.nc")
    assert tree["runs/mc/peak"].values == pytest.approx(2 * tree["runs/mc/x"].values)


def test_the_archive_verifies_and_repeats_itself(folder):
    calls(folder, STUDY + PEAK + CROSSING)
    verified = uqpen.verify(folder / "study.nc", trust=True)
    verdicts = {check.name: str(check.verdict) for check in verified}
    assert verdicts["runs"] == verdicts["statistics"] == "equal"
