"""Parts of an archive's tree by their names."""

from __future__ import annotations

from typing import TYPE_CHECKING

from uqpen.core.labels import BENCHMARK, KIND, MODELS

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["group_names", "is_benchmark", "model_trees", "read_group"]


def model_trees(tree: xr.DataTree) -> dict[str, xr.DataTree]:
    """Return the group of each model by its name; for a single model, the archive as ``""``."""
    if MODELS not in tree.children:
        return {"": tree}
    return {str(name): model for name, model in tree.children[MODELS].children.items()}


def is_benchmark(tree: xr.DataTree) -> bool:
    """Return True for the archive of a benchmark of methods, False for that of a study."""
    return bool(tree.attrs.get(KIND) == BENCHMARK)


def group_names(tree: xr.DataTree, name: str) -> list[str]:
    """Return the names of the groups in a group of the root, such as the designs with runs."""
    return list(tree.children[name].children) if name in tree.children else []


def read_group(tree: xr.DataTree, *path: str) -> xr.Dataset:
    """Return the dataset of a group; an empty one where the archive has none."""
    for name in path:
        if name not in tree.children:
            import xarray as xr

            return xr.Dataset()
        tree = tree.children[name]
    return tree.to_dataset(inherit=False)
