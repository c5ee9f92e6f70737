"""Random linkages with elastic links at rest, against an assembly of Euler-Bernoulli elements in fixed axes.

Rods, third points of bodies and welds to them are linear constraints there, eliminated by an orthonormal null space.
Those that move are compared with elements in large rotation at a small speed.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from scipy.linalg import eigh, null_space
from shared.full import full, full_unless

import symgen
from symgen.runtime import _beams

E, RHO, WIDTH, COUNT = 210e9, 7850.0, 0.02, 2
#: Values of the tunable parameters of each linkage, and the seeds of linkages; the first ones are quick.
DRAWS, SEEDS, QUICK = 5, range(40), 3


class Drawn:
    """A random four-bar with what may be attached to it, and its parameters.

    Members have points, the number of their joint at mid-length, and whether they are elastic.
    """

    def __init__(self, seed: int) -> None:
        draw = np.random.default_rng(seed)

        def chance(*seeds):
            """Some features come in the first linkages, all others by chance."""
            return seed in seeds or (seed >= QUICK and draw.random() < 0.5)

        self.frame = chance(2)
        self.places = {
            "O": np.zeros(2),
            "A": draw.uniform([0.1, 0.1], [0.2, 0.3]),
            "B": draw.uniform([0.6, 0.5], [0.8, 0.7]),
            "Q": draw.uniform([0.7, -0.1], [0.9, 0.1]),
        }
        self.members = {"crank": ("O", "A"), "coupler": ("A", "B")}
        self.between, self.welds, self.bodies = {}, {}, {}
        if chance(1):  # the rocker is longer, and joined to the coupler at its middle
            self.places["T"] = 2 * self.places["B"] - self.places["Q"]
            self.members["rocker"] = ("Q", "T")
            self.between["B"] = "rocker"
        else:
            self.members["rocker"] = ("Q", "B")
        self.elastic = {"rocker"} | {name for name in ("crank", "coupler") if chance(1, 2)}
        if chance(0):  # an arm welded to the coupler, and to whatever is elastic
            self.places["D"] = self.places["B"] + draw.uniform([0.1, 0.1], [0.3, 0.2])
            self.members["arm"] = ("B", "D")
            self.elastic.add("arm")
            self.welds["B"] = ["coupler", "arm"]
        if "coupler" not in self.elastic and chance(0):  # a dyad at a third point of the coupler
            self.bodies["C"] = draw.uniform([0.3, 0.1], [0.7, 0.3])
            self.places["G"] = draw.uniform([0.0, 1.2], [0.2, 1.4])
            along = self.places["B"] - self.places["A"]
            across = np.array([-along[1], along[0]])
            self.places["C"] = self.places["A"] + self.bodies["C"] @ [along, across]
            self.places["F"] = self.places["C"] + draw.uniform([-0.4, 0.3], [-0.2, 0.4])
            self.members |= {"first": ("C", "F"), "second": ("F", "G")}
            self.elastic |= {"first", "second"}
        if self.frame:  # clamped to the ground, and stiff corners
            self.welds["Q"] = ["rocker"]
            if {"crank", "coupler"} <= self.elastic:
                self.welds["A"] = ["crank", "coupler"]
        self.tip = next(p for p in ("T", "D", "F", "B") if p in self.places)
        self.carrier = next(k for k, (_, b) in reversed(self.members.items()) if b == self.tip)
        self.spring = "B" not in self.welds and "B" not in self.between and "coupler" in self.elastic
        # Axial forces stiffen rigid links: a small force, and none from rounded angles of springs.
        self.force = draw.uniform(-100, 100, 2) * (1.0 if "coupler" in self.elastic else 1e-8)
        self.draws = [self._values(draw) for _ in range(DRAWS)]

    def _values(self, draw):
        found = {f"h_{name}": float(draw.uniform(0.005, 0.02)) for name in self.members}
        found |= {"mass": float(draw.uniform(0.1, 1.0)), "inertia": float(draw.uniform(1e-3, 1e-2))}
        return found | ({"stiffness": float(draw.uniform(10, 1000))} if self.spring else {})

    @property
    def ground(self):
        return {"O", "Q", "G"}

    def angle(self, name):
        x, y = np.subtract(*(self.places[p] for p in reversed(self.members[name])))
        return np.arctan2(y, x)

    def scene(self, speed="0 rpm", share=1.0):
        """Return the scene at a speed of the crank, with a share of the force."""
        units = {"mass": "kg", "inertia": "kg*m^2", "stiffness": "N*m/rad"}
        points = {
            p: {"at": [f"{float(x)!r} m" for x in xy], **({"ground": True} if p in self.ground else {})}
            for p, xy in self.places.items()
            if p not in self.bodies and p not in self.between
        }
        points |= {p: {"on": on, "fraction": 0.5} for p, on in self.between.items()}
        points |= {p: {"on": "coupler", "fraction": float(a), "offset": f"{float(b * self.length('coupler'))!r} m"}
                   for p, (a, b) in self.bodies.items()}  # fmt: skip
        elastic = {"E": f"{E} Pa", "element": "cubic", "elements": COUNT}
        data = {
            "title": "Random",
            "parameters": {k: {"value": f"{v!r} {units.get(k, 'm')}", "tunable": True} for k, v in self.draws[0].items()},
            "points": points,
            "links": {
                name: {
                    "points": list(ends), "density": f"{RHO} kg/m^3",
                    "section": {"width": f"{WIDTH} m", "thickness": f"h_{name}"},
                    **({"elastic": elastic} if name in self.elastic else {}),
                }
                for name, ends in self.members.items()
            },
            "forces": [{"point": self.tip, "force": [f"{float(share * f)!r} N" for f in self.force]}],
            "masses": [{"point": self.tip, "link": self.carrier, "mass": "mass", "inertia": "inertia"}],
            "welds": [{"point": p, "links": links} for p, links in self.welds.items()],
            "crank": {"link": "crank", "speed": speed},
        }  # fmt: skip
        if self.spring:
            slack = float(self.angle("rocker") - self.angle("coupler"))
            data["torsion_springs"] = [
                {
                    "link": "rocker",
                    "against": "coupler",
                    "point": "B",
                    "stiffness": "stiffness",
                    "angle": slack,
                }
            ]
        return symgen.Scene(**data)

    def length(self, name):
        a, b = (self.places[p] for p in self.members[name])
        return float(np.linalg.norm(b - a))

    def section(self, name, node):
        """Name of the rotation of a section, empty where it is held."""
        a, b = self.members[name]
        p = {0: a, COUNT: b}.get(
            node, next((p for p, on in self.between.items() if on == name), f"{name}{node}")
        )
        welded = name in self.welds.get(p, ())
        held = (welded and p in self.ground) or (name, node) == ("crank", 0)
        return p, "" if held else f"{p}.r" if welded else f"{name}{node}.r"


def element(length, thickness):
    """Stiffness and mass in axes of the element: u, w, rotation of both nodes."""
    area, bending = WIDTH * thickness, E * WIDTH * thickness**3 / 12
    h, stiffness, mass = length, np.zeros((6, 6)), np.zeros((6, 6))
    across, along = np.ix_([1, 2, 4, 5], [1, 2, 4, 5]), np.ix_([0, 3], [0, 3])
    stiffness[across] = bending / h**3 * np.array(
        [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h],
         [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h * h, -6 * h, 4 * h * h]])  # fmt: skip
    mass[across] = RHO * area * h / 420 * np.array(
        [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h * h, 13 * h, -3 * h * h],
         [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h * h, -22 * h, 4 * h * h]])  # fmt: skip
    stiffness[along] = E * area / h * np.array([[1, -1], [-1, 1]])
    mass[along] = RHO * area * h / 6 * np.array([[2, 1], [1, 2]])
    return stiffness, mass


class Assembly:
    """Matrices over named unknowns; those without a name are zero."""

    def __init__(self, drawn: Drawn, values) -> None:
        self.names: dict[str, int] = {}
        self.drawn, self.parts, rows = drawn, [], []
        for name in drawn.members:
            (rows.extend if name not in drawn.elastic else lambda _: None)(self.rigid(name, values))
            if name in drawn.elastic:
                self.beam(name, values)
        for p, (a, b) in drawn.bodies.items():
            for k, (x, y) in enumerate([("x", "y"), ("y", "x")]):
                turn = -b if k == 0 else b
                rows.append({f"{p}.{x}": 1.0, f"A.{x}": a - 1, f"B.{x}": -a, f"A.{y}": turn, f"B.{y}": -turn})
        p, (a, b) = drawn.tip, drawn.members[drawn.carrier]
        turned = drawn.section(drawn.carrier, COUNT if b == p else 0)[1]
        self.add([f"{p}.x", f"{p}.y"], np.zeros((2, 2)), values["mass"] * np.eye(2))
        self.add([turned], np.zeros((1, 1)), values["inertia"] * np.eye(1))
        if drawn.spring:
            stiffness = values["stiffness"] * np.array([[1, -1], [-1, 1]])
            self.add(
                [drawn.section("rocker", COUNT)[1], drawn.section("coupler", COUNT)[1]],
                stiffness,
                0 * stiffness,
            )
        for own, *_ in self.parts:
            for dof in own:
                self.known(dof)
        size = len(self.names)
        self.stiffness, self.mass = np.zeros((2, size, size))
        for own, *matrices in self.parts:
            used = [k for k, dof in enumerate(own) if self.free(dof)]
            there = np.ix_(*[[self.names[own[k]] for k in used]] * 2)
            for total, matrix in zip((self.stiffness, self.mass), matrices, strict=True):
                total[there] += matrix[np.ix_(used, used)]
        bound = np.zeros((len(rows), size))
        for i, row in enumerate(rows):
            for dof, value in row.items():
                if self.free(dof):
                    bound[i, self.names[dof]] = value
        self.basis = null_space(bound) if rows else np.eye(size)

    def free(self, dof):
        return dof and dof.partition(".")[0] not in self.drawn.ground

    def known(self, dof):
        if self.free(dof):
            self.names.setdefault(dof, len(self.names))

    def add(self, own, stiffness, mass):
        self.parts.append((own, stiffness, mass))

    def beam(self, name, values):
        a, b = (self.drawn.places[p] for p in self.drawn.members[name])
        (c, s), h = (b - a) / self.drawn.length(name), self.drawn.length(name) / COUNT
        turn = np.kron(np.eye(2), np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))
        nodes = []
        for node in range(COUNT + 1):
            p, turned = self.drawn.section(name, node)
            nodes.append([f"{p}.x", f"{p}.y", turned])
        matrices = [turn.T @ m @ turn for m in element(h, values[f"h_{name}"])]
        for k in range(COUNT):
            self.add(nodes[k] + nodes[k + 1], *matrices)

    def rigid(self, name, values):
        """Rows of a uniform rod: its length; a held crank does not move; welded sections rotate with it."""
        if name in self.drawn.elastic:
            return []
        a, b = self.drawn.members[name]
        vector, own = self.drawn.places[b] - self.drawn.places[a], [f"{a}.x", f"{a}.y", f"{b}.x", f"{b}.y"]
        mass = RHO * WIDTH * values[f"h_{name}"] * self.drawn.length(name) / 6
        self.add(own, np.zeros((4, 4)), mass * np.kron([[2, 1], [1, 2]], np.eye(2)))
        rows = [dict(zip(own, [*-vector, *vector], strict=True))]
        if name == "crank":
            rows = [{f"{b}.x": 1.0}, {f"{b}.y": 1.0}]
        x, y = vector / (vector @ vector)
        for p, links in self.drawn.welds.items():
            if name in links:
                rows.append({f"{p}.r": -1.0} | dict(zip(own, [y, -x, -y, x], strict=True)))
        return rows

    def in_unknowns(self, names):
        """Return the unknowns of a model over those here, by their names: displacements within links are axial and transverse."""
        rows = np.zeros((len(names), len(self.names)))
        for row, (owner, _, what) in zip(rows, (name.rpartition(".") for name in names), strict=True):
            word, _, at = what.partition("@")
            link, _, joint = owner.partition(".")
            node = self.drawn.members[link].index(joint) * COUNT if joint else int(at or 1) - 1
            if word in ("x", "y"):
                row[self.names[f"{owner}.{word}"]] = 1.0
            elif word == "theta":
                own = self.drawn.section(link, node)[1] if joint or at else f"{owner}.r"
                row[self.names[own]] = 1.0
            else:
                angle = self.drawn.angle(link) + (np.pi / 2 if word == "w" else 0.0)
                row[[self.names[f"{link}{node}.{axis}"] for axis in "xy"]] = np.cos(angle), np.sin(angle)
        return rows

    def frequencies(self):
        stiffness, mass = (self.basis.T @ m @ self.basis for m in (self.stiffness, self.mass))
        return np.sqrt(eigh(stiffness, mass, eigvals_only=True)) / (2 * np.pi)

    def bent(self):
        load = np.zeros(len(self.names))
        load[[self.names[f"{self.drawn.tip}.{axis}"] for axis in "xy"]] = self.drawn.force
        shape = self.basis @ np.linalg.solve(self.basis.T @ self.stiffness @ self.basis, self.basis.T @ load)
        return {dof: float(shape[k]) for dof, k in self.names.items()}


@lru_cache(maxsize=1)
def linkage(seed):
    drawn = Drawn(seed)
    return drawn, symgen.build(drawn.scene())


def _case(seed, k):
    return (seed, k) if seed < QUICK else full(seed, k)


@pytest.mark.parametrize("seed, k", [_case(seed, k) for seed in SEEDS for k in range(DRAWS)])
def test_matrices(seed, k):
    """Mass and stiffness of the undeformed structure, entry by entry; rigid links are eliminated by the model's basis."""
    drawn, model = linkage(seed)
    motion = model.with_parameters(**drawn.draws[k]).motion(True)
    expected = Assembly(drawn, drawn.draws[k])
    _, mass, _, stiffness, _, basis = motion.equations().matrices(0.0, _beams.AT_REST)
    moved = expected.in_unknowns(motion.layout.names).T @ (np.eye(len(mass)) if basis is None else basis[0])
    assert moved.shape == (len(expected.names), expected.basis.shape[1])
    for found, whole in ((mass, expected.mass), (stiffness, expected.stiffness)):
        own = moved.T @ whole @ moved
        size = np.sqrt(np.diagonal(own))
        assert np.max(np.abs(found - own) / np.outer(size, size)) < 1e-9


