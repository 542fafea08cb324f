"""Parts of an archive that follow from code which is not loaded: left out, and named.

Without trust, nothing is executed that an archive names; and no archive contains a Python object.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import xarray as xr

from uqpen.core.errors import StudyError
from uqpen.study.study import ValidatedStudy
from uqpen.surrogates.unloaded_surrogate import UnloadedSurrogate
from uqpen.verification.archived_study import named_code
from uqpen.verification.check_result import CheckOutcome, CheckResult
from uqpen.verification.earlier_surrogates import leave_out_surrogates
from uqpen.verification.repetition import Runs, repeated_points
from uqpen.verification.user_defined_statistics import (
    user_defined_statistic_names,
    without_distributions,
)

__all__ = ["ADVICE", "check_points", "unchecked_analyses", "unrepeated_runs", "without_absent"]

ADVICE = "if you trust its author, use --trust"


def unchecked_analyses(analyses: list[str], tree: xr.DataTree) -> CheckResult:
    """Return the result for statistics of user-defined analyses, which are not executed."""
    statistics = ", ".join(user_defined_statistic_names(tree)) or "none"
    named = f"they follow from code that the archive names ({', '.join(analyses)})"
    message = f"not checked: {statistics}; {named}"
    return CheckResult("analyses", CheckOutcome.UNCHECKED, message, (ADVICE,))


def without_absent(
    study: ValidatedStudy, tree: xr.DataTree
) -> tuple[ValidatedStudy, xr.DataTree, list[CheckResult]]:
    """Leave out what follows from distributions or surrogates that are not here, with results."""
    if study.joint.unloaded or study.unloaded_models:
        return _without_distributions(study, tree)
    absent = [name for name, surrogate in study.surrogates.items() if surrogate.absence]
    if not absent:
        return study, tree, []
    return *leave_out_surrogates(study, tree, absent), [_unchecked_surrogates(study, absent)]


def _unchecked_surrogates(study: ValidatedStudy, absent: list[str]) -> CheckResult:
    """Return the result for surrogates that cannot be fitted here."""
    surrogates = [study.surrogates[name] for name in absent]
    reasons = "; ".join(dict.fromkeys(surrogate.absence for surrogate in surrogates))
    is_code = any(isinstance(each, UnloadedSurrogate) and not each.is_object for each in surrogates)
    message = f"not checked: {', '.join(absent)}; {reasons}"
    return CheckResult("surrogates", CheckOutcome.UNCHECKED, message, (ADVICE,) * is_code)


def _without_distributions(
    study: ValidatedStudy, tree: xr.DataTree
) -> tuple[ValidatedStudy, xr.DataTree, list[CheckResult]]:
    """Leave out results of distributions or models that are not loaded, with a result for it."""
    kept = without_distributions(tree)
    named = ", ".join(dict.fromkeys([*study.joint.unloaded.values(), *study.unloaded_models]))
    kinds = "models" if study.unloaded_models else "distributions"
    message = f"not checked: they follow from {kinds} that are not loaded ({named})"
    unchecked = CheckResult("surrogates", CheckOutcome.UNCHECKED, message)
    is_changed = kept.groups != tree.groups
    return replace(study, surrogates={}), kept, [unchecked] if is_changed else []


def check_points(
    study: ValidatedStudy, tree: xr.DataTree, runs: Runs, tolerance: float
) -> Iterator[CheckResult]:
    """Draw the points again that code of the archive has drawn, if it is loaded."""
    untrusted = named_code(tree).members
    unloaded = study.unloaded_members
    named = [name for name in unloaded if name in untrusted]
    objects = [name for name in unloaded if name not in untrusted]
    if named:
        message = f"they are drawn by code that the archive names ({', '.join(named)})"
        yield CheckResult("points", CheckOutcome.UNCHECKED, f"not checked: {message}", (ADVICE,))
    elif objects:
        message = f"{', '.join(objects)} is an object of the Python program that made the archive"
        advice = "run that program again"
        yield CheckResult("points", CheckOutcome.UNCHECKED, f"not checked: {message}", (advice,))
    elif untrusted:
        try:
            yield repeated_points(study, runs, tolerance)
        except StudyError as error:  # a user-defined design fails here
            message = "a design that its study names fails"
            yield CheckResult("points", CheckOutcome.IMPOSSIBLE, message, (str(error),))


def unrepeated_runs(study: ValidatedStudy, untrusted: list[str]) -> CheckResult | None:
    """Return the result for runs that cannot be repeated; None where they can.

    They cannot without code that the archive names, and that may not be executed, or without a
    function that no archive contains.
    """
    absent = [each.model.name for each in study.models.values() if each.model.is_absent]
    if untrusted:
        what = f"they execute code that the archive names ({', '.join(untrusted)})"
        advice = ADVICE
    elif absent:
        what = f"{', '.join(absent)} is an object of the Python program that made the archive"
        advice = "give the function: uqpen.verify(path, model=function)"
    else:
        return None
    return CheckResult("runs", CheckOutcome.UNCHECKED, f"not repeated: {what}", (advice,))
