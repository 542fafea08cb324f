"""``uqpen plan``: how many runs a precision takes, and runs that can be used again."""

import re
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from study_text import study_text

import uqpen
from uqpen.cli.plan import plan
from uqpen.core.streams import Stream
from uqpen.designs.stopping.precision import Precision
from uqpen.execution import Progress
from uqpen.statistics.analyze import analyze
from uqpen.statistics.running_estimates import required_runs
from uqpen.study.load import pilot_study
from uqpen.verification.verify import verify
from uqpen.workflow import run_design

STUDY = study_text(
    "ishigami",
    seed=3,
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": 1},
    outputs={"y": {"exceeds": [5]}},
    designs={
        "first": {"kind": "latin-hypercube", "runs": 100},
        "draws": {
            "kind": "monte-carlo",
            "until": {"y": {"mean": "2 %", "exceeds": {"5": 0.01}}},
            "at_most": 20_000,
        },
    },
    surrogates={"chaos": {"kind": "polynomial-chaos", "design": "first", "order": 2}},
)


def _plan(folder, *arguments, study=STUDY):
    file = folder / "small.toml"
    file.write_text(study)
    archive = folder / "pilot.nc"
    return CliRunner().invoke(plan, [*map(str, (file, "-o", archive, *arguments))])


@cache
def made(runs):
    study = uqpen.parse_study(STUDY)
    stream, design = Stream(study.seed, "designs", "draws"), uqpen.MonteCarlo(runs)
    return run_design(study, design, stream, map=map, progress=Progress())[""]


@pytest.mark.usefixtures("few_samples")
def test_a_pilot_tells_runs_and_time_for_each_target(tmp_path):
    done = _plan(tmp_path)
    assert done.exit_code == 0
    shown = " ".join(done.output.split())
    assert "target runs 90 % interval time" in shown
    for target in ("the mean of y within 2 % of it", "P\\(> 5\\) of y within 0.01"):
        assert re.search(rf"{target} \d[\d ]+ \d[\d ]+ to \d[\d ]+ s", shown)
    assert "--reuse" in shown


@pytest.mark.usefixtures("few_samples")
def test_the_runs_of_the_pilot_are_the_first_of_the_study(tmp_path):
    _plan(tmp_path, "--pilot", 300, "--until", "{ y = { mean = 1 } }")
    pilot = uqpen.open_archive(tmp_path / "pilot.nc")["runs/draws"].to_dataset()
    first = made(1_000).isel(run=slice(300))
    for name in ("x1", "x2", "y", "status"):
        assert np.array_equal(pilot[name].values, first[name].values)
    checks = verify(tmp_path / "pilot.nc", runs=None)
    assert {check.verdict.name for check in checks} == {"EQUAL"}


def test_a_study_without_independent_runs_gets_a_pilot_of_its_own():
    text = STUDY.partition("[designs.draws]")[0]
    pilot = pilot_study(uqpen.parse_study(text), 200)
    assert dict(pilot.designs) == {"pilot": uqpen.MonteCarlo(200)}


def test_a_study_of_runs_in_a_file_has_no_pilot(tmp_path):
    (tmp_path / "runs.csv").write_text("x,y\n1,2\n2,3\n")
    text = 'seed = 1\n[model]\ndata = "runs.csv"\noutputs = ["y"]\n'
    study = uqpen.parse_study(text, name="of_file", folder=tmp_path)
    reason = 'designs.pilot.kind: found "monte-carlo"; expected "data": all runs are those of'
    with pytest.raises(
        uqpen.StudyError, match=f"of_file: no pilot of independent runs can be made: {reason}"
    ):
        pilot_study(study, 200)


@pytest.mark.parametrize(
    ("until", "message"),
    [
        ('{ y = { mean = "x" } }', '--until: y.mean: found "x"'),
        ("{ z = { mean = 1 } }", "--until: z: found an unknown output"),
        ("{ y", "--until: found { y; expected { depth"),
        ("3", "--until: targets: found 3"),
    ],
)
def test_a_precision_that_makes_no_sense_is_reported_before_any_run(tmp_path, until, message):
    done = _plan(tmp_path, "--until", until)
    assert done.exit_code == 2
    assert message in done.output
    assert not (tmp_path / "pilot.nc").exists()


def test_a_precision_must_be_asked_for(tmp_path):
    done = _plan(tmp_path, study=STUDY.replace("until =", "#").replace("at_most =", "runs ="))
    assert done.exit_code == 2
    assert "no design of the study has until; expected --until '{ " in done.output


@pytest.fixture
def few_samples(monkeypatch):
    monkeypatch.setattr("uqpen.statistics.running_estimates._SAMPLES", 12)


