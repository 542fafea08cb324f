"""A design and a distribution from files of the user's own: in a study, its archive and checks."""

import importlib
import importlib.metadata
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import uqpen
from uqpen.checkpoints.make_archive import make_archive
from uqpen.core.errors import CheckpointError, ModelError, StudyError
from uqpen.designs.design import UnloadedDesign
from uqpen.execution import Progress
from uqpen.study.identity import run_fingerprint
from uqpen.testing import check_design, check_distribution
from uqpen.verification.archived_study import archived_study
from uqpen.verification.check_result import CheckOutcome
from uqpen.verification.verify import verify

ROOT = Path(__file__).parents[2]
PAGES = ROOT / "docs" / "extending"
DESIGNS, DISTRIBUTIONS = (
    re.findall(
        rf"```python\n(# my_{name}s.py.*?)```", (PAGES / f"{name}.md").read_text(), re.DOTALL
    )[0]
    for name in ("design", "distribution")
)
STUDY = """\
seed = 1
sensitivity = false
convergence = false
[model]
use = "ishigami"
[inputs]
x1 = { "my_distributions.py:Kumaraswamy" = { a = 2, b = 3, largest = 3 }, upper = 2.9 }
x2 = { uniform = { lower = -3, upper = 3 } }
x3 = 0
[designs.mine]
kind = "my_designs.py:Kronecker"
runs = 160
[designs.mc]
kind = "monte-carlo"
runs = 50
[surrogates.chaos]
kind = "polynomial-chaos"
design = "mine"
order = 3
"""
WITHOUT_SURROGATE = STUDY.partition("[surrogates.chaos]")[0]
MEMBERS = "my_designs.py:Kronecker, my_distributions.py:Kumaraswamy"


@pytest.fixture
def folder(tmp_path):
    """A folder with the files."""
    _write_members(tmp_path)
    return tmp_path


def _write_members(folder):
    (folder / "my_designs.py").write_text(DESIGNS)
    (folder / "my_distributions.py").write_text(DISTRIBUTIONS)


@pytest.fixture
def modules(folder, monkeypatch):
    """The modules, imported as a program or a test does."""
    monkeypatch.syspath_prepend(folder)
    names = ("my_designs", "my_distributions")
    yield tuple(importlib.import_module(name) for name in names)
    for name in names:
        sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def archived(tmp_path_factory):
    """The bytes of the study's archive."""
    folder = tmp_path_factory.mktemp("archived")
    _write_members(folder)
    uqpen.write(uqpen.run(uqpen.parse_study(STUDY, folder=folder)), folder / "a.nc")
    return (folder / "a.nc").read_bytes()


@pytest.fixture
def archive(archived, tmp_path):
    """The archive of the study, in a folder without the files."""
    (tmp_path / "a.nc").write_bytes(archived)
    return tmp_path / "a.nc"


def _checks(path, **options):
    return {check.name: check for check in verify(path, **options)}


def _kinds(path, **options):
    return _unequal(_checks(path, **options))


def _unequal(checks):
    verdicts = {(name, check.verdict.name) for name, check in checks.items()}
    return {each for each in verdicts if each[1] != "EQUAL"}


def test_they_keep_their_contracts(modules):
    check_design(modules[0].Kronecker(runs=1_600))
    check_distribution(modules[1].Kumaraswamy(a=2, b=3, largest=3))


def test_a_study_names_them(folder):
    study = uqpen.parse_study(WITHOUT_SURROGATE, folder=folder)
    assert study.designs["mine"].run_count(study.joint) == 160
    assert [file.path.name for file in study.files()] == ["my_distributions.py", "my_designs.py"]
    tree = uqpen.run(study)
    assert 0 < float(tree["runs/mine"]["x1"].min()) < float(tree["runs/mine"]["x1"].max()) < 2.9
    assert np.isfinite(tree["statistics/mine/y"]["mean"]).all()
    assert study.joint.random[0].description == (
        "my_distributions.py:Kumaraswamy: a 2, b 3, largest 3; at most 2.9"
    )


def test_their_files_decide_the_runs(folder):
    def fingerprints():
        study = uqpen.parse_study(STUDY, folder=folder)
        return [run_fingerprint(study, "", design) for design in ("mine", "mc")]

    before = fingerprints()
    assert before == fingerprints()
    with (folder / "my_designs.py").open("a") as file:
        file.write("# changed\n")
    of_mine, of_mc = fingerprints()
    changed = {key for key in of_mine if of_mine[key] != before[0][key]}
    assert changed == {"file my_designs.py"}
    assert of_mc == before[1]
    assert "file my_distributions.py" in of_mc


def test_runs_before_a_change_are_not_used(folder):
    class Interrupted(Progress):
        def advance(self, runs, failed, in_progress):
            raise KeyboardInterrupt

    def make(**options):
        make_archive(uqpen.parse_study(STUDY, folder=folder), folder / "a.nc", **options)

    with pytest.raises(KeyboardInterrupt):
        make(progress=Interrupted())
    with (folder / "my_designs.py").open("a") as file:
        file.write("# changed\n")
    with pytest.raises(CheckpointError, match=r"file my_designs\.py has changed"):
        make()


