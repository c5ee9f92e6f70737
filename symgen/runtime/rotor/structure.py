"""The assembled structure of a rotor: matrices over displacements in its rotating axes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.beams.elements import kernels
from symgen.runtime.rotor.description import RotorDescription, RotorLinkInfo

_BLOCK = "spatial_beam"
#: Unknowns of a node, in the order of the kernels; those at joints that belong to one link alone.
NODE = ("u", "u_x", "v", "v_x", "v_xx", "w", "w_x", "w_xx", "phi", "phi_x")
_LOCAL = tuple(NODE.index(name) for name in ("u_x", "v_xx", "w_xx", "phi_x"))
_MOVED = tuple(NODE.index(name) for name in ("u", "v", "w"))
#: Twist, and slopes w' = -rotation about y, v' = rotation about z.
_ROTATED = tuple(NODE.index(name) for name in ("phi", "w_x", "v_x"))
_SIGNS = np.array([[1.0], [-1.0], [1.0]])
#: Stiffnesses in the arguments of the kernels, by the kind of strain.
STRAINS = {"stretch": 4, "bending_thickness": 5, "bending_width": 6, "torsion": 7}
#: Part of the load that may be without balance by round-off.
_BALANCED = 1e-8
#: Strain energy over the sum of its terms' sizes, up to which it is round-off.
_STRAINED = 1e-15
#: Matrices of the kernel ``body``, in its order; the load follows.
_OF_BODY = ("mass", "gyroscopic", "centrifugal")


@dataclass(frozen=True, slots=True)
class RotorStructure:
    """Matrices of M s'' + C s' + K s = 0 about the drawn shape, (n, n), and their unknowns.

    ``sizes`` are the roots of the sums of sizes of the terms of the diagonal of K. ``strains`` are the
    stiffnesses of each kind of strain. ``rotation`` is the largest rotation [rad] of the steady deflection.
    """

    names: tuple[str, ...]
    mass: Array
    gyroscopic: Array
    stiffness: Array
    sizes: Array
    strains: Mapping[str, Array]
    rotation: float


@dataclass(frozen=True, slots=True)
class _Link:
    """A link in its axes: arguments of its elements, and its unknowns by those of the structure."""

    section: Array
    motions: Array
    basis: Array

    def matrix(self, kernel: str, motions: Array, section: Array | None = None) -> Array:
        """Return the sum of a kernel's output over the elements, (n, n) or (n,) of the structure."""
        n, size = self.basis.shape[1], len(NODE)
        q = self.section if section is None else section
        matrix: Array = np.zeros((n, n)) if kernel != "load" else np.zeros(n)
        for k, motion in enumerate(motions):
            rows = self.basis[k * size : (k + 2) * size]
            used = np.flatnonzero(np.any(rows, axis=0))
            at, out = rows[:, used], getattr(kernels(_BLOCK), kernel)(q=q, u=motion)
            if kernel == "load":
                matrix[used] += at.T @ out
            else:
                matrix[np.ix_(used, used)] += at.T @ out.reshape(2 * size, -1) @ at
        return matrix


