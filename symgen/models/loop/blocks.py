"""Building blocks of a spatial loop, for inspection and for other programs: a row, its screws, a link."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from symgen.mechanics.loop.dual_euler import BodyMotion, Inertia
from symgen.mechanics.loop.dual_rows import GROUND, MOTIONS, Frame, motions, name_functions, onward
from symgen.mechanics.sources import LOOP
from symgen.models.loop.derivation import DUAL, PLACED, REFERENCE, named
from symgen.symbolic.dual import DualVector
from symgen.symbolic.names import Names
from symgen.symbolic.quantity import AXES, Quantity, quantity
from symgen.symbolic.system import Export, Group, NamedMatrix, System

_ENTRIES = tuple(
    quantity(entry, "rad" if turns else "m", f"{'turn about' if turns else 'shift along'} {'ijk'[number]}")
    for entry, (number, turns) in MOTIONS.items()
)
_ROW = Group("q", "entries of the row: T = Z(theta + eps S) Y(eta) X(alpha + eps a)", _ENTRIES)
_SYMBOLS = tuple(x.symbol for x in _ENTRIES)


def loop_row_system() -> System:
    """Return the transform of one row of a link-joint table, Eqs. (1)-(4)."""
    names = Names()
    row = motions(1, _SYMBOLS, _SYMBOLS)
    frame = GROUND
    for m in row:
        name_functions(m, names)
        frame = onward(frame, m, names, f"behind_{m.entry}")
    placed = frame.turn.row_join(sp.Matrix(frame.origin))
    return _system(
        "loop_row",
        "Row of a link-joint table",
        (_ROW,),
        (
            named("transform", placed, "1, m", "axes and origin of the frame behind the row", AXES, PLACED),
            named(
                "dual_transform",
                frame.dual.beside,
                "1, m",
                "transform as R | D of the dual R + eps D",
                AXES,
                DUAL,
            ),
        ),
        names,
        kernels=("transform",),  # the dual form is shown only
    )


def loop_screws_system() -> System:
    """Return the screws of the entries of one row, for any frame before it: operators (12)-(17)."""
    names = Names()
    axes = [[quantity(f"{c}_{a}", "1", f"{a} of axis {c} of the frame") for c in "ijk"] for a in AXES]
    origin = [quantity(f"p_{a}", "m", f"{a} of the origin of the frame") for a in AXES]
    before = Group(
        "p",
        "frame before the row: axes and origin, row by row",
        tuple(x for row, p in zip(axes, origin, strict=True) for x in (*row, p)),
    )
    x, y, z = (p.symbol for p in origin)
    frame = Frame(sp.ImmutableMatrix(3, 3, [c.symbol for row in axes for c in row]), (x, y, z))
    columns = []
    for m in motions(1, _SYMBOLS, _SYMBOLS):
        name_functions(m, names)
        columns.append(frame.screw(m.screw).column)
        frame = onward(frame, m, names, f"behind_{m.entry}")
    return _system(
        "loop_screws",
        "Screws of a row of a link-joint table",
        (_ROW, before),
        (
            named(
                "screws",
                sp.Matrix.hstack(*columns),
                "1, m",
                "screw (w; v at the first origin) of every entry",
                ("wx", "wy", "wz", "vx", "vy", "vz"),
                tuple(MOTIONS),
            ),
        ),
        names,
    )


def loop_inertia_system() -> System:
    """Return momentum, inertia wrench and kinetic energy of one link in its frame, Eqs. (46)-(61)."""
    names = Names()
    motion = [
        quantity(f"{letter}_{a}", unit, f"{a} component of the {meaning}, in the frame")
        for letter, unit, meaning in (
            ("w", "rad/s", "angular velocity"),
            ("v", "m/s", "velocity of the origin"),
            ("dw", "rad/s^2", "rate of w by components"),
            ("dv", "m/s^2", "rate of v by components"),
        )
        for a in AXES
    ]
    pairs = [(i, j) for i in range(3) for j in range(i, 3)]
    about = "inertia about the centre of mass"
    mass = quantity("m", "kg", "mass")
    centre = [quantity(f"g_{a}", "m", f"{a} of the centre of mass in the frame") for a in AXES]
    inertia = {
        (i, j): quantity(f"J_{AXES[i]}{AXES[j]}", "kg*m^2", f"{AXES[i]}{AXES[j]} entry of the {about}")
        for i, j in pairs
    }
    matrix = sp.ImmutableMatrix(3, 3, lambda i, j: inertia[min(i, j), max(i, j)].symbol)
    gx, gy, gz = (x.symbol for x in centre)
    body = Inertia(mass.symbol, (gx, gy, gz), matrix)
    velocity, rate = (_dual(motion[k : k + 6]) for k in (0, 6))
    moving = BodyMotion(body, velocity, rate, names, "link")
    return _system(
        "loop_inertia",
        "Inertia of a link of a loop",
        (
            Group("u", "velocity (w; v) of the frame, and its rate", tuple(motion)),
            Group("p", "mass properties in the frame", (mass, *centre, *inertia.values())),
        ),
        (
            named(
                "momentum", moving.momentum.column, "kg*m/s, kg*m^2/s", "dual momentum about the origin",
                ("px", "py", "pz", "hx", "hy", "hz"),
            ),
            named(
                "inertia_wrench", moving.wrench.column, "N, N*m", "rate of the momentum in space",
                ("fx", "fy", "fz", "mx", "my", "mz"),
            ),
            named("kinetic_energy", sp.Matrix([moving.kinetic_energy]), "J", "kinetic energy"),
        ),
        names,
    )  # fmt: skip


def _dual(six: Sequence[Quantity]) -> DualVector:
    a, b, c, d, e, f = (x.symbol for x in six)
    return DualVector((a, b, c), (d, e, f))


def _system(
    name: str,
    title: str,
    groups: tuple[Group, ...],
    matrices: tuple[NamedMatrix, ...],
    names: Names,
    kernels: Sequence[str] = (),
) -> System:
    """Return a block with a kernel for each matrix, or for ``kernels`` alone."""
    exports = tuple(
        Export(m.name, m.description, (m.name,)) for m in matrices if m.name in kernels or not kernels
    )
    return System(
        name, title, groups, matrices, exports, names.definitions, references=(REFERENCE,), sources=LOOP
    )
