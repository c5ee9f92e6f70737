"""Couples on the sections of elastic links by laws that read places, against the elastica."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_bvp

import symgen
from symgen.errors import ModelError

LENGTH, STIFFNESS = 1.0, 210e9 * 0.02 * 0.005**3 / 12
FORCE = 12.0


def cantilever(torque, **tables):
    """A held strip under a force across its end, with a couple on its last section."""
    return symgen.Scene(
        parameters={"k": "20 N", "P": f"{FORCE} N", "turn": "5 N*m", "l": "1 m"},
        points={"O": {"at": ["0 m", "0 m"], "ground": True}, "A": {"at": ["1 m", "0 m"]}},
        links={
            "strip": {
                "points": ["O", "A"],
                "density": "7850 kg/m^3",
                "section": {"width": "20 mm", "thickness": "5 mm"},
                "elastic": {"E": "210 GPa", "elements": 16},
            }
        },
        forces=[{"point": "A", "force": ["0 N", "P"]}],
        torques=[{"link": "strip", "point": "A", "torque": torque}],
        crank={"link": "strip", "speed": "0 rpm"},
        **tables,
    )


def elastica(couple):
    """Place and rotation of the end of an inextensible strip, with a couple by both there."""

    def slopes(_, y):
        return [np.cos(y[2]), np.sin(y[2]), y[3], -FORCE * np.cos(y[2]) / STIFFNESS]

    def ends(start, end):
        return [*start[:3], STIFFNESS * end[3] - couple(*end[:3])]

    s = np.linspace(0, LENGTH, 41)
    found = solve_bvp(slopes, ends, s, np.vstack([s, 0 * s, 0 * s, 0 * s]), tol=1e-10)
    return found.y[:3, -1]


@pytest.mark.parametrize(
    ("torque", "couple"),
    [
        ("-k*A.y", lambda x, y, turned: -20 * y),
        ("-k*A.x*A.y/l", lambda x, y, turned: -20 * x * y),
        ("-turn*this.angle", lambda x, y, turned: -5 * turned),
    ],
)
def test_a_law_reads_the_place_or_the_rotation_of_the_deformed_end(torque, couple):
    x, y, _ = elastica(couple)
    found = symgen.build(cantilever(torque)).equilibrium()
    assert found.state.positions["A"] == pytest.approx([x, y], abs=1e-5)


def test_a_law_of_both_is_refused():
    with pytest.raises(ModelError, match="read the rotation of a section of strip and the place of A"):
        symgen.build(cantilever("-turn*this.angle - k*A.y")).equilibrium()
