"""Designs of experiments. Each yields rounds of points; none depends on a model."""

from __future__ import annotations

from uqpen.designs.rare_events import RARE_EVENT_METHODS

__all__ = ["DESIGNS"]

DESIGNS = {
    "monte-carlo": "uqpen.designs.monte_carlo:MonteCarlo",
    "latin-hypercube": "uqpen.designs.latin_hypercube:LatinHypercube",
    "sobol-sequence": "uqpen.designs.quasi_monte_carlo:SobolSequence",
    "halton": "uqpen.designs.quasi_monte_carlo:Halton",
    "quadrature": "uqpen.designs.quadrature:Quadrature",
    "full-factorial": "uqpen.designs.quadrature:FullFactorial",
    "saltelli": "uqpen.designs.saltelli:Saltelli",
    "morris": "uqpen.designs.one_at_a_time:Morris",
    "one-at-a-time": "uqpen.designs.one_at_a_time:OneAtATime",
    "multifidelity": "uqpen.designs.multifidelity:Multifidelity",
    "least-squares": "uqpen.designs.least_squares:LeastSquares",
    "posterior": "uqpen.designs.posterior:Posterior",
    "posterior-by-surrogate": "uqpen.surrogates.surrogate_posterior:SurrogatePosterior",
    "interval-bounds": "uqpen.surrogates.interval_bounds:IntervalBounds",
    **{name: method.design for name, method in RARE_EVENT_METHODS.items()},
    "salib:fast_sampler": "uqpen.designs.salib_designs:FastSampler",
    "salib:finite_diff": "uqpen.designs.salib_designs:FiniteDifferences",
    "salib:ff": "uqpen.designs.salib_designs:FractionalFactorial",
    "table": "uqpen.designs.data:TableDesign",
    "data": "uqpen.designs.data:DataDesign",
}
