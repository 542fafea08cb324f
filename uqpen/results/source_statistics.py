"""Statistics of an archive by source, output and name, as tables and figures read them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from uqpen.archive.estimates import UnpackedStatistics, array_entries
from uqpen.archive.fields import field_dimensions
from uqpen.archive.groups import group_names, model_trees, read_group
from uqpen.core.catalogue import CATALOGUE, FAILURE_STATISTICS
from uqpen.core.labels import (
    AXIS_SCALE,
    BOUND,
    CAVEAT,
    CITED,
    CONDITIONAL,
    COST_SPENT,
    DIFFERENCES,
    FAILURES_GROUP,
    JOINT_GROUP,
    LARGEST_CONTRIBUTION,
    LOGARITHMIC,
    MAGNITUDES,
    MISSING,
    MODEL_FORM,
    RANK,
    RUNS,
    RUNS_ABSENT,
    SAMPLING,
    SOURCE_KIND,
    STATISTICS_GROUP,
    STATUS,
)
from uqpen.core.sampling import Sampling
from uqpen.core.statistic import RECORD, RECORD_NUMBERS, RECORD_WORDS, Shown, Statistic, UnitRule
from uqpen.core.units import DIMENSIONLESS
from uqpen.results.acceptance import StatedDecision
from uqpen.results.table import (
    cut_text,
    entry_label,
    first_runs,
    label_with_unit,
    output_names,
    shown_unit,
)
from uqpen.results.texts import plain_text

# The probability that a run ends with a status.
_OF_STATUS = next(each.name for each in FAILURE_STATISTICS.values() if STATUS in each.dims)


@dataclass(frozen=True)
class SourceStatistics:
    """The statistics of one model, or of the difference of two."""

    tree: xr.DataTree  # what an archive has of the model, or of the pair
    is_difference: bool = False  # whether it is of a pair
    # What the archive has of the model whose outputs these are, if that is not `tree`.
    described_by: xr.DataTree | None = None
    # Estimate arrays by source and output: to take one out of its group takes its time.
    _arrays: dict[tuple[str, ...], UnpackedStatistics] = field(
        default_factory=dict, compare=False, repr=False
    )
    _entries: dict[tuple[str, ...], dict[Any, xr.DataArray]] = field(
        default_factory=dict, compare=False, repr=False
    )

    @classmethod
    def of_differences(cls, archive: xr.DataTree, model: str) -> SourceStatistics:
        """Return the statistics of the difference of a model from the first."""
        tree, own = archive.children[DIFFERENCES].children[model], model_trees(archive)[model]
        return cls(tree, is_difference=True, described_by=own)

    @classmethod
    def of_model_form(cls, archive: xr.DataTree) -> SourceStatistics:
        """Return the shares of the variance over several models, which have no model."""
        first = next(iter(model_trees(archive).values()))
        tree = archive.children.get(MODEL_FORM, xr.DataTree())
        return cls(tree, is_difference=True, described_by=first)

    @cached_property
    def runs(self) -> xr.Dataset:
        """The runs of the first design of the model, which describe its inputs and outputs."""
        return first_runs(self.tree if self.described_by is None else self.described_by)

    @cached_property
    def outputs(self) -> list[str]:
        """The outputs of the model, in its order."""
        return output_names(self.runs)

    @property
    def scalar_outputs(self) -> list[str]:
        """The outputs of the model without dimensions, in its order."""
        return [each for each in self.outputs if each not in self.fields]

    @cached_property
    def fields(self) -> list[str]:
        """The outputs of the model with dimensions, in its order."""
        return [each for each in self.outputs if field_dimensions(self.runs.variables[each])]

    def attributes(self, name: str) -> dict[Any, Any]:
        """Return the attributes of an input or output."""
        return dict(self.runs.variables[name].attrs)

    def si_unit(self, name: str) -> str:
        """Return the unit that an archive has an input or output in."""
        return str(self.runs.variables[name].attrs.get("units", DIMENSIONLESS))

    def unit(self, name: str) -> str:
        """Return the unit that an input or output is shown in."""
        return shown_unit(self.runs.variables[name].attrs)

    def label(self, output: str) -> str:
        """Return the name of an output, the place to which it was cut, if it was, and its unit."""
        place = cut_text(self.runs[output])
        return label_with_unit(f"{output} at {place}" if place else output, self.unit(output))

    def reached_text(self, source: str, output: str, place: tuple[int, ...]) -> str:
        """Return which curves get to a place, given by its positions; empty where all do."""
        found = self.get(source, output, "reached")
        share = 1.0 if found is None else float(found.values[..., 0][place])
        return f" (the {100 * share:.2g} % of the curves that get there)" if share < 1 else ""

    @property
    def node(self) -> xr.DataTree | None:
        """The group whose children are the sources; None where there is none."""
        return self.tree if self.is_difference else self.tree.children.get(STATISTICS_GROUP)

    @property
    def sources(self) -> list[str]:
        """Designs, then surrogates, then publications."""
        return [] if self.node is None else [str(name) for name in self.node.children]

    def kind(self, source: str) -> str:
        """Return ``design``, ``surrogate``, ``publication``, or what several models have in common.

        That is ``difference`` of two models, or ``model form`` of all.
        """
        if self.is_difference:
            return "difference" if self.minus(source) else "model form"
        return str(self._dataset(source).attrs.get(SOURCE_KIND, "design"))

    def reason_without(self, source: str) -> str:
        """Return why a source lacks a statistic that the study asks for; empty if none is known."""
        kind = self.kind(source)
        if kind in ("surrogate", "difference"):
            return f"not estimated for a {kind}"
        sampling = read_group(self.tree, RUNS, source).attrs.get(SAMPLING)
        if kind == "design" and sampling is not None and not Sampling(sampling).is_sample:
            return f"not estimated: these runs ({sampling}) are no sample of the inputs"
        return ""

    def decision(self, source: str) -> StatedDecision | None:
        """Return the decision of a design on its claim; None without one."""
        return StatedDecision.from_source(self._dataset(source).attrs)

    def cost_spent(self, source: str) -> float | None:
        """Return what a design's runs of all models cost, in runs of the first; None if unknown."""
        cost = self._dataset(source).attrs.get(COST_SPENT)
        return None if cost is None else float(cost)

    @property
    def publications(self) -> list[str]:
        """The sources that are neither designs nor surrogates."""
        return [name for name in self.sources if self.kind(name) == "publication"]

    def _dataset(self, *path: str) -> xr.Dataset:
        return xr.Dataset() if self.node is None else read_group(self.node, *path)

    def get(self, source: str, output: str, statistic: str) -> xr.DataArray | None:
        """Return an estimate array; None where the source does not have it.

        It lies along the statistic's dimensions (``probability``, ``content``, ``threshold``,
        ``category``, ``rank``, ``input``, ``pair``) and ``bound``. Coordinates: those of the
        dimensions with their companions, and ``interval``, ``interval_label`` and ``note`` of each
        entry. Attributes: ``units``, ``long_name``, ``interval_level``, ``estimator``, the counts
        of runs, ``conditional_on``, ``missing``.
        """
        return self.statistics(source, output).get(statistic)

    def change(self, source: str, output: str, statistic: str) -> xr.DataArray | None:
        """Return by how much a statistic differs between the two models of a difference."""
        is_own = statistic in ("std", "quantile")  # which others are of the differences
        return self.get(source, output, f"difference_of_{statistic}" if is_own else statistic)

    def statistics(self, source: str, output: str) -> UnpackedStatistics:
        """Return all statistics of an output by a source, those of the catalogue first."""
        if (source, output) not in self._arrays:
            self._arrays[source, output] = UnpackedStatistics(self._dataset(source, output))
        return self._arrays[source, output]

    def entries(self, source: str, output: str, statistic: str) -> dict[Any, xr.DataArray]:
        """Return the estimates of a statistic along its first dimension in the catalogue, by label.

        Empty where the source does not have it.
        """
        key = (source, output, statistic)
        if key not in self._entries:
            found: dict[Any, xr.DataArray] = {}
            if (array := self.get(*key)) is not None:
                dims = CATALOGUE[statistic].dims if statistic in CATALOGUE else array.dims
                entries = source_entries({source: array.transpose(dims[0], ...)}, str(dims[0]))
                found = {label: entry[source] for label, entry in entries}
            self._entries[key] = found
        return self._entries[key]

    def by_source(
        self, output: str, statistic: str, sources: Iterable[str] | None = None
    ) -> dict[str, xr.DataArray]:
        """Return a statistic of an output from the sources that have it, of all or of some."""
        asked = self.sources if sources is None else sources
        found = {source: self.get(source, output, statistic) for source in asked}
        return {source: array for source, array in found.items() if array is not None}

    def absence(self, source: str, output: str) -> dict[str, Any]:
        """Return what the statistics of an output are conditional on, if not all runs have it.

        That is ``runs_absent``, the number of completed runs without a value, and
        ``conditional_on``; empty where all have one.
        """
        for attributes in self.statistics(source, output).attributes():
            if RUNS_ABSENT in attributes:
                return {key: attributes[key] for key in (RUNS_ABSENT, CONDITIONAL)}
        return {}

    def largest_contribution(self, publication: str, output: str) -> str:
        """Return the input that a publication calls the largest contribution; empty for none."""
        attributes = self._dataset(publication, output).attrs
        return str(attributes.get(LARGEST_CONTRIBUTION, ""))

    def caveat(self, source: str, output: str) -> str:
        """Return what the study says that a reader has to mind of an output; empty for nothing."""
        return str(self._dataset(source, output).attrs.get(CAVEAT, ""))

    def wants_logarithm(self, output: str) -> bool:
        """Check if the study asks for charts by the logarithm of an output."""
        found = (self._dataset(source, output).attrs.get(AXIS_SCALE) for source in self.sources)
        return LOGARITHMIC in found

    def citation(self, publication: str) -> str:
        """Return the reference of a publication."""
        return str(self._dataset(publication).attrs.get(CITED, ""))

    def are_magnitudes(self, publication: str) -> bool:
        """Return True if the responses of a publication are without their signs."""
        return MAGNITUDES in self._dataset(publication).attrs

    def minus(self, source: str) -> str:
        """Return the model whose values are subtracted in a difference; empty for none."""
        attributes = (self._dataset(source, output).attrs for output in self.outputs)
        return next((str(each["minus"]) for each in attributes if "minus" in each), "")

    def of_runs(self, group: str, design: str) -> UnpackedStatistics:
        """Return the statistics of a design's runs as a whole that a group has."""
        key = ("", group, design)
        if key not in self._arrays:
            self._arrays[key] = UnpackedStatistics(read_group(self.tree, group, design))
        return self._arrays[key]

    def failures(self, design: str) -> UnpackedStatistics:
        """Return the statistics of a design's failed runs.

        ``probability`` lies along ``status`` and ``bound``, each status by its meaning; ``larger``
        and ``further_out`` along ``input`` and ``bound``; ``lowest`` and ``highest`` along
        ``input``. Empty for a design that is no sample and lost no run. The attributes of
        ``probability`` say ``runs``, ``runs_used``, ``conditional_on`` and ``missing``.
        """
        return self.of_runs(FAILURES_GROUP, design)

    def joint_probability(self, design: str) -> xr.DataArray | None:
        """Return a design's probabilities of events of several outputs; None without any.

        Along ``event`` and ``bound``; the coordinate ``event_condition`` has each event in words.
        """
        return self.joint_statistics(design).get("joint_probability")

    def joint_probabilities(self) -> dict[str, xr.DataArray]:
        """Return those of all designs that have some."""
        names = group_names(self.tree, JOINT_GROUP)
        found = {name: self.joint_probability(name) for name in names}
        return {name: array for name, array in found.items() if array is not None}

    def joint_statistics(self, design: str) -> UnpackedStatistics:
        """Return all statistics of a design's events of several outputs.

        Beside the probabilities, these are their sensitivities to the inputs, along
        ``sensitivity_event``, ``input`` and ``bound``, where a study requests them.
        """
        return self.of_runs(JOINT_GROUP, design)

    def status_probabilities(self, design: str) -> dict[str, xr.DataArray]:
        """Return the probability of each status of a design's runs, by its meaning."""
        chances = self.failures(design).get(_OF_STATUS)
        if chances is None:
            return {}
        return dict(zip(chances[STATUS].values.tolist(), array_entries(chances), strict=True))

    def run_accounts(self, design: str) -> dict[str, str]:
        """Return the attributes by which failed runs qualify the statistics of a design."""
        attributes = self.failures(design).get(_OF_STATUS, xr.DataArray()).attrs
        return {name: attributes[name] for name in (CONDITIONAL, MISSING) if name in attributes}