def structure(d: RotorDescription, numbers: Mapping[str, Array], divided: int = 1) -> RotorStructure:
    """Return the structure of a rotor with ``divided`` times as many elements.

    Raises
    ------
    ModelError
        When a link has no length or its width no direction across it, or when the load of the rotation has no
        balance as drawn.
    """
    axis, speed, through = np.split(numbers["rotation"].ravel(), [3, 4])
    length = float(np.linalg.norm(axis))
    if not length > 0.0:
        raise ModelError(f"{d.name}: the axis of its rotation has no direction")
    omega = speed * axis / length
    names = _Names(d)
    for info in d.links:
        names.add(info, divided)
    pairs = zip(d.links, numbers["links"], strict=True)
    links = [_placed(d, info, row, omega, through, names, divided) for info, row in pairs]
    n = len(names.all)
    sums = {k: np.zeros((n, n)) for k in ("mass", "gyroscopic", "centrifugal", "stiffness")}
    load = np.zeros(n)
    for link in links:
        for kernel in sums:
            sums[kernel] += link.matrix(kernel, link.motions)
        load += link.matrix("load", link.motions)
    for point, (x, y, z, *body) in zip(d.masses, numbers["masses"].reshape(-1, 7), strict=True):
        if point not in d.free:
            continue
        motion = np.concatenate([omega, np.array([x, y, z]) - through, [0.0]])
        rigid = kernels(_BLOCK).body(q=np.ones(8), u=motion, p=np.array(body))
        at = names.point(point) + (names.welded(point) if any(body[1:]) else [])
        size = len(at)
        for kernel, matrix in zip(_OF_BODY, rigid[:108].reshape(3, 6, 6), strict=True):
            sums[kernel][np.ix_(at, at)] += matrix[:size, :size]
        load[at] += rigid[108 : 108 + size]
    steady = _steady(d, sums["stiffness"], load)
    tensed = [_tensed(link, steady) for link in links]
    geometric = sum(
        (link.matrix("geometric", motions) for link, motions in zip(links, tensed, strict=True)),
        np.zeros((n, n)),
    )
    rotations = [np.abs(link.basis @ steady).reshape(-1, len(NODE))[:, _ROTATED] for link in links]
    terms = [np.diag(x) for x in (sums["stiffness"], geometric, sums["centrifugal"])]
    strains = {}
    for strain, column in STRAINS.items():
        parts = []
        for link in links:
            section = link.section.copy()
            section[[k for k in STRAINS.values() if k != column]] = 0.0
            parts.append(link.matrix("stiffness", link.motions, section))
        strains[strain] = sum(parts, np.zeros((n, n)))
    return RotorStructure(
        tuple(names.all),
        sums["mass"],
        sums["gyroscopic"],
        sums["stiffness"] + geometric - sums["centrifugal"],
        np.sqrt(sum(np.abs(x) for x in terms)),
        strains,
        max((float(np.max(x)) for x in rotations), default=0.0),
    )


class _Names:
    """The unknowns of a structure: displacements of points, rotations at joints, and those of links."""

    def __init__(self, d: RotorDescription) -> None:
        self._d = d
        self.all: list[str] = [f"{point}.{axis}" for point in d.free for axis in "xyz"]

    def point(self, point: str) -> list[int]:
        """Return the unknowns of a free point."""
        return [self.all.index(f"{point}.{axis}") for axis in "xyz"]

    def welded(self, point: str) -> list[int]:
        """Return the unknowns of the rotation of links that are welded at a free point."""
        return [self.all.index(f"{point}.r{axis}") for axis in "xyz"]

    def rotation(self, link: RotorLinkInfo, point: str) -> list[int] | None:
        """Return the unknowns of the rotation of a link's end; None where it is welded to the ground."""
        welded = point in link.welds
        if welded and point not in self._d.free:
            return None
        owner = "" if welded else f"{link.link}_"
        return [self._number(f"{owner}{point}.r{axis}") for axis in "xyz"]

    def local(self, link: RotorLinkInfo, name: str, node: int) -> int:
        """Return an unknown of a node of a link in its axes."""
        return self._number(f"{link.link}.{name}@{node}")

    def _number(self, name: str) -> int:
        if name not in self.all:
            self.all.append(name)
        return self.all.index(name)

    def add(self, link: RotorLinkInfo, divided: int) -> None:
        """Add the unknowns of a link."""
        last = link.elements * divided
        for node in range(last + 1):
            if node not in (0, last):
                for name in NODE:
                    self.local(link, name, node)
                continue
            for k in _LOCAL:
                self.local(link, NODE[k], node)
            self.rotation(link, link.start if node == 0 else link.end)


