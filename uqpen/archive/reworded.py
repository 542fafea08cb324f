"""Earlier and present wording of the texts of estimates, for the migration of archives."""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import xarray as xr

from uqpen.archive.estimates import INTERVAL_TEXTS

__all__ = ["REWORDED", "reworded", "reworded_array"]

# In turn a wording of schemas 1 and 2 and the present one. A name in braces is a placeholder.
_REWORDED = """
the points are no draws from the law
the points are not a sample of the input distribution
the table does not say that its points are independent (independent = true)
the points are not declared independent (independent = true)
no run came back
no run completed
no run of the matrices A and B came back
no run of the matrices A and B completed
the runs that came back are all of one replicate
all completed runs are of one replicate
an upper bound takes at least {runs} runs
an upper bound needs at least {runs} runs
{method}, missing runs counted both ways
{method}, for any outcome of the missing runs
the {runs} missing runs are counted both ways
allows for any outcome of the missing runs ({runs})
it is the same in all runs
the event occurs in all runs or in none
the strata leave no scatter, so nothing tells the error
the stratified points show no scatter, so the error is unknown
the runs leave no scatter that tells the error
the runs show no scatter, so the error is unknown
the inputs and the output follow from each other by straight lines
the inputs and the output are linearly dependent
no interval was found that covers
no reliable interval is known
no interval covers: its bias may exceed its scatter
no reliable interval is known: the bias may exceed the scatter
heavy tail ({tail}): no interval covers
heavy tail ({tail}): no reliable interval is known
heavy tail ({tail}): below 5 000 runs it may cover less often than it says
heavy tail ({tail}): below 5 000 runs the coverage may be below nominal
it hangs on so few runs ({tail}) that it may not exist
heavy tail ({tail}): the mean may not exist
fewer than {runs} runs do not show a heavy tail
fewer than {runs} runs are too few to detect a heavy tail
with one it covers less often than it says
with a heavy tail the coverage is below nominal
if the tail is heavier than these runs show, it covers less often than it says
the interval may be too narrow if extreme values are more frequent than in these runs
{reason}: it may cover less often than it says
{reason}: the coverage may be below nominal
with fewer than {blocks} blocks it may cover less often than it says
fewer than {blocks} blocks: the coverage may be below nominal
{effects} effects are so few that it may cover less often than it says
only {effects} effects: the coverage may be below nominal
only {distinct} of {effects} effects differ from the others; it may cover less often than it says
only {distinct} of {effects} effects differ from the others: the coverage may be below nominal
a diagnosis of the tail, not an estimate
a diagnostic of the tail, not an estimate
see the correlations of ranks
see the rank correlations
an integration rule has no scatter; its error is not told
a quadrature rule has no scatter, so its error is unknown
the rule's negative weights give no {moment} that a law can have; a higher order may
negative weights of the rule give an impossible {moment}: try a higher order
{failed} of {nodes} nodes ({share} % of the weight) were lost, which biases it
biased: {failed} of {nodes} nodes failed ({share} % of the weight)
the weights of the runs that came back add up to nothing
the weights of the completed runs add up to zero
no step came back whole
no step has two completed runs
it takes two effects at least
at least two effects are needed
the effects do not scatter, so nothing tells their error
the effects show no scatter, so their error is unknown
{failed} of {effects} effects touch a lost run
{failed} of {effects} effects are missing because a run failed
a derivative at one point; the model has no scatter
a derivative at one point has no scatter
of the step {side} alone; the other run was lost
from the step {side} only: the other run failed
curved: {down} of the step down, {up} of that up
nonlinear: {down} from the step down, {up} from the step up
the run at the nominal point was lost
the run at the nominal point failed
both runs of the step were lost
both runs of the step failed
neighbours in an input avoid each other in the others: replicates would tell
optimized points are not independent: replicates are needed
no block came back whole
no block is complete
the blocks that came back whole are all of one replicate
all complete blocks are of one replicate
fewer than ten blocks tell of it
fewer than ten blocks contribute to it
it varies in one replicate alone
it varies in one replicate only
it takes all sets of inputs, too many with {inputs} of them
it needs all subsets of the inputs, too many for {inputs} inputs
indices of the input law
indices of the input distribution
indices of the input law given admissible draws
indices of the input distribution, conditional on admissible inputs
blocks holding a lost run are dropped
blocks with a failed run are left out
blocks that lack an admissible draw are dropped
blocks without an admissible draw are left out
fewer than {runs} runs lost do not tell the error
fewer than {runs} failed runs are too few for an interval
fewer than {runs} runs that came back do not tell the error
fewer than {runs} completed runs are too few for an interval
the lost runs lie apart from all others
the failed runs are completely separated from the others
inside the interval that {design} gives it
inside the interval of {design}
outside the interval that {design} gives it
outside the interval of {design}
inside the interval that {design} gives it of the runs that came back
inside the interval of {design} (completed runs only)
outside the interval that {design} gives it of the runs that came back
outside the interval of {design} (completed runs only)
outside the simultaneous band of {design} from {lowest} to {highest}
outside the simultaneous band of {design} between probabilities {lowest} and {highest}
beyond all outputs that the surrogate was fitted to
outside the training range of the surrogate
{share} % of the variance lies beyond all outputs that the surrogate was fitted to, and {note}
{share} % of the variance is outside the training range of the surrogate; {note}
no independent runs to hold it against
no independent runs to compare with
no independent runs have an interval for it
no independent runs give an interval for it
probability that an input {what} in a lost run than in another
probability that an input {what} in a failed run than in a completed one
{lowest} value of each input among the lost runs, in SI units
{lowest} value of each input among the failed runs, in SI units
independent runs that an upper bound takes at least
least number of independent runs with an upper bound
"""
_LINES = _REWORDED.strip().splitlines()

