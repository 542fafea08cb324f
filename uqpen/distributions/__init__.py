"""Random inputs: distributions with units, their joint distribution, and constraints on it."""

from __future__ import annotations

__all__ = ["COPULAS", "DISTRIBUTIONS"]

DISTRIBUTIONS = {
    "normal": "uqpen.distributions.continuous:Normal",
    "lognormal": "uqpen.distributions.continuous:Lognormal",
    "uniform": "uqpen.distributions.continuous:Uniform",
    "log-uniform": "uqpen.distributions.continuous:LogUniform",
    "triangular": "uqpen.distributions.continuous:Triangular",
    "beta": "uqpen.distributions.continuous:Beta",
    "gamma": "uqpen.distributions.continuous:Gamma",
    "weibull": "uqpen.distributions.continuous:Weibull",
    "gumbel": "uqpen.distributions.continuous:Gumbel",
    "discrete": "uqpen.distributions.discrete:Discrete",
}

COPULAS = {
    "gaussian": "uqpen.distributions.elliptical_copulas:GaussianCopula",
    "student": "uqpen.distributions.elliptical_copulas:StudentCopula",
    "clayton": "uqpen.distributions.copulas:ClaytonCopula",
    "gumbel": "uqpen.distributions.copulas:GumbelCopula",
    "frank": "uqpen.distributions.copulas:FrankCopula",
    "joe": "uqpen.distributions.copulas:JoeCopula",
}
