"""Look up objects by name; import each only when it is needed.

Each family of interchangeable things (designs, distributions, models, analyses) is a plain
dict from a name to a ``"module:attribute"`` reference; adding a member is one file and one line.
"""

from __future__ import annotations

import difflib
import functools
import hashlib
import importlib
import inspect
from collections.abc import Iterable, Mapping
from operator import attrgetter
from typing import Any

from uqpen.core.errors import ModelError, UnknownNameError

# Fewest characters of a part of a name that stands for the name.
_SHORTEST_PART = 3
# What other programs and the literature say, and the names here; the first that is known is meant.
_SYNONYMS = {
    "a min minimum low": ("lower",),
    "b max maximum high": ("upper",),
    "loc mu average expectation": ("mean",),
    "scale sigma sd stdev stddev standard-deviation": ("std",),
    "mc crude random iid srs": ("monte-carlo",),
    "lh lhs latin": ("latin-hypercube",),
    "qmc lds low-discrepancy lowdiscrepancy quasi-monte-carlo sobol": ("sobol-sequence",),
    "sobol-indices sobol-index indices pick-freeze": ("saltelli",),
    "oat ofat": ("one-at-a-time",),
    "elementary-effects screening": ("morris",),
    "grid doe factorial": ("full-factorial",),
    "gauss gaussian collocation cubature": ("quadrature", "normal", "gaussian"),
    "is": ("importance-sampling",),
    "ss sus": ("subset-simulation",),
    "sorm": ("form",),
    "ak-mcs egra": ("active-learning",),
    "mlmc mfmc multi-fidelity": ("multifidelity",),
    "norm": ("normal",),
    "gev genextreme": ("generalised-extreme-value",),
    "t students-t": ("student",),
    "expon": ("exponential",),
    "pert": ("beta",),
    "randint discrete-uniform": ("integer",),
    "binom": ("binomial",),
    "kriging gp gpr": ("gaussian-process",),
    "pce pc rsm response-surface linear": ("polynomial-chaos",),
    "samples n size n-samples num-samples nsamples count": ("runs", "trajectories", "base"),
    "limit threshold greater-than above": ("exceeds",),
    "less-than under": ("below",),
    "percentiles percentile": ("quantiles",),
    "cvar es": ("expected_shortfall",),
    "parameters distributions variables uncertainties": ("inputs",),
    "responses results qoi": ("outputs",),
    "correlation correlations copula": ("dependence",),
    "sampling sampler samplers experiments method": ("designs",),
    "metamodel metamodels emulator emulators": ("surrogates",),
    "solver simulator code": ("model",),
    "calibration calibrations inversion": ("measured", "posterior"),
    "observations observed measurements": ("measured",),
    "bayes bayesian mcmc": ("posterior",),
    "lsq nls curve-fit": ("least-squares",),
}


def resolve(reference: str) -> Any:
    """Import the object of a ``"module:attribute"`` reference; the attribute may have dots."""
    module, _, attribute = reference.partition(":")
    return attrgetter(attribute)(importlib.import_module(module))


def resolve_name(family: Mapping[str, str], name: str, what: str) -> Any:
    """Import the object that `name` stands for in `family`.

    UnknownNameError if `name` is not in `family`. The message calls it a `what`, and lists the
    choices, the nearest first.
    """
    if name not in family:
        raise UnknownNameError(f'no {what} "{name}"; {choices(name, family)}')
    return resolve(family[name])


def family_name(family: Mapping[str, str], member: object) -> str:
    """Return the name in a family of an object's class; empty for a class of another kind."""
    reference = f"{type(member).__module__}:{type(member).__qualname__}"
    return next((name for name, known in family.items() if known == reference), "")


def installed_members(group: str) -> dict[str, str]:
    """Return the names that installed packages add to a family, with their references.

    They are the entry points of the group. Looking them up takes longer than importing a member.
    """
    import importlib.metadata

    return {point.name: point.value for point in importlib.metadata.entry_points(group=group)}


def installed_packages(group: str) -> dict[str, str]:
    """Return the installed package, with its version, of each of the `installed_members`.

    None of them is imported.
    """
    import importlib.metadata

    points = importlib.metadata.entry_points(group=group)
    return {
        point.name: f"{point.dist.name} {point.dist.version}" if point.dist else point.value
        for point in points
    }


def load_installed(group: str, name: str) -> Any:
    """Import the object that an installed package adds to a family, one of its `installed_members`.

    ModelError if the package cannot be imported, or lacks the object. The message names the
    package.
    """
    import importlib.metadata

    points = importlib.metadata.entry_points(group=group)
    point = next(point for point in points if point.name == name)
    package = point.dist.name if point.dist else point.value.partition(".")[0].partition(":")[0]
    try:
        return point.load()
    except (Exception, SystemExit) as error:  # an import can raise anything
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise ModelError(
            f'the installed package "{package}", which provides "{name}", cannot be loaded: '
            f"{reason}"
        ) from None


@functools.cache
def package_version(module: str) -> str:
    """Return the version of the installed package of a module; empty where it has none."""
    import importlib.metadata

    top = module.partition(".")[0]
    names = importlib.metadata.packages_distributions().get(top, [])
    return importlib.metadata.version(names[0]) if names else ""


def class_version(cls: type) -> dict[str, str]:
    """Return what distinguishes the versions of a class that is not the package's own.

    They are the version of its installed package, if any, and a hash of the source of its module:
    a package that is being worked on keeps its version. The file of a study is known by its hash,
    an object of a script or a notebook by its text.
    """
    if cls.__module__.startswith(("uqpen.", "uqpen_study_")) or cls.__module__ == "__main__":
        return {}
    version = package_version(cls.__module__)
    found = {"version": version} if version else {}
    try:
        source = inspect.getsource(importlib.import_module(cls.__module__))
    except (ImportError, OSError, TypeError):  # of a notebook, or compiled
        return found
    return found | {"source_sha256": hashlib.sha256(source.encode()).hexdigest()}


def nearest(name: str, known: Iterable[str]) -> str | None:
    """Return the known name most like `name`, or None where no name is similar.

    A part of one name alone counts as similar, and what other programs call it.

    >>> nearest("sequence", ["sobol-sequence", "halton"])
    'sobol-sequence'
    >>> nearest("kriging", ["polynomial-chaos", "gaussian-process"])
    'gaussian-process'
    """
    names = list(known)
    plain = name.casefold().replace("_", "-")
    if plain in names:
        return plain
    for words, meant in _SYNONYMS.items():
        if plain in words.split() and (found := [each for each in meant if each in names]):
            return found[0]
    if matches := difflib.get_close_matches(name, names, n=1, cutoff=0.6):
        return matches[0]
    containing = [each for each in names if len(name) >= _SHORTEST_PART and name in each]
    return containing[0] if len(containing) == 1 else None


def choices(name: str, known: Iterable[str]) -> str:
    """Suggest names in place of an unknown one: the nearest, then all.

    >>> choices("cmm", ["cm", "mm"])
    'did you mean "mm"? known: cm, mm'
    """
    names = list(known)
    close = nearest(name, names)
    listing = f"known: {', '.join(names)}" if names else "none is known"
    return f'did you mean "{close}"? {listing}' if close else listing
