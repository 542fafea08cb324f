"""A surrogate from a file of the user's own: in a study, its archive, its page and its checks."""

import importlib
import importlib.metadata
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import uqpen
from uqpen.archive.files import archived_files
from uqpen.cli.serve import make_offers
from uqpen.core.errors import ModelError, StudyError
from uqpen.figures.page import panels
from uqpen.results.json import archive_json
from uqpen.results.output_tables import output_tables
from uqpen.study.identity import run_fingerprint
from uqpen.testing import check_surrogate
from uqpen.verification.archived_study import refuse_user_defined_names
from uqpen.verification.check_result import CheckOutcome
from uqpen.verification.verify import verify

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "extending" / "surrogate.md").read_text(encoding="utf-8")
(KRIGING,) = re.findall(r"```python\n(# my_surrogates.py.*?)```", PAGE, re.DOTALL)
STUDY = """\
seed = 1
[model]
use = "ishigami"
[inputs]
x1 = { uniform = { lower = -2, upper = 2 } }
x2 = 0.3
x3 = 0.5
[outputs.y]
exceeds = ["5"]
[designs.training]
kind = "latin-hypercube"
runs = 20
replicates = 1
[designs.fresh]
kind = "monte-carlo"
runs = 30
[surrogates.gp]
kind = "my_surrogates.py:Kriging"
design = "training"
check = "fresh"
[surrogates.chaos]
kind = "polynomial-chaos"
design = "training"
"""


@pytest.fixture
def folder(tmp_path):
    """A folder with the file."""
    (tmp_path / "my_surrogates.py").write_text(KRIGING)
    return tmp_path


@pytest.fixture
def module(folder, monkeypatch):
    """The module, imported as a program or a test does."""
    monkeypatch.syspath_prepend(folder)
    yield importlib.import_module("my_surrogates")
    sys.modules.pop("my_surrogates", None)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """An archive of the study, in a folder without the file, whose code leaves a trace."""
    folder = tmp_path_factory.mktemp("surrogates")
    touch = f"import pathlib\npathlib.Path({str(folder / 'executed')!r}).touch()\n"
    (folder / "my_surrogates.py").write_text(touch + KRIGING)
    uqpen.write(uqpen.run(uqpen.parse_study(STUDY, folder=folder)), folder / "a.nc")
    (folder / "my_surrogates.py").unlink()
    return folder / "a.nc"


@pytest.fixture
def tree(written):
    return uqpen.open_archive(written)


def _checks(path, **options):
    return {check.name: check for check in verify(path, **options)}


ONLY_IT = "sensitivity = false\n" + STUDY.partition("[surrogates.chaos]")[0]


def _run(folder, text=ONLY_IT):
    return uqpen.run(uqpen.parse_study(text, folder=folder))


def test_it_keeps_its_contract(module):
    check_surrogate(module.Kriging(design="training"))


def test_its_file_decides_no_run(folder):
    def fingerprint():
        return run_fingerprint(uqpen.parse_study(STUDY, folder=folder), "", "training")

    before = fingerprint()
    with (folder / "my_surrogates.py").open("a") as file:
        file.write("# changed\n")
    assert fingerprint() == before


class TestShown:
    """Whatever shows an archive shows it, from what the archive says of it."""

    def test_in_the_archive(self, tree):
        group = tree["surrogates/gp"]
        assert group.attrs["kind"] == "my_surrogates.py:Kriging"
        assert group["y/diagnostics"]["correlation_length"].attrs["units"] == "1"
        (file,) = archived_files(tree["files"].to_dataset())
        assert file.name == "my_surrogates.py"
        assert file.read().decode().endswith(KRIGING)
        estimators = {
            name: tree["statistics/gp/y"][name].attrs["estimator"]
            for name in ("mean", "first_order")
        }
        assert estimators["mean"].startswith("by sampling the surrogate at")
        assert "pairs of draws" in estimators["first_order"]

    def test_its_estimates_are_near_those_of_an_expansion(self, tree):
        one, other = (tree[f"statistics/{name}/y"] for name in ("gp", "chaos"))
        for statistic in ("mean", "std", "first_order", "quantile"):
            alone = f"{statistic}_surrogate_estimate"
            found, known = (each[alone].values for each in (one, other))
            np.testing.assert_allclose(found, known, atol=0.05, err_msg=statistic)

    def test_in_tables(self, tree):
        (table,) = (each for each in output_tables(tree) if each.title.startswith("gp: fit"))
        assert table.columns == [
            "correlation length, in std of inputs",
            "check runs",
            "Q², check runs",
            "check runs within 2 std",
        ]
        ((output, cells),) = table.rows
        assert (output, cells[1]) == ("y", "30")
        assert cells[2] == "> 0.99999" or float(cells[2]) > 0.95

    def test_in_json(self, tree):
        found = json.loads(json.dumps(archive_json(tree)))["surrogates"]
        fit = found["gp"]["outputs"]["y"]["fit"]
        assert fit["check_runs"] == 30
        assert {"correlation_length", "check_q2_of_output", "training_minimum"} < fit.keys()
        assert "field_length" not in fit
        titles = found["gp"]["outputs"]["y"]["fit_titles"]
        assert titles["check_within_2_std"]["long_name"] == "check runs within 2 std"
        assert found["gp"]["made_of"]["kind"] == "my_surrogates.py:Kriging"
        assert "fit_titles" not in found["chaos"]["outputs"]["y"]

    def test_on_the_page(self, tree, tmp_path):
        uqpen.write_report(tree, tmp_path / "a.html")
        page = (tmp_path / "a.html").read_text(encoding="utf-8")
        assert "correlation length, in std of inputs" in page
        assert "my_surrogates.py:Kriging is not executed here, so no predictions are shown." in page
        assert "gp: y" in page  # its estimates, as runs correct them

    def test_its_predictions_are_in_no_figure(self, tree):
        titles = [panel.title for panel in panels(tree, "surrogate")]
        assert len(titles) == 1
        assert "y by chaos" in titles[0]


