"""Models with noise of their own: repeats of points, seeds, and runs that stand for one point."""

import re
import warnings

import numpy as np
import pytest
import xarray as xr

import uqpen
from uqpen.archive.read import read_group
from uqpen.core.errors import StudyError
from uqpen.core.model import Output
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.core.variables import Category
from uqpen.execution.processes import processes
from uqpen.report.sections.summary import summary_lines
from uqpen.results.noise import noise_lines
from uqpen.results.source_statistics import SourceStatistics
from uqpen.verification.run_pairs import RunPairs

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


@pytest.mark.parametrize("kind", [SHARED, {**SEEDED, "function": "vector"}])
def test_more_repeats_and_points_keep_seeded_runs(tmp_path, kind):
    more = {"more": "vectorized = true"} if kind["function"] == "vector" else {}
    kind = {**kind, "model": f"{kind['model']}\n{more.get('more', '')}"}
    few = made(tmp_path, repeats=2, **kind)
    many = made(tmp_path, points=8, repeats=4, **kind)
    fresh = made(tmp_path, "fresh.nc", points=8, repeats=4, **kind)
    xr.testing.assert_identical(many, fresh)
    at = (many.point < 6) & (many.repeat < 2)
    assert np.array_equal(many.y[at], few.y)


def test_repeats_of_a_block_are_those_of_all_points(tmp_path):
    made = study(tmp_path, points=10, repeats=3, **SEEDED)
    points = next(made.designs["mc"].rounds(made.joint, Stream(1, "points")))
    whole = points.read(0, 30)
    assert whole.point.values.tolist() == np.repeat(range(10), 3).tolist()
    xr.testing.assert_identical(points.read(7, 20), whole.isel(run=slice(7, 20)))


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
    with pytest.warns(RuntimeWarning, match="give its runs a seed, or declare noise = true"):
        first = made(tmp_path, function="noisy")
    assert np.array_equal(made(tmp_path, repeats=2, **NOISY).y[::2], first.y)


@pytest.mark.parametrize(
    ("parts", "found"),
    [
        ({"function": "noisy", "repeats": 2}, r"expected +noise = true in \[model\]"),
        ({"function": "noisy", "model": 'seed = "k"'}, "expected +an input of the model"),
        ({"function": "noisy", "model": "seed = []"}, "expected +an input of the model"),
        ({**SEEDED, "model": 'seed = "k"\nnoise = false'}, "expected +noise = true"),
        ({**NOISY, "more": "\n[failures]\nretry = 2"}, "draws from another distribution"),
    ],
)
def test_what_has_no_meaning_is_refused(tmp_path, parts, found):
    with pytest.raises(StudyError, match=found):
        study(tmp_path, **parts)


# Noticed


def grade(folder, code, kind="", runs=60, more="", **options):
    (folder / "model.py").write_text(code)
    model = "vectorized = true\n" * ("vectorized" in kind) + more
    text = STUDY.format(function="f", model=model, inputs="", points=runs, design="")
    study = uqpen.parse_study(f"sensitivity = false\nconvergence = false\n{text}", folder=folder)
    return uqpen.run(study, **options)


NOISES = {
    "numbers": """
import random
def f(a, b):
    return {"y": a + 1e-7 * random.random()}
""",
    "statuses": """
calls = []
def f(a, b):
    calls.append(a)
    return {"y": a} if len(calls) < 62 else {}
""",
    "vectorized, by the place in a batch": """
import numpy as np
def f(a, b):
    return {"y": a + np.random.default_rng(1).normal(size=a.shape)}
""",
}


