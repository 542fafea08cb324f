"""uqpen: uncertainty quantification for any model, with error bars that are true.

>>> import uqpen
>>> study = uqpen.load_study("studies/ishigami.toml")  # doctest: +SKIP
>>> archive = uqpen.run(study)  # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from uqpen.core.lazy_attributes import lazy_attributes, member_homes
from uqpen.designs import DESIGNS
from uqpen.distributions import COPULAS, DISTRIBUTIONS
from uqpen.models import MODELS
from uqpen.surrogates import SURROGATES

# What a type checker knows; it takes a member of a family that is not here for Any.
if TYPE_CHECKING:
    from uqpen.archive.write import write as write
    from uqpen.benchmark.compare import compare as compare
    from uqpen.core.errors import ArchiveError as ArchiveError
    from uqpen.core.errors import StudyError as StudyError
    from uqpen.core.errors import UqpenError as UqpenError
    from uqpen.designs.data import DataDesign as DataDesign
    from uqpen.designs.data import TableDesign as TableDesign
    from uqpen.designs.latin_hypercube import LatinHypercube as LatinHypercube
    from uqpen.designs.monte_carlo import MonteCarlo as MonteCarlo
    from uqpen.designs.multifidelity import Multifidelity as Multifidelity
    from uqpen.designs.one_at_a_time import Morris as Morris
    from uqpen.designs.one_at_a_time import OneAtATime as OneAtATime
    from uqpen.designs.quadrature import FullFactorial as FullFactorial
    from uqpen.designs.quadrature import Quadrature as Quadrature
    from uqpen.designs.quasi_monte_carlo import Halton as Halton
    from uqpen.designs.quasi_monte_carlo import SobolSequence as SobolSequence
    from uqpen.designs.rare_events.form import Form as Form
    from uqpen.designs.rare_events.importance_sampling import (
        ImportanceSampling as ImportanceSampling,
    )
    from uqpen.designs.rare_events.subset_simulation import SubsetSimulation as SubsetSimulation
    from uqpen.designs.saltelli import Saltelli as Saltelli
    from uqpen.designs.stopping.precision import Precision as Precision
    from uqpen.distributions.copulas import *  # noqa: F403
    from uqpen.distributions.copulas import GaussianCopula as GaussianCopula
    from uqpen.distributions.copulas import StudentCopula as StudentCopula
    from uqpen.distributions.frozen import FrozenDistribution as FrozenDistribution
    from uqpen.distributions.univariate import *  # noqa: F403
    from uqpen.distributions.univariate import Discrete as Discrete
    from uqpen.distributions.univariate import Truncated as Truncated
    from uqpen.execution.failures import FailurePolicy as FailurePolicy
    from uqpen.figures.page import figure as figure
    from uqpen.library import make_archive as make_archive
    from uqpen.library import run as run
    from uqpen.library import verify as verify
    from uqpen.models.known_functions import Campbell as Campbell
    from uqpen.models.known_functions import Ishigami as Ishigami
    from uqpen.models.rod_models import AlekseevskiiTate as AlekseevskiiTate
    from uqpen.models.rod_models import HydrodynamicLimit as HydrodynamicLimit
    from uqpen.models.rod_models import RigidPenetration as RigidPenetration
    from uqpen.models.rod_trajectories import (
        RigidPenetrationTrajectory as RigidPenetrationTrajectory,
    )
    from uqpen.models.rod_trajectories import (
        WalkerAndersonTrajectory as WalkerAndersonTrajectory,
    )
    from uqpen.models.walker_anderson import WalkerAnderson as WalkerAnderson
    from uqpen.models.walker_anderson_drucker_prager import (
        WalkerAndersonDruckerPrager as WalkerAndersonDruckerPrager,
    )
    from uqpen.report.page import write_report as write_report
    from uqpen.results.archive import Archive as Archive
    from uqpen.results.archive import open_archive as open_archive
    from uqpen.reweighting import reweight as reweight
    from uqpen.study.load import parse_study as parse_study
    from uqpen.study.python_study import OutputSpec as OutputSpec
    from uqpen.study.python_study import PythonModel as PythonModel
    from uqpen.study.python_study import Study as Study
    from uqpen.study.python_study import load_study as load_study
    from uqpen.surrogates.active_learning import ActiveLearning as ActiveLearning
    from uqpen.surrogates.archived_surrogate import ExtrapolationWarning as ExtrapolationWarning
    from uqpen.surrogates.archived_surrogate import RefutationWarning as RefutationWarning
    from uqpen.surrogates.best_surrogate import BestSurrogate as BestSurrogate
    from uqpen.surrogates.chaos.polynomial_chaos import PolynomialChaos as PolynomialChaos
    from uqpen.surrogates.gaussian_process import GaussianProcess as GaussianProcess

__version__ = "0.1.0"

# Distributions made of others, which a study file has by the keys beside or around these.
_MADE_OF_OTHERS = {
    "truncated": "uqpen.distributions.univariate:Truncated",
    "mixture": "uqpen.distributions.univariate:Mixture",
}

# Imported when they are asked for, so that the command line starts at once.
_HOMES: dict[str, Sequence[str]] = {
    "uqpen.archive.write": ("write",),
    "uqpen.benchmark.compare": ("compare",),
    "uqpen.core.errors": ("ArchiveError", "StudyError", "UqpenError"),
    "uqpen.designs.stopping.precision": ("Precision",),
    "uqpen.distributions.frozen": ("FrozenDistribution",),
    "uqpen.execution.failures": ("FailurePolicy",),
    "uqpen.figures.page": ("figure",),
    "uqpen.library": ("make_archive", "run", "verify"),
    "uqpen.report.page": ("write_report",),
    "uqpen.reweighting": ("reweight",),
    "uqpen.results.archive": ("Archive", "open_archive"),
    "uqpen.study.load": ("parse_study",),
    "uqpen.study.python_study": ("OutputSpec", "PythonModel", "Study", "load_study"),
    "uqpen.surrogates.archived_surrogate": ("ExtrapolationWarning", "RefutationWarning"),
    **member_homes(DESIGNS, DISTRIBUTIONS, _MADE_OF_OTHERS, COPULAS, MODELS, SURROGATES),
}
_NAMES = sorted({name for names in _HOMES.values() for name in names})

if not TYPE_CHECKING:  # for which an alias makes a name public
    __all__ = _NAMES

__getattr__ = lazy_attributes(__name__, _HOMES)


def __dir__() -> list[str]:
    return [*_NAMES, "__version__"]
