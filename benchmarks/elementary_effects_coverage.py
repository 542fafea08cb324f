"""How often the intervals of mean elementary effects cover; the reason for the label they carry.

Run it as ``python benchmarks/elementary_effects_coverage.py``, with uqpen installed. Trajectories
are independent, so one long design is cut into many short ones; the truth is the mean over all
places of the grid. Two thousand designs tell a coverage of 95 % to 0.5 points.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from problems import independent
from seed_table import STUDIES

from uqpen.core.arrays import FloatArray
from uqpen.core.model import Output
from uqpen.core.streams import Stream
from uqpen.designs.one_at_a_time import Morris
from uqpen.distributions.joint_distribution import JointDistribution
from uqpen.distributions.univariate import Uniform
from uqpen.execution import Evaluator, evaluate
from uqpen.models.python_function import PythonFunction
from uqpen.statistics.sensitivity.single_steps import effects_by_input, mean_effect
from uqpen.study.load import load_study

LEVELS = 4
TRIALS = 2000
TRAJECTORIES = (4, 10, 20, 50, 100, 200)


def main() -> None:
    print("problem, input, figure: coverage in % (and share with an interval) by trajectories")
    print(f"{'':45}" + "".join(f"{number:>14}" for number in TRAJECTORIES))
    for problem, joint, evaluator, output in _problems():
        (points,) = Morris(TRIALS * 50, levels=LEVELS).rounds(joint, Stream(1, "coverage"))
        drawn = effects_by_input(evaluate(evaluator, points, {}), output)
        grid = _on_grid(evaluator, joint, output)
        for position, (name, effects) in enumerate(drawn.items()):
            exact = _exact(grid, position)
            for figure, these, truth in (
                ("mu", effects, exact.mean()),
                ("mu_star", np.abs(effects), np.abs(exact).mean()),
            ):
                cells = "".join(f"{_covered(these, n, truth):>14}" for n in TRAJECTORIES)
                print(f"{f'{problem}, {name}, {figure}':45}{cells}")


def _problems() -> Iterator[tuple[str, JointDistribution, Evaluator, str]]:
    for name, output in (("concrete", "penetration_depth"), ("ishigami", "y")):
        study = load_study(STUDIES / f"{name}.toml")
        study.model.prepare()
        yield name, study.joint, Evaluator(study.model, study.constraints), output
    joint = independent(**dict.fromkeys(("x1", "x2", "x3"), Uniform(0.0, 1.0)))
    for name, function in (
        # An effect in one trajectory of four, and in one of thirty-two.
        ("step", lambda x1, x2, x3: {"y": 3.0 * (x1 + x2 > 1.3) + x3**2}),
        ("corner", lambda x1, x2, x3: {"y": 1.0 * ((x1 > 0.7) & (x2 > 0.7) & (x3 > 0.7))}),
    ):
        units = dict.fromkeys(["x1", "x2", "x3", "y"], "1")
        model = PythonFunction(
            function, name, joint.variables, (Output("y", "1"),), units, vectorized=True
        )
        yield name, joint, Evaluator(model), "y"


def _on_grid(evaluator: Evaluator, joint: JointDistribution, output: str) -> FloatArray:
    """The output at every place of the grid, an axis for each input."""
    inputs = len(joint.random)
    places = np.array(list(itertools.product(range(LEVELS), repeat=inputs)))
    points = joint.points((places + 1) / (LEVELS + 1), {})
    values: FloatArray = evaluate(evaluator, points, {})[output].values
    return values.reshape((LEVELS,) * inputs)


def _exact(grid: FloatArray, position: int) -> FloatArray:
    """Every effect of an input that there is."""
    half = LEVELS // 2
    low, high = (
        np.take(grid, levels, axis=position) for levels in np.arange(LEVELS).reshape(2, half)
    )
    return (high - low) / (half / (LEVELS + 1))


def _covered(effects: FloatArray, trajectories: int, truth: float) -> str:
    trials = effects[: len(effects) // trajectories * trajectories].reshape(-1, trajectories)[
        :TRIALS
    ]
    found = [mean_effect(trial) for trial in trials]
    given = [each for each in found if each.label != "none"]
    if not given:
        return "none"
    covered = sum(each.lower <= truth <= each.upper for each in given)
    noted = "!" if all(each.note for each in given) else ""
    return f"{100 * covered / len(given):.1f} ({len(given) / len(found):.2f}){noted}"


if __name__ == "__main__":
    main()