class TestArchive:
    def test_without_trust_it_names_the_code(self, archive):
        checks = _checks(archive, runs=None)
        assert _unequal(checks) == {("points", "UNCHECKED"), ("surrogates", "UNCHECKED")}
        assert checks["points"].text == (
            f"not checked: they are drawn by code that the archive names ({MEMBERS})"
        )
        assert "210 of 210 repeated" in checks["runs"].text

    def test_with_trust_all_is_repeated(self, archive):
        checks = _checks(archive, trust=True)
        assert {check.verdict for check in checks.values()} == {CheckOutcome.EQUAL}
        assert checks["points"].text == "the first round of mine, mc drawn again: bit-equal"

    @pytest.mark.slow
    def test_other_points_are_found(self, archive):
        groups = uqpen.open_archive(archive).to_dict()
        changed = groups["/runs/mine"].copy(deep=True)
        changed["x1"].values[3] += 0.01
        groups["/runs/mine"] = changed
        uqpen.write(type(uqpen.open_archive(archive)).from_dict(groups), archive)
        points = _checks(archive, trust=True)["points"]
        assert points.verdict is CheckOutcome.DIFFERENT
        assert "mine" in points.details[0]
        assert "x1" in points.details[0]

    @pytest.mark.slow
    def test_only_a_design_leaves_all_statistics_checked(self, folder):
        text = STUDY.replace('"my_distributions.py:Kumaraswamy"', "kumar").replace(
            "kumar = { a = 2, b = 3, largest = 3 }", "uniform = { lower = 0, upper = 3 }"
        )
        uqpen.write(uqpen.run(uqpen.parse_study(text, folder=folder)), folder / "b.nc")
        (folder / "my_designs.py").unlink()
        assert _kinds(folder / "b.nc") == {("points", "UNCHECKED")}

    def test_a_design_that_is_not_loaded_has_the_archived_sampling(self, archive):
        study = archived_study(uqpen.open_archive(archive), archive.parent, trust=False)
        design = study.designs["mine"]
        assert isinstance(design, UnloadedDesign)
        assert (design.sampling, design.runs) == ("stratified", 160)
        with pytest.raises(ModelError, match=r"my_designs.py:Kronecker is not loaded"):
            uqpen.run(study)

    @pytest.mark.slow
    def test_code_is_executed_only_with_trust(self, folder, command_line):
        trace = folder / "executed"
        for name in ("my_designs.py", "my_distributions.py"):
            touch = f"import pathlib\npathlib.Path({str(trace)!r}).touch()\n"
            (folder / name).write_text(touch + (folder / name).read_text())
        uqpen.write(uqpen.run(uqpen.parse_study(STUDY, folder=folder)), folder / "a.nc")
        trace.unlink()
        outcomes = [command_line(command, "a.nc") for command in ("show", "verify", "rerun")]
        assert [done.code for done in outcomes] == [0, 0, 2], outcomes
        assert MEMBERS in outcomes[-1].err
        assert not trace.exists()
        again = command_line("rerun", "a.nc", "--trust")
        assert again.code == 0, again.err
        assert trace.exists()
        assert (folder / "a_rerun.nc").read_bytes() == (folder / "a.nc").read_bytes()

    @pytest.mark.slow
    def test_workers_decide_nothing(self, folder, archived):
        study = uqpen.parse_study(STUDY, folder=folder)
        uqpen.make_archive(study, folder / "two.nc", workers=2)
        assert (folder / "two.nc").read_bytes() == archived


class TestPython:
    def _study(self, folder, design, distribution):
        return uqpen.Study(
            "ishigami",
            inputs={"x1": distribution, "x2": 1.0, "x3": uqpen.Uniform(-3, 3)},
            designs={"mine": design},
            sensitivity=False,
            seed=1,
            folder=folder,
        )

    @pytest.mark.slow
    def test_classes_of_the_folder_are_named(self, folder, modules):
        design = modules[0].Kronecker(runs=160)
        study = self._study(folder, design, modules[1].Kumaraswamy(2, 3, "3"))
        assert 'kind = "my_designs:Kronecker"' in study.to_toml()
        assert '"my_distributions:Kumaraswamy"' in study.to_toml()
        assert 'largest = "3"' in study.to_toml()
        assert len(list(study.files())) == 2
        tree = uqpen.run(study)
        again = uqpen.run(uqpen.parse_study(study.to_toml(), folder=folder))
        assert tree["runs/mine"].to_dataset().identical(again["runs/mine"].to_dataset())
        uqpen.write(tree, folder / "a.nc")
        assert _kinds(folder / "a.nc", trust=True) == set()

    @pytest.mark.slow
    def test_classes_of_no_file_are_objects(self, folder, modules, command_line):
        class Own(modules[0].Kronecker):  # type: ignore[name-defined,misc]
            pass

        class OwnLaw(modules[1].Kumaraswamy):  # type: ignore[name-defined,misc]
            pass

        study = self._study(folder, Own(160), OwnLaw(2, 3, "3"))
        assert "object = " in study.to_toml()
        warnings = []

        class Warned(Progress):
            def warn(self, text):
                warnings.append(text)

        uqpen.make_archive(study, folder / "a.nc", progress=Warned())
        assert len(warnings) == 2
        assert "is a Python object, so another version" in warnings[0]
        checks = _checks(folder / "a.nc", trust=True)
        assert _unequal(checks) == {("points", "UNCHECKED")}
        assert "an object of the Python program" in checks["points"].text
        refused = command_line("rerun", "a.nc", "--trust")
        assert refused.code == 2
        assert "its design or distribution is an object of a Python program" in refused.err
        (folder / "study.toml").write_text(study.to_toml())
        with pytest.raises(StudyError, match="a file cannot contain a Python object"):
            uqpen.load_study(folder / "study.toml")


