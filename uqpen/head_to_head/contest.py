"""The main path of a comparison: a study and terms in, a tree of datasets out."""

from __future__ import annotations

import xarray as xr

from uqpen import evaluation
from uqpen.designs.quasi_monte_carlo import SobolSequence
from uqpen.errors import Problem, SettingsError
from uqpen.evaluation import Map
from uqpen.head_to_head.bench import Bench
from uqpen.head_to_head.methods import methods_of
from uqpen.head_to_head.record import Record
from uqpen.head_to_head.statistics import statistics_of
from uqpen.head_to_head.terms import Terms
from uqpen.head_to_head.tree import tree_of
from uqpen.streams import Stream
from uqpen.study.study import Study

__all__ = ["Progress", "compare", "refuse"]

# What to put beside a design that has nothing to be compared with.
_SCALED_KINDS = ("monte-carlo", "latin-hypercube", "sobol-sequence", "halton")


class Progress(evaluation.Progress):
    """Who wants to know how far a comparison is; this one does not."""

    def begins(self, *, runs: int, reference: int, repeats: int, seconds: float) -> None:
        """All is known: so many runs, so many for the reference, about so long for the model."""

    def repeated(self, done: int) -> None:
        """So many repeats are done; the first comes after the reference, told as 0."""


def compare(
    study: Study,
    terms: Terms | None = None,
    *,
    map: Map = map,
    progress: Progress | None = None,
) -> xr.DataTree:
    """Try the methods of a study at equal budgets, and hold each estimate to a reference.

    Parameters
    ----------
    study : Study
        What `load_study` returns; its designs are the methods.
    terms : Terms, optional
        Budgets, repeats and the size of the reference.
    map : callable
        Like the built-in: where batches of runs are made. It cannot change a result.
    progress : Progress, optional
        Told how far it is.

    Returns
    -------
    DataTree
        ``/methods``, the reference's answers in ``/reference/<group>``, and for each output
        ``/estimates/<output>``, ``/errors/<output>``, ``/slopes/<output>`` and
        ``/verdicts/<output>``.

    Raises
    ------
    SettingsError
        If the study has nothing to compare.
    """
    terms, progress = terms or Terms(), progress or Progress()
    refuse(study, terms)
    methods = methods_of(study, terms.budgets)
    progress.preparing(study.model.name)
    study.model.prepare()
    bench = Bench(study, map, progress)
    runs, replicates = terms.reference_design(vectorized=study.model.vectorized)
    each = sum(method.spent(budget).runs for method in methods for budget in terms.budgets)
    total = runs + each * terms.repeats
    seconds = bench.seconds_per_run() * total
    progress.begins(runs=total, reference=runs, repeats=terms.repeats, seconds=seconds)
    stream = Stream(study.seed, "head_to_head", "reference")
    truth = bench.answers(bench.runs(SobolSequence(runs, replicates), stream))
    progress.repeated(0)
    record = Record.empty(
        methods, terms, tuple(statistics_of(study.questions)), truth, reference_runs=runs
    )
    # Repeat by repeat: each takes as long as the one before, which tells the end.
    for repeat in range(terms.repeats):
        _repeat(bench, record, repeat)
        progress.repeated(repeat + 1)
    return tree_of(study, record, truth)


def _repeat(bench: Bench, record: Record, repeat: int) -> None:
    """Try every method once at every budget, with random numbers of its own each time."""
    for position, method in enumerate(record.methods):
        for number, budget in enumerate(record.terms.budgets):
            if method.spent(budget).runs:
                stream = Stream(bench.study.seed, "head_to_head", method.name, budget, repeat)
                answers = method.answers(bench, budget, stream)
                record.enter(position, number, repeat, answers)


def refuse(study: Study, terms: Terms) -> None:
    """Refuse a study that has nothing to compare, before anything runs.

    Raises
    ------
    SettingsError
        Saying what was found and what is expected.
    """
    if study.has_several_models:
        found = f"{len(study.models)} models, {', '.join(study.models)}"
        expected = "a single [model]: methods are compared on one"
        raise SettingsError([Problem(("models",), found, expected)])
    able = sorted({method.source for method in methods_of(study, terms.budgets)})
    if len(able) < 2:
        found = f"{', '.join(able) or 'none'} that can be scaled to these budgets"
        expected = f"at least two, of kinds {', '.join(_SCALED_KINDS)}, or a surrogate"
        raise SettingsError([Problem(("designs",), found, expected)])
    if next(statistics_of(study.questions), None) is None:
        raise SettingsError([Problem(("model",), "no output that is a number", "at least one")])
