"""Counts that SciPy's L-BFGS-B needs on the standard problems of src/bundle_adjustment/lbfgs/tests.rs.

    pip install scipy==1.17.1 && python tests/reference/lbfgs_counts.py

prints the evaluations of value and gradient, the iterations, the final value, and the distance to the
minimum: no bounds, ten pairs, and the gradient's largest component as the only criterion.
"""

import numpy as np
from scipy.optimize import minimize


def rosenbrock(x):
    a, b = 1 - x[0], x[1] - x[0] ** 2
    return a**2 + 100 * b**2, np.array([-2 * a - 400 * x[0] * b, 200 * b])


def powell(x):
    a, b, c, d = x[0] + 10 * x[1], x[2] - x[3], x[1] - 2 * x[2], x[0] - x[3]
    gradient = [2 * a + 40 * d**3, 20 * a + 4 * c**3, 10 * b - 8 * c**3, -10 * b - 40 * d**3]
    return a**2 + 5 * b**2 + c**4 + 10 * d**4, np.array(gradient)


def quadratic(x):
    scales = 1e4 ** (np.arange(len(x)) / (len(x) - 1))
    return 0.5 * np.sum(scales * x**2), scales * x


PROBLEMS = {
    "rosenbrock": (rosenbrock, [-1.2, 1.0], np.ones(2)),
    "powell": (powell, [3.0, -1.0, 0.0, 1.0], np.zeros(4)),
    "quadratic": (quadratic, np.ones(20), np.zeros(20)),
}
OPTIONS = {"maxcor": 10, "gtol": 1e-5, "ftol": 0.0, "maxls": 20, "maxiter": 10_000, "maxfun": 10_000}

for name, (problem, start, minimum) in PROBLEMS.items():
    found = minimize(problem, start, jac=True, method="L-BFGS-B", options=OPTIONS)
    away = np.abs(found.x - minimum).max()
    print(f"{name:10} {found.nfev:4} evaluations {found.nit:4} iterations {found.fun:.1e} {away:.1e}")
