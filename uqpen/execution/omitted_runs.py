"""Runs that an archive does not keep: their number by status, and a hash of each batch."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

import numpy as np
import xarray as xr

from uqpen.core.arrays import raw_bytes
from uqpen.core.blocks import block_ranges
from uqpen.core.labels import (
    BATCH,
    BATCH_HASH,
    FAILED_RUN,
    FAILURE_REASON,
    REPLICATE,
    REPLICATES_MADE,
    RUN,
    RUNS_MADE,
    STATUS_COUNTS,
)
from uqpen.execution.batching import BATCH_SIZE
from uqpen.execution.runs import replicate_count, status_counts

# In a file: its 64 digits, and what the format has beside a text.
_BYTES_OF_A_HASH = 113


def bytes_of_hashes(runs: float) -> float:
    """Return the bytes that a file has of a number of runs which it does not keep."""
    return runs / BATCH_SIZE * _BYTES_OF_A_HASH


def are_omitted(runs: xr.Dataset) -> bool:
    """Return True if an archive has not kept the runs of a design."""
    return RUNS_MADE in runs.attrs


def omit_runs(runs: xr.Dataset) -> xr.Dataset:
    """Return what an archive has of a design without its runs.

    That is all variables and attributes, without a run; how many runs there were, and how many with
    each status; and the hash of each batch, by which repeated runs can be compared with them.

    Parameters
    ----------
    runs : Dataset
        In memory, or with values in a file, which are read by blocks.
    """
    hashes = np.array([*batch_hashes(runs)], dtype=object)
    counts = np.array([*status_counts(runs).values()], dtype=np.int64)
    described = runs.isel({RUN: slice(0)}).load()
    described = described.drop_vars([FAILED_RUN, FAILURE_REASON], errors="ignore")
    found = described.assign({BATCH_HASH: (BATCH, hashes)})
    found[BATCH_HASH].attrs = {"long_name": f"SHA-256 of each {BATCH_SIZE} runs"}
    sets = {REPLICATES_MADE: replicate_count(runs)} if REPLICATE in runs.variables else {}
    return found.assign_attrs({RUNS_MADE: runs.sizes[RUN], **sets, STATUS_COUNTS: counts})


def batch_hashes(runs: xr.Dataset) -> Iterator[str]:
    """Yield the SHA-256 of each `BATCH_SIZE` runs: of their inputs, outputs and statuses.

    A vectorised function gets as many runs at once, so the batch is what can be repeated to the
    bit. Reasons of failed runs are left out, as they may name what differs between machines.
    """
    along = sorted(
        str(name) for name, each in runs.variables.items() if RUN in each.dims and name != RUN
    )
    for start, stop in block_ranges(runs.sizes[RUN]):
        values = {name: runs.variables[name][start:stop].values for name in along}
        for first in range(0, stop - start, BATCH_SIZE):
            digest = hashlib.sha256()
            for name, block in values.items():
                batch = block[first : first + BATCH_SIZE]
                little = batch.astype(batch.dtype.newbyteorder("<"), copy=False)
                digest.update(f"{name} {little.dtype.str} {little.shape} ".encode())
                digest.update(raw_bytes(little))
            yield digest.hexdigest()
