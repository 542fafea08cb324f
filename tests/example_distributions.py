"""One distribution of each family that a study can name, from the declarations of its settings."""

from uqpen.core.lookup import resolve
from uqpen.core.settings import declared_settings
from uqpen.distributions import DISTRIBUTIONS
from uqpen.distributions.distribution import Distribution

_PLAIN = {
    "difference": 0.5,
    "number": 0.4,
    "list of quantities": (1.0, 2.0, 4.0),
    "list of numbers": (1.0, 2.0, 1.0),
    "labels": ("M8", "M10", "M12"),
}
# What a family needs beyond its declarations: moments up to the tenth, say.
_OWN = {"pareto": {"shape": 30.0}, "student": {"degrees": 30.0}, "binomial": {"trials": 12}}


def example_of(family: str) -> Distribution:
    """Make a member of a family: its quantities, and whole numbers, ascend from 1 on."""
    cls = resolve(DISTRIBUTIONS[family])
    values = {}
    for position, (field, setting) in enumerate(declared_settings(cls)):
        ascending = {"quantity": 1.0 + position, "count": 1 + 7 * position}
        value = {**_PLAIN, **ascending}[setting.kind]
        values[field.name] = _OWN.get(family, {}).get(field.name, value)
    return cls(**values)


EXAMPLES = {family: example_of(family) for family in DISTRIBUTIONS}
