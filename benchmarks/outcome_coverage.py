"""How often the interval of an event covers where a run may end in it, without a number.

A table of docs/coverage/outcomes.md as `seed_table.py` makes it. The number is a normal x. The
event is that x lies beyond a limit, or the ending. This is declared as an outcome, or left a failed
run. It lies beyond all numbers, or in the other tail. Monte Carlo has 200 runs. For the methods for
rare events, x follows from two inputs, and they have some thousand runs in five replicates.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from problems import runs_of, standard_normals
from scipy.stats import norm
from seed_table import Case, Row, SeedTable, grouped, lines

from uqpen.core.arrays import BoolArray, FloatArray
from uqpen.core.labels import ABSENT, OUTCOME_OUTPUT, ROLE, RUN, SAMPLING, STATUS
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.core.streams import Stream
from uqpen.designs.rare_events.importance_sampling import ImportanceSampling
from uqpen.designs.rare_events.subset_simulation import SubsetSimulation
from uqpen.statistics.joint_event import JointEvent, OutputLimit
from uqpen.statistics.joint_probability import joint_probabilities

RUNS = 200
MONTE_CARLO = "monte-carlo"
TAILS = ("beyond", "other tail")
READINGS = ("outcome", "failed run")
DESIGNS = {
    "importance-sampling": lambda event: ImportanceSampling(event=event, samples=1000),
    "subset-simulation": lambda event: SubsetSimulation(event=event, samples=500),
}
_LEVEL = 0.95


class Ending(NamedTuple):
    """The event x > limit, and the probability of the ending."""

    limit: float
    share: float

    def is_met(self, x: FloatArray, tail: str) -> BoolArray:
        """Return which runs end so."""
        return x > norm.isf(self.share) if tail == "beyond" else x < norm.ppf(self.share)

    def probability(self, tail: str) -> float:
        """Return that of the event or the ending."""
        exceeds = float(norm.sf(self.limit))
        return max(exceeds, self.share) if tail == "beyond" else exceeds + self.share


_RARE = {"0.05 %": Ending(3.0, 0.0005), "0.13 %": Ending(3.5, float(norm.sf(3.0)))}
ENDINGS = {
    MONTE_CARLO: {"2 %": Ending(1.0, 0.02), "20 %": Ending(1.0, 0.2)},
    "importance-sampling": _RARE,
    "subset-simulation": _RARE,
}


def cases() -> Iterator[Case]:
    """Yield a method, the share of the ending, where it lies and how it is read."""
    for method, endings in ENDINGS.items():
        for share, tail, reading in product(endings, TAILS, READINGS):
            # Where the ending is nearly all of a rare event, failed runs leave no interval.
            if (share, reading) != ("0.13 %", "failed run"):
                yield method, share, tail, reading


def interval(
    seed: int, method: str, share: str, tail: str, reading: str
) -> tuple[float, float, float]:
    """Return the estimate and both ends of its interval."""
    ending = ENDINGS[method][share]

    def with_endings(points: xr.Dataset, x: FloatArray) -> xr.Dataset:
        ends = ending.is_met(x, tail)
        has_failed = ends & (reading == "failed run")
        outcome = np.where(has_failed, -1, ends).astype(np.int8)
        flags = {"flag_values": np.array([-1, 0, 1]), "flag_meanings": "lost completed ends"}
        status = np.where(has_failed, Status.FAILED, Status.OK).astype(np.int8)
        described = {ROLE: "output", "units": "1", ABSENT: "-"}
        return points.assign(
            {
                "x": (RUN, np.where(ends, np.nan, x), described),
                OUTCOME_OUTPUT: (RUN, outcome, {ROLE: "output", **flags}),
                STATUS: (RUN, status),
            }
        )

    if method == MONTE_CARLO:
        x = np.random.default_rng([2_120, seed]).standard_normal(RUNS)
        runs = with_endings(xr.Dataset(), x).assign_attrs({SAMPLING: str(Sampling.INDEPENDENT)})
    else:
        text = f"x > {ending.limit}" + " or ends" * (reading == "outcome")
        runs = runs_of(
            DESIGNS[method](text),
            standard_normals(2),
            Stream(seed, "designs", "rare"),
            lambda at: with_endings(at, 0.6 * at["x0"].values + 0.8 * at["x1"].values),
        )
    limits = [OutputLimit("x", "x", is_above=True, value=ending.limit)]
    if reading == "outcome":
        limits += [OutputLimit("ends", OUTCOME_OUTPUT, is_above=True, value=1.0, is_category=True)]
    event = JointEvent("event", tuple(limits), is_any=True)
    found = joint_probabilities(runs, [event], _LEVEL)["joint_probability"]
    value, lower, upper = found.values[0].tolist()
    return value, lower, upper


def _rows(*case: Any) -> Iterator[Row]:
    *of, seeds = case
    for seed in seeds:
        value, lower, upper = interval(seed, *of)
        yield {"value": value, "lower": lower, "upper": upper}


def _page(rows: Sequence[Row]) -> Iterator[str]:
    head = ["method", "probability", "of the ending", "where", "read as"]
    head += ["seeds", "mean estimate", "covers", "median upper/lower end"]
    found = grouped(rows, *KEYS)
    yield from lines(head, (_line(found[case], *case) for case in cases() if case in found))


def _line(rows: Sequence[Row], method: str, share: str, tail: str, reading: str) -> list[str]:
    truth = ENDINGS[method][share].probability(tail)
    table = np.array([[row[key] for key in ("value", "lower", "upper")] for row in rows])
    value, lower, upper = table.T
    covers = np.mean((lower <= truth) & (truth <= upper))
    ratio = f"{np.median(upper / lower):.3g}" if lower.all() else "–"
    figures = [f"{np.mean(value):.3g}", f"{100 * covers:.1f} %", ratio]
    return [method, f"{truth:.3g}", share, tail, reading, f"{len(rows)}", *figures]


KEYS = ("method", "share", "tail", "reading")
TABLE = SeedTable(KEYS, _rows, {"outcomes": _page}, seeds=300, at_once=20, cases=cases)

if __name__ == "__main__":
    TABLE.main(__doc__)
