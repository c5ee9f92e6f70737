"""Steps of constrained elastic links, solved by band and border, against dense matrices and NumPy's solutions."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from shared.full import full

import symgen
from symgen.errors import SimulationError
from symgen.runtime.beams.methods import BEAM_METHODS
from symgen.runtime.beams.pieces import pieces, transformed, whole
from symgen.runtime.elastic.steps import stepped
from symgen.scene.loading import read_scene

SHORT = {"axial": False}
RAYLEIGH = {"damping": {"mass": "3 1/s", "stiffness": "1e-6 s"}}
#: Topologies: the shipped scene, what its links have under `elastic`, and damping ratios of modes; None is a rigid
#: link.
LINKAGES = {
    "slider": ("elastic_slider_crank", {"rod": RAYLEIGH}),
    "slider, modal damping": ("elastic_slider_crank", {}),
    "inextensible rod": ("elastic_slider_crank", {"rod": SHORT | RAYLEIGH}),
    "rigid coupler": ("thesis_four_bar", {"crank": RAYLEIGH, "coupler": None, "output": SHORT}),
    "rigid crank": ("thesis_four_bar", {"crank": None, "coupler": SHORT, "output": RAYLEIGH}),
    "inextensible links": ("thesis_four_bar", {"crank": SHORT, "coupler": SHORT, "output": SHORT}),
    "free crank": ("elastic_four_bar_free", {"coupler": SHORT}),
    "slider, few damped modes": ("elastic_slider_crank", {"rod": RAYLEIGH, "modes": [0.1, 0.02]}),
    "inextensible links, a damped mode": (
        "thesis_four_bar",
        {"crank": SHORT, "coupler": SHORT, "output": SHORT, "modes": [0.05]},
    ),
}
#: What they have another linkage has as well.
CONTAINED = ("slider, modal damping", "inextensible links")


def linkage(name, elements):
    scene, changes = LINKAGES[name]
    data = copy.deepcopy(dict(read_scene(scene).data))
    for link, options in changes.items():
        if link == "modes":
            data["modal_damping"] = {"ratio": options}
        elif options is None:
            del data["links"][link]["elastic"]
        else:
            data["links"][link]["elastic"] |= options
    for link in data["links"].values():
        if "elastic" in link:
            link["elastic"]["elements"] = elements
    return symgen.build(symgen.Scene(**data)).motion(True)


def solved(matrix, right):
    """Dense solution of A x = b with rows and columns of one size, for units differ."""
    scale = 1 / np.sqrt(np.abs(np.diagonal(matrix)))
    return scale * np.linalg.solve(matrix * np.outer(scale, scale), scale * right)


class Dense:
    """Matrices of the independent unknowns of a layout by dense products, for a choice of them."""

    def __init__(self, motion, independent):
        self.motion, self.equations = motion, motion.equations()
        self.n, self.m = motion.layout.unknowns, motion.layout.constraints
        self.free = independent
        self.bound = [i for i in range(self.n) if i not in independent]

    def basis(self, t):
        """R, R', R'' of J R = 0 by the rows J, J', J'' that the kernel of the joints gives."""
        layout = self.motion.layout
        joined, places = self.equations.motion.evaluate(t)[3], layout.joint_places[:-1]
        rows = np.zeros((3, self.m, self.n))
        for k in range(3):
            start = layout.joint_at[4 + k]
            rows[k][:, places] = joined[start : start + self.m * len(places)].reshape(self.m, -1)
        made = np.zeros((3, self.n, len(self.free)))
        made[0, self.free, np.arange(len(self.free))] = 1.0
        known = rows[0][:, self.bound]
        for k, right in enumerate(
            (
                lambda: rows[0] @ made[0],
                lambda: rows[1] @ made[0],
                lambda: rows[2] @ made[0] + 2 * rows[1] @ made[1],
            )
        ):
            made[k][self.bound] = -np.linalg.solve(known, right())
        return made

    def at(self, t):
        """M, C, K, Q of p in S = R p, and R, R'."""
        still, unit = np.zeros(self.n), np.eye(self.n)
        load = -self.equations.residual([t], still, still, still)[1][0]

        def columns(k):
            states = [[e if j == k else still for j in range(3)] for e in unit]
            return np.array([self.equations.residual([t], *state)[1][0] + load for state in states]).T

        stiffness, damping, mass = (columns(k) for k in range(3))
        r, rate, second = self.basis(t)
        return (
            r.T @ mass @ r,
            r.T @ (damping @ r + 2 * mass @ rate),
            r.T @ (stiffness @ r + damping @ rate + mass @ second),
            r.T @ load,
            r,
            rate,
        )

    def collocated(self, method, h, p, v):
        """One step of Gauss collocation: accelerations at all stages by one dense solution."""
        count, free = len(method.c), len(self.free)
        system, load = np.zeros((count, free, count, free)), np.zeros((count, free))
        twice = method.a @ method.a
        for i, c in enumerate(method.c):
            mass, damping, stiffness, q, *_ = self.at(c * h)
            for j in range(count):
                system[i, :, j] = h * method.a[i, j] * damping + h**2 * twice[i, j] * stiffness
            system[i, :, i] += mass
            load[i] = q - damping @ v - stiffness @ (p + c * h * v)
        size = count * free
        a = solved(system.reshape(size, size), load.ravel()).reshape(count, free)
        return p + h * v + h**2 * (method.b @ method.a) @ a, v + h * method.b @ a

    def newmark(self, h, p, v):
        """One step with mean acceleration."""
        mass, damping, stiffness, q, *_ = self.at(0.0)
        before = solved(mass, q - damping @ v - stiffness @ p)
        mass, damping, stiffness, q, *_ = self.at(h)
        system = mass + h / 2 * damping + h**2 / 4 * stiffness
        right = q - damping @ (v + h / 2 * before) - stiffness @ (p + h * v + h**2 / 4 * before)
        after = solved(system, right)
        return p + h * v + h**2 / 4 * (before + after), v + h / 2 * (before + after)


