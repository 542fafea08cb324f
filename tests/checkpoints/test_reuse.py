"""Runs that earlier studies have made, and that no study makes again."""

import math
from pathlib import Path

import numpy as np
import pytest
from hashed_trees import with_hashes
from hypothesis import given
from hypothesis import strategies as st
from study_text import TWO_INPUTS as STUDY

import uqpen
from uqpen.archive.netcdf import write_tree
from uqpen.archive.read import open_archive
from uqpen.archive.write import write
from uqpen.checkpoints.folder import keep_runs
from uqpen.checkpoints.journal import are_costly, run_seconds, seconds_at_last_pace
from uqpen.checkpoints.sources import BatchIndex, PointIndex
from uqpen.core.errors import ArchiveError, CheckpointError
from uqpen.core.labels import REUSED_RUNS
from uqpen.core.status import Status
from uqpen.execution import Evaluator, Progress
from uqpen.verification.check_result import CheckOutcome

pytestmark = pytest.mark.slow

MODEL = """\
import pathlib
def simulate(x, y):
    with pathlib.Path(__file__).with_name("calls").open("a") as stream:
        stream.write(f"{getattr(x, 'size', 1)}\\n")
    return {"z": 1 / (x > -1) * x * y}
"""
VECTORIZED = STUDY.replace("[inputs]", "vectorized = true\n[inputs]", 1)


class Recorded(Progress):
    """What a user is shown of earlier runs."""

    def __init__(self, calls=None):
        self.calls = calls
        self.reused = []
        self.texts = []
        self.warnings = []

    def announce_designs(self, runs):
        if self.calls:  # those before were made for comparison
            self.calls.write_text("")

    def count_reused(self, runs, place):
        self.reused.append((runs, Path(place).name))

    def inform(self, text):
        self.texts.append(text)

    def warn(self, text):
        self.warnings.append(text)


class Studies:
    """Studies in a folder, whose model writes down its calls."""

    def __init__(self, folder):
        self.folder = folder
        self.reported = Recorded()
        (folder / "model.py").write_text(MODEL)

    def make(self, text, name="study.nc", **options):
        """The sizes of the calls that the archive of a study takes, beside those for comparison."""
        calls = self.folder / "calls"
        calls.write_text("")
        self.reported = Recorded(calls)
        (self.folder / "study.toml").write_text(text)
        study = uqpen.load_study(self.folder / "study.toml")
        uqpen.make_archive(study, self.folder / name, progress=self.reported, **options)
        if "nothing has changed" in "".join(self.reported.texts):
            return []
        return [int(size) for size in calls.read_text().split()]

    def is_as_afresh(self, text):
        """Whether the archive has the bytes of one whose runs are all made."""
        self.make(text, "afresh.nc", fresh=True)
        return self.bytes() == self.bytes("afresh.nc")

    def bytes(self, name="study.nc"):
        return (self.folder / name).read_bytes()


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """The archive of the study."""
    studies = Studies(tmp_path_factory.mktemp("first"))
    assert len(studies.make(STUDY)) == 30
    return studies.bytes()


@pytest.fixture
def empty(tmp_path):
    return Studies(tmp_path)


@pytest.fixture
def studies(empty, archive):
    """A folder with the archive of the study."""
    (empty.folder / "study.nc").write_bytes(archive)
    return empty


def test_only_runs_that_are_new_are_made(studies):
    asked = STUDY.replace("[designs.one]", "[outputs.z]\nquantiles = [0.2]\n[designs.one]")
    assert studies.make(asked) == []
    assert studies.reported.reused == [(30, "study.nc")]
    more = asked.replace("runs = 30", "runs = 50")
    assert len(studies.make(more)) == 20
    assert studies.is_as_afresh(more)
    assert "one: 30 runs were taken from " in (studies.folder / "study.nc.log").read_text()


def test_nothing_is_made_where_nothing_has_changed(studies, monkeypatch):
    monkeypatch.setattr("uqpen.checkpoints.recheck._AT_MOST", 1e9)  # all, on any machine
    before = (studies.folder / "study.nc").stat().st_mtime_ns
    assert studies.make(STUDY) == []
    assert (studies.folder / "study.nc").stat().st_mtime_ns == before
    compared, unchanged = studies.reported.texts
    assert compared.endswith("study.nc: model.py is the same; 25 of 30 runs made again are equal")
    assert unchanged.endswith("study.nc: nothing has changed, so it stays as it is")
    assert len(studies.make(STUDY, fresh=True)) == 30


