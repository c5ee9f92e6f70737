"""Matrices of the elastic motion in one pose, as runs assemble them, with names of rows and columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from symgen.runtime import _beams
from symgen.runtime._beams import MATRICES, SPREAD, VECTORS
from symgen.runtime.arrays import Array, Indices
from symgen.runtime.beams.frames import frames
from symgen.runtime.beams.layout import BeamLayout, entries_of
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.result.modes import AssembledMatrices, LabelledMatrix

#: Constant matrices of links in the stiffness of the structure at rest.
_ELASTIC = ("stiffness",)
#: Those in the damping matrix.
_DAMPING = ("damping",)
#: Those in the factor of the rates due to the rotation of the links.
_GYROSCOPIC = ("mass", "gyroscopic")
_GEOMETRIC = ("axial0", "axial1", "axial2", "force_axial", "follower_x", "follower_y")
_MOTION = ("mass", "centrifugal", "gyroscopic", "damping")
#: Factors of the units of entries between displacements for others.
_PER = "; *m per angle, *m^2 per curvature"
#: Unit and meaning by name of the matrices of the independent unknowns, which have no symbolic form.
CONDENSED = {
    f"condensed_{name}": (unit + _PER, f"{name} of the independent unknowns")
    for name, unit in (("mass", "kg"), ("damping", "N*s/m"), ("stiffness", "N/m"), ("load", "N"))
}


def assembled_at(motion: ElasticMotion, t: float) -> AssembledMatrices:
    """Return the matrices of the elastic motion at a time, as its equations assemble them.

    Raises
    ------
    SimulationError
        When the linkage cannot be assembled there.
    """
    equations = motion.equations()
    status, *reduced, basis = equations.matrices(t)
    motion.check(equations, status, t)
    pose = _Pose(motion, equations, t)
    mass, _, _, load = pose.sums(None)
    # Masses, dampers, springs, motor, and damping of modes.
    _, damping, stiffness, _ = pose.sums((), others=True)
    rest, forces = pose.sums((), others=True, analysis=_beams.AT_REST)[2], pose.stiffness_of_forces()
    found = [
        pose.named(name, matrix, unit, about)
        for name, matrix, unit, about in (
            ("mass", mass, "kg", "mass matrix"),
            ("damping", pose.sums(_DAMPING)[1] + damping, "N*s/m", "damping matrix"),
            ("gyroscopic", pose.sums(_GYROSCOPIC)[1], "N*s/m", "factor of the rates: rotation of the links"),
            ("stiffness", pose.sums(_ELASTIC)[2] + rest, "N/m", "stiffness of the structure at rest"),
            ("geometric_stiffness", pose.sums(_GEOMETRIC)[2] + forces, "N/m", "stiffness by forces"),
            (
                "motion_stiffness",
                pose.sums(_MOTION)[2] + stiffness - rest - forces,
                "N/m",
                "stiffness by the rotation of the links, and of motor and dampers in motion",
            ),
            ("load", load, "N", "load of the rigid motion"),
        )
    ]
    found += (*pose.assembly(), *pose.recovery())
    if basis is not None:
        found += pose.condensed(reduced, basis)
    return AssembledMatrices((m.name, m) for m in found)


class _Pose:
    """The equations of an elastic motion in one pose, by the constants of its links."""

    def __init__(self, motion: ElasticMotion, equations: _beams.BeamEquations, t: float) -> None:
        self.motion, self.t, self.layout = motion, t, motion.layout
        self.moved = equations.motion
        (q, u, solutions), self.links, _ = motion.rigid_motion(equations, np.array([t]))
        self.state = q[0], u[0], solutions[0]
        self.order = _by_links(self.layout)
        self.names = tuple(self.layout.names[j] for j in self.order)

    def named(self, name: str, values: Array, unit: str, about: str) -> LabelledMatrix:
        """Return a matrix or vector of all unknowns in the order of the links."""
        square = values.ndim == 2
        values = values[np.ix_(*[self.order] * values.ndim)]
        columns = self.names if square else ()
        return LabelledMatrix(f"elastic_{name}", values, self.names, columns, unit + _PER, about)

    def sums(
        self, constants: Sequence[str] | None, others: bool = False, analysis: int = _beams.IN_MOTION
    ) -> tuple[Array, ...]:
        """Return mass, damping, stiffness and load of all unknowns, constrained or not.

        Parameters
        ----------
        constants
            Those of the links that count; None for these and all others.
        others
            Whether components other than links count, and damping of modes.
        analysis
            As of :meth:`symgen.runtime._beams.BeamEquations.matrices`.
        """
        layout = unbound(self.layout)
        if constants is not None:
            layout = of_constants(layout, constants, others)
        equations = _beams.BeamEquations(self.moved, layout, False)
        status, *matrices, _ = equations.matrices(self.t, analysis)
        self.motion.check(equations, status, self.t)
        return tuple(matrices)

    def stiffness_of_forces(self) -> Array:
        """Return the stiffness that the multipliers of rigid links give to their joints."""
        total = np.zeros((self.layout.unknowns,) * 2)
        kernels = self.motion.joints
        blocks = {b.name: b for b in kernels.info("joints").blocks}
        if "stiffness" not in blocks:
            return total
        q, u, solution = self.state
        without = solution.copy()
        without[len(q) :] = 0.0
        entries, free = (
            kernels.blocks("joints", self.t, q, u, work)["stiffness"].ravel() for work in (solution, without)
        )
        d = self.motion.rigid.description
        labels = [f"{p}_{axis}" for p in d.free for axis in d.axes]
        labels += [f"{name}_theta" for name in self.motion.info.rotations]
        place = dict(zip(labels, self.layout.joint_places.tolist(), strict=False))
        for (i, j), entry in zip(
            entries_of(blocks, "stiffness", place), (entries - free).tolist(), strict=True
        ):
            total[i, j] += entry
        return total

    def condensed(self, reduced: Sequence[Array], basis: Array) -> Iterator[LabelledMatrix]:
        """Yield R of S = R p with its rates, and the matrices of p."""
        copied = [
            np.all(basis[0] == row, axis=1) & ~np.any(basis[1:], axis=(0, 2))
            for row in np.eye(basis.shape[2])
        ]
        place = {int(np.flatnonzero(rows)[0]): k for k, rows in enumerate(copied)}
        columns = [place[j] for j in self.order.tolist() if j in place]
        kept = tuple(self.layout.names[j] for j in self.order.tolist() if j in place)
        series = ("", "1"), ("_rate", "1/s"), ("_second_rate", "1/s^2")
        for (ending, unit), values in zip(series, basis, strict=True):
            about = "R of S = R p, displacements by the independent ones" + ending.replace("_", " ")
            yield LabelledMatrix(
                f"condensation{ending}", values[self.order][:, columns], self.names, kept, unit, about
            )
        for (name, (unit, about)), matrix in zip(CONDENSED.items(), reduced, strict=True):
            names = kept if matrix.ndim == 2 else ()
            values = matrix[np.ix_(*[columns] * matrix.ndim)]
            yield LabelledMatrix(name, values, kept, names, unit, about)

    def assembly(self) -> Iterator[LabelledMatrix]:
        """Yield Z, which selects the unknowns of each element, and the numbers of those that are held."""
        rows, pairs, held, columns = list[str](), list[tuple[int, int]](), set[str](), dict[str, int]()
        for places, plain in zip(self.layout.of_links, self.motion.beams, strict=True):
            link = plain.info.link
            joints = {
                k: f"{point}.{axis}"
                for pair, point in zip(plain.joints, plain.info.points, strict=True)
                for k, axis in zip(pair, "xy", strict=True)
            }
            names = []
            for k, dof in enumerate(plain.dofs):
                free = int(places[k]) >= 0
                names.append(self.layout.names[places[k]] if free else joints.get(k, f"{link}.{dof}"))
                if not free:
                    held.add(names[-1])
                columns.setdefault(names[-1], len(columns))
            for number, piece in enumerate(plain.pieces, 1):
                pairs += [(len(rows) + i, columns[names[k]]) for i, k in enumerate(piece.at)]
                rows += [f"{link}_{number}.{plain.dofs[k]}" for k in piece.at]
        for name in self.names:
            columns.setdefault(name, len(columns))
        z = np.zeros((len(rows), len(columns)))
        z[tuple(zip(*pairs, strict=True))] = 1.0
        about = "Z: unknowns of the elements, displacements of joints on fixed axes, by those of the linkage"
        yield LabelledMatrix("assembly", z, tuple(rows), tuple(columns), "1", about)
        zero = {name: float(k) for k, name in enumerate(columns, 1) if name in held}
        about = "numbers of the unknowns that are zero: columns of the assembly, counted from 1"
        yield LabelledMatrix("boundary", np.array([*zero.values()]), tuple(zero), (), "1", about)

    def recovery(self) -> Iterator[LabelledMatrix]:
        """Yield strains and stresses at the stations by the unknowns."""
        names, strains, moduli = list[str](), list[Array](), list[float]()
        for name, k, at, fibre in self.motion.stations:
            plain, places = self.motion.beams[k], self.layout.of_links[k]
            rows = plain.rows(at)
            local = fibre * rows.curvature + rows.axial_strain
            u, w = (list(ends) for ends in zip(*plain.joints, strict=True))
            local[u], local[w] = frames(self.links[:, k]).fixed(local[u], local[w])
            total = np.zeros(self.layout.unknowns)
            np.add.at(total, places[places >= 0], local[places >= 0])
            names.append(name)
            strains.append(total[self.order])
            moduli.append(plain.properties.modulus)
        if names:
            strain = np.array(strains)
            for kind, values, unit in (
                ("strain", strain, "1/m"),
                ("stress", strain * np.array(moduli)[:, None], "Pa/m"),
            ):
                about = f"{kind} at the stations by the unknowns"
                yield LabelledMatrix(f"{kind}_recovery", values, tuple(names), self.names, unit + _PER, about)


def _by_links(layout: BeamLayout) -> Indices:
    """Return the unknowns in the order of the links and of the nodes along them, then all others."""
    of_links = [int(j) for places in layout.of_links for j in places if j >= 0]
    return np.array([*dict.fromkeys((*of_links, *range(layout.unknowns)))], dtype=np.intp)


def unbound(layout: BeamLayout) -> BeamLayout:
    """Return a layout without its constraints: its matrices are those of all unknowns."""
    band = int(np.max(np.abs(layout.rows - layout.columns), initial=0))
    return replace(layout, constraints=0, inner=layout.unknowns, band=band)


def of_constants(layout: BeamLayout, kept: Sequence[str], others: bool) -> BeamLayout:
    """Return a layout with the constants of links of these names alone.

    Parameters
    ----------
    kept
        Names in ``MATRICES``, ``VECTORS`` and ``SPREAD``.
    others
        Whether components other than links count, and damping of modes.
    """
    constants = layout.constants.copy()
    for k, n in enumerate(layout.sizes.tolist()):
        at, link = int(layout.constants_at[k]), int(layout.link_of[k])
        for name, size in _blocks(n, int(layout.loads_at[link + 1] - layout.loads_at[link])):
            if name not in kept:
                constants[at : at + size] = 0.0
            at += size
    if others:
        return replace(layout, constants=constants)
    none = np.array([-1], dtype=np.intp)
    return replace(
        layout,
        constants=constants,
        mass_slots=none,
        damping_slots=none,
        stiffness_slots=none,
        shaft=-1,
        shaft_slot=-1,
        damped=layout.damped[:0],
        apart=False,
    )


def _blocks(n: int, forces: int) -> Iterator[tuple[str, int]]:
    """Yield the constants of a piece of n unknowns in their order, each with the number of its entries."""
    for name in MATRICES:
        yield name, n * n
    for name in VECTORS:
        yield name, n
    for _ in range(forces):
        for name in SPREAD:
            yield name, n if name in SPREAD[:2] else n * n
