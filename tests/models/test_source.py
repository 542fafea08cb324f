"""What tells one version of a model from another: built in, or the user's own."""

import subprocess
import sys
from pathlib import Path

import pytest
from study_text import study_text

import uqpen
from uqpen.archive.files import archived_files
from uqpen.archive.read import read_group
from uqpen.core.errors import ModelError
from uqpen.core.lookup import resolve
from uqpen.execution.processes import processes
from uqpen.models import MODELS
from uqpen.models import source as sources
from uqpen.models.surroundings import ModelFolder

FOLDER = Path(sources.__file__).parent

STUDY = study_text(
    {"python": "own.py:f", "inputs": {"x": "1"}, "outputs": {"y": "1"}},
    inputs={"x": "0 ± 1"},
    designs={"some": {"kind": "monte-carlo", "runs": 40}},
)


class TestBuiltIn:
    @pytest.mark.parametrize("name", list(MODELS))
    def test_identity_tells_version_and_source(self, name):
        identity = resolve(MODELS[name])().identity()
        assert identity["version"] == uqpen.__version__
        assert len(identity["source_sha256"]) == 64

    def test_the_source_is_the_same_whatever_has_been_imported(self):
        code = "from uqpen.models.source import source_sha256 as s;"
        module = MODELS["walker-anderson"].partition(":")[0]
        printed = f"print(s({module!r}));"
        code += f"{printed} import numba, {module}; s.cache_clear(); {printed}"
        done = subprocess.check_output([sys.executable, "-c", code], text=True)
        assert set(done.split()) == {sources.source_sha256.__wrapped__(module)}

    @pytest.mark.parametrize(
        ("model", "module", "belongs"),
        [
            ("walker-anderson", "walker_anderson", True),
            ("walker-anderson", "rod_kernel", True),
            ("walker-anderson", "rod_course", True),
            ("rigid-penetration", "rod_course", True),
            ("walker-anderson", "rod_models", False),
            ("walker-anderson", "source", False),
            ("rigid-penetration", "rod_and_target", True),
            ("rigid-penetration", "walker_anderson", False),
            ("ishigami", "rod_and_target", False),
        ],
    )
    def test_what_a_model_imports_belongs_to_it(
        self, model, module, belongs, tmp_path, monkeypatch
    ):
        home = MODELS[model].partition(":")[0]
        digest = sources.source_sha256.__wrapped__
        before = digest(home)
        for path in FOLDER.glob("*.py"):
            (tmp_path / path.name).write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
        monkeypatch.setattr(sources, "_FOLDER", tmp_path)
        assert digest(home) == before, "the ends of lines do not count"
        changed = tmp_path / f"{module}.py"
        changed.write_bytes(changed.read_bytes() + b"# another version\n")
        assert (digest(home) != before) == belongs

    @pytest.mark.parametrize(
        "line",
        [
            "import uqpen.models.rod_kernel",
            "import uqpen.models.rod_kernel as t",
            "from uqpen.models import rod_and_target, rod_kernel",
            "from uqpen.models.rod_kernel import ERROR",
            "from . import rod_kernel",
            "from .rod_kernel import ERROR",
            "def late():\n    from uqpen.models import (\n        rod_kernel,\n    )",
        ],
    )
    def test_imports_are_found_in_every_form(self, line):
        assert "rod_kernel" in set(sources._imported_modules(line.encode()))


class TestFilesThatChange:
    """A file that is edited while the study runs."""

    def test_what_was_imported_is_kept(self, tmp_path):
        source = "def f(x): return {'y': 2 * x}\n"
        (tmp_path / "own.py").write_text(source)
        study = uqpen.parse_study(STUDY, folder=tmp_path)
        (tmp_path / "own.py").write_text("def f(x): return {'y': 3 * x}\n")
        tree = uqpen.run(study)
        runs = tree["runs/some"]
        assert (runs["y"].values == 2 * runs["x"].values).all()
        (file,) = archived_files(read_group(tree, "files"))
        assert file.read() == source.encode()

    def test_a_table_is_kept_as_it_was_read(self, tmp_path):
        (tmp_path / "own.py").write_text("def f(x): return {'y': 2 * x}\n")
        (tmp_path / "points.csv").write_text("x\n1\n2\n")
        table = '[designs.some]\nkind = "table"\nfile = "points.csv"'
        study = uqpen.parse_study(STUDY.partition("[designs")[0] + table, folder=tmp_path)
        (tmp_path / "points.csv").write_text("x\n3\n4\n")
        tree = uqpen.run(study)
        assert tree["runs/some"]["x"].values.tolist() == [1, 2]
        assert archived_files(read_group(tree, "files"))[1].read() == b"x\n1\n2\n"

    @pytest.mark.slow
    def test_runs_of_two_versions_are_refused(self, tmp_path):
        (tmp_path / "own.py").write_text("def f(x): return {'y': 2 * x}\n")
        study = uqpen.parse_study(STUDY, folder=tmp_path)
        (tmp_path / "own.py").write_text("def f(x): return {'y': 3 * x}\n")
        expected = '"own.py" was changed while the study ran'
        with processes(1) as pool, pytest.raises(ModelError, match=expected):
            uqpen.run(study, map=pool)

    def test_what_another_process_has_imported_is_known_here(self, tmp_path):
        (tmp_path / "beside.py").write_text("a = 1\n")
        there, here = ModelFolder(tmp_path), ModelFolder(tmp_path)
        there.read(str(tmp_path / "beside.py"))
        here.add_reported(there.imported)
        assert here.imported == there.imported
        assert [file.path.name for file in here.files()] == ["beside.py"]
        (tmp_path / "beside.py").write_text("a = 2\n")
        here.add_reported(there.imported)
        with pytest.raises(ModelError, match=r'"beside\.py" was changed'):
            ModelFolder(tmp_path).add_reported(there.imported)