def test_runs_come_from_any_number_of_archives(empty):
    names = ("one", "two", "three")
    for name in names:
        empty.make(STUDY.replace("designs.one", f"designs.{name}"), f"{name}.nc")
    design = STUDY[STUDY.index("[designs.one]") :]
    text = STUDY + "".join(design.replace("one", name) for name in names[1:])
    others = [empty.folder / f"{name}.nc" for name in names]
    assert empty.make(text, reuse=others) == []
    assert empty.reported.reused == [(30, f"{name}.nc") for name in names]
    assert empty.is_as_afresh(text)


def test_runs_of_another_version_of_the_model_are_not_taken(studies):
    (studies.folder / "model.py").write_text(MODEL.replace("x * y", "y * x"))
    with pytest.raises(CheckpointError, match=r"another model:\n  file model\.py has changed\n"):
        studies.make(STUDY, "new.nc", reuse=[studies.folder / "study.nc"])
    assert len(studies.make(STUDY)) == 30
    assert "none of its runs is taken" in studies.reported.texts[0]
    assert studies.reported.texts[0].endswith("another model:\n  file model.py has changed")


def kept_archives(studies):
    """The archives that were kept under another name."""
    return [path.read_bytes() for path in sorted(studies.folder.glob("study.*.nc"))]


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("runs = 30", "runs = 29"),
        ("seed = 11", "seed = 12"),
        ("[designs.one]", "[designs.one]\nkeep = 'statistics'"),
        ("[inputs]", '[constraints]\nkeep = ["x < 1"]\n[inputs]'),
        ('x = "0 ± 1"', 'x = "1"'),
    ],
)
def test_an_archive_is_kept_whose_runs_the_new_one_lacks(studies, before, after):
    earlier = studies.bytes()
    studies.make(STUDY.replace(before, after))
    assert kept_archives(studies) == [earlier]
    assert ": the earlier archive is kept as study." in studies.reported.texts[-1]
    [kept] = studies.folder.glob("study.*.nc")
    assert studies.make(STUDY, "back.nc", reuse=[kept]) == []
    assert studies.bytes("back.nc") == earlier


def test_an_archive_is_kept_whose_model_has_changed(studies):
    earlier = studies.bytes()
    (studies.folder / "model.py").write_text(MODEL.replace("x * y", "y * x"))
    studies.make(STUDY)
    assert kept_archives(studies) == [earlier]
    (studies.folder / "model.py").write_text(MODEL)
    for text in (STUDY, STUDY.replace("seed = 11", "seed = 12")):
        (studies.folder / "study.nc.log").unlink()  # so the costs are not known
        studies.make(text)
    assert kept_archives(studies).count(earlier) == 1
    assert len(kept_archives(studies)) == 2


def test_an_archive_of_statistics_is_kept_whose_points_have_changed(empty):
    text = STUDY.replace("[designs.one]", "[designs.one]\nkeep = 'statistics'")
    text = text.replace('x = "0 ± 1"', 'x = { measured = { file = "x.csv", column = "x" } }')
    asked = text.replace("[designs.one]", "[outputs.z]\nquantiles = [0.2]\n[designs.one]")
    (empty.folder / "x.csv").write_text("x\n" + "\n".join(map(str, range(40))))
    empty.make(text)
    (empty.folder / "study.nc.log").unlink()  # so the costs are not known
    empty.make(asked)
    assert kept_archives(empty) == []
    earlier = empty.bytes()
    (empty.folder / "x.csv").write_text("x\n" + "\n".join(map(str, range(1, 41))))
    (empty.folder / "study.nc.log").unlink()
    empty.make(asked)
    assert kept_archives(empty) == [earlier]


