"""Published figures: read with their units, kept apart from our own, with their own noise."""

import numpy as np
import pytest

import uqpen
from uqpen.core.errors import StudyError
from uqpen.results.output_tables import output_tables
from uqpen.statistics.published import compare_moments

DESIGNS = """
[designs.blocks]
kind = "saltelli"
base = 256
"""
PUBLISHED = """
[published.report]
source = "a report"
[published.report.y]
mean = 1.5
std = 0.25
response = { a = 0.4 }
largest_contribution = "b"
"""


def study(study_of, published=PUBLISHED):
    return study_of("a + b", DESIGNS + published, a=(0, 1), b=(0, 1))


def test_they_stand_beside_our_own(study_of):
    tree = uqpen.run(study(study_of))
    mean = tree["statistics/report/y"]["mean"]
    assert mean.values[0] == 1.5
    assert np.isnan(mean.values[1:]).all()
    assert mean.attrs["note"] == "published in a report"
    assert tree["statistics/report/y"]["response"].sel(input="a").values[0] == 0.4
    assert tree["statistics/report/y"].attrs["largest_contribution"] == "b"


def test_they_are_shown_beside_them(study_of):
    tables = {table.title: table for table in output_tables(uqpen.run(study(study_of)))}
    assert tables["y"].columns == ["blocks", "report"]
    shares = tables["y: shares of its variance"]
    assert shares.columns[-1] == "the largest to\nreport"
    assert [cells[-1] for _, cells in shares.rows] == ["–", "this"]


@pytest.mark.parametrize(
    ("old", "new", "key", "found"),
    [
        ("mean = 1.5", 'mean = "1.5 m"', "published.report.y.mean", "1.5 m"),
        ("[published.report.y]", "[published.report.z]", "published.report.z", "unknown output"),
        ("{ a = 0.4 }", "{ c = 0.4 }", "published.report.y.response.c", "unknown input"),
        ('"b"', '"c"', "published.report.y.largest_contribution", '"c"'),
        ("report", "blocks", "published.blocks", '"blocks"'),
        ('source = "a report"', "", "published.report.source", "nothing"),
    ],
)
def test_mistakes_are_met(study_of, old, new, key, found):
    with pytest.raises(StudyError) as caught:
        study(study_of, PUBLISHED.replace(old, new))
    assert any(p.key == key and found in p.found for p in caught.value.problems), caught.value


READ = """
[published.report]
source = "a report"
runs = 400
magnitudes = true
uncertainties = { a = "57.7 %" }
[published.report.y]
mean = "1.00"
std = "0.410"
response = { a = "50.0 %", b = 0.5 }
"""
SAMPLES = """
[designs.some]
kind = "monte-carlo"
runs = 2_000
[designs.steps]
kind = "one-at-a-time"
"""


def test_a_figure_as_text_keeps_its_last_zero(study_of):
    (estimates,) = (
        study_of("a + b", SAMPLES + READ, a=(0, 1), b=(0, 1)).published["report"].estimates
    )
    assert estimates.rounding == {"mean": 0.005, "std": 0.0005}
    assert estimates.response_rounding == {"a": pytest.approx(0.0005)}  # b is a plain number


def test_the_noise_of_a_stated_number_of_runs_is_that_of_the_figure(study_of):
    tree = uqpen.run(study_of("a + b", SAMPLES + READ, a=(0, 1), b=(0, 1)))
    _, low, high = tree["statistics/report/y"]["mean"].values
    # The standard error is sqrt(1/6)/20, beside a rounding of 0.005/sqrt(3); 2 000 runs see it
    # to some per cent.
    assert (high - low) / 2 == pytest.approx(1.96 * np.hypot(0.0204, 0.0029), rel=0.06)
    response = tree["statistics/report/y"]["response"]
    assert response.sel(input="a").values.tolist() == pytest.approx([0.5, 0.4995, 0.5005])
    assert np.isnan(response.sel(input="b").values[1:]).all()


def test_the_comparison_has_both_noises(study_of):
    study = study_of("a + b", SAMPLES + READ, a=(0, 1), b=(0, 1))
    runs = uqpen.run(study)["runs/some"].to_dataset()
    found = compare_moments(study.published["report"], runs, np.random.default_rng(1))
    mean, std = found.figures
    assert mean.error == pytest.approx(np.sqrt(1 / 6 / 400 + 1 / 6 / 2000 + 0.005**2 / 3), rel=0.06)
    # The kurtosis of the sum of two uniform numbers is 2.4: its error is s sqrt(1.4/(4 n)).
    assert std.published_error == pytest.approx(np.sqrt(1 / 6) * np.sqrt(1.4 / 1600), rel=0.06)
    assert found.p > 0.05


def test_a_value_may_stand_for_a_lost_run(study_of):
    text = SAMPLES + READ + '[constraints]\nkeep = ["a < b"]\n'
    study = study_of("a + b", text, a=(0, 1), b=(0, 1))
    runs = uqpen.run(study)["runs/some"].to_dataset()
    found = compare_moments(
        study.published["report"], runs, np.random.default_rng(1), {"inadmissible": {"y": 7.0}}
    )
    assert found.runs == 2000
    assert found.figures[0].found > 3


def test_a_misspelt_key_of_a_reading_is_one_mistake(study_of):
    text = f"{SAMPLES}{READ}[published.report.readings.r]\nlost.inadmisible.y = 1\n"
    with pytest.raises(StudyError) as caught:
        study_of("a + b", text, a=(0, 1), b=(0, 1))
    assert [each.key for each in caught.value.problems] == [
        "published.report.readings.r.lost.inadmisible"
    ]


@pytest.mark.parametrize(
    ("reading", "key", "found"),
    [
        ("note = 1", "published.report.readings.r.note", "1"),
        ('note = "n"', "published.report.readings.r", "a reading that changes nothing"),
        ("inputs.a = 2\ninputs.c = 1", "published.report.readings.r.inputs.c", "unknown input"),
        ('inputs.a = "2 m"', "published.report.readings.r.inputs.a", "2 m"),
        ("input.a = 2", "published.report.readings.r.input", "an unknown key"),
        ("lost.gone.y = 1", "published.report.readings.r.lost.gone", "an unknown status"),
        ("lost.failed.z = 1", "published.report.readings.r.lost.failed.z", "unknown output"),
        ("designs.some.runs = 0", "published.report.readings.r.designs.some.runs", "0"),
        ("designs.some.runs = 2_000", "published.report.readings.r",
         "a reading that changes nothing"),
    ],
)  # fmt: skip
def test_mistakes_in_a_reading_are_met(study_of, reading, key, found):
    text = f"{SAMPLES}{READ}[published.report.readings.r]\n{reading}\n"
    with pytest.raises(StudyError) as caught:
        study_of("a + b", text, a=(0, 1), b=(0, 1))
    assert any(p.key == key and found in p.found for p in caught.value.problems), caught.value
