"""Ishigami's function by chaospy alone."""

import chaospy
import numpy as np

inputs = chaospy.J(*(chaospy.Uniform(-np.pi, np.pi) for _ in range(3)))
x1, x2, x3 = points = inputs.sample(1000, rule="random", seed=1)
y = np.sin(x1) + 7 * np.sin(x2) ** 2 + 0.1 * x3**4 * np.sin(x1)
expansion = chaospy.generate_expansion(7, inputs, normed=True)
model, coefficients = chaospy.fit_regression(expansion, points, y, retall=1)
found = {"mean": coefficients[0], "std": np.sqrt(np.sum(coefficients[1:] ** 2))}
indices = chaospy.FirstOrderSobol(expansion, coefficients)
found |= {f"first order of x{number}": index for number, index in enumerate(indices, 1)}
