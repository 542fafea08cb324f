"""``uqpen rehearse`` as its user meets it."""

import json
import signal
from pathlib import Path

import pytest
from click.testing import CliRunner
from study_text import study_text

from uqpen.cli.study import study
from uqpen.rehearsal import rehearse

STUDY = study_text(
    "ishigami",
    title="Small [bold]study[/bold]",
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": 1},
    outputs={"y": {"exceeds": [5]}},
    designs={"monte_carlo": {"kind": "monte-carlo", "runs": 100}},
)
SURROGATE = """\
[surrogates.chaos]
kind = "polynomial-chaos"
design = "monte_carlo"
order = 3
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a small study and its archive."""
    folder = tmp_path_factory.mktemp("rehearsed")
    (folder / "small.toml").write_text(STUDY + SURROGATE, encoding="utf-8")
    archive = str(folder / "archives" / "small.nc")
    assert CliRunner().invoke(study, [str(folder / "small.toml"), "-o", archive]).exit_code == 0
    return folder


@pytest.fixture
def uqpen(command_line, folder, monkeypatch):
    """The command line beside that study; few draws are enough of so small a one."""
    whole = rehearse.large_sample
    monkeypatch.setattr(rehearse, "large_sample", lambda study, draws: whole(study, 2**10))
    monkeypatch.chdir(folder)
    return command_line


def test_it_shows_what_holds_on_80_columns(uqpen):
    done = uqpen("rehearse", "small.toml", "--repeats", "10", "--until", '{ y = { mean = "9 %" } }')
    assert done.code == 0
    assert "Small [bold]study[/bold]: rehearsal" in done.out
    assert "repeated 10 times on chaos" in done.out
    assert "failures of the model's runs are not in the surrogate" in done.out
    for words in ("y: intervals that hold [%]", "P(> 5)", "half-widths at 64 runs", "runs that do"):
        assert words in done.out
    assert max(map(len, done.out.splitlines())) <= 80


@pytest.mark.processor
def test_json_does_not_depend_on_workers(uqpen):
    options = ("rehearse", "small.toml", "--repeats", "10", "--json")
    alone = uqpen(*options)
    assert uqpen(*options, "--workers", "2").out == alone.out
    # The archive alone is enough.
    assert uqpen("rehearse", "archives/small.nc", *options[2:]).out == alone.out
    found = json.loads(alone.out)
    (mean,) = found["outputs"]["y"]["mean"]
    coverage = mean["designs"]["monte_carlo"]["coverage"]
    assert coverage["lower"] < coverage["estimate"] <= coverage["upper"]
    assert mean["designs_at_equal_runs"]["monte_carlo"]["runs"] == 64
    assert found["outputs"]["y"]["quantile"][1]["label"] == "0.5"


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (("other.toml",), "archives/other.nc: is not there; to make it: uqpen study other.toml"),
        (("plain.toml", "--archive", "archives/small.nc"), "plain.toml; to make it: uqpen study"),
        (("small.toml", "--surrogate", "chaso"), 'no surrogate "chaso"; did you mean "chaos"?'),
        (("small.toml", "--repeats", "2"), "repeats: found 2; expected a whole number, at least"),
        (("small.toml", "--until", "{ z = 1 }"), "--until: "),
    ],
)
def test_a_mistake_leaves_with_2_before_any_repeat(uqpen, options, complaint):
    Path("other.toml").write_text(STUDY + SURROGATE, encoding="utf-8")
    Path("plain.toml").write_text(STUDY, encoding="utf-8")
    done = uqpen("rehearse", *options)
    assert (done.code, done.out) == (2, "")
    assert complaint in done.err
    assert "Traceback" not in done.err
    assert "repeats of" not in done.err


def test_an_archive_without_a_surrogate_says_where_one_is_declared(uqpen):
    Path("bare.toml").write_text(STUDY, encoding="utf-8")
    assert uqpen("study", "bare.toml").code == 0
    done = uqpen("rehearse", "bare.toml")
    assert done.code == 2
    assert "archives/bare.nc: contains no surrogate to rehearse on; [surrogates]" in done.err


def test_ctrl_c_shows_the_repeats_so_far(uqpen, monkeypatch):
    whole = rehearse.RepeatWork.__call__

    def interrupted(work, batch):
        if batch.start == 3:
            signal.raise_signal(signal.SIGINT)
        return whole(work, batch)

    monkeypatch.setattr(rehearse.RepeatWork, "__call__", interrupted)
    done = uqpen("rehearse", "small.toml", "--repeats", "10")
    assert done.code == 130
    assert "repeated 3 times on chaos" in done.out
    assert "interrupted: this is the result of 3 of 10 repeats" in done.err
