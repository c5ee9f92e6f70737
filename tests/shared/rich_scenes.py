"""Linkages in the plane and in space that use every feature of a scene."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation
from shared.linkages import GRAVITY, at, ground
from shared.shipped import LINKAGES

import symgen

GRAVITY_IN_SPACE = {"acceleration": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}

LINK_POINTS = {
    "OA": ["O", "A", "P"],
    "body": ["A", "B", "C", "Q"],
    "BE": ["B", "E"],
    "PD": ["P", "D", "H"],
    "QF": ["Q", "F"],
}

TORQUE = [2.0, -1.0, 0.5]

JOINTS = {"one": ["A", "B", "M"], "two": ["B", "C"], "OA": ["O", "A"], "CD": ["C", "D"], "ME": ["M", "E"]}

BODY = {
    "points": ["O", "A", "B"],
    "mass": "1 kg",
    "centre": ["0 m", "0 m", "0 m"],
    "inertia": ["1 kg*m^2"] * 3,
}


def rich_scene(everything=False):
    """A branched linkage with two loops: rods with points on them, a ternary body, every planar load.

    With ``everything`` a guide, a drive and a tunable parameter too, and every output.
    """
    more = {}
    if everything:
        outputs = [f"{k}.{p}.force" for k, ps in LINK_POINTS.items() for p in ps]
        outputs += [f"{k}.{w}" for k in LINK_POINTS for w in ("angular_velocity", "angle", "tension")]
        outputs += ["momentum", "angular_momentum", "energy", "QF.torque", "H.acceleration", "E.reaction"]
        more = {
            "drivers": [{"link": "QF", "angle": "2.4 + 0.2*t/s"}],
            "guides": [{"points": ["D"], "along": "rail"}],
            "analysis": {"outputs": outputs},
        }
    scene = {
        "parameters": {"c": "0.7 N*s/m", "m0": "0.8 N*m", "s": "1 s", "k": "3 N", "l": "1 m"},
        "points": {
            "O": ground(0.0, 0.0),
            "E": ground(3.2, 0.4),
            "A": at(0.6, 0.8),
            "B": at(2.1, 1.3),
            "C": at(1.5, 2.2),
            "P": {"on": "OA", "fraction": 0.4},
            "Q": {"on": "body", "fraction": "-1/3"},
            "D": at(1.1, -0.5),
            "F": at(-0.4, 1.9),
            "H": {"on": "PD", "fraction": 1.5},
        },
        "links": {
            "OA": {"points": ["O", "A"], "mass": "1.2 kg", "centre": 0.35},
            "body": {
                "points": ["A", "B", "C"],
                "mass": "2 kg",
                "centre": ["1.3 m", "1.5 m"],
                "inertia": "0.4 kg*m^2",
            },
            "BE": {"points": ["B", "E"], "mass": "0.7 kg"},
            "PD": {"points": ["P", "D"], "mass": "0.5 kg"},
            "QF": {"points": ["Q", "F"], "mass": "0.9 kg"},
        },
        "gravity": GRAVITY,
        "masses": [{"point": "H", "mass": "0.3 kg"}, {"point": "C", "mass": "0.4 kg"}],
        "springs": [
            {
                "between": ["C", "E"],
                "stiffness": "30 N/m",
                "length": "1 m",
                "damping": "2 N*s/m",
            },
            {"between": ["H", "O"], "stiffness": "11 N/m", "length": "0 m"},
        ],
        "actuators": [{"between": ["P", "C"], "force": "k*(1 + this.length/l) - c*this.rate"}],
        "torsion_springs": [
            {
                "link": "PD",
                "against": "OA",
                "stiffness": "2 N*m",
                "angle": "20 deg",
                "damping": "0.3 N*m*s",
            }
        ],
        "forces": [{"point": "H", "force": ["-c*H.vx", "k*sin(t/s) - k*F.x/l"]}],
        "torques": [{"link": "QF", "against": "body", "torque": "m0*cos(this.angle) - m0*s*this.rate"}],
        "start": {"rates": {"OA": "1.3 rad/s", "PD": "-2 rad/s", "QF": "0.6 rad/s"}},
    }
    if everything:
        scene["points"] |= {"U": ground(-2.0, -0.9), "V": ground(4.0, -0.7)}
        scene["links"]["rail"] = {"points": ["U", "V"]}
        scene["parameters"]["k"] = {"value": "3 N", "tunable": True}
        scene["start"] = {}
    return scene | more


def place(p, **more):
    return {"at": [f"{float(c)!r} m" for c in p], **more}


def moments(matrix):
    """Return the six entries of an inertia matrix as a scene writes them."""
    m = np.asarray(matrix, dtype=float)
    return [f"{float(m[i, j])!r} kg*m^2" for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def vector(v, unit):
    return [f"{float(c)!r} {unit}" for c in v]


def general(seed=0):
    """A body without symmetry: mass, centre, inertia matrix about the centre."""
    rng = np.random.default_rng(seed)
    turn = Rotation.random(random_state=seed).as_matrix()
    return 2.3, rng.uniform(-0.3, 0.3, 3), turn @ np.diag([0.05, 0.08, 0.11]) @ turn.T


def two_bodies():
    """Mass, centre and inertia of the two bodies that ``joined_bodies`` joins."""
    (m1, c1, i1), (m2, c2, i2) = general(1), general(2)
    return {"one": (m1, c1 + [1.0, 0, 0], i1), "two": (m2, c2 + [2.0, 0.5, 0], i2)}


def written(named, mass, centre, inertia):
    """Return a body as a scene writes it."""
    return {
        "points": named,
        "mass": f"{mass!r} kg",
        "centre": vector(centre, "m"),
        "inertia": moments(inertia),
    }


def joined_bodies():
    """A rod from the ground, two bodies with a ball joint, further rods in series and in parallel, all loads in space."""
    points = {
        "O": place([0, 0, 0.3], ground=True),
        "A": place([0.7, 0.1, 0]),
        "B": place([1.5, 0.3, 0.2]),
        "C": place([2.6, 0.4, -0.3]),
        "D": place([3.0, -0.4, -0.4]),
        "M": {"on": "one", "fraction": 0.6},
        "E": place([1.3, 0.9, -0.8]),
    }
    bodies = two_bodies()
    links = {
        "OA": {"points": ["O", "A"], "mass": "0.4 kg"},
        "one": written(["A", "B"], *bodies["one"]),
        "two": written(["B", "C"], *bodies["two"]),
        "CD": {"points": ["C", "D"], "mass": "0.6 kg"},
        "ME": {"points": ["M", "E"], "mass": "0.5 kg"},
    }
    outputs = [f"{k}.{p}.force" for k, ps in JOINTS.items() for p in ps]
    outputs += [f"{k}.angular_velocity" for k in ("one", "two", "CD")]
    return {
        "parameters": {"k": {"value": "2 N/m", "tunable": True}},
        "points": points,
        "links": links,
        "gravity": GRAVITY_IN_SPACE,
        "torques": [{"link": "two", "against": "one", "torque": vector(TORQUE, "N*m")}],
        "torsion_springs": [{"link": "CD", "against": "OA", "stiffness": "1.5 N*m"}],
        "springs": [{"between": ["O", "D"], "stiffness": "k", "length": "0 m"}],
        "actuators": [{"between": ["E", "D"], "force": "k*this.length"}],
        "start": {"rates": {"one": vector([0.4, 1, -2], "rad/s"), "two": vector([1, 0, 0.5], "rad/s")}},
        "analysis": {"outputs": [*outputs, "energy", "momentum", "angular_momentum"]},
    }


def loaded():
    """A bent lever with a slider, springs with dampers, a torque between links, moving ground: all at once."""
    points = {
        "O": ground(0, 0, motion=["d*sin(w*t)", "0 m"]),
        "E": ground(2, -0.2),
        "A": at(0.4, 0.7),
        "B": at(1.1, 0.9),
        "C": at(0.7, 1.3),
        "S": at(1.6, 0.1),
        "F": ground(3, 0.1),
        "H": ground(-1, 0.1),
    }
    links = {
        "crank": {"points": ["O", "A"], "mass": "1 kg"},
        "lever": {
            "points": ["A", "B", "C"],
            "mass": "2 kg",
            "centre": ["0.7 m", "1 m"],
            "inertia": "0.3 kg*m^2",
        },
        "rod": {"points": ["B", "S"], "mass": "0.8 kg", "length": "1 m"},
        "rail": {"points": ["H", "F"]},
    }
    return symgen.Scene(
        parameters={"d": "1 cm", "w": "2 rad/s", "k": {"value": "90 N/m", "tunable": True}},
        points=points,
        links=links,
        gravity=GRAVITY,
        guides=[{"points": ["S"], "along": "rail"}],
        springs=[
            {"between": ["C", "E"], "stiffness": "k", "length": "0.4 m", "damping": "3 N*s/m"},
            {"between": ["O", "S"], "stiffness": "30 N/m", "length": "1 m", "damping": "1.5 N*s/m"},
        ],
        torques=[{"link": "crank", "torque": "2 N*m", "against": "rod"}],
        forces=[{"point": "C", "force": ["3 N", "1 N"]}],
    )


#: Linkages by name, as functions that return a scene.
SCENES = {name: (lambda name=name: name) for name in LINKAGES} | {"loaded": loaded}
