"""A study repeated on its own surrogate: coverage, widths, tails, and how it ends."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from study_text import study_text

from uqpen.benchmark.methods import BenchmarkStatistic
from uqpen.core.errors import SettingsError
from uqpen.core.streams import Stream
from uqpen.designs.one_at_a_time import OneAtATime
from uqpen.designs.stopping.precision import Precision
from uqpen.execution import Progress
from uqpen.rehearsal.rehearse import (
    RehearsalSettings,
    RepeatRecord,
    RepeatWork,
    make_repeats,
    rehearse,
    rehearsed_statistics,
    sufficient_runs,
)
from uqpen.rehearsal.rehearsed_study import (
    RehearsedStudy,
    large_sample,
    study_sources,
    surrogate_truth,
    tail_shares,
)
from uqpen.statistics.quantity_of_interest import Threshold
from uqpen.study.load import parse_study
from uqpen.surrogates.fitting import fit_surrogate
from uqpen.workflow import run_design

STUDY = study_text(
    {
        "python": "line.py:f",
        "vectorized": True,
        "inputs": {"a": "1", "b": "1"},
        "outputs": {"y": "1"},
    },
    inputs={"a": (0, 1), "b": (-1, 1)},
    outputs={"y": {"exceeds": [2]}},
)
DESIGNS = """
[designs.draws]
kind = "monte-carlo"
runs = 200
[designs.cube]
kind = "latin-hypercube"
runs = 60
replicates = 6
"""
BLOCKS = """
[designs.blocks]
kind = "saltelli"
base = 32
[designs.steps]
kind = "one-at-a-time"
"""
SURROGATE = """
[surrogates.line]
kind = "polynomial-chaos"
design = "draws"
order = 1
"""
QUICK = RehearsalSettings(repeats=10, runs=120, draws=2**10)


def rehearsed(study):
    """The surrogate of a study in place of its model, after the study's runs."""
    runs = {
        name: run_design(study, each, Stream(1, name), map=map, progress=Progress())[""]
        for name, each in study.designs.items()
    }
    ((name, surrogate),) = study.surrogates.items()
    training = runs[surrogate.design]
    stream = Stream(1, "fit")
    fitted = fit_surrogate(surrogate, name, training, study.model, study.joint, stream)
    return RehearsedStudy(study, "", fitted, runs)


def line_study(folder, designs):
    """A line, which its surrogate represents exactly."""
    (folder / "line.py").write_text("def f(a, b):\n    return {'y': 1 + 2 * a + b}\n")
    return rehearsed(parse_study(STUDY + designs + SURROGATE, folder=folder))


@pytest.fixture(scope="module")
def line(tmp_path_factory):
    return line_study(tmp_path_factory.mktemp("line"), DESIGNS)


@pytest.fixture(scope="module")
def findings(line):
    return rehearse(line, QUICK)


def entry(findings, statistic, label=""):
    is_it = (findings["statistic"] == statistic) & (findings["label"] == label)
    return findings.isel(entry=int(np.flatnonzero(is_it)[0]))


def test_on_an_exact_surrogate_it_is_the_study_itself_repeated(tmp_path):
    line = line_study(tmp_path, DESIGNS + BLOCKS)
    sources = study_sources(line.study)
    # Steps are the same each time.
    assert {source.name for source in sources} == {"draws", "cube", "blocks"}
    statistics = rehearsed_statistics(line.study, sources)
    (of_surrogate,), (of_model,) = (
        make_repeats(RepeatWork(study, sources, statistics), range(1), map)
        for study in (line.study, line.original)
    )
    assert np.isfinite(of_surrogate.estimates).sum() > 100
    np.testing.assert_allclose(of_surrogate.estimates, of_model.estimates, rtol=1e-6, atol=1e-9)
    sample = large_sample(line.study, 2**10)
    truth = surrogate_truth(line.study, line.fitted, statistics, sample)
    (first,) = (truth[i] for i, each in enumerate(statistics) if each.name == "first_order")
    assert first[:, 0] == pytest.approx([0.5, 0.5])


def test_it_knows_the_truth(findings):
    assert entry(findings, "mean")["truth"].values == pytest.approx(2)
    assert entry(findings, "std")["truth"].values == pytest.approx((2 / 3) ** 0.5)
    assert entry(findings, "exceedance", "2")["truth"].values[0] == pytest.approx(0.5, abs=0.01)
    assert not findings["hangs_on_tail"].any()


