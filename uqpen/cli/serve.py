"""``uqpen serve``: models for any UM-Bridge client to run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from uqpen.cli.messages import show_message
from uqpen.cli.options import PATH, folder_option, trust_option
from uqpen.cli.predict import split_surrogate

if TYPE_CHECKING:
    from uqpen.core.model import Model, Output
    from uqpen.distributions.constraints import Constraint
    from uqpen.server import HiddenModel, ModelServer, RunBudget, ServedModel


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
@click.option(
    "--budget",
    type=click.IntRange(min=1),
    metavar="N",
    help="Answer N runs of each model in all, then refuse.",
)
@click.option(
    "--count",
    "count_file",
    type=PATH,
    metavar="FILE",
    help="The file that counts the runs of a budget, also for the next server.  "
    "[default: archives/<model>.count.jsonl]",
)
@click.option(
    "--hidden",
    is_flag=True,
    help="Hide names, units and distributions: a run takes standard normal numbers.",
)
@folder_option("an archive's study")
@trust_option
def serve(
    model: str,
    named: str | None,
    port: int,
    host: str,
    budget: int | None,
    count_file: Path | None,
    folder: Path | None,
    *,
    hidden: bool,
    trust: bool,
) -> None:
    """Offer MODEL to any UM-Bridge client until Ctrl-C.

    MODEL is a built-in model, a study file (its models), or an archive (its surrogates; of
    several, ARCHIVE:NAME is one).

    A run takes a vector of inputs and returns a vector of outputs, in SI units. Their order is
    printed. An output with dimensions is a vector of its own.

    With --budget and --hidden it is a black-box challenge.
    """
    from uqpen.server import ModelServer

    if count_file is not None and budget is None:
        raise click.UsageError("--count is the file of a --budget")
    if hidden and named:
        raise click.UsageError("--inputs are the model's own, and --hidden hides them")
    order = tuple(name.strip() for name in named.split(",")) if named else ()
    offered = make_offers(model, order, folder, trust=trust)
    shown = hidden_offers(model, offered) if hidden else offered
    for offer in offered:
        offer.model.prepare()
    with _open_budget(budget, count_file, model, shown) as counted:
        try:
            server = ModelServer(shown, host, port, counted)
        except OSError as error:
            message = f"cannot listen at {host}, port {port}: {error.strerror or error}"
            raise click.UsageError(message) from None
        with server:
            _show(server, offered)
            try:
                server.serve_forever()
            except KeyboardInterrupt:
                show_message("stopped")


def hidden_offers(model: str, offers: Sequence[ServedModel]) -> list[HiddenModel]:
    """Return the models of a study under names that say nothing of them, in standard normal space.

    A ModelError is raised for what has no distribution of its inputs.
    """
    from uqpen.core.errors import ModelError
    from uqpen.server import HiddenModel
    from uqpen.study.load import load_study

    if not model.endswith(".toml"):
        raise ModelError(f"{model}: only models of a study can be hidden: it has distributions")
    joint = load_study(model).joint
    names = [f"model_{number}" for number in range(1, len(offers) + 1)]
    if len(offers) == 1:
        names = ["model"]
    return [HiddenModel(name, offer, joint) for name, offer in zip(names, offers, strict=True)]


def _open_budget(
    runs: int | None,
    path: Path | None,
    model: str,
    shown: Sequence[ServedModel | HiddenModel],
) -> AbstractContextManager[RunBudget | None]:
    """Open the count of a budget; None where there is no budget."""
    from uqpen.server import RunBudget

    if runs is None:
        return nullcontext()
    count = path or Path("archives", f"{Path(model).stem}.count.jsonl")
    identities = {each.name: each.identity for each in shown}
    try:
        return RunBudget(count, runs, identities)
    except OSError as error:
        message = f"{count}: runs cannot be counted there: {error.strerror or error}"
        raise click.UsageError(message) from None


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
    built_in: Model = resolve_name(MODELS, model, "built-in model")()
    needed = set(built_in.missing_inputs(()))
    varied = [variable.name for variable in built_in.inputs if variable.name in needed]
    defaults = {v.name: v.default for v in built_in.inputs if v.default is not None}
    return [_offer(built_in.name, built_in, named or varied, defaults)]


def _study_offers(path: Path, named: tuple[str, ...]) -> Iterator[ServedModel]:
    """Offer the models of a study: the vector has its random inputs, the others are as it says."""
    from uqpen.archive.provenance import provenance
    from uqpen.study.identity import model_identity
    from uqpen.study.load import load_study

    study = load_study(path)
    versions = provenance()  # a count goes on after an update
    for label, variant in study.models.items():
        model = variant.model
        known = {variable.name for variable in model.inputs}
        names = (entry.variable.name for entry in study.joint.random)
        varied = named or list(filter(known.__contains__, names))
        fixed = {**study.joint.nominal(), **variant.given}
        settings = model_identity(study, label).fingerprint.items()
        fingerprint = {key: value for key, value in settings if key not in versions}
        offered = _offer(label or model.name, model, varied, fixed, study.constraints, fingerprint)
        complete = study.joint.following({*varied, *variant.given})
        yield replace(offered, evaluator=replace(offered.evaluator, complete=complete))


def _archive_offers(
    path: Path, label: str, named: tuple[str, ...], folder: Path | None, *, trust: bool
) -> Iterator[ServedModel]:
    """Offer the surrogates of an archive, or the one with a label.

    The vector has the inputs that a surrogate was fitted in, the others are as in those runs.
    """
    from uqpen.archive.read import open_archive
    from uqpen.core.errors import UnknownNameError
    from uqpen.core.lookup import choices
    from uqpen.surrogates.archived_surrogate import surrogate_paths
    from uqpen.surrogates.diagnostics import refuted_outputs
    from uqpen.verification.archived_study import restored_study, study_surrogate

    tree = open_archive(path)
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
            model, group, surrogate = study_surrogate(study, tree, offered)
            variant = study.models[model]
            for output, reason in refuted_outputs(group).items():
                show_message(f"{offered}, {output}: {reason}")
            fixed = {**study.joint.nominal(), **variant.given, **surrogate.fixed}
            varied = named or surrogate.random_inputs
            yield _offer(offered, surrogate, varied, fixed, study.constraints)


def _offer(
    name: str,
    model: Model,
    varied: Sequence[str],
    values: Mapping[str, float],
    constraints: Sequence[Constraint] = (),
    fingerprint: Mapping[str, str] | None = None,
) -> ServedModel:
    """Offer a model with some inputs in its vector, and the values of the others."""
    from uqpen.core.errors import ModelError
    from uqpen.execution import Evaluator
    from uqpen.server import ServedModel

    if model.uncallable_reason:
        raise ModelError(f"{model.uncallable_reason}; a surrogate of an archive can be served")
    fixed = {name: value for name, value in values.items() if name not in varied}
    return ServedModel(name, Evaluator(model, constraints), tuple(varied), fixed, fingerprint or {})


def _show(server: ModelServer, offers: Sequence[ServedModel]) -> None:
    """Show the address of a server, and the inputs and outputs of its models."""
    from uqpen.cli.console import show_line, show_plain_tables, standard_output

    console = standard_output()
    for offer, shown in zip(offers, server.offers.values(), strict=True):
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
        if shown is not offer:
            size = f"{shown.input_size} standard normal numbers"
            show_line(f'hidden: clients know "{shown.name}", a vector of {size}')
        console.print()
    if server.budget is not None:
        for name in server.offers:
            left = f"{server.budget.left(name)} of {server.budget.runs} runs left"
            show_line(f"{name}: {left}, counted in {server.budget.path}")
    show_line(f"listening at {server.url} (UM-Bridge); Ctrl-C ends it")


def _describe_values(output: Output) -> str:
    """Return the possible values of an output; a kind is given by its number."""
    if output.dims:
        along = " × ".join(f"{each.name} ({len(each.values)})" for each in output.dims)
        return f"a vector of numbers along {along}"
    kinds = [f"{number}: {kind.label}" for number, kind in enumerate(output.categories)]
    return ", ".join(kinds) or "a number"
