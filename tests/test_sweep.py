"""A study at several values of an input, on the same points."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import gammaln
from study_text import study_text

import uqpen
from uqpen.archive.read import open_archive
from uqpen.checkpoints.make_archive import ResumeOptions, make_archive
from uqpen.core.errors import StudyError
from uqpen.core.sampling import Sampling
from uqpen.results.json import archive_json
from uqpen.results.sweeps import Sweep, sweep_tables
from uqpen.statistics.input_columns import InputColumns
from uqpen.statistics.model_form import event_difference
from uqpen.statistics.sample import Sample
from uqpen.verification.check_result import CheckOutcome

MODEL = """
def total(x, y, bolt, speed):
    if x > 3 and speed > 2.5:
        raise ValueError("too fast")
    return {"total": speed * x + y + {"M8": 0.0, "M10": 5.0}[bolt]}
"""
STUDY = """\
seed = 3
sensitivity = false
convergence = false
[model]
python = "sums.py:total"
[model.labels]
bolt = ["M8", "M10"]
[model.inputs]
x = "1"
y = "1"
speed = "m/s"
[model.outputs]
total = "1"
[sweep]
speed = ["1 m/s", "1.001 m/s", "300 cm/s"]
[inputs]
x = { normal = { mean = 0, std = 1 } }
y = { uniform = { lower = 0, upper = 1 } }
bolt = "M8"
[outputs.total]
exceeds = [3.0]
below = [-1.0]
[designs.monte_carlo]
kind = "monte-carlo"
runs = 2000
"""
NAMES = ["speed_1_m_s", "speed_1_001_m_s", "speed_300_cm_s"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("sweep")
    (place / "sums.py").write_text(MODEL)
    (place / "sweep.toml").write_text(STUDY)
    make_archive(uqpen.load_study(place / "sweep.toml"), place / "sweep.nc")
    return place


def test_values_have_the_same_points_and_paired_differences(folder):
    archive = open_archive(folder / "sweep.nc")
    assert list(archive["models"].children) == NAMES
    runs = [archive[f"models/{name}/runs/monte_carlo"] for name in NAMES]
    assert all(np.array_equal(runs[0]["x"], each["x"]) for each in runs)
    assert [float(each["speed"]) for each in runs] == [1.0, 1.001, 3.0]
    difference = archive[f"differences/{NAMES[1]}/monte_carlo/total"]
    # The mean difference is 0.001 E x, with the error of 0.001 x and not of the output.
    _, lower, upper = difference["mean"].values
    assert lower < 0 < upper < lower + 2 * 2.1 * 0.001 / np.sqrt(2000)
    x, y = runs[0]["x"].values, runs[0]["y"].values
    changed = np.sum((x + y > 3) != (1.001 * x + y > 3))
    probability = difference["exceedance"].values[0]
    assert changed <= 2  # and yet the interval is not 0 ± 0
    assert probability[1] < 0 < probability[2]
    assert 3 / 2000 < probability[2] - probability[1] < 16 / 2000


def test_pairs_with_a_failed_run_are_left_out_and_counted(folder):
    archive = open_archive(folder / "sweep.nc")
    x = archive[f"models/{NAMES[0]}/runs/monte_carlo"]["x"].values
    failed = int((x > 3).sum())
    assert failed > 0
    difference = archive[f"differences/{NAMES[2]}/monte_carlo/total"]
    for name in ("mean", "exceedance", "below"):
        assert difference[name].attrs["runs_used"] == 2000 - failed
        assert difference[name].attrs["runs_failed"] == failed
    y = archive[f"models/{NAMES[0]}/runs/monte_carlo"]["y"].values
    known = x <= 3
    exact = ((3 * x + y > 3)[known]).mean() - ((x + y > 3)[known]).mean()
    assert difference["exceedance"].values[0, 0] == pytest.approx(exact)


def test_runs_are_those_of_separate_studies(folder):
    """A study with one of the values takes all of its runs from the sweep, and back."""
    single = STUDY.replace('[sweep]\nspeed = ["1 m/s", "1.001 m/s", "300 cm/s"]\n', "")
    single = single.replace("[inputs]", '[inputs]\nspeed = "3 m/s"')
    (folder / "single.toml").write_text(single)

    made = make_archive(
        uqpen.load_study(folder / "single.toml"),
        folder / "single.nc",
        ResumeOptions(reuse=[folder / "sweep.nc"], recheck=False),
    )
    of_sweep = open_archive(folder / "sweep.nc")[f"models/{NAMES[2]}/runs/monte_carlo"]
    own = made["runs/monte_carlo"]
    assert np.array_equal(own["total"].values, of_sweep["total"].values, equal_nan=True)
    assert "none was made again" in made.attrs["reused_runs"]
    for name in ("mean", "exceedance"):
        one, other = (
            tree["statistics/monte_carlo/total"][name].values
            for tree in (made, open_archive(folder / "sweep.nc")[f"models/{NAMES[2]}"])
        )
        assert np.array_equal(one, other)


def test_it_verifies_and_is_shown_as_tables_json_and_page(folder, tmp_path):
    verdicts = {each.verdict for each in uqpen.verify(folder / "sweep.nc", trust=True, runs=30)}
    assert verdicts == {CheckOutcome.EQUAL}
    archive = uqpen.open_archive(folder / "sweep.nc")
    tables = {table.title: table for table in sweep_tables(archive)}
    mean = tables["total, mean over speed [m/s], monte_carlo"]
    assert mean.columns == ["at this value", "minus that at 1"]
    assert [label for label, _ in mean.rows] == ["1", "1.001", "3"]
    assert mean.rows[0][1][1] == "–"
    # A quantile of differences is no difference of quantiles, so that this one is of pairs.
    median = tables["total, median over speed [m/s], monte_carlo"]
    assert median.columns == mean.columns
    change = archive[f"differences/{NAMES[2]}/monte_carlo/total"]["difference_of_quantile"]
    of_first, of_last = (
        archive[f"models/{name}/statistics/monte_carlo/total"]["quantile"].sel(probability=0.5)
        for name in (NAMES[0], NAMES[2])
    )
    # Without the pairs of which one run has failed.
    _, lower, upper = change.sel(probability=0.5).values
    assert lower < float(of_last[0] - of_first[0]) < upper
    assert "total, P(> 3.0) over speed [m/s], monte_carlo" in tables
    found = archive_json(archive)
    assert list(found["models"]) == NAMES
    assert "exceedance" in str(found["differences"][NAMES[1]]["monte_carlo"]["outputs"]["total"])
    uqpen.write_report(archive, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Total: mean over speed" in page
    assert "Total: P(&gt; 3.0) over speed" in page
    assert "They are no sample of all models" not in page
    assert "model_form" not in archive.children
    axes = uqpen.figure(archive, "sweep", output="total").axes
    assert next(each.get_xlabel() for each in axes if each.get_visible()) == "speed [m/s]"


def test_two_swept_inputs_make_the_product(folder):
    text = (
        STUDY.replace('bolt = "M8"\n', "")
        .replace("[inputs]\n", 'bolt = ["M10", "M8"]\n[inputs]\n')
        .replace("runs = 2000", "runs = 30")
    )
    (folder / "product.toml").write_text(text)
    archive = uqpen.run(uqpen.load_study(folder / "product.toml"))
    sweep = Sweep.of_archive(archive)
    assert sweep is not None
    assert sweep.inputs == ("speed", "bolt")
    assert sweep.texts("bolt") == ["M10", "M8"] * 3
    assert len(sweep.models) == 6
    rows = next(iter(sweep_tables(archive))).rows
    assert [label for label, _ in rows][:3] == ["1, M10", "1, M8", "1.001, M10"]


@pytest.mark.parametrize(
    ("before", "after", "key", "found", "expected"),
    [
        ('["1 m/s", "1.001 m/s", "300 cm/s"]', '"1 m/s"', "sweep.speed", '"1 m/s"', "two values"),
        ('"1.001 m/s"', '"2 kg"', "sweep.speed[1]", '"2 kg"', "m/s"),
        ('"300 cm/s"', '"100 cm/s"', "sweep.speed[2]", '"100 cm/s"', "each value once"),
        ("speed = [", 'speeds = ["1 m/s"]\nspeed = [', "sweep.speeds", "an unknown input", "speed"),
        ("[sweep]\n", '[sweep]\nbolt = ["M8", "M9"]\n', "sweep.bolt[1]", '"M9"', "M8, M10"),
        ('bolt = "M8"\n', 'bolt = "M8"\nspeed = "1 m/s"\n', "sweep.speed",
         "speed, which [inputs] gives, too", "it in one of them"),
        ("[inputs]\nx = { normal = { mean = 0, std = 1 } }\n",
         '[joint.test]\nsample = { "speed [m/s]" = [1, 2], x = [0, 1] }\n[inputs]\n', "sweep.speed",
         "speed, which [joint] gives, too", "an input that nothing else gives"),
        ("y = { uniform = { lower = 0, upper = 1 } }", 'y = "speed / (1 m/s)"', "sweep.speed",
         "speed, which y in [inputs] follows from", "an input that no formula names"),
        ("[sweep]\n", f"[sweep]\nx = {[k / 10 for k in range(201)]}\n", "sweep", "603 combinations",
         "at most 200"),
    ],
)  # fmt: skip
def test_mistakes_are_met_before_a_run(folder, before, after, key, found, expected):
    (folder / "wrong.toml").write_text(STUDY.replace(before, after))
    with pytest.raises(StudyError) as caught:
        uqpen.load_study(folder / "wrong.toml")
    message = str(caught.value)
    assert "models." not in message, "a study with a sweep names no models"
    assert f"  {key}\n    found     {found}" in message
    assert expected in message.partition(f"  {key}\n")[2]


def test_a_sweep_is_of_one_model():
    text = study_text(
        sweep={},
        models={"a": {"use": "ishigami"}},
        inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": (-3, 3)},
        designs={"mc": {"kind": "monte-carlo", "runs": 10}},
    )
    with pytest.raises(StudyError, match=r"\[sweep\] beside \[models\]"):
        uqpen.parse_study(text + "[sweep]\nx1 = [1, 2]\n")


def _sample(runs: int) -> Sample:
    return Sample(
        np.zeros(runs),
        np.arange(runs),
        np.arange(0),
        InputColumns((), runs, lambda name: np.zeros(runs)),
        np.zeros(runs, int),
        Sampling.INDEPENDENT,
    )


@pytest.mark.parametrize("runs", [20, 60])
def test_differences_of_probabilities_cover_by_enumeration(runs):
    """Of all pairs of counts, with their exact probabilities: at least 95 %, also for rare ones."""
    ends = {}
    sample = _sample(runs)
    place = np.arange(runs)
    for to in range(runs + 1):
        for away in range(runs + 1 - to):
            other, first = place < to, (place >= to) & (place < to + away)
            found = event_difference(sample, first, other)
            ends[to, away] = float(found.lower), float(found.upper)
    to, away = np.array([*ends]).T
    lower, upper = np.array([*ends.values()]).T
    assert (lower < upper).all()
    counts = gammaln(runs + 1) - gammaln(to + 1) - gammaln(away + 1) - gammaln(runs - to - away + 1)
    for p, q in [(0.001, 0.001), (0.02, 0.005), (0.1, 0.1), (0.3, 0.05), (0.4, 0.4), (0.45, 1e-9)]:
        rest = (runs - to - away) * np.log(1 - p - q)
        weights = np.exp(counts + to * np.log(p) + away * np.log(q) + rest)
        covers = (lower <= p - q) & (p - q <= upper)
        assert weights[covers].sum() >= 0.95
