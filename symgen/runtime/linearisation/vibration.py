"""Derivatives of poles and frequencies of small vibrations by parameters.

A mode dq = phi exp(s t) with constraint forces J^T mu solves P phi + J^T mu = 0, J phi = 0 with
P = s^2 M + s C + K. With the solution psi, nu of the transposed equations, its derivative is

    s' = -(psi^T P' phi + psi^T J'^T mu + nu^T J' phi) / (psi^T (2 s M + C) phi),

where P' and J' follow the equilibrium as it moves, at constant s.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.evaluate import Evaluator
from symgen.runtime.linearisation.eigenvalues import eigenvalues, in_order, oscillating
from symgen.runtime.linearisation.tangents import Tangents

#: The matrices of small vibrations.
_SYSTEM = ("mass_matrix", "stiffness", "damping")
#: The part of their size by which eigenvalues must differ.
_APART = 1e-6


def spectrum(
    tangents: Tangents, kernels: Evaluator, moved: Array, parameters: Sequence[str], spectrum_name: str
) -> tuple[list[str], Array, Array]:
    """Return ``poles`` or ``frequencies`` of small vibrations: names, values and derivatives, a row each.

    Poles are real parts [1/s] and, where they oscillate, imaginary parts [rad/s]; those that grow first, then
    by rising modulus.
    Frequencies [Hz] are those of the modes that oscillate, growing or not, by rising modulus of their
    eigenvalues, as of :attr:`.Modes.frequencies`.

    Parameters
    ----------
    tangents
        At the equilibrium.
    kernels
        Those of the analysis ``vibration``.
    moved
        Derivatives of coordinates and multipliers of the equilibrium by the parameters, a row each.

    Raises
    ------
    ModelError
        When two of them are equal, since they have no individual derivatives; when no mode oscillates.
    """
    matrices = _matrices(tangents, kernels)
    mass, stiffness, damping = (matrices[name] for name in _SYSTEM)
    free, title = tangents.free, tangents.description.name
    values = eigenvalues(*(free.T @ matrix @ free for matrix in (mass, stiffness, damping)))[0]
    if spectrum_name == "frequencies":
        values = values[oscillating(values)]
        if not len(values):
            raise ModelError(
                f"no mode of {title} oscillates at this equilibrium, so there are no frequencies\n"
                "  Give poles, which include motions that grow or decay."
            )
    elif not np.any(damping):  # of each pair s, -s there is one
        values = np.append(values, -values[values.imag == 0.0])
        values = values[in_order(values)]
    for i, s in enumerate(values):
        close = np.flatnonzero(np.abs(values[:i] - s) <= _APART * np.abs(s))
        if len(close):
            raise ModelError(
                f"{spectrum_name} {close[0] + 1} and {i + 1} of {title} are equal, so that they have no "
                "derivatives "
                "one by one"
            )
    changes = _changes(tangents, kernels, moved, parameters)
    derivatives = np.zeros((len(values), len(parameters)), dtype=complex)
    for i, s in enumerate(values):
        whole = s**2 * mass + s * damping + stiffness
        left, _, right = np.linalg.svd(free.T @ whole @ free)
        phi, psi = free @ right[-1].conj(), free @ left[:, -1].conj()
        mu, nu = (-(tangents.bound.T @ b) / tangents.scale for b in (whole @ phi, whole.T @ psi))
        below = psi @ (2 * s * mass + damping) @ phi
        for k in range(len(parameters)):
            by_mass, by_stiffness, by_damping = (changes[name][k] for name in _SYSTEM)
            turned = changes["constraint_slopes"][k]
            change = psi @ (s**2 * by_mass + s * by_damping + by_stiffness) @ phi
            change += psi @ (turned.T @ mu) + nu @ (turned @ phi)
            derivatives[i, k] = -change / below
    if spectrum_name == "frequencies":
        names = [f"frequency.{i}" for i in range(1, len(values) + 1)]
        return names, values.imag / (2 * np.pi), derivatives.imag / (2 * np.pi)
    parts = [(i, part) for i, s in enumerate(values) for part in ("real", "imag")[: 1 + bool(s.imag)]]
    names = [f"pole.{i + 1}.{part}" for i, part in parts]
    numbers, rows = (np.array([getattr(x[i], part) for i, part in parts]) for x in (values, derivatives))
    return names, numbers, rows


def _matrices(tangents: Tangents, kernels: Evaluator) -> dict[str, Array]:
    """Return M, K and C, each (n, n)."""
    names = tangents.description.of_coordinates()
    values = kernels("pencil", *_at(tangents, kernels))
    matrices = {name: np.zeros((tangents.n, tangents.n)) for name in _SYSTEM}
    for block in kernels.info("pencil").blocks:
        if block.name in matrices:
            for row, column, place in block.places(names, names):
                matrices[block.name][row, column] = values[place]
    return matrices


def _changes(
    tangents: Tangents, kernels: Evaluator, moved: Array, parameters: Sequence[str]
) -> dict[str, Array]:
    """Return the derivatives of M, K, C and J by each parameter, (parameters, rows, columns)."""
    d = tangents.description
    columns = {name: i for i, name in enumerate(d.of_coordinates())}
    constraints = {name: i for i, name in enumerate(d.constraints)}
    n, m = tangents.n, tangents.m
    directions = {name: moved[i] for name, i in columns.items()}
    directions |= {f"{name}_lambda": moved[n + i] for name, i in constraints.items()}
    directions |= dict(zip(parameters, np.eye(len(parameters)), strict=True))
    changes = {name: np.zeros((len(parameters), n, n)) for name in _SYSTEM}
    changes["constraint_slopes"] = np.zeros((len(parameters), m, n))
    if not kernels.has("slopes"):
        return changes
    (block,) = kernels.info("slopes").blocks
    values = kernels("slopes", *_at(tangents, kernels))
    for label, value in zip(block.rows, values, strict=False):
        matrix, row, column, argument = label.split()
        if argument in directions:  # other parameters may not be requested
            place = constraints[row] if matrix == "constraint_slopes" else columns[row]
            changes[matrix][:, place, columns[column]] += value * directions[argument]
    return changes


def _at(tangents: Tangents, kernels: Evaluator) -> tuple[float, Array, Array, Array]:
    """Return the arguments of kernels at the equilibrium."""
    n, state = tangents.n, tangents.state
    work = np.zeros(kernels.work_size + n + tangents.m + 1)
    work[: n + tangents.m] = tangents.solution
    return state.t, state.q, np.zeros(n), work
