"""Frequencies of rotating blades by power series of their differential equation."""

from __future__ import annotations

import mpmath


def series(speed, radius, square, rotary):
    """Return the defect at the tip of EI w'''' - ((N - J (Omega^2 + omega^2)) w')' = mu omega^2 w, by power series.

    Of unit length, bending stiffness and mass per length; clamped at the radius, free at the tip.
    """
    count, squared = 60, speed**2
    # N - J (...) = n0 + n1 x + n2 x^2 of x from the root.
    n0 = squared * (mpmath.mpf(1) / 2 + radius) - rotary * (squared + square)
    n1, n2 = -squared * radius, -squared / 2
    rows = []
    for start in ((2, 1), (3, 1)):
        a = [mpmath.mpf(0)] * count
        a[start[0]] = mpmath.mpf(start[1])
        for k in range(count - 4):
            slope = [(j + 1) * a[j + 1] if j + 1 < count else 0 for j in range(k + 3)]
            tension = (k + 1) * (n0 * slope[k + 1] + n1 * slope[k] + (n2 * slope[k - 1] if k else 0))
            a[k + 4] = (tension + square * a[k]) / ((k + 1) * (k + 2) * (k + 3) * (k + 4))
        moment = sum(k * (k - 1) * c for k, c in enumerate(a))
        end = -rotary * (squared + square)
        shear = sum(k * (k - 1) * (k - 2) * c for k, c in enumerate(a)) - end * sum(
            k * c for k, c in enumerate(a)
        )
        rows.append((moment, shear))
    return rows[0][0] * rows[1][1] - rows[0][1] * rows[1][0]


def flapping(speed, radius, near, rotary=0.0):
    """Return an angular frequency of flapping near a guess, at 20 digits."""
    with mpmath.workdps(25):
        return mpmath.findroot(
            lambda w: series(mpmath.mpf(speed), mpmath.mpf(radius), w * w, mpmath.mpf(rotary)),
            near,
            tol=1e-20,
        )
