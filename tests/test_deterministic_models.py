"""Models that give the same result each time: none of them is called noisy, whatever it does."""

import warnings

import pytest

import uqpen

# Bodies of a function of numbers a and b, which return y.
OF_NUMBERS = {
    "a sum": "return a + b**2",
    "single precision": "return np.float32(a) * np.float32(b)",
    "a root": "return optimize.brentq(lambda x: x**3 + a * x - b, -10, 10)",
    "a minimum": "return optimize.minimize(lambda x: (x[0] - a)**2 + x[0]**4, [b]).x[0]",
    "a linear system": "return np.linalg.solve(A + a * np.eye(30), A[0] * b)[3]",
    "recursion": "return a if b < 1e-3 else f(a + b, b / 2)['y']",
    "a cache": "return cached(a) + b",
    "a counter": "COUNTER.append(1); return a",
    "an array's seed": "return a + np.random.default_rng(3).normal()",
    "a set": "return sum({a, b, a + b, 1e-3})",
    "an error": "return 1 / a if a > 1 else math.sqrt(-a)",
    "no number": "return math.nan if a < 1 else b",
    "a warning": "warnings.warn('careful'); return a",
    "threads in order": "return sum(POOL.map(lambda x: x * a, range(9)))",
    "threads in any order": "return unordered(a, b)",
}
# The same of arrays.
OF_ARRAYS = {
    "a sum of arrays": "return a + b**2",
    "matrices": "return (np.stack([a, b], axis=1) @ A[:2, :5]).sum(axis=1)",
    "sums along the runs": "return a + 1e-17 * np.cumsum(b)",
    "a loop": "return np.array([iterated(*each) for each in zip(a, b)])",
}
INPUTS = {
    "continuous": ("{ uniform = { lower = 0.1, upper = 2 } }",
                   "{ normal = { mean = 3, std = 0.2 } }"),
    "single values": ("{ discrete = { values = [0.5, 1, 1.5] } }",
                      "{ integer = { lower = 1, upper = 9 } }"),
    "fixed beside": ("{ weibull = { scale = 1, shape = 2 } }", "2.5"),
}  # fmt: skip

PRELUDE = """
import functools, math, warnings
from concurrent.futures import ThreadPoolExecutor, as_completed
import numpy as np
from scipy import optimize

A = np.random.default_rng(0).normal(size=(30, 30))
MEMO, COUNTER, POOL = {}, [], ThreadPoolExecutor(4)

@functools.cache
def cached(a):
    return math.exp(a)

def iterated(a, b):
    x = b
    while abs(x * x - a) > 1e-9:
        x = (x + a / x) / 2
    return x

def unordered(a, b):
    parts = np.linspace(a, b, 800).reshape(8, -1)
    return sum(each.result() for each in as_completed([POOL.submit(p.sum) for p in parts]))

def f(a, b):
    def y():
        BODY
    return {"y": y()}
"""


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*OF_NUMBERS, *OF_ARRAYS])
def test_it_is_never_called_noisy(kind, tmp_path):
    body = (OF_NUMBERS | OF_ARRAYS)[kind].replace("; ", "\n        ")
    (tmp_path / "model.py").write_text(PRELUDE.replace("BODY", body))
    vectorized = str(kind in OF_ARRAYS).lower()
    for a, b in INPUTS.values():
        study = uqpen.parse_study(
            "seed = 1\nsensitivity = false\nconvergence = false\n[model]\n"
            f'python = "model.py:f"\nvectorized = {vectorized}\n'
            'inputs = { a = "1", b = "1" }\noutputs = { y = "1" }\n'
            f"[failures]\nstop_after = 0\n[inputs]\na = {a}\nb = {b}\n"
            '[designs.mc]\nkind = "monte-carlo"\nruns = 60',
            folder=tmp_path,
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = uqpen.run(study)
        assert tree.attrs["noise"].startswith(("equal bits: 3 of 60", "rounding: 3 of 60"))
        assert "noise" not in tree.children
        assert "noise" not in tree["runs/mc"].attrs
