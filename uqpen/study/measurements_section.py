"""``measured = { … }`` of an input: a distribution that follows from measurements."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from uqpen.core.columns import Column
from uqpen.core.errors import SettingsError, TableError, toml_text
from uqpen.core.lookup import choices
from uqpen.core.model import Input
from uqpen.core.settings import declared_settings, file, text
from uqpen.core.streams import Stream
from uqpen.core.units import ANY_DIMENSION
from uqpen.distributions.continuous import DISTRIBUTIONS
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

FloatArray = npt.NDArray[np.float64]

# The key that stands where the name of a distribution would.
MEASURED = "measured"


@dataclass(frozen=True)
class _Measured:
    """Settings of measurements: a column of a file, and the family that is fitted to it."""

    file: Path = file()
    column: str | None = text(expected="the heading of a column", default=None)
    family: str | None = text(expected="the name of a distribution", default=None)


def read_measured(
    table: TableReader, variable: Input, folder: Path, stream: Stream
) -> RandomInput | None:
    """Read an input from measurements in `folder`; None where a mistake was noted.

    The test of a fit draws from `stream`, which is the input's own.
    """
    noted = len(table.problems)
    measured = table.whole_settings(_Measured, folder=folder)
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
    if not measured.family:
        made = _empirical(variable, values, column.unit, source)
    else:
        from uqpen.distributions.fitting import fit_distribution

        try:
            fitted = fit_distribution(measured.family, values, stream.generator("fit"))
        except SettingsError as error:
            for problem in error.problems:
                table.add_problem("family", f"{problem.found}, in {source}", problem.expected)
            return None
        made = _fitted(variable, measured.family, fitted, values, column.unit, source)
    return replace(made, files=(measurements.source,))


def _check_family(table: TableReader, family: str) -> None:
    from uqpen.distributions.fitting import FAMILIES, NOT_FITTABLE

    if family not in DISTRIBUTIONS:
        table.add_wrong("family", family, f"a distribution; {choices(family, FAMILIES)}")
    elif family in NOT_FITTABLE:
        found = f"{toml_text(family)}, which is not fitted: {NOT_FITTABLE[family]}"
        expected = f"one of {', '.join(FAMILIES)}, or no family for the measurements themselves"
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


def _empirical(variable: Input, values: FloatArray, unit: str, source: str) -> RandomInput:
    least, greatest = (value_text(float(end), unit) for end in (values.min(), values.max()))
    description = f"as measured: {len(values)} values of {source}, from {least} to {greatest}"
    attributes = _measurement_attributes("empirical", values, source)
    distribution = Empirical(tuple(values.tolist()))
    return RandomInput(variable, distribution, unit, description, attributes)


def _fitted(
    variable: Input,
    family: str,
    fitted: DistributionFit,
    values: FloatArray,
    unit: str,
    source: str,
) -> RandomInput:
    distribution = fitted.distribution
    description = (
        f"{family} fitted to {len(values)} values of {source}: "
        f"{parameters_text(distribution, unit)}; "
        f"Kolmogorov-Smirnov distance {fitted.distance:.3g}, p = {fitted.p_value:.2g}"
    )
    attributes = _measurement_attributes(family, values, source)
    for parameter, _ in declared_settings(distribution):
        attributes[f"fit_{parameter.name}"] = getattr(distribution, parameter.name)
    attributes["fit_test"] = "Kolmogorov-Smirnov distance; p value by parametric bootstrap"
    attributes["fit_statistic"] = fitted.distance
    attributes["fit_p_value"] = fitted.p_value
    if fitted.is_rejected:
        attributes["fit_warning"] = (
            f"{family} does not fit the measurements: of samples of the fitted law, a share of "
            f"{fitted.p_value:.2g} lies as far from it (p value)"
        )
    return RandomInput(variable, distribution, unit, description, attributes)


def _measurement_attributes(
    family: str, values: FloatArray, source: str
) -> dict[str, str | int | float]:
    return {
        "fit_family": family,
        "fit_measurements": len(values),
        "fit_source": source,
        "fit_sha256": hashlib.sha256(values.astype("<f8").tobytes()).hexdigest(),
    }