@pytest.mark.parametrize("kind", NOISES)
def test_noise_at_every_point_is_seen(tmp_path, kind):
    code = NOISES[kind]
    with pytest.warns(RuntimeWarning, match="give its runs a seed, or declare noise = true"):
        tree = grade(tmp_path, code, kind)
    first = r"noise: 3 of 60 runs of mc were made again: 3 differ\b"
    assert re.match(first, tree.attrs["noise"])
    assert tree["runs/mc"].attrs["noise"] == "noise"
    pairs = tree["noise/mc"].to_dataset()
    assert pairs.y.dims == pairs.status.dims == ("run", "repeat")
    assert pairs.run.values.tolist() == [10, 30, 50]
    assert np.array_equal(pairs.y[:, 0], tree["runs/mc"].y[pairs.run])


def test_noise_beside_a_seed_is_told_and_no_undeclared_noise(tmp_path):
    code = "import random\ndef f(a, b, k):\n    return {'y': a + random.random()}\n"
    (tmp_path / "model.py").write_text(code)
    parts = {**SEEDED, "function": "f", "points": 60, "design": ""}
    with pytest.warns(RuntimeWarning, match="Something beside the seed drives the noise"):
        tree = uqpen.run(uqpen.parse_study(STUDY.format(**parts), folder=tmp_path))
    assert tree.attrs["noise"].startswith("noise: 3 of 60 runs of mc were made again with the same")
    assert "noise" not in tree["runs/mc"].attrs
    assert tree["noise/mc"].sizes["run"] == 3


@pytest.mark.parametrize(("size", "is_small"), [(1e-3, True), (0.3, False)])
def test_the_page_minds_noise_that_moves_figures(tmp_path, size, is_small):
    # Three pairs of free noise are alike once in some hundred times.
    code = "import random\nrng = random.Random(1)\n"
    code += f"def f(a, b):\n    return {{'y': a + {size} * rng.random()}}\n"
    with pytest.warns(RuntimeWarning):
        tree = grade(tmp_path, code)
    (line,) = (each for each in noise_lines(tree) if each.startswith("noise of y"))
    assert line.endswith("less than 0.1 % of the variance") == is_small
    minded = any("Noise of the model" in each for each in summary_lines(tree))
    assert minded != is_small


@pytest.mark.parametrize("more", ["", "noise = false\n"])
def test_few_runs_are_made_again_and_none_where_the_study_says_so(tmp_path, more):
    code = "def f(a, b):\n    with open(FILE, 'a') as file:\n        file.write('.')\n"
    code += "    return {'y': a}\n"
    tree = grade(tmp_path, code.replace("FILE", repr(str(tmp_path / "calls"))), more=more)
    # The trial run, and one in 20.
    assert len((tmp_path / "calls").read_text()) == (60 if more else 64)
    assert ("noise" in tree.attrs) == (not more)


@pytest.mark.slow
def test_noise_at_one_point_in_ten_is_seen_by_29_runs_in_95_percent(tmp_path):
    code = "import random\ndef f(a, b):\n    return {'y': a + (b < 0.1) * random.random()}\n"
    (tmp_path / "model.py").write_text(code)
    text = STUDY.format(function="f", model="", inputs="", points=580, design="")
    found = 0
    for seed in range(12):
        own = text.replace("seed = 5", f"seed = {seed}\nsensitivity = false\nconvergence = false")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = uqpen.run(uqpen.parse_study(own, folder=tmp_path))
        found += tree.attrs["noise"].startswith("noise: 29 of 580")
    # 11.4 are expected; the points decide, which have a seed.
    assert found >= 10


@pytest.mark.slow
def test_workers_that_share_a_generator_are_told(tmp_path):
    code = "import numpy as np\nrng = np.random.default_rng(0)\n"
    code += "def f(a, b):\n    return {'y': rng.normal()}\n"
    with processes(2) as pool, pytest.warns(RuntimeWarning, match="each process draws the same"):
        shared = grade(tmp_path, code, map=pool)
    with processes(2) as pool, pytest.warns(RuntimeWarning):
        own = grade(tmp_path, code.replace("default_rng(0)", "default_rng()"), map=pool)
    assert "each process" in shared.attrs["noise"]
    assert "each process" not in own.attrs["noise"]


