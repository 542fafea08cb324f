"""Ishigami's function by SALib alone."""

import numpy as np
from SALib.analyze import pawn, rbd_fast
from SALib.sample import latin

problem = {"num_vars": 3, "names": ["x1", "x2", "x3"], "bounds": [[-np.pi, np.pi]] * 3}
points = latin.sample(problem, 1000, seed=1)
x1, x2, x3 = points.T
y = np.sin(x1) + 7 * np.sin(x2) ** 2 + 0.1 * x3**4 * np.sin(x1)
indices = rbd_fast.analyze(problem, points, y, seed=1)
distances = pawn.analyze(problem, points, y, S=10)
found, bars = {}, {}
for column, name in enumerate(problem["names"]):
    found[f"first order of {name}"] = indices["S1"][column]
    bars[f"first order of {name}"] = indices["S1_conf"][column]
    found[f"PAWN of {name}"] = distances["median"][column]