def test_an_archive_that_was_edited_is_kept(studies):
    tree = open_archive(studies.folder / "study.nc")
    tree["runs/one"]["z"].values[0] = 0.5
    write_tree(tree, studies.folder / "study.nc")
    edited = studies.bytes()
    studies.make(STUDY)
    assert kept_archives(studies) == [edited]


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (STUDY.replace("runs = 30", "runs = 40"), {}),
        (STUDY.replace("[designs.one]", "[outputs.z]\nquantiles = [0.2]\n[designs.one]"), {}),
        (STUDY, {"lost_again": True}),
        (STUDY.replace("seed = 11", "seed = 12"), {"fresh": True}),
    ],
)
def test_no_archive_is_kept_where_nothing_is_lost_or_it_is_asked(studies, text, options):
    studies.make(text, **options)
    assert kept_archives(studies) == []


def test_an_archive_is_kept_without_links(studies, monkeypatch):
    def refuse(*_):
        raise OSError

    monkeypatch.setattr(Path, "hardlink_to", refuse)
    earlier = studies.bytes()
    studies.make(STUDY.replace("seed = 11", "seed = 12"))
    assert kept_archives(studies) == [earlier]


SHORT, WRITTEN = "one: 30 runs in 40.000 s, 2 of them failed", "study.nc: is written"
LONG = "two: 9 runs in 61.000 s, 0 of them failed"

LOG_LINES = {
    f"{SHORT}|{WRITTEN}": False,
    f"{LONG}|{WRITTEN}": True,
    f"{SHORT}|{SHORT}|{WRITTEN}": True,
    f"{SHORT}|{WRITTEN}|{SHORT}|{WRITTEN}": False,
    f"{LONG}|{WRITTEN}|{SHORT}|{WRITTEN}": False,
    f"{LONG}|{WRITTEN}|one: 9 runs were taken from folder/study.nc|{SHORT}|{WRITTEN}": True,
    f"{SHORT}|{WRITTEN}|one: 9 runs were taken from study.nc|{SHORT}|{WRITTEN}": True,
    f"one: 9 runs were taken from other.nc|{SHORT}|{WRITTEN}": True,
    f"one: 9 runs were taken from other.nc|{SHORT}|{WRITTEN}|{SHORT}|{WRITTEN}": False,
    f"one: 29 runs were made before|{SHORT}|{WRITTEN}": True,
    f"{SHORT}|{WRITTEN}|{SHORT}": True,
    SHORT: True,
    "nothing of any run": True,
    f"{SHORT}|{WRITTEN}|{LONG}|ended early: KeyboardInterrupt": False,
}


@pytest.mark.parametrize(("lines", "expected"), LOG_LINES.items(), ids=str)
def test_the_log_says_whether_runs_were_costly(tmp_path, lines, expected):
    log = tmp_path / "study.nc.log"
    assert are_costly(log, "study.nc")
    log.write_text("".join(f"2026-11-23T12:00:00.000+00:00 {each}\n" for each in lines.split("|")))
    assert are_costly(log, "study.nc") == expected


def test_the_log_says_how_long_the_first_runs_of_a_model_took(tmp_path):
    log = tmp_path / "study.nc.log"
    assert run_seconds(log, "") is seconds_at_last_pace(log, 10) is None
    lines = [
        "one: the first runs of fine took 7200.000 s",
        "one: the first runs took 3.000 s",
        "one: 30 runs in 60.000 s, 2 of them failed",
        "two: the first runs of fine took 2.500 s",
        "two: 10 runs in 5.000 s, 0 of them failed",
        "three: 0 runs in 0.100 s, 0 of them failed",
    ]
    log.write_text("".join(f"2026-11-23T12:00:00.000+00:00 {each}\n" for each in lines))
    assert [run_seconds(log, name) for name in ("fine", "", "coarse")] == [2.5, 3.0, None]
    assert seconds_at_last_pace(log, 10) == 5.0
    assert seconds_at_last_pace(log, 10, "one") == 20.0
    assert seconds_at_last_pace(log, 10, "three") is None


def test_an_archive_whose_runs_are_made_again_at_once_is_not_kept(empty):
    empty.make(STUDY)
    empty.make(STUDY.replace("seed = 11", "seed = 12"))
    assert kept_archives(empty) == []


