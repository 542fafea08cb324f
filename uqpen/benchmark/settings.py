"""Settings of a benchmark: budgets, repeats, the size of the reference."""

from __future__ import annotations

from dataclasses import dataclass

from uqpen.core.errors import Problem, SettingsError, toml_text

__all__ = ["BUDGETS", "FEWEST_REPEATS", "REPEATS", "BenchmarkSettings"]

# Powers of two are fair to all: at other numbers of runs, a Sobol' sequence loses its balance.
BUDGETS = (128, 256, 1024, 4096, 8192)
REPEATS = 30

# With fewer repeats nothing shows that a few of them decide an error.
FEWEST_REPEATS = 10

_FEWEST_RUNS, _MOST_RUNS = 8, 10_000_000

# Number of replicates of the reference, each with a power of two of points.
_REPLICATES = 16
_EACH_VECTORIZED = 65_536


@dataclass(frozen=True)
class BenchmarkSettings:
    """Settings of a benchmark, common to all methods.

    Parameters
    ----------
    budgets : tuple of int
        Numbers of runs. They are sorted, and duplicates are removed.
    repeats : int
        Number of repeats of each method at each budget.
    reference : int or None
        Least number of runs of the reference; None for a number that depends on the model's speed.
    """

    budgets: tuple[int, ...] = BUDGETS
    repeats: int = REPEATS
    reference: int | None = None

    def __post_init__(self) -> None:
        if problems := self._problems():
            raise SettingsError(problems)
        object.__setattr__(self, "budgets", tuple(sorted(set(self.budgets))))

    def _problems(self) -> list[Problem]:
        expected = f"whole numbers of runs from {_FEWEST_RUNS} to {_MOST_RUNS:_}"
        found = [
            Problem(("budget",), toml_text(budget), expected)
            for budget in self.budgets
            if not _is_whole_number(budget, _FEWEST_RUNS)
        ]
        if not self.budgets:
            found.append(Problem(("budget",), "none", expected))
        if not _is_whole_number(self.repeats, FEWEST_REPEATS):
            expected = f"a whole number, at least {FEWEST_REPEATS}: fewer do not show the noise"
            found.append(Problem(("repeats",), toml_text(self.repeats), expected))
        fewest = 2 * _REPLICATES
        if self.reference is not None and not _is_whole_number(self.reference, fewest):
            expected = f"a whole number, at least {fewest} and at most {_MOST_RUNS:_}"
            found.append(Problem(("reference",), toml_text(self.reference), expected))
        return found

    def reference_design(self, *, vectorized: bool) -> tuple[int, int]:
        """Return runs and replicates of the reference; runs of a vectorized model are cheap."""
        wanted = self.reference
        if wanted is None:
            largest = _REPLICATES * max(self.budgets)
            wanted = max(_REPLICATES * _EACH_VECTORIZED, largest) if vectorized else largest
        each = -(-wanted // _REPLICATES)
        return _REPLICATES * (1 << (each - 1).bit_length()), _REPLICATES


def _is_whole_number(value: object, fewest: int) -> bool:
    is_whole = isinstance(value, int) and not isinstance(value, bool)
    return is_whole and fewest <= value <= _MOST_RUNS  # type: ignore[operator]
