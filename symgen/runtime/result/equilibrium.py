"""A static equilibrium, and the small motions about it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.display import Shown
from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.linearisation.eigenvalues import eigenvalues, oscillating
from symgen.runtime.result.state import State


@dataclass(frozen=True, slots=True)
class Linearised:
    """M y'' + C y' + K y = 0 with dq = Z y, the columns of ``basis`` Z spanning the free motions.

    They are orthonormal in the metric of small motions. ``multipliers`` are those of minimum norm that
    balance the forces, ``unbalanced`` is the rest that they cannot [N], ``scale`` the largest of the forces
    and constraint forces it is left of [N], ``noise`` the round-off of the forces, that of the positions
    times the stiffness included [N]. ``damped`` tells whether the damping of every force exists: forces
    without a slope by velocities at rest, such as with the root of a squared speed, have none in ``damping``.
    ``integrals`` is the number of first-order states, whose integrals have an eigenvalue of zero each.
    """

    basis: Array
    mass: Array
    damping: Array
    stiffness: Array
    multipliers: Array
    unbalanced: Array
    scale: float
    noise: float
    damped: bool = True
    integrals: int = 0

    @property
    def freedoms(self) -> int:
        """Number of free motions."""
        return self.basis.shape[1] - self.integrals

    def eigenvalues(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the eigenvalues [1/s], one per mode, and the motions y of unit modal mass as columns.

        Raises
        ------
        ModelError
            If a force has no slope by velocities at rest.
        """
        if not self.damped:
            raise ModelError(
                "there are no modes: the damping of a force is not defined at rest, such as that of a force "
                "with sqrt(speed^2)\n  Write the force with abs(speed) or sign(speed)."
            )
        return self._eigenvalues()

    def _eigenvalues(self) -> tuple[NDArray[Any], NDArray[Any]]:
        values, motions = eigenvalues(self.mass, self.stiffness, self.damping)
        kept = np.sort(np.argsort(np.abs(values), kind="stable")[self.integrals :])
        return values[kept], motions[:, kept]

    def stability(self) -> str:
        """Return ``unstable`` if a mode grows, ``neutral`` if no force drives one back, or ``stable``."""
        values = self._eigenvalues()[0]
        if np.any(values.real > 0.0):
            return "unstable"
        return "neutral" if np.any(values == 0.0) else "stable"


@checked
@dataclass(frozen=True, slots=True)
class Equilibrium(Shown):
    """A pose at rest in which all forces balance.

    Attributes
    ----------
    state
        The pose, with zero velocities.
    stability
        ``unstable`` (a small motion grows), ``neutral`` (one meets no stiffness) or ``stable``.
    freedoms
        Number of free motions.
    residual, scale
        Largest force that is left unbalanced, and the largest of the forces that balance [N].
    multipliers
        Lagrange multiplier of every constraint; the minimum-norm ones if constraints are redundant.
    reactions
        Force of the ground on the linkage at every ground point [N].
    outputs
        The outputs that the scene selects, at this pose.
    units
        Units of these outputs.
    notes
        What limits stability, modes and other derivatives: switching points of loads on which the pose is.
    """

    state: State
    stability: str
    freedoms: int
    residual: float
    scale: float
    multipliers: dict[str, float]
    reactions: dict[str, Array]
    outputs: dict[str, Array]
    units: dict[str, str]
    linearised: Linearised
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"<Equilibrium, {self.stability}: state, reactions, outputs; unbalanced {self.residual:.1e} N>"

    def summary(self) -> dict[str, Any]:
        """Return the equilibrium in plain numbers: the output of ``symgen equilibrium --json``."""
        return {
            "analysis": "equilibrium",
            "t": self.state.t,
            "stability": self.stability,
            "freedoms": self.freedoms,
            "residual": self.residual,
            "largest_force": self.scale,
            "positions": {k: v.tolist() for k, v in self.state.positions.items()},
            "multipliers": dict(self.multipliers),
            "reactions": {k: v.tolist() for k, v in self.reactions.items()},
            "outputs": {k: {"unit": self.units[k], "value": v.tolist()} for k, v in self.outputs.items()},
            "notes": list(self.notes),
        }


@dataclass(frozen=True, slots=True)
class Mode:
    """One small motion dq = shape * exp(s t) about an equilibrium.

    Attributes
    ----------
    kind
        ``oscillation``, ``decay`` (overdamped: no oscillation), ``neutral`` (no force drives it back) or
        ``unstable`` (it grows).
    s
        Complex eigenvalue [1/s]; of a conjugate pair that with a positive imaginary part.
    shape
        Displacement of every point, for unit modal mass when they are in m/sqrt(kg); real where nothing is
        damped. The largest component is positive.
    """

    kind: str
    s: complex
    shape: dict[str, Array]

    @property
    def omega(self) -> float:
        """Damped angular frequency [rad/s]; zero if the mode does not oscillate."""
        return abs(self.s.imag)

    @property
    def frequency(self) -> float:
        """Frequency of the motion [Hz]."""
        return self.omega / (2 * np.pi)

    @property
    def natural(self) -> float:
        """Undamped angular frequency abs(s) [rad/s]."""
        return abs(self.s)

    @property
    def damping_ratio(self) -> float:
        """Part of the critical damping, -Re(s)/abs(s): 1 for a decay, negative if it grows."""
        return 0.0 if self.s.real == 0 else -self.s.real / abs(self.s)


@checked
@dataclass(frozen=True, slots=True)
class Modes(Shown):
    """All small motions about an equilibrium: those that grow, the others by rising undamped frequency."""

    equilibrium: Equilibrium
    modes: tuple[Mode, ...]

    def __repr__(self) -> str:
        shown = ", ".join(f"{f:.6g}" for f in self.frequencies[:3])
        more = ", ..." if len(self) > 3 else ""
        return f"<Modes, {self.equilibrium.stability} equilibrium: {shown}{more} Hz, {len(self)} modes>"

    def __len__(self) -> int:
        return len(self.modes)

    def __iter__(self) -> Iterator[Mode]:
        return iter(self.modes)

    def __getitem__(self, i: int) -> Mode:
        """Return the mode of this number, from 0; raise ModelError if there is none."""
        if not -len(self.modes) <= i < len(self.modes):
            raise ModelError(f"expected the number of one of {len(self.modes)} modes, from 0, got {i}")
        return self.modes[i]

    @property
    def frequencies(self) -> Array:
        """Frequencies [Hz] of all modes that oscillate, damped or growing if they are, by rising abs(s)."""
        values = np.array([m.s for m in self.modes], dtype=complex)
        return values[oscillating(values)].imag / (2 * np.pi)

    @property
    def stable(self) -> bool:
        """Whether nothing grows."""
        return all(m.kind != "unstable" for m in self.modes)

    def summary(self) -> dict[str, Any]:
        """Return the modes in plain numbers: the output of ``symgen modes --json``."""
        return {
            "analysis": "modes",
            "stable": self.stable,
            "modes": [
                {
                    "kind": m.kind,
                    "frequency_hz": m.frequency,
                    "omega": m.omega,
                    "natural_omega": m.natural,
                    "damping_ratio": m.damping_ratio,
                    "s": [m.s.real, m.s.imag],
                    "shape": {p: _plain(x) for p, x in m.shape.items()},
                }
                for m in self.modes
            ],
            "equilibrium": self.equilibrium.summary(),
        }


def _plain(x: Array) -> list[Any]:
    return [[v.real, v.imag] for v in x.tolist()] if np.iscomplexobj(x) else list(x.tolist())
