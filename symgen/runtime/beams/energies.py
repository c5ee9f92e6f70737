"""Energies and powers of an elastic motion, and how far they are from balance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symgen.runtime.beams.forces import Motion, modal_rates, own_motion
from symgen.runtime.beams.links import Beam
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.result.records import Variable

Array = NDArray[np.float64]
#: Factors in the energies of a link, each (times,), by the columns of the kernel ``energies``.
Weights = Mapping[str, Array]

#: Terms of a link's energies: what energy, its factor, its matrix C, and which of (s, s', s'') are x and y of
#: x^T C y. The last is no energy but the power that damping takes.
_SQUARES = (
    ("kinetic", "kinetic_mass", "mass", (1, 1)),
    ("kinetic", "kinetic_gyroscopic", "gyroscopic", (1, 0)),
    ("kinetic", "kinetic_centrifugal", "centrifugal", (0, 0)),
    ("strain", "strain_stiffness", "stiffness", (0, 0)),
    ("", "", "damping", (1, 1)),
)
#: The same of C^T x with a load vector C.
_SUMS = (
    ("kinetic", "kinetic_rate_load_x", "load_x", 1),
    ("kinetic", "kinetic_rate_load_y", "load_y", 1),
    ("kinetic", "kinetic_rate_load_turn", "load_turn", 1),
    ("kinetic", "kinetic_load_x", "load_x", 0),
    ("kinetic", "kinetic_load_y", "load_y", 0),
    ("kinetic", "kinetic_load_out", "load_out", 0),
    ("potential", "potential_load_x", "load_x", 0),
    ("potential", "potential_load_y", "load_y", 0),
)
_LOADS = ("load_x", "load_y", "load_out", "load_turn")
#: Part of the largest power that is none.
_NOTHING = 1e-9
#: Part of the larger mean power by which means of all and of every other sample may differ.
_RESOLVED = 0.02


@dataclass(frozen=True, slots=True)
class Energies:
    """Energies [J] and powers [W] of the whole linkage, each (times,).

    ``potential`` is None where loads act along elastic links, or by angles counted over revolutions,
    ``shaft`` None where nothing is known to drive the shaft, ``imbalance`` the power of the shaft less
    ``dissipated`` and the rates of all energies, None where other loads may do work.
    """

    kinetic: Array
    strain: Array
    potential: Array | None
    dissipated: Array
    shaft: Array | None
    imbalance: Array | None

    @property
    def balance(self) -> float | None:
        """The largest imbalance over the largest power."""
        if self.imbalance is None:
            return None
        driven = np.zeros_like(self.dissipated) if self.shaft is None else self.shaft
        parts = driven, self.dissipated, driven - self.dissipated - self.imbalance
        largest = max(float(np.max(np.abs(part))) for part in parts)
        return float(np.max(np.abs(self.imbalance))) / largest if largest else None

    def mean_powers(self) -> tuple[float, float] | None:
        """Return the means [W] of the powers of the shaft and of damping over a revolution of a steady state.

        None where they need not be equal, since something else does work, where nothing is damped, or where
        every other sample has another mean: the samples are too few.
        """
        if self.imbalance is None or self.shaft is None:
            return None
        both = np.stack([self.shaft[:-1], self.dissipated[:-1]])
        means, coarse = np.mean(both, axis=1), np.mean(both[:, ::2], axis=1)
        resolved = both.shape[1] % 2 == 0 and np.all(
            np.abs(coarse - means) <= _RESOLVED * np.max(np.abs(means))
        )
        shaft, damping = means.tolist()
        damped = damping > _NOTHING * float(np.max(np.abs(self.shaft)))
        return (shaft, damping) if damped and resolved else None

    def variables(self) -> Iterator[Variable]:
        """Yield the outputs."""
        for name, unit, about, values in (
            ("kinetic_energy", "J", "kinetic energy of the linkage", self.kinetic),
            ("strain_energy", "J", "strain energy of the elastic links", self.strain),
            ("potential_energy", "J", "potential of gravity and springs", self.potential),
            ("dissipated_power", "W", "power dissipated by elastic links and modes", self.dissipated),
            ("shaft_power", "W", "power of the shaft on the crank", self.shaft),
        ):
            if values is not None:
                yield Variable(name, unit, about, (), values)


def energies(
    motion: ElasticMotion,
    rigid: tuple[Array, Array, Array],
    found: Motion,
    accelerations: Array,
    torque: Array | None,
) -> Energies | None:
    """Return energies and powers; None of the thesis' form, which has no rates in fixed axes.

    Parameters
    ----------
    rigid
        Coordinates, rates, and accelerations with multipliers of :meth:`ElasticMotion.rigid_motion`.
    accelerations
        S'' (times, unknowns).
    torque
        Torque of the shaft on a held crank [N m], (times,).
    """
    if found.thesis:
        return None
    weights, of_shaft = of_links(motion, found.times, *rigid)
    summed = {name: np.zeros(len(found.times)) for name in ("kinetic", "strain", "potential")}
    dissipated, rates = np.zeros((2, len(found.times)))
    for k, (beam, x) in enumerate(zip(motion.beams, weights, strict=True)):
        s, v, a = own_motion(motion, found, accelerations, k)
        own, rate, damping = _energies(beam, x, s, v, a)
        for name, energy in own.items():
            summed[name] += energy
        rates += rate
        dissipated += damping
    dissipated += np.sum(modal_rates(motion, found) ** 2, axis=1)
    still = np.zeros_like(found.displacements) if found.rates is None else found.rates
    moved = found.displacements, still, accelerations
    kinetic, potential, power = of_joints(motion, found.times, rigid, moved)
    summed["kinetic"] += kinetic
    summed["potential"] += potential
    shaft = None if torque is None else torque * _speed(motion, found, weights, rigid[1])
    if of_shaft is not None:
        flywheel, by_flywheel, shaft = _of_shaft(motion, of_shaft, *moved)
        summed["kinetic"] += flywheel
        rates += by_flywheel
    imbalance = None
    if found.rates is not None and motion.info.shaft_alone:
        imbalance = (0.0 if shaft is None else shaft) + power - dissipated - rates
    known = not motion.rigid.description.windings and "" not in motion.info.joints
    return Energies(
        summed["kinetic"],
        summed["strain"],
        summed["potential"] if known else None,
        dissipated,
        shaft,
        imbalance,
    )


def of_links(
    motion: ElasticMotion, times: Array, q: Array, u: Array, solutions: Array
) -> tuple[Sequence[Weights], Array | None]:
    """Return factors in the energies of each link, and those of the shaft, (times, factors), if any.

    The other parameters are the first result of :meth:`ElasticMotion.rigid_motion`.
    """
    kernels = motion.rigid.analysis("elastic_motion")
    found = kernels.many_blocks("energies", times, q, u, solutions)
    names = next(b.columns for b in kernels.info("energies").blocks if b.name == "energies")
    links = [dict(zip(names, rows.T, strict=True)) for rows in np.moveaxis(found["energies"], 1, 0)]
    return links, found.get("shaft_energy")


def of_joints(
    motion: ElasticMotion, times: Array, rigid: Sequence[Array], elastic: Sequence[Array]
) -> tuple[Array, Array, Array]:
    """Return kinetic and potential energy of all but elastic links, and the power of their loads and inertia.

    Parameters
    ----------
    rigid
        The first result of :meth:`ElasticMotion.rigid_motion`.
    elastic
        S, S' and S'' (times, unknowns), which are added.
    """
    d, names = motion.rigid.description, motion.layout.names
    columns = [names.index(f"{p}.{axis}") for p in d.free for axis in d.axes]
    s, v, a = (x[:, columns] for x in elastic)
    q, u, solutions = rigid[0] + s, rigid[1] + v, rigid[2].copy()
    solutions[:, : a.shape[1]] += a
    kernels = motion.rigid.analysis("elastic_joints")
    energy = kernels.many_blocks("energy", times, q, u, solutions)
    load = kernels.many_blocks("joints", times, q, u, solutions)["load"]
    power = np.sum(load[:, : u.shape[1]] * u, axis=1)
    return energy["kinetic_energy"][:, 0], energy["potential_energy"][:, 0], power


def _energies(beam: Beam, x: Weights, s: Array, v: Array, a: Array) -> tuple[dict[str, Array], Array, Array]:
    """Return the energies of a link by name, the sum of their rates, and the power that its damping takes.

    s, v, a are its unknowns with their rates, (times, n).
    """
    squares, rates_of_squares = np.zeros((2, len(_SQUARES), len(s)))
    sums, rates_of_sums = np.zeros((2, len(_SUMS), len(s)))
    moved = np.stack([s, v, a])
    left, right = np.array([places for _, _, _, places in _SQUARES]).T
    place, load = np.array([[way, _LOADS.index(load)] for _, _, load, way in _SUMS]).T
    for piece in beam.pieces:
        own = moved[:, :, list(piece.at)]
        forms = np.stack([getattr(piece, constant) for _, _, constant, _ in _SQUARES])
        before = own[left] @ forms
        squares += np.sum(before * own[right], axis=2)
        # The damping comes last: the rate of its power is no energy's.
        after = (own[left[:-1] + 1] @ forms[:-1]) * own[right[:-1]] + before[:-1] * own[right[:-1] + 1]
        rates_of_squares[:-1] += np.sum(after, axis=2)
        each = np.moveaxis(own @ np.stack([getattr(piece, name) for name in _LOADS], axis=1), 2, 1)
        sums += each[place, load]
        rates_of_sums += each[place + 1, load]
    found = {name: x.get(f"{name}_rigid", np.zeros(len(s))) for name in ("kinetic", "strain", "potential")}
    rate = x["kinetic_rigid_rate"] + x["potential_rigid_rate"]
    terms = [*_SQUARES[:-1], *_SUMS]
    forms, changes = np.vstack([squares[:-1], sums]), np.vstack([rates_of_squares[:-1], rates_of_sums])
    for (name, factor, _, _), form, change in zip(terms, forms, changes, strict=True):
        found[name] = found[name] + x[factor] * form
        rate = rate + x[factor] * change + x[f"{factor}_rate"] * form
    return found, rate, squares[-1]


def _of_shaft(
    motion: ElasticMotion, factors: Array, s: Array, v: Array, a: Array
) -> tuple[Array, Array, Array]:
    """Return the kinetic energy of the flywheel on an elastic crank, its rate, and the power of the motor."""
    phi, phi_t, phi_tt = (x[:, motion.layout.shaft] for x in (s, v, a))
    one = np.ones_like(phi)
    monomials = (
        (one, phi_t, phi_t**2),
        (one, phi_t, phi_tt, phi_t * phi_tt),
        (one, phi, phi_t, phi * phi_t, phi_t**2),
    )
    ends = np.cumsum([len(terms) for terms in monomials])[:-1]
    terms = np.split(factors * np.stack([m for terms in monomials for m in terms], axis=1), ends, axis=1)
    energy, rate, power = (part.sum(axis=1) for part in terms)
    return energy, rate, power


def _speed(motion: ElasticMotion, found: Motion, weights: Sequence[Weights], u: Array) -> Array:
    """Return the angular velocity of a held crank [rad/s] in the rigid motion, (times,)."""
    links = [beam.info.link for beam in motion.beams]
    if motion.info.crank in links:
        return weights[links.index(motion.info.crank)]["kinetic_rate_load_turn"]
    rotation, _ = motion.rigid_crank(found.times, found.q)
    d = motion.rigid.description
    end = 2 * d.free.index(d.links[motion.info.crank][1])
    speed: Array = np.sum(rotation * u[:, end : end + 2], axis=1)
    return speed
