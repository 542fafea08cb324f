"""Comparison of two states of a model; prints it as JSON.

A state that leaves traces has a process of its own. A process that has loaded all libraries forks
for each of them, which takes some milliseconds.
"""

from __future__ import annotations

import json
import os
import pickle
import runpy
import shutil
import sys
import tempfile
import warnings
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from changed_models import CHANGES

import uqpen
from uqpen.archive.files import FILES, files_group
from uqpen.checkpoints.identity import compare_models, compared_names
from uqpen.execution.batch import Batch
from uqpen.execution.evaluator import Evaluator, EvaluatorWork
from uqpen.study.identity import archived_identity, model_identity
from uqpen.study.study import ONLY_MODEL, ValidatedStudy
from uqpen.workflow import root_attributes

MODEL = 'python = "m.py:f"\ninputs = { x = "1" }\noutputs = { y = "1" }\n'
STUDY = '[model]\n{model}\n[inputs]\n{inputs}\n[designs.d]\nkind = "monte-carlo"\nruns = 1\n'
SOURCE = 'def f(x):\n    return {"y": x}\n'
INPUT = 'x = "2 ± 1"'
ISHIGAMI = "\n".join(
    f'x{each} = {{ uniform = {{ lower = "-1 rad", upper = "1 rad" }} }}' for each in (1, 2, 3)
)

Record = tuple[dict[str, Any], xr.Dataset]


def write(folder: Path, files: Mapping[str, str]) -> None:
    """Write files of a study; times of their writing are no part of a state."""
    for name, text in files.items():
        if name.startswith("$"):
            continue
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if text.startswith("<library>"):
            library = min(
                Path(np.__file__).parent.rglob("*.so"), key=lambda file: file.stat().st_size
            )
            path.write_bytes(library.read_bytes() + text.removeprefix("<library>").encode())
        elif text.startswith("<zip helper.py>"):
            with zipfile.ZipFile(path, "w") as archive:
                archive.writestr("helper.py", text.removeprefix("<zip helper.py>"))
        else:
            path.write_text(text)
            path.chmod(0o755)


def load(folder: Path, files: Mapping[str, str]) -> ValidatedStudy:
    """Load the study of a state in this process, which is of this state alone."""
    os.chdir(folder)
    sys.dont_write_bytecode = True
    for name, value in files.items():
        if name == "$PYTHONPATH":
            sys.path.insert(0, str((folder / value).resolve()))
        elif name.startswith("$") and name != "$model":
            os.environ[name[1:]] = value
    if "program.py" in files:
        sys.path.insert(0, str(folder))
        function = runpy.run_path("program.py", run_name="program")["f"]
        designs = {"d": uqpen.MonteCarlo(runs=1)}
        return uqpen.Study(
            model=function, inputs={"x": "2 ± 1"}, outputs={"y": "1"}, designs=designs, seed=1
        )
    own_class = 'use = "m.py:Own"'
    model = files.get("$model", own_class if "class Own" in files.get("m.py", "") else MODEL)
    inputs = ISHIGAMI if "ishigami" in model else INPUT
    text = "seed = 1\n" + STUDY.format(model=model, inputs=inputs)
    (folder / "study.toml").write_text(text)
    return uqpen.load_study(folder / "study.toml")


def record(folder: Path, files: Mapping[str, str]) -> Record:
    """Make one run, and return what an archive would say of the model."""
    study = load(folder, files)
    model = study.models[ONLY_MODEL].model
    names = ("x1", "x2", "x3") if "x1" in {each.name for each in model.inputs} else ("x",)
    batch = Batch(0, {name: np.array([2.0]) for name in names}, is_observed=True)
    result = EvaluatorWork(Evaluator(model))(batch)
    assert not result.results.status.any(), result.results.reasons
    model.record_files(result.results.files)
    return root_attributes(study), files_group(study.files(), study.folder)


def compare(folder: Path, files: Mapping[str, str], before: Record) -> dict[str, list[str]]:
    """Compare a model with that of a record."""
    study = load(folder, files)
    attributes, group = before
    groups = {"/": xr.Dataset(attrs=attributes)}
    tree = xr.DataTree.from_dict(groups | ({f"/{FILES}": group} if group.variables else {}))
    model = model_identity(study, ONLY_MODEL)
    found = compare_models(model, archived_identity(tree).models[ONLY_MODEL])
    _, uncompared = compared_names(model, found.dependencies)
    return {"changes": [*found.changes], "uncompared": [*uncompared]}


def load_libraries() -> None:
    """Load in this process what the states need, so that none of them has to."""
    with tempfile.TemporaryDirectory() as name:
        for files in ({"program.py": SOURCE}, {"m.py": SOURCE}):
            folder = Path(name).resolve()
            write(folder, files)
            called(compare, folder, files, called(record, folder, files))


def forked(task: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function in a fork of this process, and return what it returns."""
    reading, writing = os.pipe()
    process = os.fork()
    if not process:
        try:
            answer = pickle.dumps(task(*arguments))
        except BaseException as error:  # reported by the parent
            answer = pickle.dumps(RuntimeError(f"{type(error).__name__}: {error}"))
        with os.fdopen(writing, "wb") as stream:
            stream.write(answer)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as stream:
        answer = stream.read()
    os.waitpid(process, 0)
    found = pickle.loads(answer)
    if isinstance(found, RuntimeError):
        raise found
    return found


def called(task: Callable[..., Any], *arguments: Any) -> Any:
    """Call a function in this process, and leave its place and path as they were."""
    place, path = Path.cwd(), [*sys.path]
    try:
        return task(*arguments)
    finally:
        os.chdir(place)
        sys.path[:] = path


def main() -> None:
    """Print what is reported of each change, and where nothing has changed."""
    warnings.simplefilter("ignore")
    sys.modules.pop("changed_models", None)
    load_libraries()
    only = sys.argv[1:]
    found = {}
    for change in CHANGES:
        if only and change.name not in only:
            continue
        root = Path(tempfile.mkdtemp(prefix="states_")).resolve()
        folder, after = root / "study", {**change.before, **change.after}
        folder.mkdir()
        call = forked if change.leaves_traces else called
        try:
            write(folder, change.before)
            before = call(record, folder, change.before)
            unchanged = call(compare, folder, change.before, before)
            write(folder, change.after)
            changed = call(compare, folder, after, before)
            found[change.name] = {"unchanged": unchanged, "changed": changed}
        except RuntimeError as error:
            found[change.name] = {"error": str(error)}
        finally:
            shutil.rmtree(root)
    sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    main()
