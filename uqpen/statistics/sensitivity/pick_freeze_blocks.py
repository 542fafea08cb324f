"""Complete blocks of a pick-freeze design."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr

from uqpen.core.arrays import BoolArray, IntArray
from uqpen.core.labels import CONDITIONAL, REPLICATE, ROUND, STATUS
from uqpen.core.status import Status
from uqpen.designs.pick_freeze import MATRIX_A, BlockLayout
from uqpen.statistics import texts

__all__ = ["PickFreezeBlocks"]


@dataclass(frozen=True)
class PickFreezeBlocks:
    """Complete blocks: those whose runs all completed.

    Parameters
    ----------
    layout : BlockLayout
        The parts of a block.
    rows : dict of int to ndarray of int, shape (block,)
        The number of the run of each part, by the part's matrix.
    replicate : ndarray of int, shape (block,)
        The replicate of each block. Only replicates with a block are numbered.
    attributes : dict of str to int or str
        Attributes of indices from these blocks: numbers of used and dropped blocks, and the joint
        distribution that the indices refer to.
    """

    layout: BlockLayout
    rows: dict[int, IntArray]
    replicate: IntArray
    attributes: dict[str, int | str]

    @classmethod
    def from_runs(cls, runs: xr.Dataset) -> PickFreezeBlocks:
        """Return the complete blocks in the runs of a design."""
        layout = BlockLayout.from_runs(runs)
        rows = layout.run_numbers(runs)
        status = runs[STATUS].values
        reached = np.array(
            [np.where(part < 0, Status.INADMISSIBLE, status[part]) for part in rows.values()]
        )
        whole = np.flatnonzero((reached == Status.OK).all(axis=0))
        lost = (reached != Status.OK) & (reached != Status.INADMISSIBLE)
        dropped_blocks = int(lost.any(axis=0).sum())
        unsettled = reached.shape[1] - len(whole) - dropped_blocks
        is_conditional = ROUND in runs.coords or (status == Status.INADMISSIBLE).any()
        condition = runs.attrs.get(CONDITIONAL, texts.ADMISSIBLE_INPUTS)
        estimand = texts.ESTIMAND
        if is_conditional:
            estimand = texts.ESTIMAND_IF.format(condition=condition)
        if dropped_blocks:
            estimand += f"; {texts.FAILED_BLOCKS}"
        if unsettled:
            is_absent = CONDITIONAL in runs.attrs  # some of them, of an output that not all have
            estimand += f"; {texts.ABSENT_BLOCKS if is_absent else texts.INADMISSIBLE_BLOCKS}"
        chosen = {number: part[whole] for number, part in rows.items()}
        _, replicate = np.unique(runs[REPLICATE].values[chosen[MATRIX_A]], return_inverse=True)
        attributes: dict[str, int | str] = {
            "estimand": estimand,
            "blocks_used": len(whole),
            "blocks_dropped": reached.shape[1] - len(whole),
        }
        return cls(layout, chosen, replicate.astype(np.int64), attributes)

    def subset(self, chosen: BoolArray) -> PickFreezeBlocks:
        """Return some of the blocks, by a mask."""
        rows = {number: part[chosen] for number, part in self.rows.items()}
        _, replicate = np.unique(self.replicate[chosen], return_inverse=True)
        return replace(self, rows=rows, replicate=replicate.astype(np.int64))

    @property
    def count(self) -> int:
        """Number of complete blocks."""
        return len(self.replicate)

    @property
    def replicate_count(self) -> int:
        """Number of replicates with a complete block."""
        return int(self.replicate.max(initial=-1)) + 1
