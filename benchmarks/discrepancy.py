"""What an error of the model itself is worth: how often its unknown and the truth are held.

A table of docs/coverage/posteriors.md as `seed_table.py` makes it. The simple machine: it does
0.65 x / (1 + x / 20) of work at the effort x, and the model says theta x. Posteriors are exact but
for a grid over the numbers of the errors, and beside them those of a study.

References
----------
Brynjarsdóttir, J. & O'Hagan, A. (2014). Inverse Problems 30, 114007.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from scipy.stats import halfnorm, norm
from seed_table import Row, SeedTable, share, summed

import uqpen
from uqpen.core.arrays import FloatArray
from uqpen.core.streams import Stream
from uqpen.measurements.errors import Discrepancy, UnknownSize

EFFORT, ERROR, TRUE_THETA = np.linspace(0.2, 4.0, 11), 0.01, 0.65
MEAN, STD = 0.6, 0.3  # prior of theta
WHERE = (3.1, 5.0, 6.0, 8.0)
LEVEL = 0.9


def truth(effort: FloatArray) -> FloatArray:
    return TRUE_THETA * effort / (1 + effort / 20)


class Situation(NamedTuple):
    """Numbers of the errors that are not known: their half-normal scales, 0 for none."""

    size: float = 0.0  # of independent errors; 0 where it is known
    std: float = 0.0  # of a process along the effort
    length: float = 3.0
    zero_at: float | None = None


NARROWER = "process, priors a third narrower"
SITUATIONS = {
    "none": Situation(),
    "independent errors of unknown size": Situation(size=0.3),
    "process": Situation(std=0.3),
    NARROWER: Situation(std=0.2, length=2.0),
    "process that grows from 0 at x = 0": Situation(std=1.0, zero_at=0.0),
}


def _grid(scale: float, size: int) -> FloatArray:
    """Return numbers at equal shares of a half-normal distribution."""
    return np.asarray(halfnorm.ppf((np.arange(size) + 0.5) / size, scale=scale))


def posterior(measured: FloatArray, of: Situation) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return weights, means and deviations of theta and the truth at `WHERE`, (grid, quantity)."""
    at = np.array(WHERE)
    sizes = _grid(of.size, 4000) if of.size else np.array([ERROR])
    stds = _grid(of.std, 40) if of.std else np.zeros(1)
    lengths = _grid(of.length, 40) if of.std else np.ones(1)
    known = UnknownSize("", 1.0, "1", "")
    process = Discrepancy("x", EFFORT, known, known, of.zero_at)
    weights, means, deviations = [], [], []
    for size, std, length in np.stack(np.meshgrid(sizes, stds, lengths), -1).reshape(-1, 3):
        numbers = np.array(std), np.array(length)
        line = STD**2 * np.outer(EFFORT, EFFORT)
        whole = line + process.kernel(EFFORT, EFFORT, *numbers)
        whole += size**2 * np.eye(len(EFFORT))
        across = STD**2 * np.outer(at, EFFORT) + process.kernel(at, EFFORT, *numbers)
        own = STD**2 * at**2 + np.diag(process.kernel(at, at, *numbers))
        across = np.vstack([STD**2 * EFFORT, across])
        own = np.append(STD**2, own)
        lower = np.linalg.cholesky(whole)
        off = np.linalg.solve(lower, measured - MEAN * EFFORT)
        taught = np.linalg.solve(lower, across.T)
        weights.append(-0.5 * off @ off - np.log(np.diag(lower)).sum())
        means.append(np.append(MEAN, MEAN * at) + taught.T @ off)
        deviations.append(np.sqrt(np.maximum(own - (taught**2).sum(axis=0), 1e-16)))
    shares = np.exp(np.array(weights) - max(weights))
    return shares / shares.sum(), np.array(means), np.array(deviations)


def holds(weights: FloatArray, means: FloatArray, deviations: FloatArray, value: float) -> bool:
    """Return whether the middle 90 % of a mixture of normal distributions hold a value."""
    below = float(weights @ norm.cdf((value - means) / deviations))
    return (1 - LEVEL) / 2 < below < (1 + LEVEL) / 2


MODEL = "def machine(x, theta):\n    return {'work': theta * x}\n"


