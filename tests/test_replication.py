"""Published figures tested with an archive: the table together, readings as a set."""

import json
from functools import cache

import pytest
from click.testing import CliRunner

import uqpen
from uqpen.cli.replicate import replicate as command
from uqpen.core.errors import ArchiveError, UnknownNameError
from uqpen.replication import replicate

# y = a + b of two uniform numbers: mean 1, deviation 0.40825; a response of 1/2 to each.
TEXT = """
[designs.some]
kind = "monte-carlo"
runs = 4_000
[designs.steps]
kind = "one-at-a-time"
[published.paper]
source = "a paper"
runs = 2_500
[published.paper.y]
mean = "{mean}"
std = "{std}"
response = {{ a = "{response}" }}
"""
READINGS = """
[published.paper.readings.wide]
note = "b reaches to 1.2"
inputs.b = { uniform = { lower = 0, upper = 1.2 } }
[published.paper.readings.fixed]
inputs.b = 0.5
[published.paper.readings.forward]
designs.steps.difference = "forward"
"""


@pytest.fixture(scope="module")
def archive(module_study_of, tmp_path_factory):
    """Makes an archive of what is printed once, in a folder of its own."""

    @cache
    def make(readings=READINGS, **printed):
        text = TEXT.format(**{"mean": "1.00", "std": "0.408", "response": "50.0 %", **printed})
        study = module_study_of("a + b", text + readings, a=(0, 1), b=(0, 1))
        path = tmp_path_factory.mktemp("replication") / "sum.nc"
        uqpen.make_archive(study, path)
        return path

    return make


def test_of_a_right_publication_no_reading_is_made(archive):
    path = archive()
    found = replicate(path, trust=True)
    assert not found.stated.is_rejected
    assert found.readings == ()
    assert list(path.parent.glob("sum_*.nc")) == []


def test_a_wrong_one_names_the_readings_that_fit(archive):
    # With b up to 1.2 the mean is 1.1, and the deviation sqrt((1 + 1.44)/12) = 0.4509.
    path = archive(mean="1.10", std="0.451")
    found = replicate(path, trust=True)
    assert found.stated.moments.p < 1e-4
    assert [each.name for each in found.readings if each.fits] == ["wide"]
    reading = uqpen.open_archive(path.parent / "sum_paper_wide.nc")
    assert "spearman" not in reading["statistics/some/y"], "no publication has it"
    # The second time its runs are there.
    made = (path.parent / "sum_paper_wide.nc").stat().st_mtime_ns
    assert replicate(path, trust=True) == found
    assert (path.parent / "sum_paper_wide.nc").stat().st_mtime_ns == made


def test_a_reading_that_contradicts_an_input_does_not_fit(archive):
    # The deviation of b is 57.735 % of its median, whatever its upper end: then 1.2 is as good.
    either = '[published.paper.uncertainties]\nb = "{}"\n'
    for printed, fits in (("57.7 %", True), ("50.0 %", False)):
        path = archive(either.format(printed) + READINGS, mean="1.10", std="0.451")
        wide = replicate(path, trust=True).readings[0]
        assert wide.fits == fits
        assert wide.contradictions == ([] if fits else ["b"])


def test_responses_agree_to_the_digit_and_chance_is_stated(archive):
    # With b fixed at 0.5 nothing changes at the nominal point; with b up to 1.2 it is 1/2.2.
    found = replicate(archive(response="45.5 %"), trust=True)
    assert found.stated.same_responses == 0
    same = {each.name: each.same_responses for each in found.readings}
    assert same == {"wide": 1, "fixed": 0, "forward": 0}
    # A cell of 0.1 in a range from 45.45 to 50, for four readings.
    assert found.chance_agreements == pytest.approx(4 * 0.1 / (50 - 100 / 2.2), rel=1e-6)


def test_what_is_not_there_is_met(archive, study_of, tmp_path):
    path = archive()
    with pytest.raises(UnknownNameError, match="paper"):
        replicate(path, "papers", trust=True)
    text = '[designs.some]\nkind = "latin-hypercube"\nruns = 100\n'
    without = study_of("a + b", text, a=(0, 1), b=(0, 1))
    uqpen.make_archive(without, tmp_path / "without.nc")
    with pytest.raises(UnknownNameError, match="no publication"):
        replicate(tmp_path / "without.nc", trust=True)
    text += '[published.paper]\nsource = "a paper"\nruns = 9\n[published.paper.y]\nmean = "1.0"\n'
    dependent = study_of("a + b", text, a=(0, 1), b=(0, 1))
    uqpen.make_archive(dependent, tmp_path / "dependent.nc")
    with pytest.raises(ArchiveError, match="monte-carlo"):
        replicate(tmp_path / "dependent.nc", trust=True)


def test_the_command_shows_it_as_text_and_as_json(archive):
    path = str(archive(mean="1.10", std="0.451"))
    shown = CliRunner().invoke(command, [path, "--trust", "-q"], standalone_mode=False)
    assert "The study is rejected at 5 %" in shown.output
    assert "1 of 3 readings fit all printed figures: wide." in shown.output
    found = CliRunner().invoke(command, [path, "--trust", "-q", "--json"], standalone_mode=False)
    content = json.loads(found.output)
    assert content["fitting"] == ["wide"]
    assert content["stated"]["is_rejected"]
    path = str(archive(response="45.5 %"))
    shown = CliRunner().invoke(command, [path, "--trust", "-q"], standalone_mode=False)
    assert "Most agree, 1, by wide; by chance 0.088 readings" in " ".join(shown.output.split())
