"""Masses with moments of inertia on elastic links: frequencies in closed form, power balance, rigid links."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from scipy.linalg import eigh
from shared.in_numpy import build

import symgen
from symgen.errors import SceneError
from symgen.runtime.elastic.large.linkage import LargeLinkage

LENGTH, WIDTH, THICKNESS, E, RHO = 0.8, 0.02, 0.01, 210e9, 7850.0
BENDING, LINE = E * WIDTH * THICKNESS**3 / 12, RHO * WIDTH * THICKNESS
TIP = {"point": "T", "mass": "0.3 kg", "inertia": "0.02 kg*m^2"}


def cantilever(masses=(TIP,), crank=None, **elastic):
    return {
        "title": "Cantilever with a heavy tip",
        "points": {
            "O": {"at": ["0 m", "0 m"], "ground": True},
            "T": {"at": [f"{LENGTH} m", "0 m"]},
            "C": {"on": "beam", "fraction": 0.6},
        },
        "links": {
            "beam": {
                "points": ["O", "T"], "density": f"{RHO} kg/m^3",
                "section": {"width": f"{WIDTH} m", "thickness": f"{THICKNESS} m"},
                "elastic": {"E": f"{E} Pa", "elements": 4} | elastic,
            }
        },
        "masses": [*masses],
        "crank": {"link": "beam"} | (crank or {"speed": "0 rpm"}),
    }  # fmt: skip


def frequencies(mass, inertia, count):
    """Roots of the frequency equation of a clamped beam with a mass that has a moment of inertia at its tip."""
    total = LINE * LENGTH
    m, j = mass / total, inertia / (total * LENGTH**2)

    def left(b):
        c, s, ch, sh = mpmath.cos(b), mpmath.sin(b), mpmath.cosh(b), mpmath.sinh(b)
        # From EI w'' = J w'_tt and EI w''' = -m w_tt at the tip, over cosh so that it is of order one.
        return (
            1
            + c * ch
            + m * b * (c * sh - s * ch)
            - j * b**3 * (c * sh + s * ch)
            + m * j * b**4 * (1 - c * ch)
        ) / ch

    grid = np.linspace(0.05, 20, 4000)
    values = [float(left(b)) for b in grid]
    roots = [
        mpmath.findroot(left, (grid[i], grid[i + 1]), solver="anderson")
        for i in range(len(grid) - 1)
        if values[i] * values[i + 1] < 0
    ]
    return [float(b) ** 2 * np.sqrt(BENDING / LINE) / LENGTH**2 / (2 * np.pi) for b in roots[:count]]


@pytest.mark.parametrize("mass, inertia", [(0.3, 0.02), (0.0, 0.5), (5.0, 1e-3)])
def test_frequencies_of_a_cantilever_with_a_heavy_tip(mass, inertia):
    tip = {"point": "T", "mass": f"{mass} kg", "inertia": f"{inertia} kg*m^2"}
    model = symgen.build(symgen.Scene(**cantilever([tip], axial=False, elements=12)))
    expected = frequencies(mass, inertia, 3)
    assert model.modes().frequencies[:3] == pytest.approx(expected, rel=1e-9)


def test_a_disc_between_the_ends_lets_the_curvature_jump():
    """Against cubic elements, whose curvature is free at every node: the order of both is kept."""
    disc = {"point": "C", "mass": "0.1 kg", "inertia": "0.02 kg*m^2"}
    fine, quintic = (
        build(symgen.Scene(**cantilever([disc], axial=False, element=element, elements=count)))
        for element, count in (("cubic", 80), ("beam8", 8))
    )
    assert quintic.modes().frequencies[:4] == pytest.approx(fine.modes().frequencies[:4], rel=1e-6)


ANGLE = "5e-3*sin(rate*t)"


def test_torque_and_power_of_a_stiff_cantilever_with_heavy_places():
    """The torque of a rigid body on its shaft; the power of the shaft is the rate of all energies."""
    disc = {"point": "C", "mass": "0.1 kg", "inertia": "0.03 kg*m^2"}
    scene = cantilever([TIP, disc], {"angle": ANGLE}, E=f"{E * 1e4} Pa", damping={"ratio": 0.02})
    scene["parameters"] = {"rate": "6 rad/s"}
    model = symgen.build(symgen.Scene(**scene | {"analysis": {"t_end": "0.5 s"}}))
    inertia = LINE * LENGTH**3 / 3 + 0.3 * LENGTH**2 + 0.1 * (0.6 * LENGTH) ** 2 + 0.02 + 0.03
    still = model.quasi_static(samples=9)
    expected = -inertia * 36 * 5e-3 * np.sin(6 * np.asarray(still.coordinate.values))
    assert np.abs(still["beam.torque"].values - expected).max() < 1e-6 * np.abs(expected).max()
    run = model.simulate(initial="quasi-static")
    assert run.statistics["power_balance"] < 5e-12  # of rounding: 6e-13
    kinetic = inertia * (6 * 5e-3 * np.cos(6 * np.asarray(run.coordinate.values))) ** 2 / 2
    assert np.abs(run["kinetic_energy"].values - kinetic).max() < 1e-4 * kinetic.max()


def test_the_same_mass_on_a_rigid_link():
    """A torque-free rod on a pin against gravity: I theta'' = -m g l sin theta, with small oscillations."""
    scene = {
        "title": "Pendulum with a disc",
        "points": {"O": {"at": ["0 m", "0 m"], "ground": True}, "T": {"at": ["0 m", "-1 m"]}},
        "links": {"rod": {"points": ["O", "T"], "mass": "0 kg"}},
        "masses": [{"point": "T", "mass": "2 kg", "inertia": "0.5 kg*m^2"}],
        "gravity": {"acceleration": ["0 m/s^2", "-9.81 m/s^2"]},
    }
    found = build(symgen.Scene(**scene)).modes().frequencies
    assert found == pytest.approx([np.sqrt(2 * 9.81 / (2 + 0.5)) / (2 * np.pi)], rel=1e-9)


BAD = {
    "no link": ({"masses": [TIP | {"link": "other"}]}, SceneError, "other"),
    "no inertia": ({"masses": [{"point": "T", "mass": "1 kg", "link": "beam"}]}, SceneError, "rotates with no link"),
    "three": ({"masses": [TIP | {"inertia": [1, 1, 1]}]}, SceneError, r"expected a text .* got \[1, 1, 1\]"),
    "negative": ({"masses": [TIP | {"inertia": "-1 kg*m^2"}]}, SceneError, "inertia"),
    "two links": (
        {
            "links": cantilever()["links"] | {"bar": {"points": ["T", "Q"], "mass": "1 kg"}},
            "points": cantilever()["points"] | {"Q": {"at": ["1 m", "1 m"], "ground": True}},
        },
        SceneError,
        "beam, bar: a mass with inertia",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_refused(case):
    changes, kind, words = BAD[case]
    with pytest.raises(kind, match=words):
        build(symgen.Scene(**cantilever() | changes))


def test_frequencies_in_large_rotation():
    """Of the straight beam at rest, by differences of the residual of elements in large rotation."""
    linkage = LargeLinkage(build(symgen.Scene(**cantilever())).motion(True), 8)
    q, n, h = linkage.start().q, linkage.unknowns, 1e-7

    def forces(q, a):
        states = (x[None] for x in (q, np.zeros(n), a, np.zeros(linkage.multipliers)))
        return linkage.residual(np.zeros(1), *states)[0]

    unit, still = np.eye(n), np.zeros(n)
    mass = np.array([forces(q, e) - forces(q, still) for e in unit])
    stiffness = np.array([forces(q + h * e, still) - forces(q - h * e, still) for e in unit]) / (2 * h)
    link = linkage.links[0]
    held = {*link.places[0].tolist()}
    free = [k for k in range(n) if k not in held]
    bent = [k for k in free if k in set(link.places[:, 1:].ravel().tolist())]
    squares = eigh(stiffness[np.ix_(bent, bent)], mass[np.ix_(bent, bent)], eigvals_only=True)
    mass_of_tip, inertia = (float(TIP[name].split()[0]) for name in ("mass", "inertia"))
    expected = frequencies(mass_of_tip, inertia, 3)
    assert np.sqrt(squares[:3]) / (2 * np.pi) == pytest.approx(expected, rel=1e-4)
