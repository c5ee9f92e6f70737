"""Properties of every load of the registry: energy, virtual work and actions are one physics."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

import symgen
from symgen.loads import LOADS
from symgen.loads.measure import Couple, PointForce
from symgen.models.rods.linkage import RodsModel
from symgen.scene.resolve import resolve

#: A chain of two rods with a load of each kind, in the plane and in space.
CHAIN = """
symgen = 1
[points]
O = { at = ["0 m", "0 m"], ground = true }
A = { at = ["0.7 m", "0.2 m"] }
B = { at = ["1.1 m", "-0.4 m"] }
X = { on = "AB", fraction = 0.3 }
S = { at = ["0.4 m", "0.9 m"], ground = true }
[links]
OA = { points = ["O", "A"], mass = "1 kg" }
AB = { points = ["A", "B"], mass = "2 kg" }
"""
LOADED = {
    "springs": 'between = ["X", "S"]\nstiffness = "70 N/m"\nlength = "0.3 m"\ndamping = "4 N*s/m"',
    "actuators": 'between = ["S", "B"]\nforce = "k*this.length - c*this.rate"',
    "forces": 'point = "X"\nforce = ["-c*A.vx", "k*A.y"]',
    "distributed_forces": 'link = "AB"\nforce = ["3 N/m", "-2 N/m"]\nend = ["1 N/m", "5 N/m"]\naxes = "link"',
    "torques": 'link = "AB"\nagainst = "OA"\ntorque = "m*sin(this.angle)"',
    "torsion_springs": 'link = "AB"\nagainst = "OA"\nstiffness = "6 N*m"\nangle = 0.4\ndamping = "2 N*m*s"',
    "bushings": 'between = ["A", "X"]\nlink = "AB"\nagainst = "OA"\nstiffness = ["70 N/m", "30 N/m"]\n'
    'damping = ["4 N*s/m", "1 N*s/m"]\nangular_stiffness = "6 N*m"\nangle = 0.4\nangular_damping = "2 N*m*s"',
    "bearings": 'link = "AB"\nagainst = "OA"\npoint = "A"\ncoefficient = 0.2\nradius = "20 mm"\ntransition = "1 rad/s"',
}
#: The couple of a bearing, an unknown [N m].
COUPLE = -0.7
IN_SPACE = {
    "springs": LOADED["springs"],
    "actuators": LOADED["actuators"],
    "forces": 'point = "X"\nforce = ["-c*A.vx", "k*A.y", "2 N"]',
    "torques": 'link = "AB"\nagainst = "OA"\ntorque = ["1 N*m", "-2 N*m", "m*B.z/l"]',
    "torsion_springs": 'link = "AB"\nagainst = "OA"\nstiffness = "6 N*m"',
    "bushings": 'between = ["S", "X"]\nlink = "AB"\nstiffness = ["70 N/m", "30 N/m", "10 N/m"]\n'
    'damping = ["4 N*s/m", "1 N*s/m", "2 N*s/m"]',
}
CASES = [(2, t) for t in LOADED] + [(3, t) for t in IN_SPACE]


def loaded(dimension, table):
    text = CHAIN + '[parameters]\nk = "9 N/m"\nc = "2 N*s/m"\nm = "3 N*m"\nl = "1 m"\n'
    text += f"[[{table}]]\n{(LOADED if dimension == 2 else IN_SPACE)[table]}\n"
    scene = tomllib.loads(text)
    for i, point in enumerate(p for p in scene["points"].values() if "at" in p) if dimension == 3 else ():
        point["at"].append(f"{0.3 * i} m")
    return RodsModel(resolve(symgen.Scene(**scene)))


def numbers(model, q, u):
    """Values of all symbols at the coordinates q and rates u of the free points; ground where it stands."""
    put = dict(zip([x.symbol for x in model.coordinates], map(sp.Float, q), strict=True))
    put |= dict(zip([x.symbol for p in model.free for x in model.u[p]], map(sp.Float, u), strict=True))
    put |= {s: e for s, e in model.held.items()}
    put |= dict(model.linkage.defaults)
    put |= {x.symbol: sp.Float(COUPLE) for x in model.loads.of_joints.values()}
    for definition in model.calculus.definitions:
        put[definition.quantity.symbol] = definition.expression.xreplace(put)
    return lambda expression: float(sp.sympify(expression).xreplace(put))


def state(model, dimension):
    """Places and velocities of A and B by which both rods keep their lengths."""
    rng = np.random.default_rng(dimension)
    places, velocities = [model.linkage.point("O").at], [np.zeros(dimension)]
    for link in ("OA", "AB"):
        length = model.linkage.number(model.linkage.link(link).length)
        along, across = rng.normal(size=(2, dimension))
        along /= np.linalg.norm(along)
        places.append(np.array(places[-1], float) + length * along)
        velocities.append(velocities[-1] + across - along * (across @ along))
    return np.concatenate(places[1:]), np.concatenate(velocities[1:])


def test_every_kind_is_tried():
    assert set(LOADED) == {table for table, kind in LOADS.items() if kind.acts}
    for table, kind in LOADS.items():
        assert kind.noun and kind.plural and kind.schema.__doc__, table


def expected_power(dimension, table, q, u):
    """The power of each load in plain numbers, from the places and velocities of A and B."""
    (a, b), (va, vb) = np.split(q, 2), np.split(u, 2)
    x, vx = a + 0.3 * (b - a), va + 0.3 * (vb - va)
    s = np.array([0.4, 0.9, 0.9][:dimension])
    d, rate = b - a, vb - va
    if table in ("springs", "actuators"):
        line, moving = (x - s, vx) if table == "springs" else (b - s, vb)
        length = np.linalg.norm(line)
        stretching = line @ moving / length
        push = -70 * (length - 0.3) - 4 * stretching if table == "springs" else 9 * length - 2 * stretching
        return push * stretching
    if table == "bushings":
        axes, turning = np.eye(dimension), 0.0
        if dimension == 2:
            line, moving = x - a, vx - va
            axes = np.array([a, [-a[1], a[0]]]) / np.linalg.norm(a)
            turning = (a[0] * va[1] - a[1] * va[0]) / (a @ a)
            moving = moving - turning * np.array([-line[1], line[0]])
        else:
            line, moving = x - s, vx
        stiffness, damping = np.array([70.0, 30.0, 10.0]), np.array([4.0, 1.0, 2.0])
        rates = axes @ moving
        done = -(stiffness[:dimension] * (axes @ line) + damping[:dimension] * rates) @ rates
        if dimension == 3:
            return done
    if table == "forces":
        return np.array([-2 * va[0], 9 * a[1], 2.0][:dimension]) @ vx
    if table == "distributed_forces":
        along, left = d / np.linalg.norm(d), np.array([-d[1], d[0]]) / np.linalg.norm(d)
        places, weights = (
            (np.polynomial.legendre.leggauss(4)[0] + 1) / 2,
            np.polynomial.legendre.leggauss(4)[1] / 2,
        )
        force = [(3 - 2 * k) * along + (-2 + 7 * k) * left for k in places]
        velocity = [va + k * rate for k in places]
        return np.linalg.norm(d) * sum(w * f @ v for w, f, v in zip(weights, force, velocity, strict=True))
    if dimension == 3:
        if table == "torsion_springs":
            return 6 * (va @ d + a @ rate) / (np.linalg.norm(a) * np.linalg.norm(d))
        spins = [np.cross(v, w) / (v @ v) for v, w in ((a, va), (d, rate))]
        return np.array([1, -2, 3 * b[2]]) @ (spins[1] - spins[0])
    angle = np.arctan2(d[1], d[0]) - np.arctan2(a[1], a[0])
    turning = (d[0] * rate[1] - d[1] * rate[0]) / (d @ d) - (a[0] * va[1] - a[1] * va[0]) / (a @ a)
    if table == "bearings":
        return COUPLE * turning
    if table == "torques":
        return 3 * np.sin(angle) * turning
    bent = (angle - 0.4 + np.pi) % (2 * np.pi) - np.pi
    twisted = -(6 * bent + 2 * turning) * turning
    return done + twisted if table == "bushings" else twisted


#: What puts loads in place of something else: a motor.
MAKERS = {"scene/elastic/motor.py", "models/elastic/joints.py"}


def test_no_other_module_knows_a_kind_of_load():
    """A kind is named in its file and in the registry, so that none is forgotten where loads are treated."""
    root = Path(symgen.__file__).parent
    files = {kind.__module__.rpartition(".")[2] for kind in LOADS.values()}
    names = {kind.__name__ for kind in LOADS.values()} | {table for table in LOADS if "_" in table}
    word = re.compile(rf"\b({'|'.join(sorted(names))})\b|symgen\.loads\.({'|'.join(sorted(files))})\b")
    found = {
        path.relative_to(root).as_posix()
        for path in root.rglob("*.py")
        if path.parent != root / "loads" and word.search(path.read_text())
    }
    assert found == MAKERS


@pytest.mark.parametrize(("dimension", "table"), CASES)
def test_actions_do_the_work_that_the_equations_of_motion_have(dimension, table):
    """Power of the forces on points and couples on links = f.u, and minus the rate of the energies with it."""
    model = loaded(dimension, table)
    q, u = state(model, dimension)
    force, power = model.force, 0
    free = [x.symbol for x in model.coordinates]
    points, couples = [], []
    for _, term in model.loads.terms:
        for action in model.loads.actions(term):
            (points if isinstance(action, PointForce) else couples).append(action)
    for action in points:
        power += sum(f * v for f, v in zip(action.force, model.velocity(action.point), strict=True))
    for action in couples:
        assert isinstance(action, Couple)
        if dimension == 2:
            power += action.torque[0] * model.turning(action.link)[1]
        else:
            power += sum(
                t * w for t, w in zip(action.torque, model.angular_velocity(action.link), strict=True)
            )
    energy = model.potential_energy
    at = numbers(model, q, u)
    done = sum(at(force.get(s, 0)) * v for s, v in zip(free, u, strict=True))
    assert at(power) == pytest.approx(done, rel=1e-12)
    assert done == pytest.approx(expected_power(dimension, table, q, u), rel=1e-12)
    assert abs(done) > 1e-2
    step = 1e-6
    rate = (numbers(model, q + step * u, u)(energy) - numbers(model, q - step * u, u)(energy)) / (2 * step)
    others = sum(at(f) * at(v) for f, _, v in model.loads.others)
    assert done == pytest.approx(others - rate, rel=1e-7, abs=1e-7)