def source_entries(
    arrays: Mapping[str, xr.DataArray], coordinate: str
) -> Iterator[tuple[Any, dict[str, xr.DataArray]]]:
    """Yield the label of each entry of a statistic, and its estimates by source.

    The entries are the same for all sources; a coordinate has their labels.
    """
    first = next(iter(arrays.values()), None)
    labels = [] if first is None else first.coords.variables[coordinate].values.tolist()
    entries = {source: array_entries(array) for source, array in arrays.items()}
    for position, label in enumerate(labels):
        yield label, {source: own[position] for source, own in entries.items()}


def user_defined(arrays: Mapping[str, xr.DataArray]) -> dict[str, xr.DataArray]:
    """Return the estimates that are not in the catalogue; distribution functions are too long."""
    return {
        name: arrays[name]
        for name in arrays
        if name not in CATALOGUE and BOUND in arrays[name].dims and RANK not in arrays[name].dims
    }


def is_sample_design(tree: xr.DataTree, source: str) -> bool:
    """Return whether a source of a model is a design for no quantity of interest in particular."""
    runs = read_group(tree, RUNS, source)
    if not runs:
        return False
    sampling = Sampling(runs.attrs[SAMPLING])
    return sampling.is_sample and sampling is not Sampling.PICK_FREEZE