def test_coverage_counts_the_intervals_that_hold(line, findings):
    sources = study_sources(line.study)[:1]
    work = RepeatWork(line.study, sources, rehearsed_statistics(line.study, sources))
    means = np.stack([each.estimates[0, 0] for each in make_repeats(work, range(10), map)])
    held = ((means[:, 1] <= 2) & (means[:, 2] >= 2)).mean()
    found = entry(findings, "mean").isel(source=0)
    assert found["coverage"].values[0] == pytest.approx(held)
    assert found["coverage"].values[1] < held <= found["coverage"].values[2]
    assert found["half_width"] == pytest.approx(np.median(means[:, 2] - means[:, 1]) / 2)


def test_the_best_design_at_equal_runs_is_stratified(findings):
    assert set(findings["runs"].values[findings["size"].values == "equal"]) == {120}
    assert entry(findings, "mean")["best"] == "cube"


def test_an_interval_that_holds_too_rarely_falls_short():
    # Of 100 intervals of 95 %, 80 hold the truth; all of those of the second source do.
    ends = np.array([[0.0, -1.0, 1.0]] * 80 + [[3.0, 2.0, 4.0]] * 20)
    other = np.array([[0.0, -2.0, 2.0]] * 100)
    estimates = np.stack([ends, other], axis=1)[:, :, np.newaxis]
    record = RepeatRecord(estimates, np.full((100, 2), 10.0), np.zeros((1, 3)))
    coverage = record.coverage()
    assert coverage[:, 0, 0].tolist() == [0.8, 1.0]
    assert record.falls_short(np.array([0.95])).tolist() == [[True], [False]]
    assert record.half_widths().tolist() == [[1.0], [2.0]]


@pytest.mark.parametrize(
    ("name", "share"),
    [("mean", 0.2), ("std", 0.8), ("quantile", 0.0), ("exceedance", 1.0), ("half_spread", 0.0)],
)
def test_a_long_tail_decides_on_the_spread_before_it_does_on_the_mean(line, name, share):
    (quantity,) = line.study.quantities_of_interest
    limit = Threshold("40", 40.0)
    statistic = BenchmarkStatistic(replace(quantity, thresholds=(limit,)), name)
    # One value in a thousand is far beyond the training range.
    values = np.concatenate([np.linspace(-1, 1, 999), [10.0]])
    found = tail_shares(statistic, np.zeros(1), values, (-1.0, 1.0))
    assert found == pytest.approx([share], abs=0.2 if 0 < share < 1 else 0)


def test_ctrl_c_leaves_the_repeats_so_far(line):
    def interrupted(work, batches):
        for batch in batches:
            if batch.start == 2:
                raise KeyboardInterrupt
            yield work(batch)

    findings = rehearse(line, QUICK, map=interrupted)
    assert (findings.attrs["repeats"], findings.attrs["repeats_wanted"]) == (2, 10)
    assert entry(findings, "mean")["coverage"].notnull().all()


def test_the_order_of_the_repeats_changes_nothing(line, findings):
    def backwards(work, batches):
        yield from map(work, list(batches)[::-1])

    xr.testing.assert_identical(rehearse(line, QUICK, map=backwards), findings)


def test_the_runs_that_do_are_those_of_the_formula(line):
    designs = {"draws": line.study.designs["draws"]}
    study = replace(line.study, designs=designs)
    # 1.96 standard deviations over the root of 91 runs.
    rule = Precision({"y": {"mean": 1.96 * (2 / 3 / 91) ** 0.5}})
    (found,) = sufficient_runs(study, rule)
    assert (found.design, found.runs) == ("draws", 128)


@pytest.mark.parametrize(
    ("seconds", "repeats"), [(0.1, 1000), (1.0, 300), (60.0, 200), (0.0, 1000)]
)
def test_a_default_number_of_repeats_is_what_fits_five_minutes(seconds, repeats):
    assert RehearsalSettings().affordable_repeats(seconds) == repeats
    assert RehearsalSettings(repeats=50).affordable_repeats(seconds) == 50


def test_designs_are_compared_at_8_runs_and_more():
    assert RehearsalSettings(runs=8).runs == 8
    with pytest.raises(SettingsError, match="expected a whole number, at least 8"):
        RehearsalSettings(runs=7)


def test_a_study_whose_points_stay_has_nothing_to_rehearse(line):
    only = replace(line.original, designs={"steps": OneAtATime()})
    without = RehearsedStudy(only, "", line.surrogate, line.runs)
    with pytest.raises(SettingsError, match="found steps, whose points are the same each time"):
        rehearse(without, QUICK)
