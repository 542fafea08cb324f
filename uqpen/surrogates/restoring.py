"""Restore a fitted polynomial chaos from an archive; nothing in it is executed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from uqpen.core.labels import INPUT, ROLE
from uqpen.core.model import Input, Model, Output
from uqpen.core.status import Status
from uqpen.surrogates.basis import ProductBasis
from uqpen.surrogates.chaos_model import PolynomialChaosModel
from uqpen.surrogates.expansion import Expansion, PredictionCheck
from uqpen.surrogates.fit_noise import FitNoise
from uqpen.surrogates.storage import FIXED, LOGARITHM, REASON, RECURRENCE
from uqpen.surrogates.univariate_basis import UnivariateBasis

__all__ = ["restore_surrogate"]


def restore_surrogate(
    dataset: xr.Dataset, name: str, original: Model | None = None
) -> PolynomialChaosModel:
    """Restore a fitted polynomial chaos from the group of an archive.

    Parameters
    ----------
    dataset : Dataset
        The dataset of `to_dataset`, or the group read from an archive.
    name : str
        Its name.
    original : Model, optional
        The original model; without it, every finite input counts as admissible.
    """
    names = [str(entry) for entry in dataset[INPUT].values]
    univariate_bases = tuple(
        _restore_univariate_basis(entry, dataset[f"{entry}_{RECURRENCE}"]) for entry in names
    )
    fixed = {
        str(entry).removeprefix(FIXED): float(variable.values)
        for entry, variable in dataset.data_vars.items()
        if variable.attrs.get(ROLE) == "input"
    }
    inputs = [Input(*_description(entry, dataset[f"{entry}_{RECURRENCE}"])) for entry in names]
    inputs += [Input(*_description(entry, dataset[f"{FIXED}{entry}"])) for entry in fixed]
    expansions = {
        output: _restore_expansion(output, dataset)
        for output in (str(entry) for entry in dataset.attrs["outputs"].split())
    }
    return PolynomialChaosModel(
        name=name,
        inputs=original.inputs if original else tuple(inputs),
        outputs=tuple(expansion.output for expansion in expansions.values()),
        basis=ProductBasis(univariate_bases),
        expansions=expansions,
        reasons=_reasons(dataset.attrs),
        fixed=fixed,
        truncation=float(dataset.attrs["truncation"]),
        design=str(dataset.attrs["design"]),
        counts={status: int(dataset.attrs[f"runs_{status.meaning}"]) for status in Status},
        is_independent=dataset.attrs["inputs"] == "independent",
        original=original,
    )


def _restore_univariate_basis(name: str, array: xr.DataArray) -> UnivariateBasis:
    centres, ratios = np.asarray(array.values, dtype=np.float64)
    attributes = array.attrs
    location, scale = float(attributes["location"]), float(attributes["scale"])
    return UnivariateBasis(name, attributes["germ"] == LOGARITHM, location, scale, centres, ratios)


def _restore_expansion(name: str, dataset: xr.Dataset) -> Expansion:
    array = dataset[f"{name}_coefficient"]
    attributes = array.attrs
    first = np.asarray(dataset[f"{name}_fit_noise"].values, dtype=np.float64)
    return Expansion(
        output=Output(*_description(name, array)),
        indices=dataset[f"{name}_degree"].values.astype(np.int64),
        coefficients=np.asarray(array.values, dtype=np.float64),
        is_logarithm=attributes["transform"] == LOGARITHM,
        order=int(attributes["order"]),
        method=str(attributes["method"]),
        leave_one_out=float(attributes["leave_one_out_error"]),
        cross_validation=float(attributes["cross_validation_error"]),
        smallest=float(attributes["training_minimum"]),
        largest=float(attributes["training_maximum"]),
        noise=FitNoise(
            int(attributes["fit_noise_refits"]),
            float(attributes["fit_noise_mean"]),
            float(attributes["fit_noise_std"]),
            first,
        ),
        check=PredictionCheck(
            int(attributes["check_runs"]),
            float(attributes["check_q2"]),
            float(attributes["check_q2_of_output"]),
        ),
    )


def _description(name: str, array: xr.DataArray) -> tuple[str, str, str, str]:
    """Return name, unit, title and display unit of the input or output of a variable."""
    prefix = "of_" if "of_units" in array.attrs else ""
    unit, title, shown = (
        str(array.attrs[f"{prefix}{key}"]) for key in ("units", "long_name", "display_units")
    )
    return name, unit, title, shown


def _reasons(attributes: Mapping[Any, Any]) -> dict[str, str]:
    return {
        str(key).removesuffix(REASON): str(value)
        for key, value in attributes.items()
        if str(key).endswith(REASON)
    }
