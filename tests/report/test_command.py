"""``uqpen report``, and the page that ``uqpen study`` writes or names."""

import os

import pytest
from study_text import study_text

import uqpen

pytestmark = pytest.mark.slow

STUDY = study_text(
    "ishigami",
    title="Sum of two",
    inputs={"x1": 1.0, "x2": (0, 1), "x3": (0, 1)},
    designs={"some": {"kind": "monte-carlo", "runs": 50}},
)


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "sum.toml"
    path.write_text(STUDY)
    return path


def test_a_study_ends_with_the_line_that_writes_its_report(command_line, study, tmp_path):
    done = command_line("study", "sum.toml")
    assert done.out.endswith("archive: archives/sum.nc\nreport: uqpen report archives/sum.nc\n")
    assert not (tmp_path / "archives/sum.html").exists()
    done = command_line("report", "archives/sum.nc")
    assert (done.code, done.out, done.err) == (0, "report: archives/sum.html\n", "")
    page = (tmp_path / "archives/sum.html").read_text()
    assert page.startswith("<!DOCTYPE html>")
    assert "<h1>Sum of two</h1>" in page


def test_a_study_can_write_its_report_at_once(command_line, study, tmp_path):
    done = command_line("study", "sum.toml", "--report", "-o", "there/my archive.nc")
    assert done.out.endswith("report: there/my archive.html\n")
    at_once = (tmp_path / "there/my archive.html").read_bytes()
    command_line("report", "there/my archive.nc", "-o", "later.html")
    assert (tmp_path / "later.html").read_bytes() == at_once


def test_a_full_page_is_asked_for(command_line, study, tmp_path):
    command_line("study", "sum.toml")
    command_line("report", "archives/sum.nc", "-o", "short.html")
    done = command_line("report", "archives/sum.nc", "--full", "-o", "full.html")
    assert (done.code, done.out) == (0, "report: full.html\n")
    short, full = ((tmp_path / f"{name}.html").read_text() for name in ("short", "full"))
    assert '<details class="part">' in short
    assert '<details class="part" open>' in full


class TestMistakes:
    def test_the_archive_is_not_overwritten(self, command_line, archives, tmp_path):
        uqpen.write(archives["beam"], tmp_path / "beam.nc")
        before = (tmp_path / "beam.nc").read_bytes()
        done = command_line("report", "beam.nc", "-o", "beam.nc")
        assert done.code == 2
        assert done.err == "beam.nc: found the ending .nc; expected .html or .htm\n"
        assert (tmp_path / "beam.nc").read_bytes() == before

    def test_a_file_that_is_no_archive_is_reported(self, command_line, study):
        done = command_line("report", "sum.toml")
        assert (done.code, done.err[:20]) == (2, "sum.toml: is not an ")

    def test_a_page_takes_the_place_of_files_alone(self, command_line, archives, tmp_path):
        uqpen.write(archives["beam"], tmp_path / "beam.nc")
        os.mkfifo(tmp_path / "pipe.html")
        done = command_line("report", "beam.nc", "-o", "pipe.html")
        said = "pipe.html: cannot be written: there is something that is no file\n"
        assert (done.code, done.out, done.err) == (2, "", said)
        assert (tmp_path / "pipe.html").is_fifo()
