"""``[failures]``: what is done about runs that are lost."""

from __future__ import annotations

from uqpen.core.errors import toml_text
from uqpen.execution.failures import FailurePolicy
from uqpen.study.table_reader import TableReader

__all__ = ["read_failures"]

_RETRIES = "how often a lost run is made again, a whole number from 0 to 100"
_SHARE = 'the share of runs that may be lost, such as "5 %"'
_MOST_RETRIES = 100


def read_failures(table: TableReader | None) -> FailurePolicy:
    """How lost runs are dealt with; as ever where a study does not say."""
    if table is None:
        return FailurePolicy()
    retry = table.take("retry")
    if retry is None:
        retry = 0
    elif not isinstance(retry, int) or isinstance(retry, bool) or not 0 <= retry <= _MOST_RETRIES:
        table.add_problem("retry", toml_text(retry), _RETRIES)
        retry = 0
    at_most = 1.0
    if "at_most" in table:
        share = table.quantity("at_most", "1")
        if share is not None and not 0 <= share <= 1:
            table.add_problem("at_most", toml_text(table.content["at_most"]), _SHARE)
        at_most = at_most if share is None else share
    table.check_unknown_keys()
    return FailurePolicy(retry, at_most)