@pytest.mark.usefixtures("few_samples")
class TestRequiredRuns:
    RULE = Precision({"y": {"mean": 0.05, "standard_deviation": "2 %", "exceeds": {"5": 0.01}}})

    def found(self, rule=RULE, runs=512):
        quantities = uqpen.parse_study(STUDY).quantities_of_interest
        return [*required_runs(made(runs), quantities, rule, np.random.default_rng(1))]

    def test_half_the_half_width_takes_four_times_the_runs(self):
        (once,) = self.found(Precision({"y": {"mean": 0.1}}))
        (twice,) = self.found(Precision({"y": {"mean": 0.05}}))
        assert np.array(twice[1:]) == pytest.approx(4 * np.array(once[1:]))

    def test_that_many_runs_are_as_precise_as_wanted(self):
        quantities = uqpen.parse_study(STUDY).quantities_of_interest
        for each, name in zip(self.found(), ("mean", "std", "exceedance"), strict=True):
            assert each.lower < each.runs < each.upper
            statistics = analyze(
                made(round(each.runs)), quantities, only=("moments", "exceedance")
            )["y"]
            _, lower, upper = statistics[name].values.ravel()
            std = float(statistics["std"][0])
            wanted = {"mean": 0.05, "std": 0.02 * std, "exceedance": 0.01}[name]
            assert (upper - lower) / 2 == pytest.approx(wanted, rel=0.08)

    def test_without_an_interval_nothing_is_known(self):
        (found,) = self.found(Precision({"y": {"standard_deviation": "2 %"}}), runs=100)
        assert np.isnan(found.runs)


@pytest.mark.usefixtures("few_samples")
class TestDiskUse:
    """What very many runs take on the disk; a limit of memory that few runs pass."""

    free = 1e13

    @pytest.fixture(autouse=True)
    def low_limit(self, monkeypatch):
        monkeypatch.setattr("uqpen.core.limits.RUNS_IN_MEMORY", 1_000)
        monkeypatch.setattr("shutil.disk_usage", lambda path: SimpleNamespace(free=self.free))

    def shown(self, folder, study=STUDY):
        until = '{ y = { mean = "0.001 %" } }'
        return " ".join(_plan(folder, "--until", until, study=study).output.split())

    def test_kept_runs_take_it_twice_and_statistics_alone_once(self, tmp_path):
        shown = self.shown(tmp_path)
        found = re.search(
            r"takes (\d+ GB) of disk, and twice that while the archive is written\."
            r' With keep = "statistics" in its design, it takes (\d+ GB) until the statistics'
            r" are there, and the archive ([\d.]+ [GM]B)\.",
            shown,
        )
        assert found, shown
        assert found[1] == found[2] != found[3]

    def test_a_study_that_keeps_no_run_takes_it_once(self, tmp_path):
        text = STUDY.partition("[designs.draws]")[0]
        text += '[designs.draws]\nkind = "monte-carlo"\nruns = 500\nkeep = "statistics"\n'
        shown = self.shown(tmp_path, text)
        assert re.search(r"until the statistics are there, and the archive [^,]*, as no run", shown)
        assert "twice" not in shown

    def test_a_full_disk_is_named(self, tmp_path, monkeypatch):
        monkeypatch.setattr(self, "free", 2e6)
        assert "is written. Only 2 MB are free. With keep" in self.shown(tmp_path)


NOISY = """
seed = 3
[model]
python = "model.py:run"
seed = "k"
inputs = { a = "1", k = "1" }
outputs = { y = "1" }
[inputs]
a = { uniform = { lower = 1, upper = 2 } }
[designs.draws]
kind = "monte-carlo"
runs = 1000
"""


@pytest.mark.usefixtures("few_samples")
def test_a_pilot_of_a_noisy_model_tells_what_repeats_buy(tmp_path):
    source = "import numpy as np\ndef run(a, k):\n    r = np.random.default_rng(k)\n"
    (tmp_path / "model.py").write_text(f'{source}    return {{"y": a + 0.3 * r.normal()}}\n')
    done = _plan(tmp_path, "--until", '{ y = { mean = "1 %" } }', "--pilot", "200", study=NOISY)
    assert done.exit_code == 0
    # 200 points at least, each with two runs.
    runs = uqpen.open_archive(tmp_path / "pilot.nc")["runs/draws"]
    assert runs.sizes["run"] == 400
    shown = " ".join(done.output.split())
    assert re.search(r"Noise of the model is [\d.]+ % .* of the variance of y", shown)
    assert "runs at a point points mean / sd noise share" in shown
    assert "the noise share with 3." in shown