@pytest.mark.parametrize("seed, k", [_case(seed, k) for seed in SEEDS for k in range(DRAWS)])
def test_frequencies_and_static_deflections(seed, k):
    drawn, model = linkage(seed)
    model, expected = model.with_parameters(**drawn.draws[k]), Assembly(drawn, drawn.draws[k])
    frequencies = model.modes().frequencies
    assert len(frequencies) == expected.basis.shape[1]
    assert frequencies == pytest.approx(expected.frequencies(), rel=1e-9)
    bent = expected.bent()
    found = model.quasi_static(samples=2, geometric_stiffness=False)
    largest = max(abs(x) for dof, x in bent.items() if not dof.endswith(".r"))
    for p in drawn.places:
        if p not in drawn.ground and f"{p}.displacement" in found:
            own = [bent[f"{p}.{axis}"] for axis in "xy"]
            assert found[f"{p}.displacement"].values[-1] == pytest.approx(own, rel=0, abs=1e-9 * largest)


@pytest.mark.parametrize(
    "seed", full_unless(lambda seed: seed == 0, [seed for seed in SEEDS if not Drawn(seed).frame])
)
def test_transients_at_small_speed_are_those_in_large_rotation(seed):
    """Vibrations from an abrupt start under a small force, over the period of the lowest mode."""
    model = symgen.build(Drawn(seed).scene("1 rpm", 2.5e-3))
    options = {"revolutions": 1 / 60 / model.modes().frequencies[0], "samples": 21}
    linear, large = (
        model.simulate(**options, rtol=1e-5),
        model.large_rotation(**options, elements=COUNT, rtol=1e-4),
    )
    names = [name for name in linear if name.endswith(".displacement")]
    largest = max(np.max(np.abs(linear[name].values)) for name in names)
    for name in names:
        # Mass matrices along the elements differ: those of linear and of cubic shape functions.
        assert large[name].values == pytest.approx(linear[name].values, rel=0, abs=3e-3 * largest), name
