"""``uqpen serve``: models for any UM-Bridge client to run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    import xarray as xr

    from uqpen.core.model import Model, Output
    from uqpen.server import ModelServer, ServedModel
    from uqpen.study.study import Study

__all__ = ["make_offers", "serve"]


@click.command(short_help="Offer a model to any UM-Bridge client.")
@click.argument("model")
@click.option(
    "--inputs",
    "named",
    metavar="A,B,C",
    help="Which inputs make up the vector, in this order.",
)
@click.option("--port", type=click.IntRange(0, 65535), default=4242, show_default=True)
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Where to listen; beyond this machine only if you say so.",
)
@click.option(
    "--folder",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Take the files that an archive's study names from here.  [default: those that it keeps]",
)
def serve(model: str, named: str | None, port: int, host: str, folder: Path | None) -> None:
    """Offer MODEL to any UM-Bridge client until Ctrl-C.

    MODEL is a built-in model, a study file (its models), or an archive (its surrogates; of
    several, ARCHIVE:NAME is one).

    A run takes one vector of inputs and gives one of outputs, in SI units; which ones, is printed.
    """
    from uqpen.server import ModelServer

    order = tuple(name.strip() for name in named.split(",")) if named else ()
    offered = make_offers(model, order, folder)
    for offer in offered:
        offer.model.prepare()
    try:
        server = ModelServer(offered, host, port)
    except OSError as error:
        message = f"cannot listen at {host}, port {port}: {error.strerror or error}"
        raise click.UsageError(message) from None
    with server:
        _show(server)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            click.echo("stopped", err=True)


def make_offers(
    model: str, named: tuple[str, ...] = (), folder: Path | None = None
) -> list[ServedModel]:
    """What a server is to offer.

    Parameters
    ----------
    model : str
        As on the command line: a built-in model, a study file, or an archive.
    named : tuple of str
        The inputs that make up the vector, if others than by default.
    folder : Path, optional
        Where to take the files that an archive's study names, in place of those that it keeps.

    Raises
    ------
    UqpenError
        If there is no such model, or it lacks an input.
    """
    from uqpen.core.lookup import resolve_name
    from uqpen.models import MODELS

    path, _, label = model.rpartition(".nc:")
    if path or model.endswith(".nc"):
        archive, label = (Path(f"{path}.nc"), label) if path else (Path(model), "")
        return _archive_offers(archive, label, named, folder)
    if model.endswith(".toml"):
        return list(_study_offers(Path(model), named))
    return [_model_offer(resolve_name(MODELS, model, "model")(), named)]


def _model_offer(model: Model, named: tuple[str, ...]) -> ServedModel:
    """A built-in model: what must be given makes up the vector, the rest has its default."""
    from uqpen.execution import Evaluator
    from uqpen.server import ServedModel

    needed = set(model.missing_inputs(()))
    varied = named or tuple(v.name for v in model.inputs if v.name in needed)
    defaults = {v.name: v.default for v in model.inputs if v.default is not None}
    return ServedModel(model.name, Evaluator(model), varied, _fixed_values(defaults, varied))


def _study_offers(path: Path, named: tuple[str, ...]) -> Iterator[ServedModel]:
    """The models of a study: what it draws makes up the vector, the rest is as it says."""
    from uqpen.execution import Evaluator
    from uqpen.server import ServedModel
    from uqpen.study.load import load_study

    study = load_study(path)
    drawn = tuple(entry.variable.name for entry in study.joint.random)
    for label, variant in study.models.items():
        model = variant.model
        known = {variable.name for variable in model.inputs}
        varied = named or tuple(name for name in drawn if name in known)
        fixed = {**study.joint.nominal(), **variant.given}
        evaluator = Evaluator(model, study.constraints)
        yield ServedModel(label or model.name, evaluator, varied, _fixed_values(fixed, varied))


def _archive_offers(
    path: Path, label: str, named: tuple[str, ...], folder: Path | None
) -> list[ServedModel]:
    """The surrogates of an archive, or the one with a label."""
    from uqpen.archive.read import group_names, model_trees, open_archive
    from uqpen.core.errors import UnknownNameError
    from uqpen.core.labels import SURROGATES
    from uqpen.core.lookup import choices
    from uqpen.verification.restored_study import restored_study

    tree = open_archive(path)
    found = {
        f"{model}/{name}" if model else name: (model, name)
        for model, model_tree in model_trees(tree).items()
        for name in group_names(model_tree, SURROGATES)
    }
    if not found and not label:
        raise UnknownNameError(f"{path}: holds no surrogate, and nothing else of it can be served")
    if not found or (label and label not in found):
        raise UnknownNameError(f'{path}: no surrogate "{label}"; {choices(label, found)}')
    # Nothing that the archive names is executed: only what is admissible is asked of its models.
    with restored_study(tree, folder, trust=False) as restored:
        return [
            _surrogate_offer(tree, restored.study, offered, *found[offered], named)
            for offered in ([label] if label else found)
        ]


def _surrogate_offer(
    tree: xr.DataTree, study: Study, label: str, model: str, name: str, named: tuple[str, ...]
) -> ServedModel:
    """A surrogate: what it was fitted in makes up the vector, the rest is as in those runs."""
    from uqpen.archive.read import model_trees
    from uqpen.core.labels import SURROGATES
    from uqpen.execution import Evaluator
    from uqpen.server import ServedModel
    from uqpen.surrogates.restoring import restore_surrogate

    variant = study.models[model]
    group = model_trees(tree)[model].children[SURROGATES].children[name]
    surrogate = restore_surrogate(group, label, variant.model)
    varied = named or surrogate.random_inputs
    fixed = {**study.joint.nominal(), **variant.given, **surrogate.fixed}
    evaluator = Evaluator(surrogate, study.constraints)
    return ServedModel(label, evaluator, varied, _fixed_values(fixed, varied))


def _fixed_values(values: Mapping[str, float], varied: Sequence[str]) -> dict[str, float]:
    return {name: value for name, value in values.items() if name not in varied}


def _show(server: ModelServer) -> None:
    """Say where the server listens, and what the vectors are made of."""
    from uqpen.cli.screen import plain_table, standard_output

    console = standard_output()
    for offer in server.offers.values():
        console.print(offer.name, style="bold", markup=False)
        for header, rows in (
            (["input", "unit", "values"], [(v.name, v.unit, str(v.bounds)) for v in offer.inputs]),
            (["held", "unit", "value"], _fixed_inputs(offer)),
            (
                ["output", "unit", "values"],
                [(v.name, v.unit, _describe_values(v)) for v in offer.outputs],
            ),
        ):
            if rows:
                console.print()
                console.print(plain_table(header, rows))
        console.print()
    message = f"listening at {server.url} (UM-Bridge); Ctrl-C ends it"
    console.print(message, soft_wrap=True, markup=False, highlight=False)


def _fixed_inputs(offer: ServedModel) -> list[tuple[str, str, str]]:
    """The inputs that a client cannot change."""
    return [
        (variable.name, variable.unit, f"{offer.fixed_inputs[variable.name]:.10g}")
        for variable in offer.model.inputs
        if variable.name in offer.fixed_inputs
    ]


def _describe_values(output: Output) -> str:
    """Return the possible values of an output; a kind is given by its number."""
    kinds = [f"{number}: {kind.label}" for number, kind in enumerate(output.categories)]
    return ", ".join(kinds) or "a number"
