"""One run that raises, one that is not a number and one inadmissible point, in every design.

Every estimator says how many runs it used, and none turns to zero or to no number without a reason.
"""

from functools import cache

import numpy as np
import pytest

import uqpen
from uqpen.archive.estimates import interval_text
from uqpen.core.status import Status
from uqpen.designs import DESIGNS
from uqpen.execution import status_counts
from uqpen.results.source_statistics import SourceStatistics

pytestmark = pytest.mark.slow

MODEL = """
import math

calls = 0

def count(a, b, c):
    global calls
    calls += 1
    if calls == 4:
        raise ValueError("the fourth")
    if calls == 2:
        return {"y": math.nan}
    return {"y": 1 + a + 2 * b + a * c}
"""

STUDY = """
seed = 2
[model]
python = "model.py:count"
noise = false
inputs = {{ a = "1", b = "1", c = "1" }}
outputs = {{ y = "1" }}
[inputs]
a = {{ uniform = {{ lower = 0, upper = 1 }} }}
b = {{ uniform = {{ lower = 0, upper = 1 }} }}
c = {{ uniform = {{ lower = 0, upper = 1 }} }}
[constraints]
keep = ["a + b + c < {limit}"]
[outputs.y]
exceeds = [2.5]
[designs.it]
kind = "{kind}"
{settings}
"""

# What to make of each kind, and a limit that one of its points at least lies beyond.
SETTINGS = {
    "monte-carlo": ("runs = 400", 2.6),
    "latin-hypercube": ("runs = 400", 2.6),
    "sobol-sequence": ("runs = 512", 2.6),
    "halton": ("runs = 480", 2.6),
    "quadrature": ("order = 5", 2.8),
    "full-factorial": ("levels = 5", 2.6),
    "saltelli": ("base = 256", 2.6),
    "morris": ("trajectories = 30", 2.1),
    "one-at-a-time": ("step = 0.01", 1.504),
    "table": ('file = "points.csv"\nindependent = true', 2.6),
}

# Where nothing else can be said of what was lost, an estimate may have no value, for this reason.
ABSENT = ("failed", "no scatter", "does not vary", "runs lie on one side")


@pytest.fixture(scope="module")
def tree_of(tmp_path_factory):
    """The archive of a design by its kind, made when it is first asked for."""
    return cache(lambda kind: _made(kind, tmp_path_factory.mktemp(kind)))


def _made(kind, folder):
    (folder / "model.py").write_text(MODEL)
    points = np.random.default_rng(1).random((400, 3))
    rows = "\n".join(",".join(map(repr, map(float, row))) for row in points)
    (folder / "points.csv").write_text(f"a,b,c\n{rows}\n")
    settings, limit = SETTINGS[kind]
    text = STUDY.format(kind=kind, settings=settings, limit=limit)
    return uqpen.run(uqpen.parse_study(text, folder=folder))


# A multifidelity design needs several models: see `test_stand_ins`. Designs for a rare event
# have that in place of estimates of outputs: see `test_rare_events`, `test_importance_sampling`,
# `test_form` and `test_active_learning`. The designs of SALib have analyses of their own: see
# `test_salib_analyses`, and bounds over intervals a test of their own: see `test_interval_bounds`.
# What follows measurements has no estimates of outputs: see `test_least_squares`, `test_posterior`.
RARE_EVENTS = {"subset-simulation", "importance-sampling", "form", "active-learning"}
OF_SALIB = {kind for kind in DESIGNS if kind.startswith("salib:")}
MEASURED = {kind for kind in DESIGNS if kind.startswith(("least-squares", "posterior"))}
ELSEWHERE = {"data", "multifidelity", "interval-bounds"} | RARE_EVENTS | OF_SALIB | MEASURED


@pytest.mark.parametrize("kind", sorted(DESIGNS.keys() - ELSEWHERE))
def test_every_estimator_copes_with_what_is_lost(kind, tree_of):
    tree = tree_of(kind)
    runs = tree["runs/it"].to_dataset()
    counts = status_counts(runs)
    assert counts[Status.FAILED] == 1
    assert counts[Status.NOT_FINITE] == 1
    assert counts[Status.INADMISSIBLE] >= 1
    if kind == "saltelli":
        assert tree["statistics/it/y"]["first_order"].attrs["blocks_dropped"] >= 1
    view = SourceStatistics(tree)
    statistics, failures = view.statistics("it", "y"), view.failures("it")
    assert statistics
    for name, array in {**statistics, **failures}.items():
        # The sample within pick-freeze blocks may be whole where the blocks are not.
        if kind != "saltelli" and "runs" in array.attrs:
            assert array.attrs["runs_used"] < array.attrs["runs"]
        # A status that no run has is a probability of zero.
        if name != "probability":
            check(name, array)
    assert all("runs" in array.attrs for array in statistics.values())


def check(name, array):
    """No figure that is nothing, or not a number, without a reason."""
    if "bound" not in array.dims:
        return
    for at in np.ndindex(array.shape[:-1]):
        figure = array[at]
        value = float(figure.sel(bound="estimate"))
        if np.isnan(value):
            assert any(word in interval_text(figure, "note") for word in ABSENT), (name, figure)
    assert not (array.sel(bound="estimate") == 0).all(), name


def test_what_is_known_stays_right_within_its_interval(tree_of):
    # Losing a run for no reason that has to do with it biases nothing: the mean over the draws
    # below the limit, by a large sample.
    points = np.random.default_rng(2).random((4_000_000, 3))
    a, b, c = points[points.sum(axis=1) < 2.6].T
    exact = float(np.mean(1 + a + 2 * b + a * c))
    for kind in ("monte-carlo", "latin-hypercube", "sobol-sequence", "halton", "saltelli"):
        mean = tree_of(kind)["statistics/it/y"]["mean"].values
        assert mean[1] <= exact <= mean[2], kind
