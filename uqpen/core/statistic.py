"""Record of a statistic: all that the study, the archive and every surface know of it by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import Enum, StrEnum
from typing import Any

from uqpen.core.labels import RANK

# The record of a user-defined statistic in attributes of its variable: the beginning of their
# names, and the fields of `Shown` that they keep.
RECORD = "shown_"
RECORD_WORDS = ("label", "sentence", "axis")
RECORD_NUMBERS = ("row", "rank", "is_compared")


@dataclass(frozen=True)
class EntryDimension:
    """Dimension that the entries of a statistic lie along, such as the levels of its quantiles."""

    # Its name in an archive. No field can lie along a dimension of this name.
    name: str
    kind: str = "number"  # kind of its labels: ``"number"``, ``"count"`` or ``"text"``
    # Further coordinates along it, with their kinds.
    companions: Mapping[str, str] = field(default_factory=dict)
    # Those that exist only where a study asks for them.
    optional: Mapping[str, str] = field(default_factory=dict)
    is_listed: bool = True  # false for one that tables and lists leave out, unless it is asked for


@dataclass(frozen=True)
class Request:
    """Request for the entries of a statistic, in a table ``[outputs.<name>]``."""

    key: str = ""  # its key in the study file, and its argument in Python
    # An entry in the summary of a study, with ``{entry}`` for the number; empty where that has
    # words of its own.
    summary: str = ""
    field: str = ""  # field of the quantity of interest, if that has another name than the key
    # Reference to the declaration of the field. Without one it is written out there.
    declared_by: str = ""
    always: tuple[float, ...] = ()  # entries that every study has
    # What an output with dimensions has none of; empty where it has the statistic.
    refusal: str = ""

    @property
    def attribute(self) -> str:
        """Name of the field of the quantity of interest."""
        return self.field or self.key


@dataclass(frozen=True)
class Shown:
    """Place and words of a statistic in tables and lists.

    Parameters
    ----------
    label : str
        Its label, with ``{entry}`` for the entry.
    row : int
        Rank of its rows in a table of statistics.
    json : str
        Key of its entries in JSON; a statistic without entries stands there under its name.
    entry : str
        How an entry is written: ``"text"`` as it is, ``"number"``, ``"percent"`` of a probability,
        or ``"probability"`` of a quantile.
    coordinate : str
        Coordinate with the entries, if it is not the statistic's own dimension.
    ends : str
        Of a tolerance limit: which of its ends it states, ``"at most"``, ``"at least"`` or
        ``"between"``.
    rank : int
        Place among the statistics that a page states first, of those that the study asks for.
    sentence : str
        Sentence on an entry, with ``{entry}``, ``{label}``, ``{output}`` and
        ``{estimate}``.
    axis : str
        Label of an axis with its estimates, if that is not the output's.
    is_compared : bool
        Whether sources, models and archives are compared by it.
    event : str
        Of a probability that a study can accept, and which then has a verdict: where the output
        lies in its event.
    """

    label: str = ""
    row: int = 0
    json: str = ""
    entry: str = "text"
    coordinate: str = ""
    ends: str = ""
    rank: int = 99
    sentence: str = "The {label} of {output} is {estimate}."
    axis: str = ""
    is_compared: bool = False
    event: str = ""

    @property
    def has_verdict(self) -> bool:
        """True if a study can accept its entries."""
        return bool(self.event)


@dataclass(frozen=True)
class Measure:
    """Place and words of a measure of the inputs' part in an output or in an event."""

    label: str = ""  # its name in a table or a chart
    table: str = ""  # name of the table that it is a column of
    # Its place among all measures. The first one that an archive has orders the inputs, of those
    # with a `reason`.
    rank: int = 99
    # Shape of its dots in a chart; empty for one that stands in tables alone.
    marker: str = "circle"
    # Of a part of a variance: that of an input ``"alone"``, the ``"total"`` with its interactions,
    # or the one by which a variance is ``"divided"`` also where inputs depend on each other.
    share: str = ""
    reason: str = ""  # words for an order of the inputs by it; empty where it orders none
    # Sentence on the first of that order, with ``{input}``, ``{output}`` and ``{estimate}``; a
    # share has sentences of its own.
    sentence: str = ""
    # Title of a chart of its magnitudes by itself; empty for one that shares a chart with others.
    chart: str = ""
    axis: str = ""  # label of the axis of its chart; a share has one that depends on the inputs
    # ``"output"`` and ``"input"``, where it is in per cent of their values.
    relative_to: tuple[str, ...] = ()
    # Key in JSON of one that lies along more than the inputs. It stands there under the name of the
    # statistic that it follows from.
    json: str = ""


