"""Elastic links as superelements: kernels against quadrature, and links against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Polynomial as P
from shared.beam_reference import Reference
from shared.rigid_motions import rigid_motions

from symgen.elements import ELEMENTS
from symgen.errors import ModelError, SceneError
from symgen.runtime.beams.data import Lump, Properties
from symgen.runtime.beams.elements import kernels
from symgen.runtime.beams.links import beam
from symgen.runtime.beams.pieces import whole
from symgen.runtime.kernels.elastic_description import BeamInfo

NAMES = list(ELEMENTS)
UNIFORM = Properties(
    length=1.3,
    mass=(0.7, 0.0, 0.0),
    rotary=(0.0,) * 5,
    axial=(4e5, 0.0, 0.0),
    bending=(11.0, 0.0, 0.0, 0.0, 0.0),
    shear=(2e5, 0.0, 0.0),
    fibre=(0.002, 0.0),
    modulus=7e10,
)
TAPERED = Properties(
    length=1.3,
    mass=(0.7, -0.3, 0.1),
    rotary=(2e-3, 1e-4, -3e-4, 2e-4, 1e-4),
    axial=(4e5, -1e5, 2e4),
    bending=(11.0, -2.0, 1.0, -0.5, 0.2),
    shear=(2e5, 1e4, -3e4),
    fibre=(0.002, 0.0),
    modulus=7e10,
)
LUMPS = (Lump(0.3, 0.2), Lump(1.3 / 3, 0.4), Lump(1.3 / 2, 0.1), Lump(1.3, 0.3))


def info(element="beam8", elements=1, **more):
    e = ELEMENTS[element]
    return BeamInfo("arm", "O", "A", element, e.node_dofs, e.inner_dofs, elements, **more)


def frequencies(b, held=(), piece=None):
    from scipy.linalg import eigh

    p = piece or whole(b.pieces, len(b.dofs))
    free = [i for i, dof in enumerate(b.dofs) if dof not in held and i not in b.fixed]
    at = np.ix_(free, free)
    return np.sqrt(np.abs(eigh(p.stiffness[at], p.mass[at], eigvals_only=True)))


def pinned(b):
    return {f"w@{n + 1}" for n in (0, b.info.elements)} | {"u@1"}


def arguments(p, length):
    return np.array([length, *p.mass, *p.rotary, *p.axial, *p.bending, *p.shear])


# -- elements ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kernel", ["mass", "gyroscopic", "stiffness", "geometric", "load"])
@pytest.mark.parametrize("name", ["beam8", "cubic", "rayleigh", "beam9"])
def test_kernels_against_quadrature_of_numerical_shape_functions(name, kernel):
    q = arguments(TAPERED, 0.9)
    found, exact = getattr(kernels(f"element_{name}"), kernel)(q=q), getattr(Reference(), kernel)(name, q)
    assert found == pytest.approx(exact, rel=1e-10, abs=1e-12 * np.max(np.abs(exact)))


@pytest.mark.parametrize("name", ["beam8", "cubic", "rayleigh", "beam9"])
@pytest.mark.parametrize("x", [0.0, 0.31, 0.9])
def test_shapes_against_numerical_ones(name, x):
    q = arguments(TAPERED, 0.9)
    exact = Reference().shape(name, q, [x])
    assert kernels(f"element_{name}").shape(q=q, u=np.array([x])) == pytest.approx(exact, rel=1e-10, abs=1e-9)


def test_timoshenko_without_load_is_the_one_of_equilibrium():
    """Its shear strains condensed: the classical matrix with 12 EI/(kGA L^2)."""
    q = arguments(UNIFORM, 0.05)
    stiffness = kernels("element_timoshenko").stiffness(q=q).reshape(8, 8)
    outer, inner = stiffness[:6, :6], stiffness[6:, 6:]
    found = outer - stiffness[:6, 6:] @ np.linalg.solve(inner, stiffness[6:, :6])
    exact = Reference().stiffness("timoshenko", q)
    assert found.ravel() == pytest.approx(exact, rel=1e-9, abs=1e-12 * np.max(np.abs(exact)))


# -- links from elements -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("lumps", [(), LUMPS], ids=["plain", "lumps"])
@pytest.mark.parametrize("elements", [1, 2, 3])
@pytest.mark.parametrize("name", NAMES)
def test_rigid_motions_of_a_tapered_link(name, elements, lumps):
    """Inertia, loads and geometric stiffness of rigid motions are integrals of the section and sums of lumps."""
    b = beam(info(name, elements), TAPERED, lumps)
    p, length = whole(b.pieces, len(b.dofs)), TAPERED.length
    along, across, turned = rigid_motions(b.info, b.dofs, p, TAPERED).T
    mu, x = P(TAPERED.mass), P([0, 1])
    spin = P(TAPERED.rotary).integ()(length) if ELEMENTS[name].rotary else 0.0
    total, first, second = (
        (mu * x**k).integ()(length) + sum(m.mass * m.at**k for m in lumps) for k in range(3)
    )
    close = {"rel": 1e-11, "abs": 1e-11}
    assert along @ p.mass @ along == pytest.approx(total, **close)
    assert across @ p.mass @ across == pytest.approx(total, **close)
    assert across @ p.mass @ turned == pytest.approx(first, **close)
    assert turned @ p.mass @ turned == pytest.approx(second + spin, **close)
    assert turned @ p.centrifugal @ turned == pytest.approx(second, **close)
    assert along @ p.gyroscopic @ turned == pytest.approx(first, **close)
    loads = np.array([p.load_x, p.load_y, p.load_out, p.load_turn])
    expected = [[total, 0, first, 0], [0, total, 0, first], [0, first, 0, second + spin]]
    for motion, exact in zip((along, across, turned), expected, strict=True):
        assert loads @ motion == pytest.approx(exact, **close)
    before = mu.integ().integ()(length) + sum(m.mass * (length - m.at) for m in lumps)
    moment = (mu * x).integ().integ()(length) + sum(m.mass * m.at * (length - m.at) for m in lumps)
    for matrix, exact in ((p.axial0, length), (p.axial1, before), (p.axial2, moment)):
        assert turned @ matrix @ turned == pytest.approx(exact, **close)
    assert np.abs(p.stiffness @ np.array([along, across, turned]).T).max() < 1e-9 * np.abs(p.stiffness).max()


def displaced(b, u, w):
    """The unknowns of a link for polynomials u and w of x, without shear."""
    found = np.zeros(len(b.dofs))
    fields = {"u": u, "w": w, "theta": w.deriv(), "kappa": w.deriv(2), "mid": u}
    for j, dof in enumerate(b.dofs):
        kind, _, node = dof.partition("@")
        x = np.mean([float(k) - 1 for k in node.split(".")]) * b.properties.length / b.info.elements
        found[j] = fields[kind](x) if kind in fields else 0.0
    return found


@pytest.mark.parametrize("elements", [1, 3])
@pytest.mark.parametrize("name", NAMES)
def test_rows_recover_polynomials(name, elements):
    """Linear along, cubic across: every element has these; ends, inside and where elements meet."""
    u, w = P([0.1, -0.3]), P([0.2, 0.1, -0.4, 0.6])
    b = beam(info(name, elements), TAPERED)
    s = displaced(b, u, w)
    for at in (0.0, 0.2, 1 / 3, 0.5, 1.0):
        x, rows = at * TAPERED.length, b.rows(at)
        found = [
            s @ r for r in (rows.u, rows.w, rows.slope, rows.rotation, rows.axial_strain, rows.curvature)
        ]
        exact = [u(x), w(x), w.deriv()(x), w.deriv()(x), u.deriv()(x), w.deriv(2)(x)]
        assert found == pytest.approx(exact, rel=1e-10, abs=1e-10)
    with pytest.raises(ModelError, match=r"link 'arm' is a fraction .* got 1\.5"):
        b.rows(1.5)


#: Relative errors of f1 and f2 as the method prints them.
GOLDEN = {1: ("7.1475e-04", "8.133e-03"), 2: ("1.01e-06", "7.15e-04"), 3: ("3e-08", "1.2e-05")}


@pytest.mark.parametrize("elements", GOLDEN)
def test_pinned_pinned_by_the_golden_file(elements):
    b = beam(info(elements=elements), UNIFORM)
    found = frequencies(b, {"w@1", f"w@{elements + 1}"} | {d for d in b.dofs if d[0] == "u"})[:2]
    exact = np.array([np.pi, 2 * np.pi]) ** 2 * np.sqrt(11.0 / 0.7) / 1.3**2
    errors = found / exact - 1
    for error, golden in zip(errors, GOLDEN[elements], strict=True):
        digits = max(len(golden) - 6, 0)
        assert f"{error:.{digits}e}" == golden


def test_curvature_is_held_where_there_is_no_moment():
    held = lambda *a, **k: {b.dofs[i] for b in [beam(info(elements=2, **k), *a)] for i in b.fixed}  # noqa: E731
    assert held(UNIFORM) == {"kappa@1", "kappa@3"}
    assert held(UNIFORM, clamped=True) == {"kappa@3"}
    assert held(UNIFORM, [Lump(0.0, 0.0, 0.1)]) == {"kappa@3"}
    pointed = replace(UNIFORM, bending=(1.3**3, -3 * 1.3**2, 3 * 1.3, -1.0, 0.0))  # (L - x)^3
    assert held(pointed) == {"kappa@1"}


@pytest.mark.parametrize(
    "made, message",
    [
        (lambda: beam(info(elements=0), UNIFORM), "needs one element or more, got 0"),
        (lambda: beam(info(), UNIFORM, [Lump(1.4, 1.0)]), r"lies at 1\.4 m, expected 0 to its length"),
        (lambda: beam(info(), UNIFORM, [Lump(0.4, -1.0)]), r"zero or more, got -1\.0 kg"),
        (lambda: beam(info(reduction="craig-bampton", modes=99), UNIFORM), "got 99\n  Give fewer modes"),
    ],
)
def test_what_makes_no_sense_is_refused(made, message):
    with pytest.raises((ModelError, SceneError), match=message):
        made()


# -- damping -----------------------------------------------------------------------------------------------------


def test_rayleigh_damping():
    b = beam(info(elements=2), replace(TAPERED, mass_damping=0.4, stiffness_damping=3e-5))
    for piece in b.pieces:
        assert piece.damping == pytest.approx(0.4 * piece.mass + 3e-5 * piece.stiffness, rel=1e-14)


@pytest.mark.parametrize("name", NAMES)
def test_modal_damping(name):
    """All modes of the free link decay by the ratio; rigid motions do not at all."""
    b = beam(info(name, 3), replace(TAPERED, ratio=0.02), LUMPS)
    p = whole(b.pieces, len(b.dofs))
    rigid = rigid_motions(b.info, b.dofs, p, TAPERED)
    assert np.abs(p.damping @ rigid).max() < 1e-12 * np.abs(p.damping).max()
    free = [i for i in range(len(b.dofs)) if i not in b.fixed]
    at = np.ix_(free, free)
    n = len(free)
    left = np.linalg.solve(p.mass[at], np.hstack([p.stiffness[at], p.damping[at]]))
    scale = np.sqrt(np.abs(left[:, :n]).max())
    values = np.linalg.eigvals(
        np.block([[np.zeros((n, n)), scale * np.eye(n)], [-left[:, :n] / scale, -left[:, n:]]])
    )
    elastic = values[values.imag > 1.0]
    assert len(elastic) == n - 3
    assert -elastic.real / np.abs(elastic) == pytest.approx(0.02, rel=1e-6)


# -- fewer unknowns ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_a_link_of_one_length_bends_as_one_that_stretches(name):
    b, kept = (beam(info(name, 3, axial=axial), TAPERED) for axial in (True, False))
    assert [d for d in kept.dofs if d[0] == "u"] == ["u@1", "u@4"] and "mid@1.2" not in kept.dofs
    stretching = {d for d in b.dofs if d[0] == "u" or d[:3] == "mid"}
    exact = frequencies(b, pinned(b) | stretching)
    assert frequencies(kept, pinned(b) | stretching) == pytest.approx(exact, rel=1e-10)


@pytest.mark.parametrize("name", NAMES)
def test_guyan_keeps_what_is_static_and_rigid(name):
    b, kept = (beam(info(name, 3, clamped=True, reduction=kind), TAPERED) for kind in ("", "guyan"))
    assert kept.dofs == ("u@1", "w@1", "theta@1", "u@4", "w@4")
    p, small = whole(b.pieces, len(b.dofs)), kept.pieces[0]
    load = np.zeros(len(b.dofs))
    load[b.dofs.index("u@4")], load[b.dofs.index("w@4")] = 2.0, 3.0
    free = [i for i, d in enumerate(b.dofs) if d not in ("u@1", "w@1", "theta@1") and i not in b.fixed]
    s = np.zeros(len(b.dofs))
    s[free] = np.linalg.solve(p.stiffness[np.ix_(free, free)], load[free])
    y = np.zeros(5)
    y[3:] = np.linalg.solve(small.stiffness[3:, 3:], [2.0, 3.0])
    for at in (0.0, 0.4, 1.0):
        whole_rows, rows = b.rows(at), kept.rows(at)
        for row in ("u", "w", "slope", "curvature", "axial_strain"):
            expected = s @ getattr(whole_rows, row)
            assert y @ getattr(rows, row) == pytest.approx(expected, rel=1e-7, abs=1e-12)
    translation = np.array([0.0, 1.0, 0.0, 0.0, 1.0])
    assert translation @ small.mass @ translation == pytest.approx(P(TAPERED.mass).integ()(1.3))


def test_craig_and_bampton_come_to_the_whole_link_from_above():
    whole_link = beam(info(elements=4), TAPERED)
    exact = frequencies(whole_link)[3:7]
    before = None
    for modes in (2, 4, 8, 14):
        kept = beam(info(elements=4, reduction="craig-bampton", modes=modes), TAPERED)
        assert len(kept.dofs) == 4 + modes
        count = min(4, modes)
        errors = frequencies(kept)[3 : 3 + count] / exact[:count] - 1
        assert np.all(errors > -1e-9)
        assert before is None or np.all(errors[: len(before)] <= before + 1e-10)
        before = errors
    assert np.max(before) < 1e-9, "all modes: nothing is lost"