FAILING = """
from dataclasses import dataclass
import numpy as np
from uqpen.core.sampling import Sampling
from uqpen.core.settings import count
from uqpen.designs.design import Design

@dataclass(frozen=True)
class Kronecker(Design):
    sampling = Sampling.INDEPENDENT
    runs: int = count()
    def run_count(self, joint): return self.runs
    def rounds(self, joint, stream):
        BODY
"""


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("yield 1 / 0", "ZeroDivisionError: division by zero"),
        ("yield 1", "it yields an object of class int, not a dataset"),
        ("yield joint.points(np.ones((2, 2)), {}).drop_vars('x2')", "its points lack x2"),
        ("return []", "AttributeError"),
        ("if 0: yield", "it yields no points"),
    ],
)
def test_what_a_design_does_wrong_is_reported(folder, body, reason):
    (folder / "my_designs.py").write_text(FAILING.replace("BODY", body))
    with pytest.raises(StudyError, match=f"the design Kronecker fails: {re.escape(reason)}"):
        uqpen.run(uqpen.parse_study(STUDY, folder=folder))


def test_a_distribution_that_raises_is_reported(folder):
    wrong = DISTRIBUTIONS.replace("return -np.expm1(self._log_sf(value))", "return 1 / 0")
    (folder / "my_distributions.py").write_text(wrong)
    with pytest.raises(StudyError, match="ZeroDivisionError"):
        uqpen.parse_study(STUDY, folder=folder)


WRONG = """
from dataclasses import dataclass
from uqpen.core.settings import count
from uqpen.designs.design import Design

class Thing: pass

class Loose(Design): pass

@dataclass(frozen=True)
class Partial(Design):
    runs: int = count()

@dataclass(frozen=True)
class Undeclared(Design):
    number: int
    sampling = rounds = run_count = None

@dataclass(frozen=True)
class Raising(Design):
    sampling = rounds = run_count = None
    runs: int = count()
    def check_settings(self): raise RuntimeError("no such day")
"""


@pytest.mark.parametrize(
    ("before", "after", "key", "found"),
    [
        ("my_designs.py", "no.py", "designs.mine.kind", 'there is no file "no.py"'),
        ("Kronecker", "Kron", "kind", 'has no class "Kron"; it defines Kronecker'),
        ("my_designs.py:Kronecker", "my_designs.py:", "kind", "is not of the form"),
        ("my_designs.py:Kronecker", "wrong.py:Thing", "kind", "does not derive from Design"),
        ("my_designs.py:Kronecker", "wrong.py:Loose", "kind", "is no frozen dataclass"),
        ("my_designs.py:Kronecker", "wrong.py:Partial", "kind", "lacks rounds, run_count"),
        ("my_designs.py:Kronecker", "wrong.py:Undeclared", "kind", "no settings: number"),
        ("my_designs.py:Kronecker", "wrong.py:Raising", "kind", "RuntimeError: no such day"),
        ("my_designs.py:Kronecker", "cronecker", "kind", '"cronecker"'),
        ("runs = 160", "runs = 161", "designs.mine.runs", "161"),
        ("runs = 160", "runs = 160\nruns_ = 1", "designs.mine.runs_", "an unknown key"),
        ("my_distributions.py:", "no.py:", "inputs.x1", 'there is no file "no.py"'),
        ("my_distributions.py:Kumaraswamy", "my_designs.py:Kronecker", "x1", "from Distribution"),
        ("a = 2", "a = -2", "Kumaraswamy", "-2"),
        ("a = 2", "c = 2", "Kumaraswamy", "nothing"),
        ('"my_distributions.py:Kumaraswamy"', "kumaraswamy", "x1", "an unknown distribution"),
    ],
)  # fmt: skip
def test_a_mistake_is_reported_before_any_run(folder, before, after, key, found):
    (folder / "wrong.py").write_text(WRONG)
    with pytest.raises(StudyError) as caught:
        uqpen.parse_study(STUDY.replace(before, after), folder=folder)
    (message, *_) = [each for each in caught.value.problems if found in each.found]
    assert key in message.key
    assert re.search(r"study\.toml:\d+ ", str(caught.value))
