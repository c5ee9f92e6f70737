"""Small oscillations about an equilibrium: frequencies, damping ratios and mode shapes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.rods.equilibrium import Equilibrium
from symgen.runtime.rods.linear import oscillating


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
class Modes:
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


def analyse(evaluator: Evaluator, equilibrium: Equilibrium) -> Modes:
    """Return the small oscillations about an equilibrium.

    Raises
    ------
    ModelError
        When nothing can move.
    """
    lin = equilibrium.linearised
    if lin.freedoms == 0:
        raise ModelError(
            f"{evaluator.description.name}: constraints and drives hold every freedom: nothing oscillates"
        )
    values, motions = lin.eigenvalues()
    free: NDArray[Any] = lin.basis @ motions
    if np.isrealobj(free):
        free = _separated(values, free)
    results = [
        Mode(_kind(complex(s)), complex(s), _shape(evaluator, equilibrium, free[:, i]))
        for i, s in enumerate(values)
    ]
    return Modes(equilibrium, tuple(results))


def _kind(s: complex) -> str:
    if s == 0:
        return "neutral"
    if s.real > 0:
        return "unstable"
    return "oscillation" if s.imag else "decay"


def _separated(values: NDArray[Any], shapes: Array) -> Array:
    """Fix the shapes within each set of equal frequencies, where round-off would rotate them arbitrarily.

    Coordinate directions are projected onto the common space one after the other; independent ones are kept.
    The rotation is orthogonal, so modal masses remain one.
    """
    result = shapes.copy()
    squares = np.where(values.real > 0.0, -1.0, 1.0) * np.abs(values) ** 2
    close = 1e-9 * float(np.max(np.abs(squares)))
    groups = np.split(np.arange(len(squares)), np.flatnonzero(np.abs(np.diff(squares)) > close) + 1)
    for group in groups:
        space = shapes[:, group]
        size = float(np.max(np.linalg.norm(space, axis=1)))
        chosen: list[Array] = []
        for least in (0.1, 1e-6):
            for row in space / size:
                new = row - sum((row @ c) * c for c in chosen)
                if len(chosen) < len(group) and np.linalg.norm(new) > least:
                    chosen.append(new / np.linalg.norm(new))
        if len(chosen) == len(group) > 1:
            result[:, group] = space @ np.array(chosen).T
    return result


def _shape(evaluator: Evaluator, equilibrium: Equilibrium, motion: NDArray[Any]) -> dict[str, Array]:
    """Return the displacement of every point or user's coordinate, its largest component positive."""
    state, d = equilibrium.state, evaluator.description
    parts = [np.ascontiguousarray(part) for part in (np.real(motion), np.imag(motion))]
    moved = [x if d.rates else evaluator.blocks("points", state.t, state.q, x)["velocities"] for x in parts]
    shape = moved[0] + 1j * moved[1] if np.iscomplexobj(motion) else moved[0]
    flat = shape.ravel()
    largest = flat[int(np.argmax(np.abs(flat) > (1 - 1e-6) * np.max(np.abs(flat))))]
    shape = shape * (np.conj(largest) / abs(largest)) if largest else shape
    if np.iscomplexobj(shape) and np.max(np.abs(shape.imag)) <= 1e-9 * np.max(np.abs(shape)):
        shape = shape.real
    return dict(zip(d.free if d.rates else d.points, shape, strict=True))
