"""Data of an elastic link: its section, masses and forces along it, and its matrices in its own axes."""

from __future__ import annotations

from dataclasses import dataclass

from symgen.runtime.arrays import Array


@dataclass(frozen=True, slots=True)
class Properties:
    """Section, material and damping of an elastic link, polynomials in x [m] from its first point.

    Attributes
    ----------
    length
        Undeformed length [m].
    mass
        Mass per length [kg/m], coefficients by power.
    rotary
        Rotary inertia per length [kg m].
    axial, bending, shear
        Stiffnesses E A [N], E I [N m^2] and k G A [N].
    fibre
        Distance of the outer fibre from the neutral axis [m].
    modulus
        Young's modulus [Pa].
    mass_damping, stiffness_damping
        Rayleigh damping: times mass matrix [1/s], times stiffness matrix [s].
    ratio
        Part of the critical damping of every elastic mode of the link with free ends.
    yield_stress
        [Pa]; infinite where none is given.
    """

    length: float
    mass: tuple[float, float, float]
    rotary: tuple[float, float, float, float, float]
    axial: tuple[float, float, float]
    bending: tuple[float, float, float, float, float]
    shear: tuple[float, float, float]
    fibre: tuple[float, float]
    modulus: float
    mass_damping: float = 0.0
    stiffness_damping: float = 0.0
    ratio: float = 0.0
    yield_stress: float = float("inf")


@dataclass(frozen=True, slots=True)
class Lump:
    """A mass [kg] fixed to the link ``at`` metres from its first point, with a moment of inertia [kg m^2]."""

    at: float
    mass: float
    inertia: float = 0.0


#: Columns of the weights of forces along links by the matrices of :class:`Piece` that they multiply.
STIFFNESS_OF_FORCES = {
    "stiffness_geometric_force": "force_axial",
    "stiffness_follower_x": "follower_x",
    "stiffness_follower_y": "follower_y",
}


@dataclass(frozen=True, slots=True)
class Profile:
    """How a force lies along a link: per length ``even + slope*x``, x [m] from the first point of the link.

    Where both are zero it is one force, ``at`` metres from the first point. With ``follows``, it rotates with
    the sections. ``mass`` is the part of the link's mass [kg] that the rigid linkage has at a joint there.
    """

    at: float
    even: float = 0.0
    slope: float = 0.0
    follows: float = 0.0
    mass: float = 0.0

    @property
    def is_point(self) -> bool:
        """Whether it is one force at one place."""
        return self.even == self.slope == 0.0

    def before(self, x: Array) -> Array:
        """Return how much of it lies from the first point to places of the link, those included."""
        if self.is_point:
            return (x >= self.at).astype(float)
        return self.even * x + self.slope * x**2 / 2


@dataclass(frozen=True, slots=True)
class Piece:
    """Constant matrices over some unknowns of a link, in the link's own moving axes.

    With th the direction of the link, (ax, ay) the acceleration of its first point less gravity, resolved on
    its axes, and N0 the axial force of the rigid motion just before its first point, tension positive, ::

        mass s'' + (damping - 2 th' gyroscopic) s'
            + (stiffness - th'^2 centrifugal - th'' gyroscopic + N0 axial0 + ax axial1 - th'^2 axial2) s
            = -ax load_x - ay load_y + th'^2 load_out - th'' load_turn

    Attributes
    ----------
    at
        Which unknowns of the link they are over, n of them.
    mass
        (n, n): inertia, rotary inertia of the sections included.
    centrifugal
        (n, n): the same without rotary inertia, for a section that turns with the link has the same moment
        of inertia whatever its angle; the same object as ``mass`` without rotary inertia.
    gyroscopic
        (n, n), antisymmetric: integral of mu (Nu Nw^T - Nw Nu^T).
    stiffness, damping
        (n, n).
    axial0, axial1, axial2
        (n, n): integrals of Nw' Nw'^T times 1, the mass before x, and its first moment about the first point
        of the link; lumped masses before x included. Zero without geometric stiffness.
    load_x, load_y, load_out, load_turn
        (n,): integrals of mu Nu, mu Nw, mu x Nu and mu x Nw + j Nphi, x from the first point of the link.
    force_x, force_y
        (k, n): for k forces along the link with the profiles p the integrals of p Nu and p Nw: times the
        components of the force along and across the link.
    force_axial
        (k, n, n): integrals of Nw' Nw'^T times that of p before x: times minus the component along the link.
    follower_x, follower_y
        (k, n, n): integrals of p Nw Nphi^T and p Nu Nphi^T of forces that follow sections, else zero: times
        minus the component along, and times that across the link.
    """

    at: tuple[int, ...]
    mass: Array
    centrifugal: Array
    gyroscopic: Array
    stiffness: Array
    damping: Array
    axial0: Array
    axial1: Array
    axial2: Array
    load_x: Array
    load_y: Array
    load_out: Array
    load_turn: Array
    force_x: Array
    force_y: Array
    force_axial: Array
    follower_x: Array
    follower_y: Array


@dataclass(frozen=True, slots=True)
class StationRows:
    """Rows over the unknowns of a link, each (n,): a row times the unknowns is the quantity of its name.

    ``u`` and ``w`` are axial and transverse displacements [m], ``slope`` dw/dx and ``rotation`` of the
    section [rad], ``axial_strain`` du/dx and ``curvature`` [1/m] that of bending.
    """

    u: Array
    w: Array
    slope: Array
    rotation: Array
    axial_strain: Array
    curvature: Array
