"""Stand-in: a cheap model in the place of another one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from uqpen.core.settings import name, number

__all__ = ["StandIn", "family_costs"]


@dataclass(frozen=True, kw_only=True)
class StandIn:
    """Model that another one stands for, and the cost of a run in its place.

    Parameters
    ----------
    stands_for : str
        The name of that model.
    cost : float
        Cost of a run, relative to one of that model.
    """

    stands_for: str = name()
    cost: float = number(
        above=0,
        below=1,
        expected="the cost of a run over that of the model it stands for, above 0 and below 1",
    )


def family_costs(first: str, stand_ins: Mapping[str, StandIn]) -> dict[str, float]:
    """Return the cost of a run of a model and of all that stand for it, relative to its own.

    Parameters
    ----------
    first : str
        The name of the model.
    stand_ins : mapping of str to StandIn
        The stand-ins of a study by name. Some may stand for other stand-ins, without a circle.
    """
    costs = {first: 1.0}
    left = dict(stand_ins)
    while near := {name: each for name, each in left.items() if each.stands_for in costs}:
        costs |= {name: costs[each.stands_for] * each.cost for name, each in near.items()}
        left = {name: each for name, each in left.items() if name not in near}
    return {name: costs[name] for name in (first, *stand_ins) if name in costs}
