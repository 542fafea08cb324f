"""Contract tests of the families, for user-defined members.

Each function raises an `AssertionError` that names the broken rule. A test of your own calls it:

>>> from uqpen import Uniform
>>> from uqpen.testing import check_distribution
>>> check_distribution(Uniform(1.0, 3.0))
"""

from __future__ import annotations

from uqpen.testing.contracts import (
    check_distribution,
    check_figure,
    check_joint,
    check_model,
    check_section,
    check_statistic,
    check_surrogate,
    example_joint_distribution,
    example_samples,
)
from uqpen.testing.design_contract import check_design, check_extension, check_stopping_rule

__all__ = [
    "check_design",
    "check_distribution",
    "check_extension",
    "check_figure",
    "check_joint",
    "check_model",
    "check_section",
    "check_statistic",
    "check_stopping_rule",
    "check_surrogate",
    "example_joint_distribution",
    "example_samples",
]
