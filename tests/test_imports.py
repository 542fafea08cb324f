"""Packages that a command loads: what a user waits for before anything happens, counted."""

import subprocess
import sys

import pytest
from study_text import study_text

import uqpen

# Each takes 10 to 300 ms of a processor to load.
HEAVY = (
    *("chaospy", "distributed", "jinja2", "matplotlib", "multiprocessing", "netCDF4", "numba"),
    *("pandas", "rich"),
    *("SALib", "scipy.integrate", "scipy.interpolate", "scipy.linalg", "scipy.ndimage"),
    *("scipy.optimize", "scipy.sparse", "scipy.spatial", "scipy.special", "scipy.stats", "xarray"),
)
# xarray loads what it may need of multiprocessing.
TABLES = {"multiprocessing", "pandas", "rich", "xarray"}

# The packages that a command has loaded, how often Python has looked for garbage, and how many
# objects it never looks at. xarray loads Dask with half of SciPy wherever it is installed, which a
# plain installation is not.
PROBE = f"""
import gc, sys
searches = []
gc.callbacks.append(lambda phase, found: searches.append(phase))
sys.modules["dask"] = None
sys.argv[0] = "uqpen"
from uqpen.__main__ import main
try:
    main()
except SystemExit as left:
    assert not left.code, left.code
counts = len(searches) // 2, gc.get_freeze_count()
print(*counts, *(name for name in {HEAVY} if name in sys.modules), file=sys.stderr)
"""

STUDY = study_text(
    "ishigami",
    inputs={"x1": "0 ± 1", "x2": "0 ± 1", "x3": "0 ± 1"},
    designs={"plain": {"kind": "monte-carlo", "runs": 64}},
)

EXPANSION = """\
[surrogates.chaos]
kind = "polynomial-chaos"
design = "plain"
"""

ROD = study_text(
    "walker-anderson",
    inputs={
        "projectile_density": "17.5 g/cm^3",
        "projectile_yield_limit": "1.65 GPa",
        "projectile_length": "16 cm",
        "impact_velocity": "1400 m/s",
        "projectile_sound_speed": "3071 m/s",
        "target_density": "(2.5 ± 0.05) g/cm^3",
        "target_yield_limit": "400 MPa",
        "plasticity_radius": "100 mm",
        "crater_radius": "17 mm",
    },
    designs={"plain": {"kind": "monte-carlo", "runs": 16}},
)


def probed(folder, *arguments):
    """The searches for garbage, the objects left out of them, and the packages of a command."""
    done = subprocess.run(
        [sys.executable, "-c", PROBE, *arguments], cwd=folder, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    searches, kept, *packages = done.stderr.splitlines()[-1].split()
    return int(searches), int(kept), set(packages)


def loaded(folder, *arguments):
    return probed(folder, *arguments)[2]


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("imports")
    (folder / "study.toml").write_text(STUDY, encoding="utf-8")
    (folder / "expansion.toml").write_text(STUDY + EXPANSION, encoding="utf-8")
    allowed = {*TABLES, "netCDF4", "scipy.special"}
    assert loaded(folder, "study", "study.toml", "-o", "archive.nc") <= allowed
    return folder / "archive.nc"


@pytest.mark.parametrize(
    ("arguments", "allowed"),
    [
        (("--help",), set()),
        (("check", "expansion.toml"), {"rich", "scipy.special"}),
        (("show", "archive.nc"), {*TABLES, "netCDF4"}),
        (("report", "archive.nc"), {*TABLES, "jinja2", "netCDF4", "scipy.special"}),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_a_command_loads_what_it_needs_and_looks_for_no_garbage_in_it(archive, arguments, allowed):
    searches, kept, packages = probed(archive.parent, *arguments)
    assert packages <= allowed
    assert searches < 100
    assert arguments == ("--help",) or kept > 50_000


def test_to_check_inputs_of_any_kind_loads_no_other_statistics(tmp_path):
    (tmp_path / "model.py").write_text("def f(a, b, c, d, e, g, bolt):\n    return {'y': a}\n")
    text = """
        seed = 1
        [model]
        python = "model.py:f"
        inputs = { a = "1", b = "1", c = "1", d = "1", e = "1", g = "1" }
        labels = { bolt = ["M8", "M10"] }
        outputs = { y = "1" }
        [inputs]
        a = { poisson = { mean = 3 } }
        b = { gumbel = { mean = 3, std = 1 } }
        c.mixture = [
            { weight = 1, normal = { mean = 0, std = 1 } },
            { weight = 2, weibull = { scale = 1, shape = 2 } },
        ]
        d = { lognormal = { median = 2, quantile = [0.95, 3] } }
        e = "10 ± 5 %"
        g = { normal = { mean = [0, 1], std = 1 } }
        bolt = { choice = { labels = ["M8", "M10"] } }
        [designs.mc]
        kind = "monte-carlo"
        runs = 40
    """
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    packages = loaded(tmp_path, "check", "study.toml")
    assert packages.isdisjoint({"scipy.stats", "chaospy"}), packages


def test_functions_of_the_library_load_no_distributions_of_scipy():
    text = "import sys, uqpen; uqpen.run, uqpen.verify; print('scipy.stats' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


def test_a_study_of_the_rod_loads_numba_and_compiles_nothing_twice(tmp_path):
    (tmp_path / "study.toml").write_text(ROD, encoding="utf-8")
    uqpen.run(uqpen.load_study(tmp_path / "study.toml"))  # compiles it where nothing has done so
    assert loaded(tmp_path, "check", "study.toml") <= {"rich", "scipy.special"}
    compiler = {"numba", "scipy.linalg"}
    command = ("study", "study.toml", "-o", "archive.nc")
    assert loaded(tmp_path, *command) <= {*TABLES, *compiler, "netCDF4", "scipy.special"}
    probe = "from uqpen.models.rod_kernel import erode; sys.exit(bool(erode.stats.cache_misses))"
    subprocess.run([sys.executable, "-c", f"import sys; {probe}"], check=True)
