"""``[designs.<name>]``: which runs to make."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import partial

from uqpen.core.errors import TableError, toml_text
from uqpen.core.labels import MEASURED, POINT, REPEAT
from uqpen.core.lookup import family_name
from uqpen.core.sampling import Sampling
from uqpen.designs import DESIGNS
from uqpen.designs.at_experiments import (
    AtSetting,
    DesignAtExperiments,
    MeasuredDesign,
    at_problem,
)
from uqpen.designs.data import DataDesign, TableDesign
from uqpen.designs.design import Design, UnloadedDesign
from uqpen.designs.rare_events import RARE_EVENT_METHODS
from uqpen.designs.repeated import (
    REPEATS,
    RepeatedDesign,
    Repeats,
    each_point_once,
    repeat_problem,
)
from uqpen.distributions.input_group import ConditionalGroup
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.distributions.unknowns import MOST_INTERVALS
from uqpen.execution import FailurePolicy
from uqpen.measurements.experiments import Experiments, MeasuredOutputs
from uqpen.statistics.quantity_of_interest import QuantityOfInterest
from uqpen.study.study import Variant, family_costs
from uqpen.study.table_reader import (
    TableReader,
    named_tables,
)
from uqpen.study.user_defined_members import (
    DESIGN,
    Files,
    read_member,
)

# What has a meaning where the inputs depend on each other.
_VALID = (
    "use a sample (monte-carlo, latin-hypercube, sobol-sequence, halton). Any sample gives delta "
    "and first-order indices, which then include what an input shares with others. "
    "Shapley effects, which divide the shared part, follow from a surrogate"
)

_OF_INTERVALS = (
    'kind = "interval-bounds", which gives bounds; or a value, at each of its ends by '
    "[models.<name>] with = {{ {name} = … }} or in a study of its own; or a distribution, which is "
    "another statement and has one answer, maybe far from both bounds"
)

# What decides the number of runs; which designs have it, and why no other.
_RULES = {
    "until": 'kind = "monte-carlo", "latin-hypercube", "sobol-sequence" or "halton": intervals of '
    "other designs are not certified where the runs decide their number",
    "accept": 'kind = "monte-carlo": the test needs independent runs. Points of a set avoid each '
    "other, so only whole sets could count, and it would take 40 of them at least",
}

# Each unknown kind is looked for among installed packages, which takes some 20 ms.
_MOST_DESIGNS = 500


def read_designs(
    table: TableReader, measured: Mapping[str, MeasuredOutputs | None]
) -> tuple[dict[str, Design], dict[str, Files]]:
    """Read the designs of a study; invalid ones are noted and left out.

    Those that refer to measurements get them; None stands for those with a mistake.

    Returns
    -------
    designs, files
        By name; the files are those that a user-defined design was loaded from.
    """
    designs: dict[str, Design] = {}
    files: dict[str, Files] = {}
    if len(table.content) > _MOST_DESIGNS:
        expected = f"at most {_MOST_DESIGNS} designs"
        table.add_problem((), f"{len(table.content)} designs", expected)
        return {}, {}
    for name, section in named_tables(table):
        repeats = section.settings(Repeats) or Repeats()
        at = section.settings(AtSetting) or AtSetting()
        design, _, loaded = read_member(
            section,
            DESIGN,
            lambda label, is_object: UnloadedDesign(label),
            partial(_refuse_rules, section),
        )
        if design is not None:
            designs[name], files[name] = _bound(section, design, at.at, measured), loaded
            if repeats.repeats > 1 and (problem := repeat_problem(designs[name])):
                section.add_problem(REPEATS, *problem)
            elif repeats.repeats > 1:
                designs[name] = RepeatedDesign(design, repeats.repeats)
    if table.is_given and not table.content:
        table.add_problem((), "no design", f"a [designs.<name>] of kind {', '.join(DESIGNS)}")
    return designs, files


def _bound(
    section: TableReader,
    design: Design,
    at: str | None,
    measured: Mapping[str, MeasuredOutputs | None],
) -> Design:
    """Return a design with the measurements that it names; note those that a study has not."""
    names = {MEASURED: getattr(design, MEASURED, ())} if at is None else {"at": (at,)}
    for key, wanted in names.items():
        for each in wanted:
            if each not in measured:
                expected = f"a [measured.<name>]; {section.suggest(each, measured)}"
                section.add_wrong(key, each, expected)
                return design
    ((_, wanted),) = names.items()
    experiments = Experiments(tuple(each for name in wanted if (each := measured[name])))
    if len(experiments.sections) < len(wanted):
        return design
    if at is None:
        if any(each.left_out for each in experiments.sections):
            alone = "two sections of measurements: one of them for this design"
            if getattr(design, "sampling", None) is not Sampling.POSTERIOR:
                found = "rows that are held out, which a posterior alone is compared with"
                section.add_problem(MEASURED, found, f'kind = "posterior"; or {alone}')
            elif len(wanted) > 1:
                found = "rows that are held out beside another section"
                section.add_problem(MEASURED, found, "one section")
        is_compared = isinstance(design, MeasuredDesign) and bool(wanted)
        return dataclasses.replace(design, experiments=experiments) if is_compared else design  # type: ignore[type-var]
    if problem := at_problem(design):
        section.add_problem("at", *problem)
        return design
    sections = tuple(each.whole or each for each in experiments.sections)
    return DesignAtExperiments(design, Experiments(sections))


def _refuse_rules(table: TableReader, design: type) -> None:
    """Note the rules that a kind of design cannot have."""
    settings = [field.name for field in dataclasses.fields(design)]
    for key, expected in _RULES.items():
        if key in table and key not in settings:
            table.take(key)
            table.take("at_most")
            table.add_problem(key, f'{key} with kind = "{table.content["kind"]}"', expected)


def check_tables(
    table: TableReader, designs: dict[str, Design], joint: JointDistribution
) -> set[str] | None:
    """Note tables of points that do not fit the inputs.

    Returns
    -------
    set of str or None
        The inputs that every design gives by itself, as a column of its table; None where that
        is unknown, since a design has a mistake.
    """
    given: list[set[str]] = []
    for name, repeated in designs.items():
        design = each_point_once(repeated)
        try:
            if isinstance(design, DataDesign) and design.model is None:
                continue  # the mistake of its file is noted
            if isinstance(design, TableDesign | DataDesign):
                given.append(set(design.columns(joint)))
            else:
                given.append(set())
        except TableError as error:
            expected = 'a column "name [unit]" for each input that it varies'
            table.add_problem((name, "file"), str(error), expected)
    if set() in given:
        return set()
    return set.intersection(*given) if 0 < len(given) == len(table.content) else None


def check_outputs(
    table: TableReader, designs: Mapping[str, Design], quantities: Sequence[QuantityOfInterest]
) -> None:
    """Note designs that do not fit the outputs of the first model."""
    for name, design in designs.items():
        table.add_problems(design.check_outputs(quantities), name)


def check_models(
    table: TableReader, designs: Mapping[str, Design], models: Mapping[str, Variant]
) -> None:
    """Note designs that do not fit the models and the costs of their runs."""
    stand_ins = {name: each.stand_in for name, each in models.items() if each.stand_in}
    costs = family_costs(next(iter(models)), stand_ins)
    lacks_numbers = any(
        each.absent for variant in models.values() for each in variant.model.outputs
    )
    for name, design in designs.items():
        if lacks_numbers and design.needs_numbers:
            found = "a model with [model.outcomes]: runs that end so have no numbers to follow"
            table.add_problem(
                (name, "kind"), found, "subset-simulation, importance-sampling or a sample"
            )
    for name, design in designs.items():
        table.add_problems(design.check_models(models, costs), name)


# Why a method that searches cannot take runs with noise, by the method's name.
_WITHOUT_NOISE = {
    "form": "it follows gradients and roots of the output, and noise has none",
    "active-learning": "it learns the limit by a surrogate that runs at the same inputs agree with",
    "interval-bounds": "its polynomial is judged by what it leaves of runs, and it leaves noise",
}
_WITH_NOISE = (
    "monte-carlo, subset-simulation, or importance-sampling with another start than form: they "
    "hold for the probability of the output, noise included"
)


def check_noise(
    root: TableReader,
    designs: Mapping[str, Design],
    models: Mapping[str, Variant],
    failures: FailurePolicy,
) -> None:
    """Note what has no meaning for models with noise of their own, and repeats without any."""
    noisy = [each.model for each in models.values() if each.model.noise.is_declared]
    table = root.table("designs")
    for name, design in designs.items():
        if isinstance(design, RepeatedDesign):
            _check_repeats(table.table(name), models, is_noisy=bool(noisy))
        if getattr(each_point_once(design), "noise", False) and not noisy:
            expected = "noise = true or a seed in [model]: others give the same result again"
            table.add_problem((name, "noise"), "a second run at the first point", expected)
        method = family_name(DESIGNS, design)
        start = getattr(design, "start", "")
        if noisy and (
            method in _WITHOUT_NOISE or (method in RARE_EVENT_METHODS and start == "form")
        ):
            reason = _WITHOUT_NOISE.get(method, _WITHOUT_NOISE["form"])
            found = f"a search that a model with noise of its own misleads: {reason}"
            key = "kind" if method in _WITHOUT_NOISE else "start"
            is_of_intervals = method == "interval-bounds"
            expected = "a value in place of each interval" if is_of_intervals else _WITH_NOISE
            table.add_problem((name, key), found, expected)
    if failures.retry and any(model.noise.is_unseeded for model in noisy):
        found = f"{failures.retry} further attempts at runs of a model with noise and no seed"
        expected = (
            "no retries: to try until a run completes draws from another distribution than the "
            "model's. With seed in [model], each attempt is the same run"
        )
        root.add_problem(("failures", "retry"), found, expected)


def _check_repeats(table: TableReader, models: Mapping[str, Variant], *, is_noisy: bool) -> None:
    """Note repeats of models that give the same result again, and names that they need."""
    if not is_noisy:
        expected = "noise = true in [model]: a model without noise gives the same result again"
        table.add_problem(REPEATS, "several runs at each point", expected)
    variables = [
        each.name
        for variant in models.values()
        for of_model in (variant.model.inputs, variant.model.all_outputs)
        for variable in of_model
        for each in (variable, *getattr(variable, "dims", ()))
    ]
    for label in (POINT, REPEAT):
        if label in variables:
            found = f'a variable or a dimension named "{label}"'
            table.add_problem(REPEATS, found, f"another name of it: {label} is one of the runs")


def _box_reason(design: Design) -> str:
    """Return why a design has no bounds over parameters that are intervals; empty where it has."""
    if isinstance(design, RepeatedDesign):
        return "bounds are of one run at each point"
    if design.sampling is Sampling.STRATIFIED:
        return "weights, by which the same runs answer for each distribution, spoil its strata"
    if design.sampling is Sampling.TOWARDS_EVENT:
        return "its points move by one distribution: each end of an interval is a study of its own"
    if design.sampling is Sampling.TOWARDS_BOUNDS:
        return "intervals of inputs and of parameters are not searched together"
    if design.ends_early:
        return "its rule decides by estimates of one distribution, so give the number of runs"
    if not design.takes_boxes:
        return "it needs one distribution of each input, and intervals have none"
    return ""


def check_designs(
    table: TableReader, designs: Mapping[str, Design], joint: JointDistribution
) -> None:
    """Note other designs that do not fit the inputs."""
    for name, design in designs.items():
        if isinstance(each_point_once(design), TableDesign | DataDesign):
            continue
        if not joint.random:
            expected = 'a random input, such as "(2.5 ± 0.1) m" or { uniform = { … } }'
            which = "fixed or intervals" if joint.intervals else "all fixed"
            table.add_problem(name, f"a design over inputs that are {which}", expected)
        elif joint.intervals and not design.takes_intervals:
            kind = toml_text(table.content[name]["kind"])
            interval = joint.intervals[0].variable.name
            found = f"{kind} over {interval}, an interval, which has no distribution"
            table.add_problem((name, "kind"), found, _OF_INTERVALS.format(name=interval))
        elif design.assumes_independence and not joint.is_independent:
            kind = toml_text(table.content[name]["kind"])
            where = "[dependence]" if joint.dependence else "[joint]"
            if any(isinstance(each, ConditionalGroup) for each in joint.groups):
                where = "parameters of [inputs]"
            found = f"{kind} with inputs that depend on each other ({where})"
            table.add_problem((name, "kind"), found, f"{design.independence_reason}; {_VALID}")
        elif design.unordered_reason and (
            named := [each.variable.name for each in joint.random if each.variable.labels]
        ):
            kind = toml_text(table.content[name]["kind"])
            found = f"{kind} over {named[0]}, whose values are labels"
            table.add_problem((name, "kind"), found, f"{design.unordered_reason}; {_VALID}")
        elif joint.boxes and (reason := _box_reason(design)):
            kind = toml_text(table.content[name]["kind"])
            found = f"{kind} over {next(iter(joint.boxes))}, whose parameters are intervals"
            expected = f'{reason}. kind = "monte-carlo" gives bounds over the intervals'
            table.add_problem((name, "kind"), found, expected)
        elif (count := sum(len(each.ends) for each in joint.boxes.values())) > MOST_INTERVALS:
            expected = f"at most {MOST_INTERVALS}: bounds are looked for on a grid over all of them"
            table.add_problem(name, f"{count} parameters that are intervals", expected)
        else:
            table.add_problems(design.check_inputs(joint), name)
