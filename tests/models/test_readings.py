"""Where a number stands in what a program has written, and how placeholders give it numbers."""

import contextlib
import signal
import sys
import warnings

import pytest
from hypothesis import given
from hypothesis import strategies as st

import uqpen
from uqpen.core.errors import StudyError
from uqpen.core.limits import Limits
from uqpen.core.model import RunWarning
from uqpen.core.status import Status
from uqpen.models.command.output_readers import ColumnReader, RunFiles, TextReader, UnreadableError
from uqpen.models.command.program import Delimiters, NotWholeError, fill, find_mistakes

LOG = "step 1: s = 4\nstep 2: s = 9\nstep 3: s = 2.0D+00\nresult\nmax s = 8\n"
TABLE = "# time  force\n0 1.5\n\n1 2.5\n# a comment\n2 3.5\nforces at the end\n 7 8 9\n 4 5 6\n"
ANGLES = Delimiters("<<", ">>")


def number(folder, reader, content):
    """What is read from a file with some content, or why nothing is."""
    (folder / reader.file).write_text(content)
    try:
        return reader.value(RunFiles(folder))
    except UnreadableError as error:
        return str(error)


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({"match": "first"}, 4.0),
        ({"match": "last"}, 8.0),
        ({"match": "min"}, 2.0),
        ({"match": "max"}, 9.0),
        ({"after": "result"}, 8.0),
        ({"after": "step", "match": "first"}, 2.0),
        ({"after": "resultat"}, 'out does not contain "resultat"'),
    ],
)
def test_a_reading_says_which_match_counts(tmp_path, keys, expected):
    reader = TextReader("out", r"s = (\S+)", **keys)  # type: ignore[arg-type]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert number(tmp_path, reader, LOG) == expected


def test_several_matches_are_counted_where_nothing_says_which(tmp_path):
    with pytest.warns(RunWarning, match="several matches .* the last is taken") as reported:
        assert number(tmp_path, TextReader("out", r"s = (\S+)"), LOG) == 8.0
    (warning,) = (each.message for each in reported)
    assert isinstance(warning, RunWarning)
    assert warning.of_one_run.startswith("4 matches for ")


@pytest.fixture
def endless(tmp_path):
    """Read a file with a pattern that does not match it, in any of 2^60 ways."""
    (tmp_path / "out").write_text("a" * 60 + "b")
    signals = (signal.SIGINT, signal.SIGVTALRM, signal.SIGPROF)
    handlers = [signal.getsignal(each) for each in signals]
    yield lambda limits: TextReader("out", "(a+)+$").value(RunFiles(tmp_path, limits))
    assert [signal.getsignal(each) for each in signals] == handlers
    assert signal.getitimer(signal.ITIMER_VIRTUAL) == (0, 0)


@pytest.mark.skipif(sys.platform == "win32", reason="programs run on POSIX only")
class TestEndlessPattern:
    """Patterns of exponential cost."""

    def test_its_time_is_limited(self, endless):
        reason = r'reading what "\(a\+\)\+\$" matches in out took longer than 0.05 s'
        with pytest.raises(UnreadableError, match=reason) as reported:
            endless(Limits(0.05))
        assert reported.value.status == Status.TIMED_OUT

    @pytest.mark.parametrize("seconds", [3600, None])
    def test_ctrl_c_ends_it(self, endless, seconds):
        def read():
            signal.setitimer(signal.ITIMER_PROF, 0.05)
            endless(Limits(seconds))

        handler = signal.signal(signal.SIGPROF, lambda *_: signal.raise_signal(signal.SIGINT))
        try:
            with pytest.raises(KeyboardInterrupt):
                read()
        finally:
            signal.signal(signal.SIGPROF, handler)


@pytest.mark.parametrize(
    ("column", "row", "after", "expected"),
    [
        ("force", 0, None, 1.5),
        ("time", 2, None, 2.0),
        (1, 1, None, 2.5),
        (-1, 0, "forces at", 9.0),
        (0, -1, "forces at", 4.0),
        ("depth", -1, None, 'out has no column "depth"; it has time, force'),
        (5, 0, None, "there is no row 0 of column 5 in out"),
        (1, 9, None, "there is no row 9 of column 1 in out"),
        (1, 3, None, "row 3 of column 1 in out is no number"),
        (0, 0, "nothing", 'out does not contain "nothing"'),
    ],
)
def test_a_table_with_blanks_between_its_columns_is_read(tmp_path, column, row, after, expected):
    assert number(tmp_path, ColumnReader("out", column, row, after), TABLE) == expected