@pytest.mark.parametrize(
    ("name", "method"),
    [
        *((name, "gauss") if name not in CONTAINED else full(name, "gauss") for name in LINKAGES),
        *((name, "newmark") if i % 3 == 0 else full(name, "newmark") for i, name in enumerate(LINKAGES)),
    ],
)
def test_a_step_is_that_of_dense_matrices(name, method):
    motion = linkage(name, 3)
    equations = motion.equations()
    basis = equations.matrices(0.0)[-1][0]
    unit = np.eye(basis.shape[1])
    # R copies the independent unknowns.
    independent = [int(np.flatnonzero(np.all(basis == row, axis=1))[0]) for row in unit]
    dense = Dense(motion, independent)
    h = motion.period / 500
    # A shape under load: of an arbitrary one the bending moments, and their round-off, would be enormous.
    mass, _, stiffness, load, r, rate = dense.at(0.0)
    p = np.linalg.solve(stiffness + mass / h**2, load)
    v = 2 * p / h
    start = (r @ p)[:, None], (r @ v + rate @ p)[:, None]
    (displacements,), (rates,) = stepped(
        motion, equations, BEAM_METHODS[method], np.array([h]), np.array([1]), start
    )
    if method == "newmark":
        p, v = dense.newmark(h, p, v)
    else:
        p, v = dense.collocated(BEAM_METHODS[method], h, p, v)
    r, rate, _ = dense.basis(h)
    for found, exact in ((displacements, r @ p), (rates, r @ v + rate @ p)):
        assert np.max(np.abs(found - exact)) < 2e-9 * np.max(np.abs(exact))


@pytest.mark.parametrize("name", [full("slider"), full("rigid coupler"), "inextensible links"])
def test_band_does_not_grow_with_elements(name):
    few, many = (linkage(name, elements).layout for elements in (4, 16))
    assert few.constraints and few.band == many.band < 9
    assert many.inner > 3 * few.inner


def test_elements_of_an_inextensible_link_add_up_to_the_whole():
    """Pieces of single elements add up to the matrices of the whole link, transformed at once."""
    beam = linkage("inextensible rod", 5).beams[0]
    parts = pieces(beam.segments, beam.properties, beam.lumps, (), True)
    one = transformed(whole(parts, len(beam.expansion)), beam.expansion)
    total = whole(beam.pieces, len(beam.dofs))
    assert len(beam.pieces) == 5
    for field in (
        "mass",
        "gyroscopic",
        "stiffness",
        "centrifugal",
        "axial0",
        "axial2",
        "load_x",
        "load_turn",
    ):
        exact = getattr(one, field)
        assert np.max(np.abs(getattr(total, field) - exact)) <= 1e-13 * np.max(np.abs(exact)), field


def test_a_motion_whose_powers_overflow_is_refused():
    """Displacements of 1e197 are finite, and their squares are not."""
    with pytest.raises(SimulationError, match="grows without bound"):
        symgen.build("elastic_slider_crank").simulate(method="rk4", steps=600, revolutions=0.2, samples=3)