def best_sources(tree: xr.DataTree, found: Iterable[tuple[str, xr.DataArray]]) -> list[str]:
    """Return the sources whose indices of an output are shown: all but plain samples.

    Where there are only these, or no other has a value, the largest of them is shown, the first of
    equals. Where no other has an interval, the largest of those that have one is shown beside them.
    `found` has a source and an array of its indices, which has their number of runs.
    """
    runs: dict[str, int] = {}
    with_values, with_intervals = set(), set()
    for source, array in found:
        runs.setdefault(source, int(array.attrs.get("runs", 0)))
        if np.isfinite(array.values).any():
            with_values.add(source)
        if np.isfinite(array.values[..., 1:]).any():
            with_intervals.add(source)
    samples = [source for source in runs if is_sample_design(tree, source)]
    dedicated = [source for source in runs if source not in samples]
    if not with_intervals.isdisjoint(dedicated):
        return dedicated
    if not with_values.isdisjoint(dedicated):
        samples = [source for source in samples if source in with_intervals]
    # Those without a value stay, as they say why.
    return dedicated + sorted(samples, key=lambda source: -runs[source])[:1]


# The single numbers among the statistics of an output, each under its label in a table.

# The statistics that tables show, in the order of their rows.
SHOWN = sorted(
    (each for each in CATALOGUE.values() if each.shown.label), key=lambda each: each.shown.row
)

