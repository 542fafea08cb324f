"""``uqpen compare`` as its user meets it, and its archive."""

import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import netCDF4
import pandas as pd
import pytest
from study_text import study_text

from uqpen.checkpoints.folder import lock_archive

pytestmark = pytest.mark.slow

STUDY = study_text(
    "ishigami",
    title="Small [bold]study[/bold]",
    inputs={"x1": (-3, 3), "x2": (-3, 3), "x3": 1},
    outputs={"y": {"exceeds": [5]}},
    designs={
        "monte_carlo": {"kind": "monte-carlo", "runs": 100},
        "latin_hypercube": {"kind": "latin-hypercube", "runs": 100},
    },
)
# The group of the reference.
TRUTH = "statistics/reference"
MC = "statistics/monte_carlo"
SHORT = ("--budget", "16,32", "--repeats", "10", "--reference", "512")


@pytest.fixture
def uqpen(command_line, tmp_path):
    """The command line beside a small study."""
    (tmp_path / "small.toml").write_text(STUDY, encoding="utf-8")
    return command_line


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """An archive made by a process of its own."""
    folder = tmp_path_factory.mktemp("compared")
    (folder / "small.toml").write_text(STUDY, encoding="utf-8")
    command = [sys.executable, "-m", "uqpen", "compare", "small.toml", *SHORT]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return folder / "archives" / "small_compare.nc"


class TestCompare:
    @pytest.mark.processor
    def test_it_writes_an_archive_and_shows_it(self, uqpen, archive, monkeypatch):
        at_once = SimpleNamespace(monotonic=lambda: 1e6)  # no time passes between repeats
        monkeypatch.setattr("uqpen.cli.benchmark_screen.time", at_once)
        done = uqpen("compare", "small.toml", *SHORT)
        assert done.code == 0
        for word in ("Small [bold]study[/bold]", "slope", "replicated", "y, P(> 5)", "at 16"):
            assert word in done.out
        assert "archive: archives/small_compare.nc" in done.out
        assert max(map(len, done.out.splitlines())) <= 80
        assert uqpen("show", "archives/small_compare.nc").out in done.out
        # Another process wrote the same bytes.
        assert Path("archives/small_compare.nc").read_bytes() == archive.read_bytes()
        # It tells what is to come: two budgets for three methods, ten times.
        assert "1\u202f952 runs, 512 of them for the reference" in done.err
        repeats = [line for line in done.err.splitlines() if line.startswith("repeat")]
        assert repeats == ["repeat 1 of 10: about 1 s to go", "repeat 10 of 10: done"]

    @pytest.mark.parametrize(
        ("options", "complaint"),
        [
            (("--budget", "16,x"), '--budget: found "16,x"; expected whole numbers with commas'),
            (("--budget", "0"), "budget: found 0; expected whole numbers of runs from 8"),
            (("--repeats", "2"), "repeats: found 2; expected a whole number, at least 10"),
            (("-o", "small.toml"), "is not an archive"),
        ],
    )
    def test_a_mistake_leaves_with_2_before_any_run(self, uqpen, options, complaint):
        done = uqpen("compare", "small.toml", *options)
        assert (done.code, done.out) == (2, "")
        assert complaint in done.err
        assert "Traceback" not in done.err
        assert "runs, of which" not in done.err

    def test_two_at_once_do_not_make_the_same_archive(self, uqpen):
        with lock_archive(Path("one.nc").absolute()):
            done = uqpen("compare", "small.toml", *SHORT, "-o", "one.nc")
        assert done.code == 2
        assert "another process is making it right now" in done.err

    def test_several_models_are_refused(self, uqpen):
        models = '[models.one]\nuse = "ishigami"\n[models.two]\nuse = "ishigami"'
        text = STUDY.replace('[model]\nuse = "ishigami"', models)
        Path("two.toml").write_text(text, encoding="utf-8")
        done = uqpen("compare", "two.toml")
        assert done.code == 2
        assert "models: found 2 models, one, two; expected a single [model]" in done.err


