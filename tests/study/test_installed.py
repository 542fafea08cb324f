"""Members of each family from an installed package, and packages that cannot be imported."""

import importlib
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.core.errors import ModelError, StudyError
from uqpen.core.lookup import package_version
from uqpen.study.identity import run_fingerprint
from uqpen.surrogates.archived_surrogate import restore_surrogate
from uqpen.verification.check_result import CheckOutcome

PAGES = Path(__file__).parents[2] / "docs" / "extending"
DESIGN, DISTRIBUTION, MODEL, STATISTIC = (
    re.findall(r"```python\n(.*?)```", (PAGES / f"{name}.md").read_text(), re.DOTALL)[0]
    for name in ("design", "distribution", "model", "statistic")
)
COPULA = """
from dataclasses import dataclass
from uqpen.distributions.copulas import FrankCopula

@dataclass(frozen=True)
class Own(FrankCopula):
    pass
"""
SOURCE = "\n".join([DESIGN, DISTRIBUTION, MODEL, STATISTIC, COPULA])
POINTS = """\
[uqpen.designs]
kronecker = uqpen_test_members:Kronecker
[uqpen.distributions]
kumaraswamy = uqpen_test_members:Kumaraswamy
[uqpen.models]
spring = uqpen_test_members:Spring
[uqpen.analyses]
interquartile-range = uqpen_test_members:interquartile_range
[uqpen.copulas]
own = uqpen_test_members:Own
"""
STUDY = """\
seed = 1
analyses = ["interquartile-range"]
[model]
use = "spring"
hardening = 1.5
[inputs]
mass = { kumaraswamy = { a = 2, b = 3, largest = "20 kg" } }
stiffness = { uniform = { lower = "1 N/mm", upper = "2 N/mm" } }
[dependence]
copula = "own"
inputs = ["mass", "stiffness"]
theta = 2
[designs.mine]
kind = "kronecker"
runs = 160
"""
# The names in the study, and their places in it.
FAMILIES = {
    "designs": ("kronecker", "designs.mine.kind"),
    "distributions": ("kumaraswamy", "inputs.mass"),
    "models": ("spring", "model.use"),
    "analyses": ("interquartile-range", "analyses[0]"),
    "copulas": ("own", "dependence.copula"),
}


def test_a_study_names_them(install, tmp_path):
    install("members", SOURCE, POINTS)
    study = uqpen.parse_study(STUDY, folder=tmp_path / "none")
    tree = uqpen.run(study)
    assert np.isfinite(tree["statistics/mine/deflection"]["interquartile_range"][..., 0]).all()
    assert list(study.files()) == [], "an archive keeps no file of a package"
    assert tree.attrs["model_name"] == "spring"
    assert tree.attrs["model_version"] == "1.2"
    assert run_fingerprint(study, "", "mine")["model version"] == "1.2"


def test_the_version_of_a_package_decides_the_runs(install, tmp_path):
    def fingerprint():
        study = uqpen.parse_study(STUDY, folder=tmp_path / "none")
        return run_fingerprint(study, "", "mine")

    site = install("members", SOURCE, POINTS)
    before = fingerprint()
    metadata = site / "uqpen_test_members-1.2.dist-info" / "METADATA"
    metadata.write_text(metadata.read_text().replace("1.2", "1.3"))
    importlib.invalidate_caches()
    package_version.cache_clear()
    upgraded = fingerprint()
    changed = {key for key in upgraded if upgraded[key] != before[key]}
    assert changed == {
        "model version",
        "design mine version",
        "dependence version",
        "distribution of mass version",
    }
    install("members", f"{SOURCE}# edited\n", POINTS)
    package_version.cache_clear()
    edited = fingerprint()
    changed = {key for key in edited if edited[key] != before[key]}
    assert "design mine source_sha256" in changed
    package_version.cache_clear()


def test_they_need_no_trust(install, tmp_path):
    install("members", SOURCE, POINTS)
    uqpen.write(uqpen.run(uqpen.parse_study(STUDY, folder=tmp_path)), tmp_path / "a.nc")
    checks = uqpen.verify(tmp_path / "a.nc")
    assert {check.verdict for check in checks} == {CheckOutcome.EQUAL}
    assert "runs" in {check.name for check in checks}


def test_what_stands_beside_a_study_does_not_replace_a_package(install, tmp_path):
    """An archive could contain a file by the name of an installed module."""
    install("members", SOURCE, POINTS)
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / "uqpen_test_members.py").write_text("raise RuntimeError('executed')\n")
    assert uqpen.parse_study(STUDY, folder=folder, trust=False).unloaded_members == []


@pytest.mark.parametrize("family", FAMILIES)
def test_a_name_of_no_member_is_told_with_its_line(install, tmp_path, family):
    name, key = FAMILIES[family]
    thing = "thing" if family == "analyses" else "Thing"
    section = f"[uqpen.{family}]\n"
    points = POINTS.replace(section, f"{section}{name}-3 = uqpen_test_members:{thing}\n")
    install("members", f"{SOURCE}\nclass Thing: pass\nthing = 1\n", points)
    install("broken", "import numpi\n", f"{section}{name}-2 = uqpen_test_broken:Thing\n")
    for ending, found in {
        "-2": f'^the installed package "uqpen-test-broken", which provides "{name}-2", cannot be '
        "loaded: ModuleNotFoundError: No module named 'numpi'$",
        "-3": "does not derive from|is an object of class int",
        "z": f"{name}z|an unknown distribution",
    }.items():
        text = STUDY.replace(f'"{name}"', f'"{name}{ending}"')
        text = text.replace(f"{name} = ", f"{name}{ending} = ")
        with pytest.raises(StudyError) as raised:
            uqpen.parse_study(text, folder=tmp_path)
        problem = raised.value.problems[0]
        assert problem.key.startswith(key)
        assert re.search(found, problem.found)
        assert re.search(r"study\.toml:\d+ ", str(raised.value))


def test_a_study_without_them_loads_none(install, tmp_path):
    install("members", f"raise RuntimeError\n{SOURCE}", POINTS)
    text = (
        'seed = 1\nmodel.use = "ishigami"\n[inputs]\nx1 = 1\nx2 = 1\n'
        'x3 = { uniform = { lower = 0, upper = 1 } }\n[designs.mc]\nkind = "monte-carlo"\nruns = 9'
    )
    assert uqpen.parse_study(text, folder=tmp_path).runs == 9


def test_a_broken_package_of_an_archived_surrogate_is_named(install, tmp_path):
    tree = xr.DataTree(xr.Dataset(attrs={"kind": "kriging"}))
    install("broken", "1 / 0\n", "[uqpen.surrogates]\nkriging = uqpen_test_broken:Thing\n")
    with pytest.raises(ModelError, match='"uqpen-test-broken", which provides "kriging"'):
        restore_surrogate(tree, "gp")