# By the earlier wording, the present one.
REWORDED = dict(zip(_LINES[::2], _LINES[1::2], strict=True))


def _pattern(template: str) -> re.Pattern[str]:
    """Return the expression for the texts of a template; no value contains a semicolon."""
    return re.compile(re.sub(r"\\\{(\w+)\\\}", r"(?P<\1>[^;]+)", re.escape(template)))


_PATTERNS = [(_pattern(old), new) for old, new in REWORDED.items()]


@cache
def reworded(text: str) -> str:
    """Return a text in its present wording: one or several notes, joined by semicolons.

    >>> reworded("it varies in one replicate alone; a note that nobody changed")
    'it varies in one replicate only; a note that nobody changed'
    """
    notes, found = text.split("; "), []
    while notes:
        # The longest beginning that has an earlier wording: some of these contain a semicolon.
        for count in range(len(notes), 0, -1):
            if present := _present("; ".join(notes[:count])):
                break
        found.append(present or notes[0])
        del notes[:count]
    return "; ".join(found)


def _present(earlier: str) -> str:
    """Return the present wording of one of the templates; empty for any other text."""
    for pattern, new in _PATTERNS:
        if match := pattern.fullmatch(earlier):
            values = match.groupdict()
            return new.format(**{**values, "note": reworded(values.get("note", ""))})
    return ""


def reworded_array(array: xr.DataArray) -> xr.DataArray:
    """Return an estimate array of an earlier schema with its texts in their present wording."""
    texts = {}
    for name in INTERVAL_TEXTS:
        if name in array.coords:
            earlier = array.coords[name]
            entries = [reworded(text) for text in np.ravel(earlier.values).tolist()]
            texts[name] = (earlier.dims, np.array(entries, dtype=object).reshape(earlier.shape))
    present = array.assign_coords(texts)
    for each in (present, *present.coords.values()):
        each.attrs = {
            key: reworded(value) if isinstance(value, str) else value
            for key, value in each.attrs.items()
        }
    return present
