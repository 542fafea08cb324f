"""Models with noise of their own: repeats of points, seeds, and runs that stand for one point."""

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.archive.read import read_group
from uqpen.core.errors import StudyError

MODEL = """
import random
import numpy as np
free = np.random.default_rng()

def seeded(a, b, k):
    assert type(k) is int
    noise = np.random.default_rng(k).normal()
    return {"y": a + b**2 + noise}

def shared(a, b):
    return {"y": a + b**2 + np.random.normal() + random.random()}

def noisy(a, b):
    return {"y": a + b**2 + free.normal()}

def vector(a, b, k):
    assert k.dtype.kind == "i"
    return {"y": a + b**2 + np.array([np.random.default_rng(each).normal() for each in k])}
"""

STUDY = """
seed = 5
[model]
python = "model.py:{function}"
{model}
inputs = {{ a = "1", b = "1"{inputs} }}
outputs = {{ y = "1" }}
[inputs]
a = {{ uniform = {{ lower = 0, upper = 2 }} }}
b = {{ uniform = {{ lower = 0, upper = 1 }} }}
[designs.mc]
kind = "monte-carlo"
runs = {points}
{design}
"""

SEEDED = {"function": "seeded", "model": 'seed = "k"', "inputs": ', k = "1"'}
SHARED = {"function": "shared", "model": 'seed = "global"'}
NOISY = {"function": "noisy", "model": "noise = true"}


def study(folder, points=6, repeats=1, more="", **parts):
    (folder / "model.py").write_text(MODEL)
    design = f"repeats = {repeats}\n" * (repeats > 1) + more
    parts = {"model": "", "inputs": "", **parts}
    text = STUDY.format(points=points, design=design, **parts)
    return uqpen.parse_study(text, folder=folder, name="noise")


def made(folder, name="noise.nc", **options):
    settings = {key: options.pop(key) for key in ("map", "reuse", "fresh") if key in options}
    tree = uqpen.make_archive(study(folder, **options), folder / name, **settings)
    return read_group(tree, "runs", "mc").load()


def test_repeats_are_rows(tmp_path):
    runs, once = made(tmp_path, repeats=3, **SEEDED), made(tmp_path, "once.nc", **SEEDED)
    assert runs.run.values.tolist() == list(range(18))
    assert runs.point.dims == runs.repeat.dims == ("run",)
    assert runs.point.values.tolist() == np.repeat(range(6), 3).tolist()
    assert runs.repeat.values.tolist() == [0, 1, 2] * 6
    assert np.array_equal(runs.a.values.reshape(6, 3)[:, 0], once.a)
    assert np.unique(runs.a).size == 6
    assert np.unique(runs.y).size == np.unique(runs.k).size == 18
    assert runs.k.dtype == np.int64
    assert 1 <= runs.k.values.min() < runs.k.values.max() < 2**31 - 1
    # Statistics are those of the first run at each point, but for those that know repeats.
    whole, first = (uqpen.open_archive(tmp_path / name) for name in ("noise.nc", "once.nc"))
    repeated, single = (each["statistics/mc/y"].to_dataset() for each in (whole, first))
    known = {"mean", "std", "first_order"}
    shared = [name for name in single.data_vars if name not in known]
    xr.testing.assert_identical(
        repeated[shared].drop_vars("input", errors="ignore"),
        single[shared].drop_vars("input", errors="ignore"),
    )
    assert whole["statistics/mc"].attrs["runs_spent"] == 18
    assert whole["statistics/mc"].attrs["repeats"] == 3


@pytest.mark.parametrize("kind", [SEEDED, SHARED, {**SEEDED, "function": "vector"}])
def test_more_repeats_and_points_keep_seeded_runs(tmp_path, kind):
    more = {"more": "vectorized = true"} if kind["function"] == "vector" else {}
    kind = {**kind, "model": f"{kind['model']}\n{more.get('more', '')}"}
    few = made(tmp_path, repeats=2, **kind)
    many = made(tmp_path, points=8, repeats=4, **kind)
    fresh = made(tmp_path, "fresh.nc", points=8, repeats=4, **kind)
    xr.testing.assert_identical(many, fresh)
    at = (many.point < 6) & (many.repeat < 2)
    assert np.array_equal(many.y[at], few.y)


def test_equal_points_of_a_design_have_other_seeds(tmp_path):
    (tmp_path / "points.csv").write_text("a [1],b [1]\n" + "1,0.5\n" * 3 + "2,0.5\n")
    text = STUDY.format(points=1, design="", **SEEDED).partition("[designs.mc]")[0]
    text += '[designs.mc]\nkind = "table"\nfile = "points.csv"\nrepeats = 2\n'
    (tmp_path / "model.py").write_text(MODEL)
    tree = uqpen.make_archive(uqpen.parse_study(text, folder=tmp_path), tmp_path / "table.nc")
    assert np.unique(read_group(tree, "runs", "mc").k).size == 8


def test_a_run_without_a_seed_stands_for_one_point_and_repeat(tmp_path):
    first = made(tmp_path, repeats=2, **NOISY)
    more = made(tmp_path, repeats=4, **NOISY)
    at = more.repeat < 2
    assert np.array_equal(more.y[at], first.y)
    assert np.unique(more.y).size == 24
    # As recorded once more, they are not those of another design.
    other = uqpen.parse_study(
        study(tmp_path, repeats=4, **NOISY).text.replace("designs.mc", "designs.other"),
        folder=tmp_path,
    )
    tree = uqpen.make_archive(other, tmp_path / "other.nc", reuse=[tmp_path / "noise.nc"])
    assert not np.isin(read_group(tree, "runs", "other").y, more.y).any()


def test_to_declare_noise_keeps_the_runs(tmp_path):
    first = made(tmp_path, function="noisy", recheck=False)
    assert np.array_equal(made(tmp_path, repeats=2, **NOISY).y[::2], first.y)


@pytest.mark.parametrize(
    ("parts", "found"),
    [
        ({"function": "noisy", "repeats": 2}, r"expected +noise = true in \[model\]"),
        ({"function": "noisy", "model": 'seed = "k"'}, "expected +an input of the model"),
        ({**SEEDED, "model": 'seed = "k"\nnoise = false'}, "expected +noise = true"),
        ({**NOISY, "more": "\n[failures]\nretry = 2"}, "draws from another distribution"),
    ],
)
def test_what_has_no_meaning_is_refused(tmp_path, parts, found):
    with pytest.raises(StudyError, match=found):
        study(tmp_path, **parts)
