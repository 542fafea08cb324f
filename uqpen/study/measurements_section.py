"""``measured = { … }`` of an input: a law that follows from measurements."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from uqpen.columns import Column
from uqpen.errors import SettingsError, TableError, as_written
from uqpen.files import FileRead
from uqpen.inputs.distribution import Distribution
from uqpen.inputs.distributions import DISTRIBUTIONS
from uqpen.inputs.empirical import Empirical
from uqpen.inputs.measurements import (
    FEWEST,
    FEWEST_OF_A_FAMILY,
    Measurements,
    parameters_shown,
    problems,
    shown,
)
from uqpen.lookup import choices
from uqpen.model import Input
from uqpen.settings import declared
from uqpen.streams import Stream
from uqpen.study.section import Section

__all__ = ["MEASURED", "Origin", "read_measured"]

FloatArray = npt.NDArray[np.float64]

# The key that stands where the name of a distribution would.
MEASURED = "measured"

_TEST = "Kolmogorov-Smirnov distance; p value by parametric bootstrap"


@dataclass(frozen=True)
class Origin:
    """A law, and what it was made from.

    Parameters
    ----------
    law : Distribution
        In SI units.
    unit : str
        That its author wrote.
    description : str
        In one line.
    fit : mapping of str to str, int or float
        Where it follows from measurements: what an archive keeps of them.
    files : tuple of FileRead
        Where those measurements stand.
    """

    law: Distribution
    unit: str
    description: str
    fit: Mapping[str, str | int | float] = field(default_factory=dict)
    files: tuple[FileRead, ...] = ()


def read_measured(table: Section, variable: Input, folder: Path, stream: Stream) -> Origin | None:
    """The law that measurements give; None where a mistake was noted.

    Parameters
    ----------
    table : Section
        What stands behind ``measured =``.
    variable : Input
        What was measured.
    folder : Path
        Where the file lies.
    stream : Stream
        The input's own, for the test of a fit.
    """
    noted = len(table.problems)
    measurements = table.settings(Measurements, folder=folder)
    heading = table.text("column", "the heading of a column", default="")
    family = table.text("family", "the name of a distribution", default="")
    table.close()
    if family:
        _check_family(table, family)
    if measurements is None or heading is None or family is None or len(table.problems) > noted:
        return None
    found = _read(table, measurements, heading, variable)
    if found is None:
        return None
    column, values = found
    source = f"{measurements.file.name}, {column.heading}"
    fewest = FEWEST_OF_A_FAMILY if family else FEWEST
    for problem in problems(values, column, variable, fewest=fewest):
        table.wrong("file", f"{problem.found} in {source}", problem.expected)
    if len(table.problems) > noted:
        return None
    if family:
        origin = _fitted(table, family, values, column.unit, source, stream)
    else:
        origin = _empirical(values, column.unit, source)
    return origin and replace(origin, files=(measurements.source,))


def _check_family(table: Section, family: str) -> None:
    from uqpen.inputs.fitting import FAMILIES, UNFITTED

    if family not in DISTRIBUTIONS:
        table.wrong("family", as_written(family), f"a distribution; {choices(family, FAMILIES)}")
    elif family in UNFITTED:
        found = f"{as_written(family)}, which is not fitted: {UNFITTED[family]}"
        expected = f"one of {', '.join(FAMILIES)}, or no family for the measurements themselves"
        table.wrong("family", found, expected)


def _read(
    table: Section, measurements: Measurements, heading: str, variable: Input
) -> tuple[Column, FloatArray] | None:
    expected = f'a CSV or NetCDF file beside the study, with a column such as "x [{variable.unit}]"'
    try:
        _ = measurements.columns
    except TableError as error:
        table.wrong("file", str(error), expected)
        return None
    try:
        column = measurements.column(heading)
        return column, column.values(variable.unit)
    except TableError as error:
        table.wrong("column", str(error), f"the heading of a column of {variable.title}")
    return None


def _empirical(values: FloatArray, unit: str, source: str) -> Origin:
    law = Empirical(tuple(values.tolist()))
    ends = f"from {shown(float(values.min()), unit)} to {shown(float(values.max()), unit)}"
    description = f"as measured: {len(values)} values of {source}, {ends}"
    return Origin(law, unit, description, _measured("empirical", values, source))


def _fitted(
    table: Section, family: str, values: FloatArray, unit: str, source: str, stream: Stream
) -> Origin | None:
    from uqpen.inputs.fitting import fit

    try:
        fitted = fit(family, values, stream.generator("fit"))
    except SettingsError as error:
        for problem in error.problems:
            table.wrong("family", f"{problem.found}, in {source}", problem.expected)
        return None
    test = f"Kolmogorov-Smirnov distance {fitted.distance:.3g}, p = {fitted.p_value:.2g}"
    law = f"{family} fitted to {len(values)} values of {source}"
    described = f"{law}: {parameters_shown(fitted.distribution, unit)}; {test}"
    attributes = _measured(family, values, source)
    for parameter, _ in declared(fitted.distribution):
        attributes[f"fit_{parameter.name}"] = getattr(fitted.distribution, parameter.name)
    attributes["fit_test"] = _TEST
    attributes["fit_statistic"] = fitted.distance
    attributes["fit_p_value"] = fitted.p_value
    if fitted.is_bad:
        attributes["fit_warning"] = (
            f"{family} does not fit the measurements: of samples of the fitted law, a share of "
            f"{fitted.p_value:.2g} lies as far from it (p value)"
        )
    return Origin(fitted.distribution, unit, described, attributes)


def _measured(family: str, values: FloatArray, source: str) -> dict[str, str | int | float]:
    """What an archive keeps of measurements, whatever law they gave."""
    return {
        "fit_family": family,
        "fit_measurements": len(values),
        "fit_source": source,
        "fit_sha256": hashlib.sha256(values.astype("<f8").tobytes()).hexdigest(),
    }
