"""Parts of an archive that are of no statistic: runs, trajectories, files."""

from __future__ import annotations

from collections.abc import Iterator

from flat_archive.content import Flat, Key, NoPlaceError, Tree, describe, put, put_plain

__all__ = ["models_of", "put_model_apart", "put_root", "put_runs"]

_REASON = "lost_reason"
_LOST = "lost_run"


def put_root(flat: Flat, tree: Tree) -> None:
    """Put the root's attributes and the files of the study at their places."""
    root = tree.take("/")
    if root.variables:
        raise NoPlaceError(f"variables at the root: {', '.join(root.variables)}")
    describe(flat, Key(kind="root"), root.attributes)
    put_plain(flat, Key(kind="files"), tree.take("/files"))


def models_of(tree: Tree) -> Iterator[tuple[str, str]]:
    """The name of each model, and the path that its groups stand under."""
    names = tree.children("/models")
    yield from ((name, f"/models/{name}") for name in names)
    if not names:
        yield "", ""


def put_model_apart(flat: Flat, tree: Tree, model: str, path: str) -> None:
    """Put a model's identity and trajectory at their places."""
    if path:
        put_plain(flat, Key(model, "model"), tree.take(path))
    put_plain(flat, Key(model, "trajectory"), tree.take(f"{path}/trajectory"))


def put_runs(flat: Flat, tree: Tree, model: str, path: str) -> None:
    """Put the runs of each design at their places; the reason of each lost run is a text."""
    designs = tree.children(f"{path}/runs")
    put(flat.facts, Key(model, "runs", what="order"), tuple(designs))
    for design in designs:
        group = tree.take(f"{path}/runs/{design}")
        key = Key(model, "runs", design)
        reasons = group.variables.pop(_REASON, None)
        if reasons is not None:
            lost = group.variables[_LOST].values.tolist()
            for run, reason in zip(lost, reasons.values.tolist(), strict=True):
                put(flat.texts, key._replace(name=_REASON, at=(("run", run),)), reason)
            describe(flat, key._replace(name=_REASON), reasons.attributes)
        put_plain(flat, key, group)
