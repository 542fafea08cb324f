"""What a terminal and a pipe show of a study that runs."""

import inspect
import io
import threading

import pytest
from rich.console import Console

import uqpen
from uqpen.checkpoints.journal import Journal
from uqpen.cli.progress import _Lines, progress_lines, show_progress
from uqpen.core.progress import StudyProgress
from uqpen.execution import Progress
from uqpen.notebook import NotebookProgress

TWO = """
[designs.some]
kind = "monte-carlo"
runs = 60
[designs.more]
kind = "latin-hypercube"
runs = 40
[surrogates.cheap]
kind = "polynomial-chaos"
design = "some"
"""


def drawn(progress, width=80, now=0.0):
    console = Console(width=width, file=io.StringIO(), force_terminal=False)
    with console.capture() as captured:
        console.print(progress_lines(progress, now))
    return captured.get().splitlines()


def test_one_bar_counts_the_runs_of_all_designs():
    progress = StudyProgress(
        design="latin_hypercube",
        design_number=2,
        designs=4,
        runs=60_000,
        done=15_000,
        failed=92,
        in_progress=8,
        runs_per_second=3_000.0,
    )
    bar, counts = drawn(progress)
    assert bar.startswith("design 2 of 4: latin_hypercube ━━━")
    assert bar.rstrip().endswith(" 25 %")
    assert len(bar) <= 80
    assert counts.replace("\u202f", " ").rstrip() == (
        "15 000 of 60 000 runs, 92 failed, 8 under way, about 15 s left"
    )


def test_a_step_of_the_analysis_has_its_place_and_its_time():
    bar, below = drawn(StudyProgress(step="fitting chaos", step_number=4, steps=5), now=12.4)
    assert bar.startswith("step 4 of 5: fitting chaos ━━━")
    assert bar.rstrip().endswith(" 60 %"), "what is under way is not done yet"
    assert below.rstrip() == "12 s so far"


@pytest.mark.parametrize("width", [30, 40, 80])
def test_no_line_is_wider_than_the_terminal(width):
    progress = StudyProgress(design="x" * 60, design_number=10, designs=12, runs=10**9, done=7)
    assert all(len(line) <= width for line in drawn(progress, width))


def test_control_characters_of_a_name_are_spelled_out():
    assert "\x1b" not in "".join(drawn(StudyProgress(step="preparing \x1b[2J")))


def test_every_step_is_named_before_it_starts(study_of, tmp_path):
    steps = []
    designs = []

    class Recorded(Progress):
        def start_step(self, name, number=0, total=0):
            steps.append((name, number, total))

        def start_design(self, name, runs):
            designs.append(name)

        def announce_designs(self, runs):
            assert runs == {"some": 60, "more": 40}
            assert not designs

    uqpen.make_archive(study_of("x", TWO, x=(0, 1)), tmp_path / "a.nc", progress=Recorded())
    assert designs == ["some", "more"]
    assert steps == [
        ("making runs again, to see noise of the model", 0, 0),
        ("statistics of some", 1, 5),
        ("statistics of more", 2, 5),
        ("fitting cheap", 3, 5),
        ("estimates of cheap", 4, 5),
        ("trajectory at the nominal inputs", 5, 5),
        ("writing the archive", 0, 0),
    ]


def test_several_models_are_named_in_the_steps(tmp_path):
    study = uqpen.Study(
        models={
            name: uqpen.PythonModel(lambda x: {"y": x}, {"x": "1"}, {"y": "1"}) for name in "ab"
        },
        inputs={"x": uqpen.Uniform(0, 1)},
        outputs={"y": "1"},
        designs={"some": uqpen.MonteCarlo(runs=20)},
        seed=1,
    )
    steps = []

    class Recorded(Progress):
        def start_step(self, name, number=0, total=0):
            steps.append((name, number, total))

    uqpen.run(study, progress=Recorded())
    steps = [each for each in steps if each[1]]
    names = [name for name, _, _ in steps]
    assert names[0] == "statistics of some of a"
    assert names[-1] == "differences of b from a"
    assert [number for _, number, _ in steps] == list(range(1, steps[0][2] + 1))


