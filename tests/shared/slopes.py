"""Derivatives of functions in many digits."""

import mpmath as mp
import numpy as np


def slopes(of, values):
    """Return the derivatives of a function that returns a list by each of its arguments, at 40 digits."""
    with mp.workdps(40):
        point = [mp.mpf(v) for v in values]

        def at_step(i, h):
            return mp.matrix(of(*point[:i], point[i] + h, *point[i + 1 :]))

        h = mp.mpf(10) ** -14  # the error is of order h^2
        columns = [(at_step(i, h) - at_step(i, -h)) / (2 * h) for i in range(len(point))]
        return np.array([[float(v) for v in column] for column in columns]).T