# Those by which sources, models and archives are compared, in the order of the catalogue.
COMPARED = [each for each in CATALOGUE.values() if each.shown.is_compared]

# Probabilities of lying beyond a value that the study asks for.
THRESHOLD_PROBABILITIES = [each for each in COMPARED if each.shown.has_verdict]


def labelled_entries(
    statistic: Statistic, arrays: Mapping[str, xr.DataArray]
) -> Iterator[tuple[str, dict[str, xr.DataArray]]]:
    """Yield the entries of a statistic that tables show, with their labels.

    Each has its estimates by source, along ``bound`` alone.
    """
    if not statistic.dims:
        yield entry_label(statistic, ""), dict(arrays)
        return
    if statistic.name not in CATALOGUE:
        by_label: dict[str, dict[str, xr.DataArray]] = {}
        for source, array in arrays.items():
            for entry, each in zip(array[statistic.dims[0]].values.tolist(), array, strict=True):
                by_label.setdefault(entry_label(statistic, entry), {})[source] = each
        yield from by_label.items()
        return
    coordinate = statistic.shown.coordinate or statistic.dims[0]
    for entry, found in source_entries(arrays, coordinate):
        yield entry_label(statistic, entry), found


def described_statistics(statistics: SourceStatistics, output: str) -> list[Statistic]:
    """Return the records of an output's user-defined statistics, as their attributes have them."""
    found: dict[str, Statistic] = {}
    for source in statistics.sources:
        for name, array in user_defined(statistics.statistics(source, output)).items():
            if name not in found and (record := _described(name, array)):
                own = "1" if record.unit is UnitRule.NONE else statistics.si_unit(output)
                if array.attrs.get("units") == own:
                    found[name] = record
    return list(found.values())


def _described(name: str, array: xr.DataArray) -> Statistic | None:
    """Return the record of a statistic from its attributes; None where these have none.

    The words of an archive are a stranger's: plain text without any meaning of their own.
    """
    attributes = array.attrs
    found: dict[str, Any] = {
        key: plain_text(str(attributes[RECORD + key]), 300)
        for key in RECORD_WORDS
        if RECORD + key in attributes
    }
    for key in RECORD_NUMBERS:
        if isinstance(number := attributes.get(RECORD + key), int | float | np.number):
            found[key] = int(np.nan_to_num(np.clip(number, -999, 999)))
    rule = str(attributes.get("unit_rule", "none")).upper()
    if not found.get("label") or array.ndim > 2 or rule not in UnitRule.__members__:
        return None
    title = plain_text(str(attributes.get("long_name", name)), 100)
    shown = replace(Shown(row=999), **found)
    return Statistic(name, title, tuple(map(str, array.dims[:-1])), UnitRule[rule], shown=shown)