class TestChecked:
    def test_without_trust_no_code_is_executed_and_it_is_named(self, written, tmp_path):
        trace = written.parent / "executed"
        trace.unlink(missing_ok=True)
        tree = uqpen.open_archive(written)
        assert list(output_tables(tree))
        uqpen.write_report(tree, tmp_path / "a.html")
        checks = _checks(written)
        assert {name for name, each in checks.items() if each.verdict.name != "EQUAL"} == {
            "surrogates"
        }
        assert checks["surrogates"].text == (
            "not checked: gp; it follows from code that the archive names "
            "(my_surrogates.py:Kriging)"
        )
        with pytest.raises(ModelError, match=r"code that it names: my_surrogates\.py:Kriging"):
            refuse_user_defined_names(tree, written, trust=False)
        assert not trace.exists()
        refuse_user_defined_names(tree, written, trust=True)

    def test_with_trust_all_is_repeated(self, written):
        checks = _checks(written, trust=True).values()
        assert {check.verdict for check in checks} == {CheckOutcome.EQUAL}

    def test_it_is_served_only_with_trust(self, written):
        with pytest.raises(ModelError, match="gp follows from code that the archive names"):
            make_offers(f"{written}:gp")
        (offer,) = make_offers(f"{written}:gp", trust=True)
        inputs = {name: np.array([0.5]) for name in ("x1", "x2", "x3")}
        found = offer.model.evaluate(inputs).outputs["y"]
        expected = np.sin(0.5) + 7 * np.sin(0.3) ** 2 + 0.1 * 0.5**4 * np.sin(0.5)
        assert found == pytest.approx(expected, abs=0.1)


class TestPython:
    def _study(self, folder, surrogate):
        return uqpen.Study(
            "ishigami",
            inputs={"x1": uqpen.Uniform(-2, 2), "x2": 0.3, "x3": 0.5},
            designs={"training": uqpen.LatinHypercube(20, 1), "fresh": uqpen.MonteCarlo(30)},
            surrogates={"gp": surrogate},
            sensitivity=False,
            seed=1,
            folder=folder,
        )

    def test_a_class_of_the_folder_is_named(self, folder, module):
        study = self._study(folder, module.Kriging(design="training", nugget=1e-6))
        assert 'kind = "my_surrogates:Kriging"' in study.to_toml()
        assert "nugget = 1e-6" in study.to_toml().replace("1e-06", "1e-6")
        found, again = (
            each["surrogates/gp/y"].to_dataset()
            for each in (uqpen.run(study), _run(folder, study.to_toml()))
        )
        assert found.identical(again)

    def test_a_class_of_no_file_is_an_object(self, folder, module):
        class Own(module.Kriging):  # type: ignore[name-defined,misc]
            pass

        own = Own(design="training")
        study = self._study(folder, own)
        assert "object = " in study.to_toml()
        uqpen.make_archive(study, folder / "a.nc")
        checks = _checks(folder / "a.nc", trust=True)
        assert checks["statistics"].verdict is CheckOutcome.EQUAL
        text = checks["surrogates"].text
        assert "is an object of the Python program that made the archive" in text
        results = uqpen.verify(folder / "a.nc", surrogates={"gp": own})
        assert {result.verdict for result in results} == {CheckOutcome.EQUAL}
        with pytest.raises(ModelError, match="its surrogate is an object of a Python program"):
            refuse_user_defined_names(uqpen.open_archive(folder / "a.nc"), folder, trust=True)
        (folder / "study.toml").write_text(study.to_toml())
        with pytest.raises(StudyError, match="a file cannot contain a Python object"):
            uqpen.load_study(folder / "study.toml")


