"""Storage of a fitted polynomial chaos as a dataset, with all that evaluation needs.

A variable holds each input's recurrence, and two each output's terms: their degrees and their
coefficients. What is known of a fit stands in the attributes of the coefficients.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
import xarray as xr

from uqpen.core.labels import INPUT, ROLE
from uqpen.core.model import Input
from uqpen.core.status import Status
from uqpen.surrogates.basis import ProductBasis
from uqpen.surrogates.expansion import Expansion
from uqpen.surrogates.univariate_basis import UnivariateBasis

__all__ = ["FIXED", "LOGARITHM", "REASON", "RECURRENCE", "to_dataset"]

_KIND = "polynomial-chaos"
RECURRENCE = "recurrence"
REASON = "_not_fitted"
# Before the name of a fixed input, which might be that of an output's coefficients.
FIXED = "fixed_"

# Attributes can hold neither true nor false.
_LINEAR, LOGARITHM, _NO_TRANSFORM = "linear", "logarithm", "none"


class _Storable(Protocol):
    """Attributes of a fitted surrogate that are stored; see `PolynomialChaosModel`."""

    @property
    def inputs(self) -> tuple[Input, ...]: ...
    @property
    def basis(self) -> ProductBasis: ...
    @property
    def expansions(self) -> Mapping[str, Expansion]: ...
    @property
    def reasons(self) -> Mapping[str, str]: ...
    @property
    def fixed(self) -> Mapping[str, float]: ...
    @property
    def truncation(self) -> float: ...
    @property
    def design(self) -> str: ...
    @property
    def counts(self) -> Mapping[Status, int]: ...
    @property
    def is_independent(self) -> bool: ...


def to_dataset(model: _Storable) -> xr.Dataset:
    """Convert a fitted polynomial chaos to the group of an archive."""
    variables: dict[str, Any] = {}
    given = {variable.name: variable for variable in model.inputs}
    for basis in model.basis.univariate_bases:
        variables[f"{basis.name}_{RECURRENCE}"] = _univariate_basis_variable(
            basis, given[basis.name]
        )
    for name, value in model.fixed.items():
        variables[f"{FIXED}{name}"] = (
            (),
            value,
            _variable_attributes(given[name]) | {ROLE: "input"},
        )
    for name, expansion in model.expansions.items():
        variables |= _expansion_variables(name, expansion)
    dataset = xr.Dataset(variables, {INPUT: _input_names(model)}, _group_attributes(model))
    return dataset.assign_attrs(
        {f"{name}{REASON}": reason for name, reason in model.reasons.items()}
    )


def _input_names(model: _Storable) -> tuple[str, Any, dict[str, str]]:
    names = np.array(model.basis.names, dtype=object)
    return (INPUT, names, {"long_name": "random input"})


def _group_attributes(model: _Storable) -> dict[str, Any]:
    """Return the attributes of the group."""
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


def _univariate_basis_variable(
    basis: UnivariateBasis, variable: Input
) -> tuple[tuple[str, str], Any, dict[str, Any]]:
    attributes = {
        "long_name": f"recurrence coefficients of the polynomials in {variable.title}",
        "units": "1",
        "germ": LOGARITHM if basis.is_logarithm else _LINEAR,
        "location": basis.location,
        "scale": basis.scale,
        "of_units": variable.unit,
        "of_display_units": variable.preferred_unit,
        "of_long_name": variable.title,
    }
    dimensions = (f"{basis.name}_coefficient", f"{basis.name}_degree")
    return dimensions, np.stack([basis.centres, basis.ratios]), attributes


def _expansion_variables(name: str, expansion: Expansion) -> dict[str, Any]:
    output, noise, check = expansion.output, expansion.noise, expansion.check
    terms = f"{name}_term"
    logarithm = "the logarithm of " if expansion.is_logarithm else ""
    attributes = {
        "long_name": f"coefficients of {logarithm}{output.title}",
        "units": "1" if expansion.is_logarithm else output.unit,
        "of_units": output.unit,
        "of_display_units": output.preferred_unit,
        "of_long_name": output.title,
        "transform": LOGARITHM if expansion.is_logarithm else _NO_TRANSFORM,
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


def _variable_attributes(variable: Input) -> dict[str, str]:
    return {
        "long_name": variable.title,
        "units": variable.unit,
        "display_units": variable.preferred_unit,
    }