@pytest.mark.slow
@pytest.mark.processor
@pytest.mark.parametrize("kind", [SEEDED, SHARED])
def test_seeded_runs_are_equal_to_the_byte_on_any_number_of_workers(tmp_path, kind):
    made(tmp_path, repeats=3, **kind)
    expected = (tmp_path / "noise.nc").read_bytes()
    uqpen.make_archive(study(tmp_path, repeats=3, **kind), tmp_path / "w.nc", workers=3)
    assert (tmp_path / "w.nc").read_bytes() == expected


# What figures are of


@pytest.mark.slow
def test_figures_say_what_they_are_of(tmp_path):
    more = (
        '[designs.blocks]\nkind = "saltelli"\nbase = 64\nnoise = true\n'
        '[surrogates.gp]\nkind = "gaussian-process"\ndesign = "mc"\n'
    )
    uqpen.make_archive(study(tmp_path, 100, more=more, **SEEDED), tmp_path / "a.nc")
    tree = uqpen.open_archive(tmp_path / "a.nc")

    def note(source, statistic):
        return str(SourceStatistics(tree).get(source, "y", statistic)[0].note.values)

    assert note("blocks", "total_order").startswith("what is left of the variance if all other")
    assert note("mc", "first_order").startswith("of the whole output, noise of the model included")
    assert note("gp", "first_order").startswith("of the whole output, noise of the model included")
    assert "of the whole" not in note("blocks", "mean_total_order")
    # What is missing is of nothing.
    assert note("gp", "shapley").startswith("the surrogate explains ")
    fit = tree["surrogates/gp/y/diagnostics"]
    assert float(fit["noise_std"]) == pytest.approx(1.0, rel=0.25)
    assert fit["noise_std"].attrs["units"] == "1"
    assert 0.4 < float(fit["noise_share"]) < 1


# Verified by the distribution


@pytest.mark.parametrize("shift", [0.0, 0.8])
def test_runs_that_cannot_be_repeated_are_verified_by_their_distribution(tmp_path, shift):
    uqpen.make_archive(study(tmp_path, points=150, **NOISY), tmp_path / "a.nc")
    model = (tmp_path / "model.py").read_text()
    (tmp_path / "model.py").write_text(model.replace("free.normal()", f"free.normal() + {shift}"))
    results = uqpen.verify(tmp_path / "a.nc", folder=tmp_path, trust=True)
    runs = next(each for each in results if each.name == "runs")
    assert runs.verdict == ("unlikely" if shift else "likely")
    assert ("unlikely (p = 0.0002)" in runs.text) == bool(shift)
    assert re.search(r"a shift of any output by 0\.\d+ of its standard dev", runs.details[-1])


def test_signs_are_flipped_run_by_run():
    # All outputs of a run are flipped together: equal outputs count once.
    rng = np.random.default_rng(1)
    one, other = rng.normal(size=(2, 40))
    p, status = [], {"status": ("run", np.zeros(40, dtype=np.int8))}
    for outputs in (1, 5):
        pairs = RunPairs()
        runs = [
            xr.Dataset({f"y{n}": ("run", y) for n in range(outputs)} | status) for y in (one, other)
        ]
        pairs.add("mc", *runs, [Output(f"y{n}", "1") for n in range(outputs)])
        p.append(pairs.result("40 of 40", np.random.default_rng(2)).text)
    assert p[0] == p[1]


def test_runs_that_fail_each_time_say_nothing_of_a_category():
    status = ("run", np.repeat(np.array([Status.OK, Status.FAILED], dtype=np.int8), 50))
    kinds = ("run", np.where(np.arange(100) < 50, np.arange(100) % 2, -1))
    pairs = RunPairs()
    made = xr.Dataset({"kind": kinds, "status": status})
    pairs.add(
        "mc", made, made, [Output("kind", "1", categories=(Category("a", "A"), Category("b", "B")))]
    )
    text = pairs.result("100 of 100", np.random.default_rng(2)).text
    assert text == "100 of 100: of the same distribution as far as they show (p = 1)"
