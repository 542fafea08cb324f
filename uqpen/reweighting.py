"""Runs of an archive as weighted runs of the same study with other distributions of its inputs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import xarray as xr

from uqpen.archive.provenance import of_python_functions, provenance, provenance_differences
from uqpen.archive.read import is_archive, is_benchmark, model_trees, open_archive
from uqpen.archive.write import prepare_destination, write
from uqpen.checkpoints.identity import compare_models
from uqpen.core.errors import ArchiveError, Problem
from uqpen.core.labels import (
    CONTENT,
    DEPENDENCE,
    DEPENDENCIES,
    MODELS,
    NOT_MADE_AGAIN,
    REUSED_RUNS,
    REWEIGHTED,
    REWEIGHTED_FROM,
    REWEIGHTED_STUDY,
    RUN,
    SAMPLING,
    WEIGHT,
)
from uqpen.core.sampling import Sampling
from uqpen.distributions.joint_distribution import (
    DerivedInput,
    FixedInput,
    IntervalInput,
    JointDistribution,
    RandomInput,
    points_dataset,
)
from uqpen.execution.omitted_runs import are_omitted
from uqpen.results.archive import Archive
from uqpen.statistics.reweighting import (
    ExpectedWeights,
    effective_share,
    expected_weights,
    relative_weights,
)
from uqpen.statistics.weights import effective_sizes
from uqpen.study.document import parse_document
from uqpen.study.identity import (
    MODEL_PREFIX,
    archived_content,
    archived_identity,
    model_identity,
)
from uqpen.study.python_study import as_study
from uqpen.study.study import ValidatedStudy
from uqpen.verification.archived_study import Runs, archived_runs, restored_study
from uqpen.workflow import analyse_runs


def reweight(
    archive: str | Path,
    study: ValidatedStudy | str | Path,
    path: str | Path | None = None,
    *,
    folder: str | Path | None = None,
    trust: bool = False,
) -> Archive:
    """Answer a study with other distributions of its inputs by the runs of an archive.

    Each run gets a weight, the density of its inputs now over that when it was drawn. No model
    runs. An interval stands only where the weights allow it.

    Parameters
    ----------
    archive : str or Path
        The archive of the study whose runs are taken. Its designs are independent draws.
    study : Study, str or Path
        The study with the other distributions, or the path of its file. All that decides its runs
        is as in the archive; what it asks of them may be different.
    path : str or Path, optional
        The archive to write; by default none is written. Another archive that is there is kept
        beside it, under a name with a part of its hash.
    folder : str or Path, optional
        Folder with the files that the archived study names; by default the archived files.
    trust : bool
        True if code that the archived study names may be executed.

    Returns
    -------
    Archive
        With the coordinate ``weight`` of all runs, and the statistics by these weights.

    Raises
    ------
    StudyError
        If the study changes more than distributions; or no run lies where an input may lie now, a
        density is not known, or the weights have no finite variance.
    ArchiveError
        If the archive is not finished, or its runs are no independent draws.
    """
    archive, asked = Path(archive), as_study(study, {})
    unfinished = archive.parent / f"{archive.name}.parts"
    if not archive.exists() and unfinished.is_dir():
        raise ArchiveError(
            f"{archive}: is not finished, and a part of the runs of a design is no sample of its "
            "inputs; the same uqpen study command continues it"
        )
    if path is not None and Path(path).resolve() == archive.resolve():
        raise ArchiveError(f"{path}: has the runs themselves; give another name (-o)")
    tree = open_archive(archive)
    if is_benchmark(tree):
        raise ArchiveError(f"{archive}: contains a benchmark of methods, not the runs of a study")
    with restored_study(tree, None if folder is None else Path(folder), trust=trust) as restored:
        drawn = restored.study.joint
    runs = archived_runs(tree)
    _check_runs(archive, asked, runs)
    label = str(study) if isinstance(study, str | Path) else asked.name
    expected = _check_study(label, asked, tree, drawn)
    source = str(tree.attrs.get(CONTENT, ""))
    weighted = {
        model: {
            name: _weighted(of_model[name], drawn, asked.joint, expected, source)
            for name in asked.designs
        }
        for model, of_model in runs.items()
    }
    found = analyse_runs(asked, weighted)
    for name, group in model_trees(tree).items():
        own = found[f"{MODELS}/{name}"] if name else found
        of_model = {str(key): value for key, value in group.attrs.items()}
        own.attrs |= {
            key: value
            for key, value in of_model.items()
            if key.startswith(MODEL_PREFIX) or key == DEPENDENCIES
        }
    found.attrs |= {
        REWEIGHTED_FROM: source,
        REWEIGHTED_STUDY: str(tree.attrs["study_text"]),
        REUSED_RUNS: "\n".join(_made_with(tree, asked)),
    }
    if path is not None:
        target = Path(path).absolute()
        prepare_destination(target)
        write(found, target, keeps_earlier=target.exists() and is_archive(target))
    return Archive.of(found)


def _made_with(tree: xr.DataTree, study: ValidatedStudy) -> Iterator[str]:
    """Yield what the runs of an archive were made with, as far as it differs from what is here."""
    yield from filter(None, str(tree.attrs.get(REUSED_RUNS, "")).split("\n"))
    then = {str(key): value for key, value in tree.attrs.items()}
    here = {**provenance(), **of_python_functions()}
    others = [f"{name} {before}" for name, before, _ in provenance_differences(then, here)]
    if others:
        yield f"runs made with {', '.join(others)}"
    yield from (f"{name}: {NOT_MADE_AGAIN}" for name in study.designs)


# What may be reweighted: runs that are draws, of a study that differs in distributions alone.


def _check_runs(archive: Path, study: ValidatedStudy, runs: Runs) -> None:
    """Refuse designs whose runs are no independent draws, or are not kept.

    Raises
    ------
    ArchiveError
    """
    for of_model in runs.values():
        for name in study.designs:
            made = of_model.get(name)
            if made is None:
                continue  # it is refused as a change of the study
            sampling, reason = Sampling(str(made.attrs[SAMPLING])), ""
            if sampling is Sampling.STRATIFIED:
                reason = "weights spoil its strata, by which its error is estimated"
            elif sampling is not Sampling.INDEPENDENT:
                reason = f"its points ({sampling}) are no independent draws of the inputs"
            elif WEIGHT in made.coords:
                reason = "its runs have weights already"
            elif are_omitted(made):
                reason = "its runs are not kept"
            if reason:
                raise ArchiveError(
                    f"{archive}: design {name} cannot be reweighted: {reason}\n"
                    f"leave [designs.{name}] out of the new study, or make its runs there"
                )


def _check_study(
    label: str, study: ValidatedStudy, tree: xr.DataTree, drawn: JointDistribution
) -> ExpectedWeights:
    """Return what is known of the weights beforehand; refuse a study that has none.

    Raises
    ------
    StudyError
        With all that differs from the archive and must not.
    """
    document = parse_document(study.text, label)
    problems = [*_changed_settings(study, tree), *_changed_inputs(study.joint, drawn)]
    expected = ExpectedWeights(1.0, True)
    if not problems:
        expected = expected_weights(drawn, study.joint)
        if expected.reason:
            place = ("inputs", expected.input) if expected.input else ("inputs",)
            problems = [
                Problem(
                    place,
                    expected.reason,
                    "distributions within those that the runs were drawn from, whose weights have "
                    "a finite variance; uqpen study makes fresh runs of others",
                )
            ]
    if problems:
        raise document.error(problems)
    return expected


def _changed_settings(study: ValidatedStudy, tree: xr.DataTree) -> Iterator[Problem]:
    """Yield what decides runs and is not as in the archive, but for the inputs."""
    archived, now = archived_identity(tree), study.content
    before = archived_content(tree)
    if {*archived.models} != {*study.models}:
        yield Problem(("models",), ", ".join(study.models), ", ".join(archived.models))
    else:
        for name in study.models:
            compared = compare_models(model_identity(study, name), archived.models[name])
            place = ("models", name) if name else ("model",)
            for change in compared.changes[:1]:
                yield Problem(place, change, "the model of the archive")
            if not compared.is_same_domain:
                yield Problem(("constraints",), "other constraints", "those of the archive")
    if str(before.get("seed", 0)) != str(study.seed):
        yield Problem(("seed",), str(study.seed), f"{before.get('seed', 0)}, as in the archive")
    designs: Mapping[str, object] = before.get("designs", {})
    for name in study.designs:
        if name not in designs:
            expected = f"designs of the archive: {', '.join(designs)}"
            yield Problem(("designs", name), "a design without runs in the archive", expected)
        elif now["designs"][name] != designs[name]:
            yield Problem(("designs", name), "other settings", "those of the archive")
    if study.surrogates:
        yield Problem(
            ("surrogates",),
            "a surrogate, which would be fitted to weighted runs",
            "none: that of the archive predicts (uqpen predict)",
        )


def _changed_inputs(asked: JointDistribution, drawn: JointDistribution) -> Iterator[Problem]:
    """Yield inputs that differ in more than their distribution."""
    now, before = ({each.variable.name: each for each in joint.inputs} for joint in (asked, drawn))
    for name in {**before, **now}:
        found, expected = (_stated(each.get(name)) for each in (now, before))
        if found != expected:
            yield Problem(("inputs", name), found, f"{expected}, as in all runs of the archive")


def _stated(
    entry: FixedInput | RandomInput | DerivedInput | IntervalInput | None,
) -> str:
    """Return what reweighting cannot change of an input, in words."""
    match entry:
        case FixedInput():
            return f"{entry.value!r} {entry.variable.unit}".removesuffix(" 1")
        case DerivedInput():
            return f'"{entry.formula.text}"'
        case IntervalInput():
            return f"an interval from {entry.lower!r} to {entry.upper!r} {entry.variable.unit}"
        case RandomInput():
            return "a distribution"
    return "no such input"


# The runs with their weights.


def _weighted(
    made: xr.Dataset,
    drawn: JointDistribution,
    asked: JointDistribution,
    expected: ExpectedWeights,
    source: str,
) -> xr.Dataset:
    """Return the runs of a design with their weights, and with the inputs described as now."""
    values = {each.variable.name: made[each.variable.name].values for each in asked.random}
    weights = relative_weights(values, drawn, asked)
    if not weights.any():
        raise ArchiveError(
            "no run lies where the inputs may lie now; make fresh runs (uqpen study)"
        )
    described = points_dataset(asked, values, {}, runs=made.sizes[RUN])
    size, share = float(effective_sizes(weights)), 100 * float(effective_share(weights))
    known = "" if expected.is_exact else "at most "
    text = (
        f"runs drawn for other distributions of the inputs, with weights (archive {source[:16]}): "
        f"their effective size is {size:.0f}, {share:.3g} % of the runs, where "
        f"{known}{100 * expected.share:.3g} % are expected"
    )
    dependence = asked.dependence_text
    kept = {key: value for key, value in made.attrs.items() if key != DEPENDENCE}
    attributes = {**kept, **({DEPENDENCE: dependence} if dependence else {}), REWEIGHTED: text}
    own = {name: made[name].copy() for name in values}
    for name, column in own.items():
        column.attrs = dict(described[name].attrs)
    found = made.assign(own).assign_coords({WEIGHT: (RUN, weights)})
    found.attrs = attributes
    return found
