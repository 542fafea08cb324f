"""``[failures]``: policy for failed runs."""

from __future__ import annotations

from uqpen.core.units import DIMENSIONLESS
from uqpen.execution.failures import FailurePolicy
from uqpen.study.table_reader import TableReader

__all__ = ["read_failures"]


def read_failures(table: TableReader | None) -> FailurePolicy:
    """Read the policy for failed runs; the default where a study has none."""
    if table is None:
        return FailurePolicy()
    policy = table.settings(FailurePolicy, like=DIMENSIONLESS)
    table.check_unknown_keys()
    return policy or FailurePolicy()
