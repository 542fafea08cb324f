"""How often an interval that is looked at all the time misses the truth at some look.

The 95 % interval of a mean of independent draws, by Student's t, after each of 20 to 2 000 runs.
Called without arguments; takes about a second.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import t

FIRST, LAST, TRIALS = 20, 2_000, 4_000


def main() -> None:
    rng = np.random.default_rng(1)
    size = np.arange(1, LAST + 1)
    quantile = t.ppf(0.975, np.maximum(size - 1, 1))
    for name, draw in (("normal", rng.standard_normal), ("exponential", rng.standard_exponential)):
        truth = 0.0 if name == "normal" else 1.0
        at_some_look = at_the_end = 0
        for _ in range(TRIALS):
            deviations = draw(LAST) - truth
            mean = np.cumsum(deviations) / size
            variance = (np.cumsum(deviations**2) - size * mean**2) / np.maximum(size - 1, 1)
            is_missed = np.abs(mean) > quantile * np.sqrt(variance / size)
            at_some_look += bool(is_missed[FIRST - 1 :].any())
            at_the_end += bool(is_missed[-1])
        print(
            f"{name}: missed at some look in {at_some_look / TRIALS:.1%}, "
            f"at the end in {at_the_end / TRIALS:.1%} of {TRIALS} trials"
        )


if __name__ == "__main__":
    main()
