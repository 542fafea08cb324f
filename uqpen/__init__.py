"""uqpen: uncertainty quantification for any model, with error bars that are true.

>>> import uqpen
>>> study = uqpen.load_study("studies/ishigami.toml")  # doctest: +SKIP
>>> archive = uqpen.run(study)  # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from uqpen.core.lazy_attributes import lazy_attributes

if TYPE_CHECKING:
    from uqpen.archive.write import write
    from uqpen.benchmark.compare import compare
    from uqpen.core.errors import ArchiveError, StudyError, UqpenError
    from uqpen.designs.data import DataDesign
    from uqpen.designs.full_factorial import FullFactorial
    from uqpen.designs.latin_hypercube import LatinHypercube
    from uqpen.designs.monte_carlo import MonteCarlo
    from uqpen.designs.morris import Morris
    from uqpen.designs.multifidelity.multifidelity import Multifidelity
    from uqpen.designs.one_at_a_time import OneAtATime
    from uqpen.designs.quadrature import Quadrature
    from uqpen.designs.quasi_monte_carlo import Halton, SobolSequence
    from uqpen.designs.rare_events.form import Form
    from uqpen.designs.rare_events.importance_sampling import ImportanceSampling
    from uqpen.designs.rare_events.subset_simulation import SubsetSimulation
    from uqpen.designs.saltelli import Saltelli
    from uqpen.designs.stopping.precision import Precision
    from uqpen.designs.table import TableDesign
    from uqpen.distributions.continuous import (
        Beta,
        Gamma,
        Gumbel,
        Lognormal,
        LogUniform,
        Normal,
        Triangular,
        Uniform,
        Weibull,
    )
    from uqpen.distributions.copulas import ClaytonCopula, FrankCopula, GumbelCopula, JoeCopula
    from uqpen.distributions.elliptical_copulas import GaussianCopula, StudentCopula
    from uqpen.distributions.frozen import FrozenDistribution
    from uqpen.distributions.truncated import Truncated
    from uqpen.execution.failures import FailurePolicy
    from uqpen.figures.page import figure
    from uqpen.library import make_archive, run, verify
    from uqpen.models.alekseevskii_tate import AlekseevskiiTate
    from uqpen.models.campbell import Campbell
    from uqpen.models.hydrodynamic_limit import HydrodynamicLimit
    from uqpen.models.ishigami import Ishigami
    from uqpen.models.rigid_penetration import RigidPenetration
    from uqpen.models.walker_anderson import WalkerAnderson
    from uqpen.models.walker_anderson_drucker_prager import WalkerAndersonDruckerPrager
    from uqpen.models.walker_anderson_trajectory import WalkerAndersonTrajectory
    from uqpen.report.page import write_report
    from uqpen.results.archive import Archive, open_archive
    from uqpen.study.load import parse_study
    from uqpen.study.python_model import OutputSpec, PythonModel
    from uqpen.study.python_study import Study, load_study
    from uqpen.surrogates.active_learning.active_learning import ActiveLearning
    from uqpen.surrogates.archived_surrogate import ExtrapolationWarning, RefutationWarning
    from uqpen.surrogates.gaussian_process import GaussianProcess
    from uqpen.surrogates.polynomial_chaos import PolynomialChaos

__all__ = [
    "ActiveLearning",
    "AlekseevskiiTate",
    "Archive",
    "ArchiveError",
    "Beta",
    "Campbell",
    "ClaytonCopula",
    "DataDesign",
    "Discrete",
    "ExtrapolationWarning",
    "FailurePolicy",
    "Form",
    "FrankCopula",
    "FrozenDistribution",
    "FullFactorial",
    "Gamma",
    "GaussianCopula",
    "GaussianProcess",
    "Gumbel",
    "GumbelCopula",
    "Halton",
    "HydrodynamicLimit",
    "ImportanceSampling",
    "Ishigami",
    "JoeCopula",
    "LatinHypercube",
    "LogUniform",
    "Lognormal",
    "MonteCarlo",
    "Morris",
    "Multifidelity",
    "Normal",
    "OneAtATime",
    "OutputSpec",
    "PolynomialChaos",
    "Precision",
    "PythonModel",
    "Quadrature",
    "RefutationWarning",
    "RigidPenetration",
    "Saltelli",
    "SobolSequence",
    "StudentCopula",
    "Study",
    "StudyError",
    "SubsetSimulation",
    "TableDesign",
    "Triangular",
    "Truncated",
    "Uniform",
    "UqpenError",
    "WalkerAnderson",
    "WalkerAndersonDruckerPrager",
    "WalkerAndersonTrajectory",
    "Weibull",
    "compare",
    "figure",
    "load_study",
    "make_archive",
    "open_archive",
    "parse_study",
    "run",
    "verify",
    "write",
    "write_report",
]

__version__ = "0.1.0"

# Imported when they are asked for, so that the command line starts at once.
_HOMES = {
    "uqpen.archive.write": ("write",),
    "uqpen.benchmark.compare": ("compare",),
    "uqpen.core.errors": ("ArchiveError", "StudyError", "UqpenError"),
    "uqpen.designs.data": ("DataDesign",),
    "uqpen.designs.full_factorial": ("FullFactorial",),
    "uqpen.designs.latin_hypercube": ("LatinHypercube",),
    "uqpen.designs.monte_carlo": ("MonteCarlo",),
    "uqpen.designs.morris": ("Morris",),
    "uqpen.designs.multifidelity.multifidelity": ("Multifidelity",),
    "uqpen.designs.one_at_a_time": ("OneAtATime",),
    "uqpen.designs.quadrature": ("Quadrature",),
    "uqpen.designs.quasi_monte_carlo": ("Halton", "SobolSequence"),
    "uqpen.designs.rare_events.form": ("Form",),
    "uqpen.designs.rare_events.importance_sampling": ("ImportanceSampling",),
    "uqpen.designs.rare_events.subset_simulation": ("SubsetSimulation",),
    "uqpen.designs.saltelli": ("Saltelli",),
    "uqpen.designs.stopping.precision": ("Precision",),
    "uqpen.designs.table": ("TableDesign",),
    "uqpen.distributions.continuous": (
        "Beta",
        "Gamma",
        "Gumbel",
        "LogUniform",
        "Lognormal",
        "Normal",
        "Triangular",
        "Uniform",
        "Weibull",
    ),
    "uqpen.distributions.copulas": ("ClaytonCopula", "FrankCopula", "GumbelCopula", "JoeCopula"),
    "uqpen.distributions.discrete": ("Discrete",),
    "uqpen.distributions.elliptical_copulas": ("GaussianCopula", "StudentCopula"),
    "uqpen.distributions.frozen": ("FrozenDistribution",),
    "uqpen.distributions.truncated": ("Truncated",),
    "uqpen.execution.failures": ("FailurePolicy",),
    "uqpen.figures.page": ("figure",),
    "uqpen.library": ("make_archive", "run", "verify"),
    "uqpen.models.alekseevskii_tate": ("AlekseevskiiTate",),
    "uqpen.models.campbell": ("Campbell",),
    "uqpen.models.hydrodynamic_limit": ("HydrodynamicLimit",),
    "uqpen.models.ishigami": ("Ishigami",),
    "uqpen.models.rigid_penetration": ("RigidPenetration",),
    "uqpen.models.walker_anderson": ("WalkerAnderson",),
    "uqpen.models.walker_anderson_drucker_prager": ("WalkerAndersonDruckerPrager",),
    "uqpen.models.walker_anderson_trajectory": ("WalkerAndersonTrajectory",),
    "uqpen.report.page": ("write_report",),
    "uqpen.results.archive": ("Archive", "open_archive"),
    "uqpen.study.load": ("parse_study",),
    "uqpen.study.python_model": ("OutputSpec", "PythonModel"),
    "uqpen.study.python_study": ("Study", "load_study"),
    "uqpen.surrogates.active_learning.active_learning": ("ActiveLearning",),
    "uqpen.surrogates.archived_surrogate": ("ExtrapolationWarning", "RefutationWarning"),
    "uqpen.surrogates.gaussian_process": ("GaussianProcess",),
    "uqpen.surrogates.polynomial_chaos": ("PolynomialChaos",),
}


__getattr__ = lazy_attributes(__name__, _HOMES)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
