"""``uqpen serve``: models for any UM-Bridge client to run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from uqpen.cli.options import folder_option, trust_option
from uqpen.cli.surrogate_argument import split_surrogate

if TYPE_CHECKING:
    from uqpen.core.model import Model, Output
    from uqpen.distributions.constraints import Constraint
    from uqpen.server import ModelServer, ServedModel

__all__ = ["make_offers", "serve"]


@click.command(short_help="Offer a model to any UM-Bridge client.")
@click.argument("model")
@click.option(
    "--inputs",
    "named",
    metavar="A,B,C",
    help="Inputs of the vector, in this order.",
)
@click.option("--port", type=click.IntRange(0, 65535), default=4242, show_default=True)
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    help="Address to listen at; by default, only this machine can reach it.",
)
@folder_option("an archive's study")
@trust_option
def serve(
    model: str, named: str | None, port: int, host: str, folder: Path | None, trust: bool
) -> None:
    """Offer MODEL to any UM-Bridge client until Ctrl-C.

    MODEL is a built-in model, a study file (its models), or an archive (its surrogates; of
    several, ARCHIVE:NAME is one).

    A run takes a vector of inputs and returns a vector of outputs, in SI units. Their order is
    printed. An output with dimensions is a vector of its own.
    """
    from uqpen.server import ModelServer

    order = tuple(name.strip() for name in named.split(",")) if named else ()
    offered = make_offers(model, order, folder, trust=trust)
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
    model: str, named: tuple[str, ...] = (), folder: Path | None = None, *, trust: bool = False
) -> list[ServedModel]:
    """Make the models of a server, from its argument on the command line.

    `named` are the inputs that make up the vector, if others than by default. `folder` has the
    files that an archive's study names, by default those that it keeps; code among them is executed
    only with `trust`. A UqpenError is raised if there is no such model, or it lacks an input.
    """
    from uqpen.core.lookup import resolve_name
    from uqpen.models import MODELS

    if archive := split_surrogate(model):
        return list(_archive_offers(*archive, named, folder, trust=trust))
    if model.endswith(".toml"):
        return list(_study_offers(Path(model), named))
    built_in: Model = resolve_name(MODELS, model, "model")()
    needed = set(built_in.missing_inputs(()))
    varied = [variable.name for variable in built_in.inputs if variable.name in needed]
    defaults = {v.name: v.default for v in built_in.inputs if v.default is not None}
    return [_offer(built_in.name, built_in, named or varied, defaults)]


def _study_offers(path: Path, named: tuple[str, ...]) -> Iterator[ServedModel]:
    """Offer the models of a study: the vector has its random inputs, the others are as it says."""
    from uqpen.study.load import load_study

    study = load_study(path)
    for label, variant in study.models.items():
        model = variant.model
        known = {variable.name for variable in model.inputs}
        names = (entry.variable.name for entry in study.joint.random)
        varied = named or list(filter(known.__contains__, names))
        fixed = {**study.joint.nominal(), **variant.given}
        yield _offer(label or model.name, model, varied, fixed, study.constraints)


def _archive_offers(
    path: Path, label: str, named: tuple[str, ...], folder: Path | None, *, trust: bool
) -> Iterator[ServedModel]:
    """Offer the surrogates of an archive, or the one with a label.

    The vector has the inputs that a surrogate was fitted in, the others are as in those runs.
    """
    from uqpen.archive.read import model_trees, open_archive
    from uqpen.core.errors import UnknownNameError
    from uqpen.core.labels import SURROGATES
    from uqpen.core.lookup import choices
    from uqpen.surrogates.archived_surrogate import surrogate_paths
    from uqpen.surrogates.restoring import restore_surrogate
    from uqpen.verification.restored_study import restored_study

    tree = open_archive(path)
    trees = model_trees(tree)
    found = surrogate_paths(tree)
    if not found and not label:
        raise UnknownNameError(f"{path}: holds no surrogate, and nothing else of it can be served")
    if not found or (label and label not in found):
        raise UnknownNameError(f'{path}: no surrogate "{label}"; {choices(label, found)}')
    # Without trust nothing that the archive names is executed: only what is admissible is asked of
    # its models.
    with restored_study(tree, folder, trust=trust) as restored:
        study = restored.study
        for offered in [label] if label else found:
            model, name = found[offered]
            variant = study.models[model]
            group = trees[model].children[SURROGATES].children[name]
            settings = study.surrogates[name]
            loaded = None if settings.absence else type(settings)
            surrogate = restore_surrogate(group, offered, variant.model, loaded=loaded)
            fixed = {**study.joint.nominal(), **variant.given, **surrogate.fixed}
            varied = named or surrogate.random_inputs
            yield _offer(offered, surrogate, varied, fixed, study.constraints)


def _offer(
    name: str,
    model: Model,
    varied: Sequence[str],
    values: Mapping[str, float],
    constraints: Sequence[Constraint] = (),
) -> ServedModel:
    """Offer a model with some inputs in its vector, and the values of the others."""
    from uqpen.core.errors import ModelError
    from uqpen.execution import Evaluator
    from uqpen.server import ServedModel

    if model.uncallable_reason:
        raise ModelError(f"{model.uncallable_reason}; a surrogate of an archive can be served")
    fixed = {name: value for name, value in values.items() if name not in varied}
    return ServedModel(name, Evaluator(model, constraints), tuple(varied), fixed)


def _show(server: ModelServer) -> None:
    """Show the address of a server, and the inputs and outputs of its models."""
    from uqpen.cli.screen import show_line, show_plain_tables, standard_output

    console = standard_output()
    for offer in server.offers.values():
        fixed = [v for v in offer.model.inputs if v.name in offer.fixed_inputs]
        console.print(offer.name, style="bold", markup=False)
        show_plain_tables(
            console,
            (["input", "unit", "values"], [(v.name, v.unit, str(v.bounds)) for v in offer.inputs]),
            (
                ["held", "unit", "value"],
                [(v.name, v.unit, f"{offer.fixed_inputs[v.name]:.10g}") for v in fixed],
            ),
            (
                ["output", "unit", "values"],
                [(v.name, v.unit, _describe_values(v)) for v in offer.outputs],
            ),
        )
        console.print()
    show_line(f"listening at {server.url} (UM-Bridge); Ctrl-C ends it")


def _describe_values(output: Output) -> str:
    """Return the possible values of an output; a kind is given by its number."""
    if output.dims:
        along = " × ".join(f"{each.name} ({len(each.values)})" for each in output.dims)
        return f"a vector of numbers along {along}"
    kinds = [f"{number}: {kind.label}" for number, kind in enumerate(output.categories)]
    return ", ".join(kinds) or "a number"