def _placed(
    d: RotorDescription,
    link: RotorLinkInfo,
    row: Array,
    omega: Array,
    through: Array,
    names: _Names,
    divided: int,
) -> _Link:
    """Return a link: its axes are its line, the direction of its width, and the one across both."""
    first, second, width = row[:3], row[3:6], row[6:9]
    length = float(np.linalg.norm(second - first))
    if not length > 0.0:
        raise ModelError(f"{d.name}: the link {link.link} has no length")
    along = (second - first) / length
    across = width - (width @ along) * along
    if not np.linalg.norm(across) > 1e-6 * np.linalg.norm(width):
        raise ModelError(f"{d.name}: the width of {link.link} lies along the link: expected it across")
    across = across / np.linalg.norm(across)
    axes = np.array([along, across, np.cross(along, across)])
    count, size = link.elements * divided, len(NODE)
    basis = np.zeros((size * (count + 1), len(names.all)))
    for node in range(count + 1):
        here = size * node
        if node not in (0, count):
            basis[range(here, here + size), [names.local(link, name, node) for name in NODE]] = 1.0
            continue
        basis[[here + k for k in _LOCAL], [names.local(link, NODE[k], node) for k in _LOCAL]] = 1.0
        point = link.start if node == 0 else link.end
        if point in d.free:
            basis[np.ix_([here + k for k in _MOVED], names.point(point))] = axes
        rotation = names.rotation(link, point)
        if rotation is not None:
            basis[np.ix_([here + k for k in _ROTATED], rotation)] = _SIGNS * axes
    motions = np.zeros((count, 7))
    motions[:, :3] = axes @ omega
    motions[:, 3:6] = [axes @ (first + along * length * k / count - through) for k in range(count)]
    return _Link(np.concatenate([[length / count], row[9:]]), motions, basis)


def _steady(d: RotorDescription, stiffness: Array, load: Array) -> Array:
    """Return the steady displacements by the rotation, of the first order."""
    scale = 1.0 / np.sqrt(np.diag(stiffness))
    scale[~np.isfinite(scale)] = 0.0
    scaled = stiffness * np.outer(scale, scale)
    solution: Array = scale * np.linalg.lstsq(scaled, scale * load, rcond=1e-12)[0]
    left = scale * (stiffness @ solution - load)
    if np.max(np.abs(left), initial=0.0) > _BALANCED * np.max(np.abs(scale * load), initial=0.0):
        raise ModelError(
            f"{d.name}: the load of its rotation has no balance as drawn: joints let links swing out\n"
            "  Weld the links, or draw them where they rotate steadily."
        )
    return solution


def _tensed(link: _Link, steady: Array) -> Array:
    """Return the motions of the elements with their axial force at the first node [N], tension positive."""
    size, motions = len(NODE), link.motions.copy()
    for k, motion in enumerate(motions):
        ends = link.basis[k * size : (k + 2) * size] @ steady
        call: Any = kernels(_BLOCK)
        force = call.stiffness(q=link.section, u=motion).reshape(2 * size, -1)[0] @ ends
        motion[6] = call.load(q=link.section, u=motion)[0] - force
    return motions


def parts(assembled: RotorStructure, shapes: NDArray[Any]) -> Mapping[str, Array]:
    """Return the parts of the strain energy of shapes (n, modes) by the kind of strain, (modes,) each.

    Zero where the energy is round-off of rigid motions.
    """
    energies = {
        k: np.einsum("im,ij,jm->m", shapes.conj(), matrix, shapes, optimize=True).real
        for k, matrix in assembled.strains.items()
    }
    total = sum(energies.values(), np.zeros(shapes.shape[1]))
    noise = _STRAINED * np.sum((assembled.sizes[:, None] * np.abs(shapes)) ** 2, axis=0)
    return {k: np.divide(x, total, out=np.zeros_like(x), where=total > noise) for k, x in energies.items()}