@given(content=st.text(), column=st.integers(-3, 3) | st.just("a"), after=st.none() | st.text())
def test_any_content_is_a_number_or_a_reason(tmp_path_factory, content, column, after):
    if after is None or after.strip():
        reader = ColumnReader("out", column, 0, after)
        (folder := tmp_path_factory.getbasetemp() / "any").mkdir(exist_ok=True)
        (folder / "out").write_text(content, encoding="utf-8")
        with contextlib.suppress(UnreadableError):
            assert isinstance(reader.value(RunFiles(folder)), float)


def test_other_delimiters_leave_braces_and_lone_delimiters_alone():
    text = "{ R1 1 0 <<r>> ; cout << x; <<n:d>> <<r:.2e>> $x^{2}$ }"
    filled = fill(text, {"r": 47.5, "n": 3.0}, ANGLES)
    assert filled == "{ R1 1 0 47.5 ; cout << x; 3 4.75e+01 $x^{2}$ }"
    at = Delimiters("@", "@")
    assert fill("a@b.org @r@", {"r": 1.0}, at) == "a@b.org 1.0"
    wrong = "1\n<<rr>> <<inputs:d>> <<r:x>>"
    found = list(find_mistakes(wrong, ["r"], ["inputs"], ANGLES))
    assert [(line, text) for line, text, _ in found] == [
        (2, "<<rr>>"),
        (2, "<<inputs:d>>"),
        (2, "<<r:x>>"),
    ]
    assert found[0][2].endswith("known: r, inputs")
    assert found[2][2] == "a format such as <<r:.6e>>"


@given(number=st.integers(-(2**53), 2**53))
def test_whole_numbers_are_written_without_a_point(number):
    assert fill("{n:d}", {"n": float(number)}) == str(number)
    with pytest.raises(NotWholeError, match=r"\{n:03d\} is 0.5, which is no whole number"):
        fill("{n:03d}", {"n": 0.5})


STUDY = """\
seed = 1
[model]
command = ["cat", "deck.in"]
{model}
templates = {{ "deck.in" = "deck.template" }}
inputs = {{ length = "mm", n = "1", x = "1" }}
outputs = {{ y = "mm" }}
read = {{ text = "stdout", pattern = 'L = (\\S+)' }}
[inputs]
length = "7 mm"
n = {n}
x = "0 ± 1"
[designs.some]
kind = "monte-carlo"
runs = 2
"""


@pytest.mark.skipif(sys.platform == "win32", reason="programs run on POSIX only")
class TestStudy:
    """Studies of a program that repeats its input file."""

    @pytest.fixture
    def folder(self, tmp_path):
        (tmp_path / "deck.template").write_text("L = <<length>> x = <<x>> n = <<n:d>>")
        return tmp_path

    def study(self, folder, model='delimiters = ["<<", ">>"]', n="3"):
        return uqpen.parse_study(STUDY.format(model=model, n=n), folder=folder, name="deck")

    def test_numbers_arrive_as_they_are_written_and_several_matches_are_reported_once(self, folder):
        text = "{n}\nL = <<length>> \nL = <<length>>\nn = <<n:d>>; <<x:.0f>>"
        (folder / "deck.template").write_text(text)
        with pytest.warns(RuntimeWarning, match="several matches for") as reported:
            runs = uqpen.run(self.study(folder, 'delimiters = ["<<", ">>"]\nkeep = "all"'))
        assert len({str(each.message) for each in reported}) == 1
        assert runs["runs/some"]["y"].values.tolist() == [0.007, 0.007]
        kept = next((folder / "deck_runs").iterdir())
        assert (kept / "deck.in").read_text().startswith("{n}\nL = 7.0 \nL = 7.0\nn = 3; ")

    def test_a_number_that_should_be_whole_and_is_not_fails_its_run(self, folder):
        runs = uqpen.run(self.study(folder, n="2.5"))["runs/some"]
        assert set(runs["status"].values) == {Status.FAILED}
        assert set(runs["lost_reason"].values) == {"<<n:d>> is 2.5, which is no whole number"}

    @pytest.mark.parametrize(
        "wrong", ['"<<"', '["<<"]', '["a", "b"]', '["<<", ""]', '["< <", ">>"]', '["<<", 3]']
    )
    def test_delimiters_are_two_texts(self, folder, wrong):
        with pytest.raises(StudyError, match="expected  two texts of 1 to 8 signs"):
            self.study(folder, f"delimiters = {wrong}")
