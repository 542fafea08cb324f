"""An epidemic among people who meet at random: each run is one course of it."""

import numpy as np

PEOPLE, FIRST, DAYS = 400, 8, 200


def simulate(contacts, transmission, illness, seed):
    """Return how many people fall ill, and how many are ill on the worst day.

    Everybody who is ill meets a number of others each day, passes the illness on to some of those
    who have not had it, and recovers with the same probability each day.
    """
    rng = np.random.default_rng(seed)
    healthy = np.ones(PEOPLE, dtype=bool)
    ill = np.zeros(PEOPLE, dtype=bool)
    healthy[:FIRST], ill[:FIRST] = False, True
    worst = FIRST
    for _ in range(DAYS):
        if not ill.any():
            break
        met = rng.integers(PEOPLE, size=rng.poisson(contacts * ill.sum()))
        reached = np.unique(met[rng.random(met.size) < transmission])
        caught = reached[healthy[reached]]
        recovered = ill & (rng.random(PEOPLE) < 1 / illness)
        ill[recovered] = False
        healthy[caught], ill[caught] = False, True
        worst = max(worst, int(ill.sum()))
    return {"cases": PEOPLE - int(healthy.sum()), "worst_day": worst}
