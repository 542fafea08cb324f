"""Random inputs: distributions with units, their joint distribution, and constraints on it."""

from __future__ import annotations

__all__ = ["COPULAS", "DISTRIBUTIONS"]

DISTRIBUTIONS = {
    "normal": "uqpen.distributions.univariate:Normal",
    "lognormal": "uqpen.distributions.univariate:Lognormal",
    "uniform": "uqpen.distributions.univariate:Uniform",
    "rectangular": "uqpen.distributions.univariate:Uniform",
    "log-uniform": "uqpen.distributions.univariate:LogUniform",
    "triangular": "uqpen.distributions.univariate:Triangular",
    "beta": "uqpen.distributions.univariate:Beta",
    "gamma": "uqpen.distributions.univariate:Gamma",
    "weibull": "uqpen.distributions.univariate:Weibull",
    "gumbel": "uqpen.distributions.univariate:Gumbel",
    "exponential": "uqpen.distributions.univariate:Exponential",
    "rayleigh": "uqpen.distributions.univariate:Rayleigh",
    "pareto": "uqpen.distributions.univariate:Pareto",
    "generalised-extreme-value": "uqpen.distributions.univariate:GeneralisedExtremeValue",
    "student": "uqpen.distributions.univariate:Student",
    "logistic": "uqpen.distributions.univariate:Logistic",
    "arcsine": "uqpen.distributions.univariate:Arcsine",
    "discrete": "uqpen.distributions.univariate:Discrete",
    "choice": "uqpen.distributions.univariate:Choice",
    "integer": "uqpen.distributions.univariate:Integer",
    "poisson": "uqpen.distributions.univariate:Poisson",
    "binomial": "uqpen.distributions.univariate:Binomial",
    "bernoulli": "uqpen.distributions.univariate:Bernoulli",
}

COPULAS = {
    "gaussian": "uqpen.distributions.copulas:GaussianCopula",
    "student": "uqpen.distributions.copulas:StudentCopula",
    "clayton": "uqpen.distributions.copulas:ClaytonCopula",
    "gumbel": "uqpen.distributions.copulas:GumbelCopula",
    "frank": "uqpen.distributions.copulas:FrankCopula",
    "joe": "uqpen.distributions.copulas:JoeCopula",
}
