"""A fitted polynomial chaos as a dataset, and back: an archive holds all that evaluation needs.

A variable holds each input's recurrence, and two each output's terms: their degrees and their
coefficients. What is known of a fit stands in the attributes of the coefficients.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from uqpen.labels import INPUT, ROLE, Status
from uqpen.model import Input, Model, Output
from uqpen.surrogates.basis import Basis
from uqpen.surrogates.chaos_model import ChaosModel
from uqpen.surrogates.expansion import Check, Expansion
from uqpen.surrogates.fit_noise import FitNoise
from uqpen.surrogates.germ import Germ

__all__ = ["from_dataset", "to_dataset"]

_KIND = "polynomial-chaos"
_RECURRENCE = "recurrence"
_REASON = "_not_fitted"
# Before the name of a fixed input, which might be that of an output's coefficients.
_FIXED = "fixed_"

# Attributes can hold neither true nor false.
_LINEAR, _LOGARITHM, _NO_TRANSFORM = "linear", "logarithm", "none"


def to_dataset(model: ChaosModel) -> xr.Dataset:
    """A fitted polynomial chaos as the group of an archive."""
    variables: dict[str, Any] = {}
    given = {variable.name: variable for variable in model.inputs}
    for germ in model.basis.germs:
        variables[f"{germ.name}_{_RECURRENCE}"] = _of_germ(germ, given[germ.name])
    for name, value in model.fixed.items():
        variables[f"{_FIXED}{name}"] = ((), value, _described(given[name]) | {ROLE: "input"})
    for name, expansion in model.expansions.items():
        variables |= _of_expansion(name, expansion)
    dataset = xr.Dataset(variables, {INPUT: _input_names(model)}, _accounts(model))
    return dataset.assign_attrs(
        {f"{name}{_REASON}": reason for name, reason in model.reasons.items()}
    )


def from_dataset(dataset: xr.Dataset, name: str, original: Model | None = None) -> ChaosModel:
    """A fitted polynomial chaos from the group of an archive.

    Parameters
    ----------
    dataset : Dataset
        What `to_dataset` returned, or was read of it.
    name : str
        What it is called.
    original : Model, optional
        What it stands for; without that, every finite input counts as admissible.
    """
    names = [str(entry) for entry in dataset[INPUT].values]
    germs = tuple(_germ(entry, dataset[f"{entry}_{_RECURRENCE}"]) for entry in names)
    fixed = {
        str(entry).removeprefix(_FIXED): float(variable.values)
        for entry, variable in dataset.data_vars.items()
        if variable.attrs.get(ROLE) == "input"
    }
    inputs = [Input(*_description(entry, dataset[f"{entry}_{_RECURRENCE}"])) for entry in names]
    inputs += [Input(*_description(entry, dataset[f"{_FIXED}{entry}"])) for entry in fixed]
    expansions = {
        output: _expansion(output, dataset)
        for output in (str(entry) for entry in dataset.attrs["outputs"].split())
    }
    return ChaosModel(
        name=name,
        inputs=original.inputs if original else tuple(inputs),
        outputs=tuple(expansion.output for expansion in expansions.values()),
        basis=Basis(germs),
        expansions=expansions,
        reasons=_reasons(dataset.attrs),
        fixed=fixed,
        truncation=float(dataset.attrs["truncation"]),
        design=str(dataset.attrs["design"]),
        counts={status: int(dataset.attrs[f"runs_{status.meaning}"]) for status in Status},
        is_independent=dataset.attrs["inputs"] == "independent",
        original=original,
    )


def _input_names(model: ChaosModel) -> tuple[str, Any, dict[str, str]]:
    names = np.array(model.basis.names, dtype=object)
    return (INPUT, names, {"long_name": "random input"})


def _accounts(model: ChaosModel) -> dict[str, Any]:
    """What the group says of itself."""
    return {
        "kind": _KIND,
        "design": model.design,
        "outputs": " ".join(model.expansions),
        "truncation": model.truncation,
        "inputs": "independent" if model.is_independent else "dependent",
        "runs": sum(model.counts.values()),
        "runs_used": model.counts[Status.OK],
        **{f"runs_{status.meaning}": count for status, count in model.counts.items()},
    }


def _of_germ(germ: Germ, variable: Input) -> tuple[tuple[str, str], Any, dict[str, Any]]:
    attributes = {
        "long_name": f"recurrence coefficients of the polynomials in {variable.title}",
        "units": "1",
        "germ": _LOGARITHM if germ.is_logarithm else _LINEAR,
        "location": germ.location,
        "scale": germ.scale,
        "of_units": variable.unit,
        "of_display_units": variable.shown_unit,
        "of_long_name": variable.title,
    }
    dimensions = (f"{germ.name}_coefficient", f"{germ.name}_degree")
    return dimensions, np.stack([germ.centres, germ.ratios]), attributes


def _germ(name: str, array: xr.DataArray) -> Germ:
    centres, ratios = np.asarray(array.values, dtype=np.float64)
    attributes = array.attrs
    location, scale = float(attributes["location"]), float(attributes["scale"])
    return Germ(name, attributes["germ"] == _LOGARITHM, location, scale, centres, ratios)


def _of_expansion(name: str, expansion: Expansion) -> dict[str, Any]:
    output, noise, check = expansion.output, expansion.noise, expansion.check
    terms = f"{name}_term"
    logarithm = "the logarithm of " if expansion.is_logarithm else ""
    attributes = {
        "long_name": f"coefficients of {logarithm}{output.title}",
        "units": "1" if expansion.is_logarithm else output.unit,
        "of_units": output.unit,
        "of_display_units": output.shown_unit,
        "of_long_name": output.title,
        "transform": _LOGARITHM if expansion.is_logarithm else _NO_TRANSFORM,
        "order": expansion.order,
        "terms": len(expansion.coefficients),
        "method": expansion.method,
        "leave_one_out_error": expansion.leave_one_out,
        "cross_validation_error": expansion.cross_validation,
        "q2": expansion.q2,
        "check_runs": check.runs,
        "check_q2": check.q2,
        "check_q2_of_output": check.q2_of_output,
        "training_minimum": expansion.smallest,
        "training_maximum": expansion.largest,
        "fit_noise_refits": noise.refits,
        "fit_noise_mean": noise.mean,
        "fit_noise_std": noise.std,
    }
    return {
        f"{name}_degree": (
            (terms, INPUT),
            expansion.indices.astype(np.int32),
            {"long_name": f"degrees of the terms of {output.title}", "units": "1"},
        ),
        f"{name}_coefficient": ((terms,), expansion.coefficients, attributes),
        f"{name}_fit_noise": (
            (INPUT,),
            noise.first,
            {"long_name": f"fit noise of {output.title}'s first-order indices", "units": "1"},
        ),
    }


def _expansion(name: str, dataset: xr.Dataset) -> Expansion:
    array = dataset[f"{name}_coefficient"]
    told = array.attrs
    first = np.asarray(dataset[f"{name}_fit_noise"].values, dtype=np.float64)
    return Expansion(
        output=Output(*_description(name, array)),
        indices=dataset[f"{name}_degree"].values.astype(np.int64),
        coefficients=np.asarray(array.values, dtype=np.float64),
        is_logarithm=told["transform"] == _LOGARITHM,
        order=int(told["order"]),
        method=str(told["method"]),
        leave_one_out=float(told["leave_one_out_error"]),
        cross_validation=float(told["cross_validation_error"]),
        smallest=float(told["training_minimum"]),
        largest=float(told["training_maximum"]),
        noise=FitNoise(
            int(told["fit_noise_refits"]),
            float(told["fit_noise_mean"]),
            float(told["fit_noise_std"]),
            first,
        ),
        check=Check(
            int(told["check_runs"]), float(told["check_q2"]), float(told["check_q2_of_output"])
        ),
    )


def _described(variable: Input) -> dict[str, str]:
    return {
        "long_name": variable.title,
        "units": variable.unit,
        "display_units": variable.shown_unit,
    }


def _description(name: str, array: xr.DataArray) -> tuple[str, str, str, str]:
    """Name, unit, title and display unit of what a variable is, or is of."""
    prefix = "of_" if "of_units" in array.attrs else ""
    unit, title, shown = (
        str(array.attrs[f"{prefix}{key}"]) for key in ("units", "long_name", "display_units")
    )
    return name, unit, title, shown


def _reasons(attributes: Mapping[Any, Any]) -> dict[str, str]:
    return {
        str(key).removesuffix(_REASON): str(value)
        for key, value in attributes.items()
        if str(key).endswith(_REASON)
    }
