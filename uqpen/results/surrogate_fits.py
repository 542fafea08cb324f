"""The fits of a surrogate to its outputs: their diagnostics, and why one could not be made."""

from __future__ import annotations

from typing import Any

import xarray as xr

from uqpen.surrogates.storage import REASON

__all__ = ["fit_diagnostics", "fitted_outputs", "unfitted_outputs"]

# Attributes of the array that the diagnostics stand at, which are of the array and the output.
_OF_THE_ARRAY = ("of_", "units", "long_name")


def fitted_outputs(surrogate: xr.Dataset) -> list[str]:
    """Return the outputs that a surrogate was fitted to.

    Parameters
    ----------
    surrogate : Dataset
        Its group of an archive.
    """
    return str(surrogate.attrs["outputs"]).split()


def unfitted_outputs(surrogate: xr.Dataset) -> dict[str, str]:
    """Return the outputs that it could not be fitted to, each with the reason."""
    return {
        str(name).removesuffix(REASON): str(reason)
        for name, reason in surrogate.attrs.items()
        if str(name).endswith(REASON)
    }


def fit_diagnostics(surrogate: xr.Dataset, output: str) -> dict[str, Any]:
    """Return how the fit to an output was found, and how good it is.

    Parameters
    ----------
    surrogate : Dataset
        Its group of an archive.
    output : str
        One of `fitted_outputs`.

    Returns
    -------
    dict
        ``order``, ``terms``, ``q2``, ``check_q2_of_output`` and more, as the archive has them.
    """
    attributes = surrogate[f"{output}_coefficient"].attrs
    return {
        str(name): value
        for name, value in attributes.items()
        if not str(name).startswith(_OF_THE_ARRAY)
    }
