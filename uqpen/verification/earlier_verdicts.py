"""Verdicts on surrogates by another rule than today's, which cannot be repeated.

The rule decides labels and notes of a surrogate's estimates, never their values. An archive names
the rule that its verdicts follow. Where that is none or another, its verdicts stay as they are and
are shown as they are; the repetition compares the values alone.
"""

from __future__ import annotations

from collections.abc import Iterable

import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS, interval_codes_name, statistic_names
from uqpen.archive.read import model_trees
from uqpen.core.labels import SOURCE_KIND, STATISTICS_GROUP, VERDICT_RULE
from uqpen.trust import VALIDATION_RULE
from uqpen.verification.check_result import CheckOutcome, CheckResult

__all__ = ["earlier_verdict_groups", "unchecked_verdicts", "without_verdicts"]


def earlier_verdict_groups(tree: xr.DataTree) -> dict[str, str]:
    """Return the surrogates whose verdicts follow another rule, by the paths of their groups."""
    found = {}
    for model in model_trees(tree).values():
        group = model.children.get(STATISTICS_GROUP)
        for name, source in (group.children if group is not None else {}).items():
            is_surrogate = source.attrs.get(SOURCE_KIND) == "surrogate"
            if is_surrogate and source.attrs.get(VERDICT_RULE) != VALIDATION_RULE:
                found[source.path] = str(name)
    return found


def without_verdicts(group: xr.Dataset) -> xr.Dataset:
    """Return the statistics of a source or of an output without the texts of their intervals."""
    codes = [interval_codes_name(name) for name in statistic_names(group)]
    found = group.drop_vars(codes, errors="ignore").copy()
    for variable in found.variables.values():
        for text in INTERVAL_TEXTS:
            variable.attrs.pop(text, None)
    found.attrs = {key: value for key, value in found.attrs.items() if key != VERDICT_RULE}
    return found


def unchecked_verdicts(names: Iterable[str]) -> CheckResult:
    """Return the result for verdicts on surrogates by another rule, which are not compared."""
    message = f"on {', '.join(dict.fromkeys(names))}: by the rule of another uqpen, not compared"
    return CheckResult("verdicts", CheckOutcome.UNCHECKED, message)
