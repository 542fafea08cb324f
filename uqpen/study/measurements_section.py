"""``measured = { … }`` of an input: a distribution that follows from measurements."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from uqpen.core.arrays import FloatArray
from uqpen.core.columns import Column
from uqpen.core.errors import SettingsError, TableError, toml_text
from uqpen.core.lookup import choices, resolve
from uqpen.core.model import Input
from uqpen.core.setting_fields import declared_settings
from uqpen.core.settings import file, text
from uqpen.core.streams import Stream
from uqpen.core.units import ANY_DIMENSION
from uqpen.distributions import DISTRIBUTIONS
from uqpen.distributions.distribution import Distribution
from uqpen.distributions.empirical import Empirical
from uqpen.distributions.joint_distribution import RandomInput
from uqpen.distributions.measurements import (
    FEWEST,
    FEWEST_FOR_A_FAMILY,
    Measurements,
    check_measurements,
    parameters_text,
    value_text,
)
from uqpen.study.table_reader import TableReader

if TYPE_CHECKING:
    from uqpen.distributions.fitting import DistributionFit

__all__ = ["MEASURED", "read_measured"]


# The key that stands where the name of a distribution would.
MEASURED = "measured"


@dataclass(frozen=True)
class _Measured:
    """Settings of measurements: a column of a file, and the family that is fitted to it."""

    file: Path = file()
    column: str | None = text(expected="the heading of a column", default=None)
    family: str | None = text(expected="the name of a distribution", default=None)


def read_measured(table: TableReader, variable: Input, stream: Stream) -> RandomInput | None:
    """Read an input from measurements; None where a mistake was noted.

    The test of a fit draws from `stream`, which is the input's own.
    """
    noted = len(table.problems)
    measured = table.whole_settings(_Measured)
    family = table.content.get("family")
    if isinstance(family, str) and family.strip():
        _check_family(table, family)
    if measured is None or len(table.problems) > noted:
        return None
    measurements = Measurements(measured.file)
    found = _read_column(table, measurements, measured.column or "", variable)
    if found is None:
        return None
    column, values = found
    source = f"{measured.file.name}, {column.heading}"
    fewest = FEWEST_FOR_A_FAMILY if measured.family else FEWEST
    for problem in check_measurements(values, column, variable, fewest=fewest):
        table.add_problem("file", f"{problem.found} in {source}", problem.expected)
    if len(table.problems) > noted:
        return None
    distribution: Distribution
    if measured.family is None:
        distribution = Empirical(tuple(values.tolist()))
        ends = (value_text(float(end), column.unit) for end in (values.min(), values.max()))
        description = f"as measured: {len(values)} values of {source}, from {' to '.join(ends)}"
        fit: dict[str, str | int | float] = {}
    else:
        fitted = _fit(table, measured.family, values, source, stream)
        if fitted is None:
            return None
        distribution = fitted.distribution
        description = (
            f"{measured.family} fitted to {len(values)} values of {source}: "
            f"{parameters_text(distribution, column.unit)}; "
            f"Kolmogorov-Smirnov distance {fitted.distance:.3g}, p = {fitted.p_value:.2g}"
        )
        fit = _fit_attributes(measured.family, fitted)
    fit = {
        "fit_family": measured.family or "empirical",
        "fit_measurements": len(values),
        "fit_source": source,
        "fit_sha256": hashlib.sha256(values.astype("<f8").tobytes()).hexdigest(),
        **fit,
    }
    files = (measurements.source,)
    return RandomInput(variable, distribution, column.unit, description, fit, files)


def _check_family(table: TableReader, family: str) -> None:
    from uqpen.distributions.fitting import fitted_families

    if family not in DISTRIBUTIONS:
        table.add_wrong("family", family, f"a distribution; {choices(family, fitted_families())}")
    elif reason := resolve(DISTRIBUTIONS[family]).unfitted_reason:
        found = f"{toml_text(family)}, which is not fitted: {reason}"
        known = ", ".join(fitted_families())
        expected = f"one of {known}, or no family for the measurements themselves"
        table.add_problem("family", found, expected)


def _read_column(
    table: TableReader, measurements: Measurements, heading: str, variable: Input
) -> tuple[Column, FloatArray] | None:
    unit = "cm" if variable.unit is ANY_DIMENSION else variable.unit
    expected = f'a CSV or NetCDF file beside the study, with a column such as "x [{unit}]"'
    try:
        _ = measurements.columns
    except TableError as error:
        table.add_problem("file", str(error), expected)
        return None
    try:
        column = measurements.column(heading)
        if variable.unit is ANY_DIMENSION:
            return None
        return column, column.values(variable.unit)
    except TableError as error:
        table.add_problem("column", str(error), f"the heading of a column of {variable.title}")
    return None


def _fit(
    table: TableReader, family: str, values: FloatArray, source: str, stream: Stream
) -> DistributionFit | None:
    from uqpen.distributions.fitting import fit_distribution

    try:
        return fit_distribution(family, values, stream.generator("fit"))
    except SettingsError as error:
        for problem in error.problems:
            table.add_problem("family", f"{problem.found}, in {source}", problem.expected)
    return None


def _fit_attributes(family: str, fitted: DistributionFit) -> dict[str, str | int | float]:
    attributes = {
        f"fit_{parameter.name}": getattr(fitted.distribution, parameter.name)
        for parameter, _ in declared_settings(fitted.distribution)
    }
    attributes["fit_test"] = "Kolmogorov-Smirnov distance; p value by parametric bootstrap"
    attributes["fit_statistic"] = fitted.distance
    attributes["fit_p_value"] = fitted.p_value
    if fitted.is_rejected:
        attributes["fit_warning"] = (
            f"{family} does not fit the measurements: of samples of the fitted law, a share of "
            f"{fitted.p_value:.2g} lies as far from it (p value)"
        )
    return attributes
