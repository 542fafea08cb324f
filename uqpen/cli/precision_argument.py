"""Wanted precision as an argument of the command line: a table as in a study file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from uqpen.designs.stopping.precision import Precision
    from uqpen.study.study import ValidatedStudy

__all__ = ["EXAMPLE", "read_precision"]

EXAMPLE = '{ depth = { mean = "1 %" } }'


def read_precision(written: str, study: ValidatedStudy) -> Precision:
    """Return the precision that the option ``--until`` states; a mistake in it is one of usage."""
    import tomllib

    from uqpen.core.errors import SettingsError
    from uqpen.designs.stopping.precision import Precision

    try:
        rule = Precision(tomllib.loads(f"until = {written}")["until"])
        problems = list(rule.check_outputs(study.quantities_of_interest))
        if problems:
            raise SettingsError(problems)
    except tomllib.TOMLDecodeError:
        raise click.UsageError(f"--until: found {written}, expected {EXAMPLE}") from None
    except SettingsError as error:
        raise click.UsageError(f"--until: {error}") from None
    return rule
