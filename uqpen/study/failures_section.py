"""``[failures]``: policy for failed runs."""

from __future__ import annotations

from uqpen.execution.failures import FailurePolicy
from uqpen.study.table_reader import TableReader

__all__ = ["read_failures"]


def read_failures(table: TableReader) -> FailurePolicy:
    """Read the policy for failed runs; the default where a study has none."""
    return table.whole_settings(FailurePolicy) or FailurePolicy()