class TestExport:
    def test_statistics_of_all_sources_are_listed(self, uqpen, archive):
        assert uqpen("export", str(archive), "-o", "table.csv").code == 0
        table = pd.read_csv("table.csv")
        sources = ["reference", "monte_carlo", "latin_hypercube", "latin_hypercube_replicated"]
        assert list(table["source"].unique()) == sources
        own = table[table["source"] == "monte_carlo"]
        (error,) = own[(own["statistic"] == "mean_error") & (own["budget"] == 32)].itertuples()
        found = json.loads(uqpen("show", str(archive), "--json").out)
        shown = found["outputs"]["y"]["mean"]["errors"]["monte_carlo"]["32"]
        assert (error.estimate, error.lower) == (shown["estimate"], shown["lower"])
        assert len(own[own["statistic"] == "mean"]) == 20, "two budgets, ten repeats"

    def test_it_has_no_runs_to_export(self, uqpen, archive):
        done = uqpen("export", str(archive), "--runs")
        assert (done.code, done.out) == (2, "")
        assert "is a benchmark of methods, which keeps no runs" in done.err


class TestNames:
    def test_a_design_may_have_the_name_of_the_reference(self, uqpen):
        text = STUDY.replace("monte_carlo", "reference").replace(
            "s.latin_hypercube", "s.reference_"
        )
        text += '[designs.reference__replicated]\nkind = "sobol-sequence"\nruns = 64\n'
        Path("names.toml").write_text(text, encoding="utf-8")
        shown = uqpen("compare", "names.toml", *SHORT)
        assert shown.code == 0
        found = json.loads(uqpen("show", "archives/names_compare.nc", "--json").out)
        names = ("reference_", "reference__replicated")
        replicated = (f"{name} replicated" for name in names)
        assert set(found["methods"]) == {"reference", *names, *replicated}
        assert found["reference_runs"] == 512


class TestShow:
    def test_json_is_for_scripts(self, uqpen, archive):
        found = json.loads(uqpen("show", str(archive), "--json").out)
        assert found["kind"] == "head-to-head"
        assert found["methods"]["latin_hypercube replicated"]["replicates"]["16"] == 8
        mean = found["outputs"]["y"]["mean"]
        error = mean["errors"]["monte_carlo"]["32"]
        assert error["lower"] < error["estimate"] < error["upper"]
        assert mean["verdicts"]["single"]["32"]["winner"] in found["methods"]
        assert "5" in found["outputs"]["y"]["exceedance"]
        assert found["outputs"]["y"]["quantiles"]["0.95"]["reference"]["interval"]

    @pytest.mark.parametrize(
        ("damage", "complaint"),
        [
            (lambda d: d["comparison"].renameGroup("y", "z"), f"/{MC}/z: no statistics"),
            (
                lambda d: d[f"{MC}/y"].renameVariable("runs", "walks"),
                f"/{MC}/y: no runs and replicates along budget",
            ),
            (lambda d: d[MC].delncattr("variants"), f"/{MC}: no runs_spent, source, variants"),
            (
                lambda d: d["comparison/y"].renameVariable("mean_lead", "mean_led"),
                "/comparison/y: no mean_lead",
            ),
            (
                lambda d: d["comparison/y"].delncattr("display_units"),
                "/comparison/y: no units of the output",
            ),
            (lambda d: d[f"{MC}/y"]["mean_error"].delncattr("interval_label"), "how its interval"),
            (
                lambda d: d[f"{TRUTH}/y"]["std"].delncattr("interval_label"),
                f"/{TRUTH}/y: std: does not say how its interval",
            ),
            (
                lambda d: d[f"{TRUTH}/y"]["quantile"].delncattr("runs_used"),
                f"/{TRUTH}/y: no runs_used of quantile",
            ),
            (
                lambda d: d[f"{TRUTH}/y"].renameVariable("threshold", "level"),
                f"/{TRUTH}/y: no threshold to tell its entries apart",
            ),
            (lambda d: d[f"{MC}/y"].renameVariable("mean", "mode"), f"/{MC}/y: no mean"),
            (lambda d: d.renameGroup("comparison", "contest"), "no comparison"),
            (lambda d: d[MC].renameGroup("y", "lost"), f"/{MC}/y: no statistics"),
            (lambda d: d[TRUTH].renameGroup("y", "lost"), f"/{TRUTH}/y: no statistics"),
            (lambda d: d[TRUTH].delncattr("runs_spent"), f"/{TRUTH}: no runs_spent"),
            (lambda d: d.setncattr("uqpen_kind", "other"), 'of kind "other", which this uqpen'),
        ],
    )
    def test_a_damaged_archive_leaves_with_2_and_says_where(
        self, uqpen, archive, damage, complaint
    ):
        Path("damaged.nc").write_bytes(archive.read_bytes())
        with netCDF4.Dataset("damaged.nc", "a") as dataset:
            damage(dataset)
        done = uqpen("show", "damaged.nc")
        assert done.code == 2
        assert "is damaged: " in done.err
        assert complaint in done.err
