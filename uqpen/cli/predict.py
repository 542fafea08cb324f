"""``uqpen predict``: a surrogate of an archive at the points of a table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from uqpen.cli.export import alternatives, table_format, write_file, write_table
from uqpen.cli.messages import show_message
from uqpen.cli.options import PATH, folder_option, trust_option
from uqpen.results import TABLE_FORMATS

if TYPE_CHECKING:
    import xarray as xr

    from uqpen.core.arrays import FloatArray
    from uqpen.core.columns import Column
    from uqpen.surrogates.archived_surrogate import ArchivedSurrogate

# A surrogate of an archive as an argument: ``ARCHIVE:NAME``.


def split_surrogate(argument: str) -> tuple[Path, str] | None:
    """Return the archive and the name of ``ARCHIVE:NAME``; no name for ``ARCHIVE`` alone.

    None stands for an argument that names no archive.
    """
    path, _, name = argument.rpartition(".nc:")
    if path:
        return Path(f"{path}.nc"), name
    return (Path(argument), "") if argument.endswith(".nc") else None


def open_surrogate(
    tree: xr.DataTree, path: Path, name: str, folder: Path | None, *, trust: bool
) -> ArchivedSurrogate:
    """Return a surrogate of an archive; the only one where no name is given.

    Code that the archive names is executed only with `trust`. `folder` has the files that its study
    names, by default those that it keeps. An UnknownNameError is raised if the archive has no such
    surrogate, or several and no name is given; else it raises as `archived_surrogate` does.
    """
    from uqpen.core.errors import UnknownNameError
    from uqpen.surrogates.archived_surrogate import archived_surrogate, surrogate_paths
    from uqpen.verification.archived_study import restored_study

    paths = surrogate_paths(tree)
    if not paths:
        raise UnknownNameError(f"{path}: contains no surrogate")
    if not name and len(paths) > 1:
        listed = ", ".join(f"{path}:{each}" for each in paths)
        raise UnknownNameError(f"{path}: contains several surrogates; expected one of {listed}")
    label = name or next(iter(paths))
    if not trust or label not in paths:
        return archived_surrogate(tree, label)
    with restored_study(tree, folder, trust=True) as restored:
        settings = restored.study.surrogates[paths[label][1]]
        return archived_surrogate(tree, label, kind=None if settings.absence else type(settings))


# The command.

_ENDINGS = alternatives(f".{ending}" for ending in (*TABLE_FORMATS, "nc"))

# Bytes of a file that are copied at a time.
_READ = 2**24


@click.command(short_help="Predict outputs at given points by a surrogate.")
@click.argument("surrogate", metavar="ARCHIVE:NAME")
@click.argument("points", type=PATH)
@click.option("-o", "file", type=PATH, help=f"The file to write, {_ENDINGS}.")
@folder_option("an archive's study")
@trust_option
def predict(
    surrogate: str, points: Path, file: Path | None, folder: Path | None, trust: bool
) -> None:
    """Predict outputs at POINTS by the surrogate NAME of ARCHIVE; no model is run.

    POINTS is a CSV file with a column "name [unit]" for each input, or a NetCDF file with a
    variable for each. An input of texts has them there, too. The predictions follow as further
    columns, in the units of the study. An output with dimensions has a row for each of its places.
    The column "extrapolated" names the inputs that are outside of the training range. Without -o,
    the table goes to standard output.
    A NetCDF file has all dimensions, in SI units.
    """
    from uqpen.archive.read import open_archive
    from uqpen.cli.prediction_table import prediction_parts
    from uqpen.core.columns import read_columns
    from uqpen.core.errors import UnknownNameError
    from uqpen.core.lookup import choices, nearest

    is_dataset = file is not None and file.suffix.lower() == ".nc"
    kind = "" if is_dataset else table_format(file)
    archive = split_surrogate(surrogate)
    if archive is None:
        raise UnknownNameError(f"{surrogate}: expected ARCHIVE.nc:NAME")
    found = open_surrogate(open_archive(archive[0]), *archive, folder, trust=trust)
    known = [variable.name for variable in found.inputs]
    # A heading of the data file that the runs come from is the title of an input.
    names = {each.title: each.name for each in found.inputs} | {name: name for name in known}
    labels = {each.name: each.labels for each in found.inputs}
    texts = {heading: labels[name] for heading, name in names.items()}
    columns = tuple(
        replace(each, name=names.get(each.name, each.name))
        for each in read_columns(points, texts).columns
    )
    taken = [column for column in columns if column.name in known]
    if ignored := [column.name for column in columns if column.name not in known]:
        show_message(f"columns that are no input: {', '.join(ignored)}")
        absent = set(known).difference(column.name for column in taken)
        for name in ignored:
            if nearest(name, absent):
                show_message(f'column "{name}": {choices(name, known)}')
    values, text = _checked_values(found, taken, points)
    for said in filter(None, (text, found.refutation_text)):
        show_message(said)
    if is_dataset and file is not None:
        del columns, taken  # of many points, their numbers take as much as the values
        import tempfile

        import xarray as xr

        from uqpen.archive.netcdf import write_tree
        from uqpen.cli.messages import printable
        from uqpen.surrogates.archived_surrogate import EXTRAPOLATED

        # NetCDF has no booleans.
        predicted = found.predict(values)
        numbers = predicted.assign({EXTRAPOLATED: predicted[EXTRAPOLATED].astype("int8")})
        with tempfile.TemporaryDirectory() as made:
            whole = Path(made) / file.name
            write_tree(xr.DataTree(numbers), whole)
            with whole.open("rb") as stream:
                write_file(file, iter(lambda: stream.read(_READ), b""))
        click.echo(printable(str(file)))
    else:
        write_table(prediction_parts(found, values, taken), kind, file)


def _checked_values(
    found: ArchivedSurrogate, columns: list[Column], points: Path
) -> tuple[dict[str, FloatArray], str]:
    """Return the points in SI units, and a text on those outside of the training range."""
    from uqpen.core.errors import ModelError, TableError

    units = {variable.name: variable.unit for variable in found.inputs}
    names = [column.name for column in columns]
    if twice := next((name for name in names if names.count(name) > 1), ""):
        raise TableError(f'"{points.name}": column "{twice}" stands twice')
    values = {column.name: column.values(units[column.name]) for column in columns}
    try:
        return values, found.extrapolation_text(found.extrapolation(values))
    except ModelError as error:
        raise TableError(f'"{points.name}": {error}') from None
