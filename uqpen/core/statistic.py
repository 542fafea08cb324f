"""Record of a statistic: all that the study, the archive and every surface know of it by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from uqpen.core.labels import RANK

__all__ = ["EntryDimension", "Request", "Shown", "Statistic", "UnitRule"]


@dataclass(frozen=True)
class EntryDimension:
    """Dimension that the entries of a statistic lie along, such as the levels of its quantiles.

    Parameters
    ----------
    name : str
        Its name in an archive. No field can lie along a dimension of this name.
    kind : str
        Kind of its labels: ``"number"``, ``"count"`` or ``"text"``.
    companions : mapping of str to str
        Further coordinates along it, with their kinds.
    optional : mapping of str to str
        Those that exist only where a study asks for them.
    is_listed : bool
        False for one that tables and lists leave out, unless it is asked for.
    """

    name: str
    kind: str = "number"
    companions: Mapping[str, str] = field(default_factory=dict)
    optional: Mapping[str, str] = field(default_factory=dict)
    is_listed: bool = True


@dataclass(frozen=True)
class Request:
    """Request for the entries of a statistic, in a table ``[outputs.<name>]``.

    Parameters
    ----------
    key : str
        Its key in the study file, and its argument in Python.
    summary : str
        An entry in the summary of a study, with ``{entry}`` for the number; empty where that has
        words of its own.
    field : str
        Field of the quantity of interest, if that has another name than the key.
    declared_by : str
        Reference to the declaration of the field. Without one it is written out there.
    always : tuple of float
        Entries that every study has.
    refusal : str
        What an output with dimensions has none of; empty where it has the statistic.
    """

    key: str = ""
    summary: str = ""
    field: str = ""
    declared_by: str = ""
    always: tuple[float, ...] = ()
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
        or ``"quantile"``.
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
    has_verdict : bool
        Whether a study can accept its entries, which then have a verdict.
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
    has_verdict: bool = False


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
    recipe : int
        Version of the recipe that its interval is made by: the number of the last change. Whoever
        changes how the interval is made takes the next number after `INTERVAL_RECIPE`.
    group : str
        Group of statistics that a study may leave out together.
    by : mapping of str to str
        References to the functions that estimate it, by what they take: ``"sample"`` or
        ``"field"``. One that estimates several statistics stands at the first of them.
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
    """

    name: str
    title: str
    dims: tuple[str, ...] = ()
    unit: UnitRule = UnitRule.NONE
    has_bounds: bool = True
    kind: str = "number"
    note_is_of_estimate: bool = False
    recipe: int = 1
    group: str = ""
    by: Mapping[str, str] = field(default_factory=dict)
    takes_all_values: bool = False
    is_of_surrogates: bool = False
    own: EntryDimension | None = None
    asked: Request = Request()
    shown: Shown = Shown()

    @property
    def is_function(self) -> bool:
        """True for a distribution function, which is checked and shown as a whole."""
        return RANK in self.dims
