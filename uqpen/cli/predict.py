"""``uqpen predict``: a surrogate of an archive at the points of a table."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from uqpen.cli.options import PATH, folder_option, trust_option
from uqpen.cli.surrogate_argument import open_surrogate, split_surrogate

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from uqpen.core.columns import Column
    from uqpen.surrogates.archived_surrogate import ArchivedSurrogate

__all__ = ["predict"]


@click.command(short_help="Predict outputs at given points by a surrogate.")
@click.argument("surrogate", metavar="ARCHIVE:NAME")
@click.argument("points", type=PATH)
@click.option("-o", "file", type=PATH, help="The file to write, .csv, .json or .parquet.")
@folder_option("an archive's study")
@trust_option
def predict(
    surrogate: str, points: Path, file: Path | None, folder: Path | None, trust: bool
) -> None:
    """Predict outputs at POINTS by the surrogate NAME of ARCHIVE; no model is run.

    POINTS is a CSV file with a column "name [unit]" for each input, or a NetCDF file with a
    variable for each. The predictions follow as further columns, in the units of the study. The
    column "extrapolated" names the inputs that are outside of the training range. Without -o, the
    table goes to standard output.
    """
    from uqpen.archive.read import open_archive
    from uqpen.cli.printable import printable
    from uqpen.cli.table_file import table_format, write_table
    from uqpen.core.columns import read_columns
    from uqpen.core.errors import UnknownNameError

    kind = table_format(file)
    archive = split_surrogate(surrogate)
    if archive is None:
        raise UnknownNameError(f"{surrogate}: expected ARCHIVE.nc:NAME")
    found = open_surrogate(open_archive(archive[0]), *archive, folder, trust=trust)
    known = {variable.name for variable in found.inputs}
    columns = read_columns(points).columns
    taken = [column for column in columns if column.name in known]
    if ignored := [column.name for column in columns if column.name not in known]:
        click.echo(printable(f"columns that are no input: {', '.join(ignored)}"), err=True)
    predicted = _predict(found, taken, points)
    if text := found.extrapolation_text(predicted):
        click.echo(printable(text), err=True)
    write_table(_table(found, predicted, taken), kind, file)


def _predict(found: ArchivedSurrogate, columns: list[Column], points: Path) -> xr.Dataset:
    from uqpen.core.errors import ModelError, TableError

    units = {variable.name: variable.unit for variable in found.inputs}
    names = [column.name for column in columns]
    if twice := next((name for name in names if names.count(name) > 1), ""):
        raise TableError(f'"{points.name}": column "{twice}" stands twice')
    values = {column.name: column.values(units[column.name]) for column in columns}
    try:
        return found.predict(values)
    except ModelError as error:
        raise TableError(f'"{points.name}": {error}') from None


def _table(found: ArchivedSurrogate, predicted: xr.Dataset, columns: list[Column]) -> pd.DataFrame:
    """Return the points as their file has them, the predictions, and the inputs out of range."""
    import numpy as np
    import pandas as pd

    from uqpen.core.labels import INPUT
    from uqpen.core.units import scale
    from uqpen.results.table import label_with_unit
    from uqpen.surrogates.archived_surrogate import EXTRAPOLATED, std_name

    table = {column.heading: column.load() for column in columns}
    for output in found.outputs:
        unit, std = output.preferred_unit, std_name(output)
        table[label_with_unit(output.name, unit)] = scale(unit).from_si(predicted[output.name])
        if std in predicted:
            deviations = scale(unit).difference_from_si(predicted[std])
            table[label_with_unit(std, unit)] = deviations
    marked = predicted[EXTRAPOLATED]
    inputs = marked[INPUT].values
    outside = [" ".join(inputs[row]) for row in np.atleast_2d(marked.values)]
    return pd.DataFrame({**table, EXTRAPOLATED: outside})
