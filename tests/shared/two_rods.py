"""Two uniform rods that hang from each other, as a scene and by their angles in any number of digits."""

from __future__ import annotations

from mpmath import cos, mp, mpf, sin

#: Time [s], and coordinates of A and B then [m], by :func:`positions`.
END = 10.0
POSITIONS = (
    "0.72523085188401664906",
    "-0.68850578172996013325",
    "-0.27025084181635867016",
    "-0.78345944151952344993",
)


def scene() -> dict[str, object]:
    """Return the scene: rods of 1 m and 1 kg, drawn and released at rest along x and y."""
    return {
        "symgen": 1,
        "title": "Two uniform rods",
        "points": {
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "A": {"at": ["1 m", "0 m"]},
            "B": {"at": ["1 m", "1 m"]},
        },
        "links": {
            "OA": {"points": ["O", "A"], "mass": "1 kg"},
            "AB": {"points": ["A", "B"], "mass": "1 kg"},
        },
        "gravity": {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
        "analysis": {"t_end": "10 s", "outputs": ["A.position", "B.position"]},
    }


def _accelerations(state: list[mpf]) -> list[mpf]:
    """Return the slopes of (a, b, a', b'), the angles of the rods from x.

    Lagrange's equations with T = 2/3 a'^2 + 1/6 b'^2 + 1/2 a' b' cos(a - b) and V = 3/2 g sin a + 1/2 g sin b.
    """
    a, b, p, q = state
    c, s, g = cos(a - b) / 2, sin(a - b) / 2, mpf("9.81")
    first = -s * q * q - 3 * g * cos(a) / 2
    second = s * p * p - g * cos(b) / 2
    m, k = mpf(4) / 3, mpf(1) / 3
    det = m * k - c * c
    return [p, q, (k * first - c * second) / det, (m * second - c * first) / det]


def positions(end: float = END, step: str = "0.0125", levels: int = 14, digits: int = 40) -> list[mpf]:
    """Return the coordinates of A and B [m] after a time [s], by extrapolation of the midpoint rule.

    E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, II.9: order 2 ``levels``.
    """
    with mp.workdps(digits):
        state = [mpf(0), mp.pi / 2, mpf(0), mpf(0)]
        for _ in range(round(mpf(end) / mpf(step))):
            state = _extrapolated(state, mpf(step), levels)
        a, b = state[:2]
        return [cos(a), sin(a), cos(a) + cos(b), sin(a) + sin(b)]


def _extrapolated(state: list[mpf], step: mpf, levels: int) -> list[mpf]:
    rows: list[list[mpf]] = []
    parts = [2 * (k + 1) for k in range(levels)]
    for k, n in enumerate(parts):
        h = step / n
        old, new = state, [y + h * f for y, f in zip(state, _accelerations(state), strict=True)]
        for _ in range(n - 1):
            old, new = new, [y + 2 * h * f for y, f in zip(old, _accelerations(new), strict=True)]
        row = [[(x + y + h * f) / 2 for x, y, f in zip(old, new, _accelerations(new), strict=True)]]
        for j in range(k):
            ratio = (mpf(n) / parts[k - 1 - j]) ** 2 - 1
            row.append([y + (y - x) / ratio for x, y in zip(rows[j], row[j], strict=True)])
        rows = row
    return rows[-1]