def test_what_runs_have_imported_is_compared_too(empty):
    (empty.folder / "late.py").write_text("factor = 1\n")
    imported = MODEL.replace("x * y", "x * y * __import__('late').factor")
    (empty.folder / "model.py").write_text(imported)
    empty.make(STUDY)
    more = STUDY.replace("runs = 30", "runs = 40")
    assert len(empty.make(more)) == 10
    assert empty.is_as_afresh(more)
    assert empty.make(more) == []
    (empty.folder / "late.py").write_text("factor = 2\n")
    assert len(empty.make(more)) == 40
    assert empty.reported.texts[0].endswith("file late.py has changed")


def test_failed_runs_are_taken_and_lost_ones_made_again_if_asked(studies):
    tree = open_archive(studies.folder / "study.nc")
    failed = int((tree["runs/one"]["status"] > 0).sum())
    assert 0 < failed < 30
    assert studies.make(STUDY, "other.nc", reuse=[studies.folder / "study.nc"]) == []
    assert studies.bytes("other.nc") == studies.bytes()
    assert len(studies.make(STUDY, lost_again=True)) == failed
    assert studies.bytes("other.nc") == studies.bytes()


def test_whole_batches_of_a_vectorised_function_are_taken(empty):
    text = VECTORIZED.replace("runs = 30", "runs = 2_500")
    (empty.folder / "model.py").write_text(MODEL.replace("1 / (x > -1) * ", ""))
    assert empty.make(text) == [1024, 1024, 452]
    assert empty.make(text + "[outputs.z]\nquantiles = [0.2]") == []
    assert empty.make(text.replace("2_500", "3_000")) == [952]
    assert empty.is_as_afresh(text.replace("2_500", "3_000"))


def test_another_model_runs_at_the_points_of_the_first(empty):
    start, end = STUDY.index("python"), STUDY.index("[inputs]")
    model = STUDY[start:end]
    given = model + 'with = { y = "2 m" }\n'
    both = f"[models.a]\n{model}[models.b]\n{given}"
    text = STUDY.replace(f"[model]\n{model}", both).replace('"(0 ± 1) m"', '"1 m"')
    assert len(empty.make(text)) == 60, "y has another value in each"
    assert len(empty.make(text.replace('"2 m"', '"3 m"'))) == 30
    assert empty.reported.reused == [(30, "study.nc")]
    assert empty.is_as_afresh(text.replace('"2 m"', '"3 m"'))


def test_a_new_constraint_excludes_points_and_repeats_no_run(studies):
    text = STUDY.replace("[inputs]", '[constraints]\nkeep = ["x < 1"]\n[inputs]')
    assert studies.make(text) == []
    assert studies.is_as_afresh(text)
    assert studies.make(STUDY, "back.nc", reuse=[studies.folder / "study.nc"]) != []


def test_a_rule_that_stops_takes_the_runs_that_it_learns_from(empty):
    (empty.folder / "model.py").write_text(MODEL.replace("1 / (x > -1) * ", ""))
    text = STUDY.replace("runs = 30", 'until = { z = { mean = "0.08 m" } }\nat_most = 4096')
    assert len(empty.make(text)) > 512
    assert empty.make("title = 'Again'\n" + text) == []


def test_an_archive_says_what_runs_of_other_versions_were_made_with(studies):
    old = open_archive(studies.folder / "study.nc")
    old.attrs["version_numpy"] = "0.1"
    write(old, studies.folder / "old.nc")
    assert studies.make(STUDY, "new.nc", reuse=[studies.folder / "old.nc"]) == []
    new = open_archive(studies.folder / "new.nc")
    assert new.attrs[REUSED_RUNS] == "one: runs made with numpy 0.1"
    assert new["statistics"].identical(old["statistics"])
    for result in uqpen.verify(studies.folder / "new.nc", trust=True):
        assert result.verdict in {CheckOutcome.EQUAL, CheckOutcome.CLOSE}
    assert studies.make(STUDY, "later.nc", reuse=[studies.folder / "new.nc"]) == []
    later = open_archive(studies.folder / "later.nc")
    assert later.attrs[REUSED_RUNS] == new.attrs[REUSED_RUNS]