def study_text(measured: FloatArray, of: Situation, seed: int) -> str:
    """Return a study of the machine, with blank rows where the truth is to be predicted."""
    text = f"""seed = {seed}
confidence_level = {LEVEL}
[model]
python = "machine.py:machine"
vectorized = true
inputs = {{ x = "1", theta = "1" }}
outputs = {{ work = "1" }}
[inputs]
x = 1
theta = "{MEAN} ± {STD}"
[measured.rows]
conditions = ["x"]
unknown = ["theta"]
[measured.rows.table]
x = {[*EFFORT.tolist(), *WHERE]}
work = {[*measured.tolist(), *[""] * len(WHERE)]}
[measured.rows.work]
std = {f"{{ half-normal = {of.size} }}" if of.size else ERROR}
"""
    if of.std:
        numbers = f"std = {{ half-normal = {of.std} }}\nlength = {{ half-normal = {of.length} }}\n"
        zero = "" if of.zero_at is None else f"zero_at = {of.zero_at}\n"
        text += f'[measured.rows.work.discrepancy]\nalong = "x"\n{numbers}{zero}'
    design = "particles = 200\nat_most = 2_000_000\n"
    return f'{text}[designs.fit]\nkind = "posterior"\nmeasured = ["rows"]\n{design}'


def _of_study(measured: FloatArray, of: Situation, seed: int) -> Row:
    """Return mean and deviation of theta, and what is held by the intervals of a study."""
    with TemporaryDirectory() as folder:
        Path(folder, "machine.py").write_text(MODEL, encoding="utf-8")
        tree = uqpen.run(uqpen.parse_study(study_text(measured, of, seed), folder=folder))
    found = tree["calibrations/fit"]
    ends = found["posterior_quantile"].sel(probability=[0.05, 0.95]).values[0, :, 0]
    bands = found["prediction"].values
    exact = truth(np.array(WHERE))
    held = [ends[0] < TRUE_THETA < ends[1], *((bands[:, 1] < exact) & (exact < bands[:, 2]))]
    missing = np.isnan(bands[:, 1])
    named = {f"x {at:g}": int(each) for at, each in zip(WHERE, held[1:], strict=True)}
    named |= {f"x {at:g}": -1 for at, none in zip(WHERE, missing, strict=True) if none}
    mean, std = (float(found[f"posterior_{key}"].values[0, 0]) for key in ("mean", "std"))
    return {"mean": mean, "std": std, "theta": int(held[0]), **named}


def _rows(name: str, by: str, seeds: Sequence[int]) -> Iterator[Row]:
    situation = SITUATIONS[name]
    for seed in seeds:
        rng = Stream(seed, "measurements").generator()
        measured = truth(EFFORT) + ERROR * rng.standard_normal(len(EFFORT))
        if by == "study":
            yield _of_study(measured, situation, seed)
            continue
        weights, means, deviations = posterior(measured, situation)
        exact = [TRUE_THETA, *truth(np.array(WHERE))]
        columns = zip(means.T, deviations.T, exact, strict=True)
        held = [holds(weights, *each) for each in columns]
        mean = float(weights @ means[:, 0])
        variance = weights @ (deviations[:, 0] ** 2 + means[:, 0] ** 2) - mean**2
        named = {f"x {at:g}": int(each) for at, each in zip(WHERE, held[1:], strict=True)}
        yield {"mean": mean, "std": float(np.sqrt(variance)), "theta": int(held[0]), **named}


def _held(name: str) -> Callable[[SimpleNamespace], str]:
    def text(cell: SimpleNamespace) -> str:
        held = getattr(cell, name)
        return share(held, cell.count) if held >= 0 else "no interval"

    return text


COLUMNS = {
    "error of the model": "discrepancy",
    "by": "by",
    "theta (0.65)": lambda c: f"{c.mean / c.count:.3f} ± {c.std / c.count:.3f}",
    "theta held": _held("theta"),
    **{f"truth held at x = {at:g}": _held(f"x {at:g}") for at in WHERE},
}
KEYS = ("discrepancy", "by")
TABLE = SeedTable(
    KEYS,
    _rows,
    {"discrepancy": summed(COLUMNS, *KEYS)},
    seeds=100,
    # Outside of the measurements, where other priors say something else, a study has no interval.
    cases=lambda: [
        case for case in product(SITUATIONS, ("grid", "study")) if case != (NARROWER, "study")
    ],
)

if __name__ == "__main__":
    TABLE.main(__doc__)
