"""How often the interval of an event covers where a run may end in it, without a number.

A table of docs/coverage.md as `seed_table.py` makes it. Each seed is a sample of 200 normal numbers
x, of which the event is x > 1, or the ending. The ending is declared as an outcome, or left a
failed run. It lies beyond all numbers, or in the other tail.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np
import xarray as xr
from scipy.stats import norm
from seed_table import Case, Row, SeedTable, lines

from uqpen.core.labels import ABSENT, SAMPLING, STATUS
from uqpen.core.sampling import Sampling
from uqpen.core.status import Status
from uqpen.statistics.joint_event import JointEvent, OutputLimit
from uqpen.statistics.joint_probability import joint_probabilities

RUNS = 200
SHARES = {"2 %": 0.02, "20 %": 0.2}
TAILS = ("beyond", "other tail")
READINGS = ("outcome", "failed run")
_EXCEEDS = OutputLimit("x > 1", "x", is_above=True, value=1.0)
_ENDS = OutputLimit("ends", "outcome", is_above=True, value=1.0, is_category=True)
EVENTS = {
    "outcome": JointEvent("event", (_EXCEEDS, _ENDS), is_any=True),
    "failed run": JointEvent("event", (_EXCEEDS,)),
}


def interval(seed: int, share: float, tail: str, reading: str) -> tuple[float, float, float]:
    """Return the lower end, the upper end and the true probability."""
    x = np.random.default_rng([2_120, seed]).standard_normal(RUNS)
    ends = x > norm.isf(share) if tail == "beyond" else x < norm.ppf(share)
    exceeds = norm.sf(_EXCEEDS.value)
    is_outcome = reading == "outcome"
    runs = xr.Dataset(
        {
            "x": ("run", np.where(ends, np.nan, x), {"units": "1", ABSENT: "it ends"}),
            "outcome": ("run", np.where(ends, 1 if is_outcome else -1, 0).astype(np.int8)),
            STATUS: ("run", np.where(ends & (not is_outcome), Status.FAILED, 0).astype(np.int8)),
        },
        attrs={SAMPLING: str(Sampling.INDEPENDENT)},
    )
    found = joint_probabilities(runs, [EVENTS[reading]], 0.95)["joint_probability"]
    _, lower, upper = found.values[0].tolist()
    return lower, upper, float(max(exceeds, share) if tail == "beyond" else exceeds + share)


def _rows(case: Case, seeds: Sequence[int], _: Namespace) -> Iterator[Row]:
    share, tail, reading = map(str, case)
    for seed in seeds:
        lower, upper, truth = interval(seed, SHARES[share], tail, reading)
        yield {"lower": lower, "upper": upper, "truth": truth}


def _page(rows: Sequence[Row]) -> Iterator[str]:
    head = ["share of the ending", "where", "read as", "seeds", "covers", "mean width"]
    of = {
        key: [row for row in rows if (row["share"], row["tail"], row["reading"]) == key]
        for key in product(SHARES, TAILS, READINGS)
    }
    yield from lines(head, (_line(found, *key) for key, found in of.items() if found))


def _line(rows: Sequence[Row], share: str, tail: str, reading: str) -> list[str]:
    covers = np.mean([row["lower"] <= row["truth"] <= row["upper"] for row in rows])
    width = np.mean([row["upper"] - row["lower"] for row in rows])
    return [share, tail, reading, f"{len(rows)}", f"{100 * covers:.1f} %", f"{width:.3f}"]


TABLE = SeedTable(
    ("share", "tail", "reading"),
    lambda: product(SHARES, TAILS, READINGS),
    _rows,
    {"outcomes": _page},
    seeds=300,
)

if __name__ == "__main__":
    sys.exit(TABLE.main(__doc__))