def test_runs_that_timed_out_are_named_and_made_again_with_another_limit(studies):
    slow = open_archive(studies.folder / "study.nc")
    lost = slow["runs/one"]["status"].values > Status.INADMISSIBLE
    slow["runs/one"]["status"].values[lost] = Status.TIMED_OUT
    write(slow, studies.folder / "slow.nc")
    options = {"reuse": [studies.folder / "slow.nc"]}
    assert studies.make(STUDY, "new.nc", **options) == []
    expected = "one: runs that timed out or crashed in an earlier study"
    assert open_archive(studies.folder / "new.nc").attrs[REUSED_RUNS] == expected
    limited = STUDY.replace("[inputs]", 'time_limit = "100 s"\n[inputs]')
    assert len(studies.make(limited, "limited.nc", **options)) == int(lost.sum())
    assert REUSED_RUNS not in open_archive(studies.folder / "limited.nc").attrs


def test_an_archive_that_was_edited_is_refused(studies):
    tree = open_archive(studies.folder / "study.nc")
    tree["runs/one"]["z"].values[0] = 0.5
    edited = studies.folder / "edited.nc"
    write_tree(tree, edited)
    with pytest.raises(ArchiveError, match="been changed since it was written"):
        studies.make(STUDY, "new.nc", reuse=[edited])
    nested = studies.folder / "nested.nc"
    tree.attrs["study_text"] = "a = " + "[" * 100_000
    write_tree(with_hashes(tree), nested)
    with pytest.raises(ArchiveError, match="is damaged"):
        studies.make(STUDY, "new.nc", reuse=[nested])
    edited.write_text("no archive")
    with pytest.raises(ArchiveError, match="is not an archive"):
        studies.make(STUDY, "new.nc", reuse=[edited])


def test_runs_may_be_raised_in_an_interrupted_study(empty, monkeypatch):
    monkeypatch.setattr("uqpen.execution.evaluation.WORTH_SENDING", 0.0)
    for runs in (30, 40):
        with pytest.raises(KeyboardInterrupt):
            _make_until(empty, STUDY.replace("runs = 30", f"runs = {runs}"), stop=runs - 10)
    more = STUDY.replace("runs = 30", "runs = 50")
    assert len(empty.make(more)) == 20
    assert empty.reported.reused == [(20, "those kept before"), (10, "those kept before")]
    assert empty.is_as_afresh(more)
    assert not (empty.folder / "study.nc.parts").exists()


def _make_until(studies, text, stop):
    class Stopped(Recorded):
        done = 0

        def count_reused(self, runs, place):
            self.done += runs

        def advance(self, runs, failed, in_progress):
            self.done += runs
            if self.done >= stop:
                raise KeyboardInterrupt

    (studies.folder / "study.toml").write_text(text)
    study = uqpen.load_study(studies.folder / "study.toml")
    uqpen.make_archive(study, studies.folder / "study.nc", progress=Stopped())


def test_a_changed_design_without_a_point_in_common_is_reported(empty):
    cubes = STUDY.replace("monte-carlo", "latin-hypercube")
    changed = cubes.replace("runs = 30", "runs = 40")
    empty.make(cubes)
    assert len(empty.make(changed, "other.nc", reuse=[empty.folder / "study.nc"])) == 40
    expected = "one: none of its 30 earlier runs is at a point of the changed design"
    assert empty.reported.texts == [expected]
    # Of the archive that is replaced, also the settings that would keep them are known.
    assert len(empty.make(changed)) == 40
    expected = "one: 30 of its 30 earlier runs are not used; to use all of them: runs = 39"
    [reported] = empty.reported.texts
    assert reported.startswith(expected)


def test_runs_that_a_smaller_design_leaves_out_are_not_removed(empty):
    with pytest.raises(KeyboardInterrupt):
        _make_until(empty, STUDY, stop=25)
    assert empty.make(STUDY.replace("runs = 30", "runs = 10")) == []
    assert "still holds runs of one, which this study does not have" in empty.reported.warnings[0]
    assert len(empty.make(STUDY, fresh=True)) == 30