def test_the_log_passes_every_report_on(tmp_path):
    reported = []

    class Recorded(Progress):
        def __getattribute__(self, name):
            if not name.startswith("_"):
                reported.append(name)
            return super().__getattribute__(name)

    journal = Journal(tmp_path / "log", "title", Recorded())
    reports = [name for name in vars(Progress) if not name.startswith("_") and name != "warn"]
    for name in reports:
        report = getattr(journal, name)
        kinds = {"str": "x", "int": 1, "Mapping[str, int]": {}}
        parameters = inspect.signature(report).parameters.values()
        report(*(kinds.get(str(each.annotation)) for each in parameters))
    assert reported == reports


class TestPipe:
    """Where standard error is no terminal."""

    @pytest.fixture
    def lines(self):
        time = [0.0]
        shown = io.StringIO()
        return _Lines(Console(file=shown, width=80), lambda: time[0]), time, shown

    def test_a_design_has_a_line_at_its_end(self, lines):
        progress, time, shown = lines
        progress.announce_designs({"one": 10, "two": 1})
        progress.start_step("reading the study")
        progress.start_design("one", 10)
        for _ in range(10):
            time[0] += 0.1
            progress.advance(1, 0, 1)
        progress.start_design("two", 1)
        progress.advance(1, 0, 0)
        progress.start_analysis()
        progress.start_step("statistics of one", 1, 2)
        assert shown.getvalue().splitlines() == [
            "one: 10 runs in 1.00 s",
            "two: 1 run in 0.00 s",
            "analysing the runs",
        ]

    def test_what_is_known_before_the_runs_is_shown_before_them(self, lines):
        progress, _, shown = lines
        progress.warn("early")
        progress.announce_designs({"one": 1})
        assert shown.getvalue().splitlines() == ["warning: early"]
        progress.start_design("one", 1)
        progress.warn("late")
        progress.start_analysis()
        progress.show_warnings()
        assert shown.getvalue().splitlines()[2:] == ["analysing the runs", "warning: late"]

    def test_a_large_design_has_a_line_before_its_first_points_are_drawn(self, lines):
        progress, _, shown = lines
        progress.announce_designs({"small": 2**20, "large": 2**20 + 1})
        progress.start_design("small", 2**20)
        progress.start_design("large", 2**20 + 1)
        assert shown.getvalue().replace("\u202f", " ").splitlines()[1:] == [
            "large: drawing the points of 1 048 577 runs"
        ]

    def test_what_takes_long_says_how_far_it_is(self, lines):
        progress, time, shown = lines
        progress.announce_designs({"one": 100})
        progress.start_design("one", 100)
        for _ in range(30):
            time[0] += 1
            progress.advance(1, 1, 2)
        progress.start_step("statistics of one", 1, 2)
        time[0] += 60
        progress.start_step("fitting chaos", 2, 2)
        assert shown.getvalue().splitlines() == [
            "one; 10 of 100 runs, 10 failed, 2 under way, about 90 s left",
            "one; 20 of 100 runs, 20 failed, 2 under way, about 80 s left",
            "one; 30 of 100 runs, 30 failed, 2 under way, about 70 s left",
            "one: 30 runs in 30.00 s",
            "step 2 of 2: fitting chaos",
        ]


def test_a_terminal_goes_on_while_nothing_is_reported(monkeypatch):
    """The clock of a long step is drawn by a thread of its own."""
    drawings = threading.Semaphore(0)

    class Terminal(io.StringIO):
        def isatty(self):
            return True

        def write(self, text):
            drawings.release()
            return super().write(text)

    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr("sys.stderr", Terminal())
    with show_progress() as progress:
        progress.start_step("fitting chaos", 1, 2)
        for _ in range(5):
            assert drawings.acquire(timeout=60)


def test_a_notebook_shows_one_bar_over_all_designs():
    shown = []

    class Handle:
        def update(self, content, *, raw):
            shown.append(content)

    bar = NotebookProgress(Handle())
    bar.announce_designs({"one": 60, "two": 40})
    bar.start_design("one", 60)
    bar.count_restored(60)
    bar.start_design("two", 40)
    assert shown[-1] == {
        "text/plain": "design 2 of 2: two; 60 of 100 runs",
        "text/html": '<progress value="60" max="100"></progress> '
        "design 2 of 2: two; 60 of 100 runs",
    }
    bar.start_step("fitting <chaos>", 2, 4)
    assert shown[-1]["text/html"] == (
        '<progress value="1" max="4"></progress> step 2 of 4: fitting &lt;chaos&gt;'
    )