class UnitRule(Enum):
    """Relation of a statistic's unit to the unit of its output."""

    VALUE = "a value of the output"
    """Converted with the offset of the unit: 0 degC is 273.15 K."""
    DIFFERENCE = "a difference of two values of the output"
    """Converted by the factor of the unit alone."""
    NONE = "a plain number"


@dataclass(frozen=True)
class Statistic:
    """Description of a statistic.

    Parameters
    ----------
    name : str
        Name of its variable in an archive.
    title : str
        Name for display.
    dims : tuple of str
        Names of its dimensions; an estimate has ``bound`` behind them. That of a field has the
        dimensions of the field before them.
    unit : UnitRule
        Relation of its unit to that of the output.
    has_bounds : bool
        Whether it is an estimate with bounds; a place on an axis, say, is none.
    kind : str
        Kind of its values: ``"number"``, or ``"text"`` for what is said of estimates in words.
    note_is_of_estimate : bool
        Whether a note concerns the estimate rather than its interval.
    is_diagnosis : bool
        Whether it diagnoses the sample of other estimates, which have notes of their own.
    recipe : int
        Version of the recipe that its interval is made by: the number of the last change. Whoever
        changes how the interval is made takes the next number after `INTERVAL_RECIPE`.
    group : str
        Group of statistics that a study may leave out together.
    by : mapping of str to str
        References to the functions that estimate it, by what they take: ``"sample"``, ``"field"``,
        ``"part"`` of a sample, by which it is followed as runs are added, or ``"repeats"``, several
        runs at each point. Those of designs that
        are made for one purpose stand under their `Sampling`, of fields under `of_field` of that.
        One that estimates several statistics stands at the first of them. Under ``"corrected"`` is
        how real runs correct it where a surrogate estimates it, besides indices; under
        ``"stand_ins"`` how a model's stand-ins do as control variates.
    takes_weights : bool
        Whether it is right for weighted runs. Others would count every run the same.
    takes_all_values : bool
        Whether it is estimated from all values at once, and so never by blocks of runs.
    is_of_surrogates : bool
        Whether it is estimated from the draws of a surrogate.
    own : EntryDimension, optional
        The dimension that its entries lie along, where it is described here.
    asked : Request
        How a study asks for its entries; without a key where no study has to.
    shown : Shown
        Its place in tables and lists of single numbers; without a label where it has none.
    measure : Measure
        The same of a measure of the inputs' part; without a label for another statistic.
    prefix : str
        Of a statistic that follows from another: the beginning of its name.
    of : str
        The name of that other.
    """

    name: str
    title: str
    dims: tuple[str, ...] = ()
    unit: UnitRule = UnitRule.NONE
    has_bounds: bool = True
    kind: str = "number"
    note_is_of_estimate: bool = False
    is_diagnosis: bool = False
    recipe: int = 1
    group: str = ""
    by: Mapping[str, str] = field(default_factory=dict)
    takes_weights: bool = False
    takes_all_values: bool = False
    is_of_surrogates: bool = False
    own: EntryDimension | None = None
    asked: Request = Request()
    shown: Shown = Shown()
    measure: Measure = Measure()
    prefix: str = ""
    of: str = ""

    @property
    def is_function(self) -> bool:
        """True for a distribution function, which is checked and shown as a whole."""
        return RANK in self.dims


def of_field(sampling: str) -> str:
    """Return what a function takes that estimates a field from the runs of such a design."""
    return f"field, {sampling}"


def derived(
    record: Statistic, prefix: str, title: str, dims: tuple[str, ...] = (), **changes: Any
) -> Statistic:
    """Return the record of a statistic that follows from another.

    It has the unit and the recipe of the other. It is asked for, estimated and shown by itself only
    as `changes` say. The prefix is the beginning of its name, the title may have ``{title}`` for
    that of the other, and its dimensions stand before those of the other.
    """
    own = {
        "name": f"{prefix}{record.name}",
        "title": title.replace("{title}", record.title),
        "dims": (*dims, *record.dims),
        "prefix": prefix,
        "of": record.name,
        "group": "",
        "by": {},
        "takes_all_values": False,
        "is_of_surrogates": False,
        "own": None,
        "asked": Request(),
        "shown": Shown(),
    }
    return replace(record, **{**own, **changes})


class AcceptanceVerdict(StrEnum):
    """Verdict on a requirement, by the interval of an estimate."""

    MET = "met"
    """The whole interval is accepted."""
    NOT_MET = "not met"
    """No value in the interval is accepted."""
    NOT_DECIDED = "not decided"
    """A part of the interval is accepted, or there is no interval."""