def test_a_run_that_was_made_outside_a_study_is_taken(empty):
    text = STUDY.replace('"monte-carlo"\nruns = 30', '"one-at-a-time"')
    (empty.folder / "study.toml").write_text(text)
    study = uqpen.load_study(empty.folder / "study.toml")
    nominal = {name: np.array([value]) for name, value in study.joint.nominal().items()}
    results = Evaluator(study.model)(nominal)
    keep_runs(study, empty.folder / "study.nc", nominal, results)
    expected = len(empty.make(text, "other.nc", fresh=True))
    assert len(empty.make(text)) == expected - 1
    assert not (empty.folder / "study.nc.parts").exists()


def test_the_run_of_a_check_is_taken_where_a_design_has_its_point(empty, command_line):
    calls, parts = empty.folder / "calls", empty.folder / "archives" / "study.nc.parts"
    (empty.folder / "study.toml").write_text(STUDY)
    assert "kept for" not in command_line("check", "--try", "study.toml").out
    assert not parts.exists()
    (empty.folder / "study.toml").write_text(
        STUDY.replace('"monte-carlo"\nruns = 30', '"one-at-a-time"')
    )
    shown = command_line("check", "--try", "study.toml").out
    assert f"kept for {Path('archives', 'study.nc')}, as a design has this point" in shown
    calls.write_text("")
    assert "one: 1 of " in command_line("study", "study.toml").err
    made = len(calls.read_text().split())
    calls.write_text("")
    command_line("study", "study.toml", "--fresh")
    assert len(calls.read_text().split()) == made, "but one was made for comparison"
    assert not parts.exists()


def test_the_command_tells_what_it_takes(empty, command_line):
    (empty.folder / "study.toml").write_text(STUDY)
    command_line("study", "study.toml", "-o", "a.nc")
    outcome = command_line("study", "study.toml", "-o", "b.nc", "--reuse", "a.nc")
    assert "one: 30 of 30 runs from a.nc\n" in outcome.err
    outcome = command_line("study", "study.toml", "-o", "b.nc")
    assert "b.nc: nothing has changed, so it stays as it is\n" in outcome.err
    # Also where nothing would be taken from it.
    outcome = command_line("study", "study.toml", "-o", "b.nc", "--reuse", "absent.nc")
    assert outcome.code == 2
    assert "absent.nc: there is no such file" in outcome.err


bits = st.sampled_from([0.0, -0.0, 1.0, math.nextafter(1.0, 2.0), 5e-324])
points = st.lists(st.tuples(bits, bits), min_size=1, max_size=12)


@given(points, points)
def test_points_are_found_by_their_bits(known, wanted):
    def columns(rows):
        return dict(zip("xy", np.array(rows, dtype=float).T, strict=True))

    texts = [str(row) for row in known]
    expected = [texts.index(str(row)) if str(row) in texts else -1 for row in wanted]
    found = PointIndex(columns(known)).find(columns(wanted), 0, len(wanted))
    assert found.tolist() == expected
    whole = BatchIndex(columns(known), [np.arange(len(known))], 12).find(
        columns(wanted), 0, len(wanted)
    )
    is_same = texts == [str(row) for row in wanted]
    assert whole.tolist() == (list(range(len(known))) if is_same else [-1] * len(wanted))


def test_models_of_files_with_one_name_outside_of_the_folder_are_unchanged(tmp_path):
    for place, factor in (("one", 1), ("two", 2)):
        (tmp_path / place).mkdir()
        (tmp_path / place / "m.py").write_text(f"def f(x):\n    return {{'y': {factor} * x}}\n")
    tables = [
        f"[models.{place}]\npython = '{tmp_path / place}/m.py:f'\n"
        "inputs = { x = '1' }\noutputs = { y = '1' }\n"
        for place in ("one", "two")
    ]
    design = "[inputs]\nx = '1 ± 0.1'\n[designs.plain]\nkind = 'monte-carlo'\nruns = 20\n"
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / "study.toml").write_text("".join(["title = 'T'\nseed = 1\n", *tables, design]))
    study = uqpen.load_study(folder / "study.toml")
    uqpen.make_archive(study, folder / "a.nc")
    recorded = Recorded()
    uqpen.make_archive(study, folder / "a.nc", progress=recorded)
    assert recorded.texts[-1:] == [f"{folder / 'a.nc'}: nothing has changed, so it stays as it is"]