FAILING = """
from dataclasses import dataclass
import numpy as np
from uqpen.surrogates.fitted_surrogate import Prediction
from uqpen.surrogates.diagnostics import Diagnostic
from uqpen.surrogates.separate_fits import OutputFit
from uqpen.surrogates.output_surrogate import OutputSurrogate

@dataclass(frozen=True, eq=False)
class Fit(OutputFit):
    kept: object = 0.0
    def predict(self, points):
        PREDICT
    def diagnostics(self):
        yield Diagnostic("DIAGNOSTIC", 1.0, "a number")

@dataclass(frozen=True)
class Kriging(OutputSurrogate):
    output_fit = Fit
    def fit_output(self, points, values, rng):
        FIT
"""


@pytest.mark.parametrize(
    ("fit", "predict", "diagnostic", "reason"),
    [
        ("return 1 / 0", "", "d", "its fit fails: ZeroDivisionError: division by zero"),
        ("import sys; sys.exit(3)", "", "d", "its fit fails: SystemExit: 3"),
        ("return 'too rough'", "", "d", "too rough"),
        ("return 1", "", "d",
         "its fit fails: TypeError: fit_output returns an object of class int, not Fit"),
        ("return Fit()", "return points", "d", "predict returns an object of class ndarray"),
        ("return Fit()", "return Prediction(points)", "d", "a mean of shape (20, 1), not (20,)"),
        ("return Fit()", "return Prediction(points[:, 0], -np.ones(len(points)))", "d",
         "a std that is negative or no number"),
        ("return Fit()", "return Prediction(points[:, 0] * np.nan)", "d", "is not finite"),
        ("return Fit({})", "return Prediction(points[:, 0])", "d", "Fit.kept is an object of"),
        ("return Fit()", "return Prediction(points[:, 0])", "a b", "a name and a title, not 'a b'"),
        ("return Fit()", "return Prediction(points[:, 0])", "check_runs", "names of their own"),
    ],
)  # fmt: skip
def test_a_fit_that_fails_is_a_reason(folder, fit, predict, diagnostic, reason):
    text = FAILING.replace("FIT", fit).replace("PREDICT", predict or "pass")
    (folder / "my_surrogates.py").write_text(text.replace("DIAGNOSTIC", diagnostic))
    tree = _run(folder)
    assert reason in tree["surrogates/gp/y"].attrs["not_fitted"]
    assert np.isfinite(tree["statistics/training/y"]["mean"]).any()
    (table,) = (each for each in output_tables(tree) if each.title.startswith("gp: fit"))
    assert table.rows[0][1][0].startswith("not fitted")


def test_predictions_that_fail_later_are_a_reason(folder):
    predict = "return Prediction(points[: 50 if len(points) > 30 else None, 0])"
    text = FAILING.replace("FIT", "return Fit()").replace("PREDICT", predict)
    (folder / "my_surrogates.py").write_text(text.replace("DIAGNOSTIC", "d"))
    reason = _run(folder)["surrogates/gp/y"].attrs["not_fitted"]
    assert reason == (
        "its predictions fail: ValueError: predict returns a mean of shape (50,), not (4096,)"
    )


def test_a_fit_of_the_whole_that_fails_is_a_reason(folder):
    settings = KRIGING.partition("\n\ndef correlations")[0]
    text = f"{settings}\n    def fit(self, *arguments):\n        return None\n"
    (folder / "my_surrogates.py").write_text(text)
    tree = _run(folder)
    reason = "its fit fails: it returns an object of class NoneType, not a FittedSurrogate"
    assert tree["surrogates/gp/y"].attrs["not_fitted"] == reason
    assert tree["surrogates/gp"].attrs["runs_used"] == 20


@pytest.mark.parametrize(
    ("before", "after", "key", "found"),
    [
        ("py:Kriging", "py:KrigingFit", "kind", "does not derive from Surrogate"),
        ("my_surrogates.py:Kriging", "krging", "kind", '"krging"'),
        ('design = "training"\ncheck', 'design = "trainng"\ncheck', "gp.design", '"trainng"'),
        ('check = "fresh"', "nugget = -1", "surrogates.gp.nugget", "-1"),
    ],
)
def test_a_mistake_is_reported_before_any_run(folder, before, after, key, found):
    with pytest.raises(StudyError) as caught:
        uqpen.parse_study(STUDY.replace(before, after), folder=folder)
    (message, *_) = [each for each in caught.value.problems if found in each.found]
    assert key in message.key
    assert re.search(r"study\.toml:\d+ ", str(caught.value))


def test_an_installed_package_adds_names(folder, module, monkeypatch):
    point = importlib.metadata.EntryPoint("kriging", "my_surrogates:Kriging", "uqpen.surrogates")
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda group: [point])
    study = uqpen.parse_study(
        ONLY_IT.replace("my_surrogates.py:Kriging", "kriging"), folder=folder / "none", trust=False
    )
    uqpen.write(uqpen.run(study), folder / "a.nc")
    assert uqpen.open_archive(folder / "a.nc")["surrogates/gp"].attrs["kind"] == "kriging"
    (panel,) = panels(uqpen.open_archive(folder / "a.nc"), "surrogate", source="gp")
    assert "y by gp" in panel.title
