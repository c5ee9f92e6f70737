"""Energies and powers of an elastic motion, and the error of their balance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.beams.forces import ElasticForces, RunMotion, local_motion, modal_rates, of_coordinates
from symgen.runtime.beams.shortening import Shortening, rows_work, shortening
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.result.records import Variable

#: Factors in the energies of a link, each (times,), by the columns of the kernel ``energies``.
Weights = Mapping[str, Array]

Term = tuple[str, str, str, tuple[int, ...]]
#: Terms of a link's energies, and of the virtual work of its inertia and weight: what energy or force, its
#: factor, its matrix C or load vector, and which of (s, s', s'') are x and y of x^T C y, or x of C^T x.
_TERMS: tuple[Term, ...] = (
    ("kinetic", "kinetic_mass", "mass", (1, 1)),
    ("kinetic", "kinetic_gyroscopic", "gyroscopic", (1, 0)),
    ("kinetic", "kinetic_centrifugal", "centrifugal", (0, 0)),
    ("strain", "strain_stiffness", "stiffness", (0, 0)),
    ("kinetic", "kinetic_rate_load_x", "load_x", (1,)),
    ("kinetic", "kinetic_rate_load_y", "load_y", (1,)),
    ("kinetic", "kinetic_rate_load_turn", "load_turn", (1,)),
    ("kinetic", "kinetic_load_x", "load_x", (0,)),
    ("kinetic", "kinetic_load_y", "load_y", (0,)),
    ("kinetic", "kinetic_load_out", "load_out", (0,)),
    ("potential", "potential_load_x", "load_x", (0,)),
    ("potential", "potential_load_y", "load_y", (0,)),
)
_WORK: tuple[Term, ...] = (
    ("force_x", "force_x_load_x", "load_x", (0,)),
    ("force_x", "force_x_load_y", "load_y", (0,)),
    ("force_x", "force_x_rate_load_y", "load_y", (1,)),
    ("force_x", "force_x_second_rate_load_x", "load_x", (2,)),
    ("force_y", "force_y_load_x", "load_x", (0,)),
    ("force_y", "force_y_load_y", "load_y", (0,)),
    ("force_y", "force_y_rate_load_x", "load_x", (1,)),
    ("force_y", "force_y_second_rate_load_y", "load_y", (2,)),
    ("moment", "moment_centrifugal", "centrifugal", (0, 0)),
    ("moment", "moment_rate_centrifugal", "centrifugal", (1, 0)),
    ("moment", "moment_second_rate_gyroscopic", "gyroscopic", (2, 0)),
    ("moment", "moment_load_out", "load_out", (0,)),
    ("moment", "moment_load_x", "load_x", (0,)),
    ("moment", "moment_load_y", "load_y", (0,)),
    ("moment", "moment_rate_load_out", "load_out", (1,)),
    ("moment", "moment_second_rate_load_turn", "load_turn", (2,)),
)
#: Factors whose values are the virtual velocity of a link, by the force or moment of the same direction.
_VELOCITIES = {
    "force_x": "kinetic_rate_load_x",
    "force_y": "kinetic_rate_load_y",
    "moment": "kinetic_rate_load_turn",
}
#: Step, over the displacements, of the differences that give terms of first and second degree.
_STEP = 1 / 64
#: Power of damping, over the largest power of the shaft, below which it is round-off.
_UNDAMPED = 1e-9
#: Part of the larger mean power by which means of all and of every other sample may differ.
_RESOLVED = 0.02


@dataclass(frozen=True, slots=True)
class Energies:
    """Energies [J] and powers [W] of the whole linkage, each (times,).

    ``potential`` is None where loads act along elastic links, or by angles counted over revolutions,
    ``shaft`` None where nothing is known to drive the shaft. ``omitted`` is the power of the torque of second
    degree that a crank that is not held would need to keep its rigid motion, and that nothing applies.
    ``imbalance`` is the power of both less ``dissipated`` and the rates of all energies. The last two are
    None where other loads may do work, ``omitted`` also of a held crank.
    """

    kinetic: Array
    strain: Array
    potential: Array | None
    dissipated: Array
    shaft: Array | None
    omitted: Array | None
    imbalance: Array | None

    @property
    def balance(self) -> float | None:
        """The largest imbalance over the largest power."""
        return self._of_largest(self.imbalance)

    @property
    def omitted_share(self) -> float | None:
        """The largest omitted power over the largest power."""
        return self._of_largest(self.omitted)

    def _of_largest(self, power: Array | None) -> float | None:
        """Return the largest value of a power over that of shaft, damping and the rate of all energies."""
        if power is None or self.imbalance is None:
            return None
        shaft, both = _sum(self.shaft), _sum(self.shaft, self.omitted)
        parts = shaft, self.dissipated, both - self.dissipated - self.imbalance
        largest = max(float(np.max(np.abs(part))) for part in parts)
        return float(np.max(np.abs(power))) / largest if largest else None

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
        damped = damping > _UNDAMPED * float(np.max(np.abs(self.shaft)))
        return (shaft, damping) if damped and resolved else None

    def variables(self) -> Iterator[Variable]:
        """Yield the outputs."""
        for name, unit, about, values in (
            ("kinetic_energy", "J", "kinetic energy of the linkage to second order", self.kinetic),
            ("strain_energy", "J", "strain energy of the elastic links", self.strain),
            ("potential_energy", "J", "potential of gravity and springs", self.potential),
            ("dissipated_power", "W", "power dissipated by elastic links and modes", self.dissipated),
            ("shaft_power", "W", "power of the shaft on the crank", self.shaft),
            ("omitted_power", "W", "power of the torque that linear theory omits", self.omitted),
        ):
            if values is not None:
                yield Variable(name, unit, about, (), values)


def of_kinetic(balance: Energies | None) -> list[str]:
    """Return the note on negative kinetic energy of linear theory."""
    least = 0.0 if balance is None else float(np.nanmin(balance.kinetic, initial=0.0))
    if least >= 0.0:
        return []
    return [
        f"kinetic_energy falls to {least:.3g} J: energies of linear theory are of second order in the "
        "deflections, and negative where these are too large; compare with large rotation"
    ]


def of_angles(motion: ElasticMotion) -> list[str]:
    """Return the note that potential energy and balance of powers are omitted if loads count angles."""
    if not motion.rigid.description.windings:
        return []
    return [
        "no potential energy and no balance of powers: a torsion spring or another load depends on an angle "
        "that counts revolutions, so a pose does not determine its energy; large-rotation has both"
    ]


def energies(
    motion: ElasticMotion,
    rigid: tuple[Array, Array, Array],
    run: RunMotion,
    accelerations: Array,
    acting: ElasticForces,
) -> Energies | None:
    """Return energies and powers; None of the thesis' form, which has no rates in fixed axes.

    Parameters
    ----------
    rigid
        Coordinates, rates, and accelerations with multipliers of :meth:`ElasticMotion.rigid_motion`.
    accelerations
        S'' (times, unknowns).
    acting
        Joint forces and torque of a held crank; where the shaft alone does work, that of second degree takes
        its place.
    """
    if run.thesis:
        return None
    is_held, second = motion.info.mode == "held", None
    torque = next((v.values for v in acting.variables if v.name == f"{motion.info.crank}.torque"), None)
    weights, of_shaft = of_links(motion, run.times, *rigid)
    on_shaft = np.zeros((len(run.times), 4))
    if of_shaft is not None:
        on_shaft = motion._motion.many("shaft", run.times, *rigid)
    if motion.info.shaft_alone and run.rates is not None and not (is_held and torque is None):
        second = shortening(motion, rigid, run, accelerations, on_shaft)
        torque = torque_of_second_degree(motion, rigid, run, accelerations, acting, second)
        if of_shaft is not None:
            mass, damping, stiffness, load = on_shaft.T
            s, v, a = (x[:, motion.layout.shaft] for x in (run.displacements, run.rates, accelerations))
            torque += mass * a + damping * v + stiffness * s - load
    summed = {name: np.zeros(len(run.times)) for name in ("kinetic", "strain", "potential")}
    dissipated, rates = np.zeros((2, len(run.times)))
    for k, x in enumerate(weights):
        forms = EnergyForms(motion, run, accelerations, k, second)
        of_link, rate = _energies(x, forms)
        for name, energy in of_link.items():
            summed[name] = summed[name] + energy
        rates += rate
        dissipated += forms("damping", (1, 1))
    dissipated += np.sum(modal_rates(motion, run) ** 2, axis=1)
    still = np.zeros_like(run.displacements) if run.rates is None else run.rates
    moved = run.displacements, still, accelerations
    kinetic, potential, power, motor, _ = of_joints(motion, run.times, rigid, moved)
    summed["kinetic"] += kinetic
    summed["potential"] += potential
    if second is not None:
        kinetic, rate = second.kinetic(motion, rigid)
        summed["kinetic"] += kinetic
        summed["potential"] += second.lifted[0]
        rates += rate + second.lifted[1]
    shaft = omitted = imbalance = None
    if motion.has_motor and of_shaft is None:  # of a rigid crank, among the loads
        shaft, power = motor, power - motor
    if of_shaft is not None:
        kinetic, rate, shaft = _of_shaft(motion, of_shaft, *moved)
        summed["kinetic"] += kinetic
        rates += rate
    if torque is not None and (is_held or second is not None):
        driven = torque * _speed(motion, run, weights, rigid[1])
        shaft, omitted = (driven, None) if is_held else (shaft, driven)
    if run.rates is not None and motion.info.shaft_alone:
        imbalance = power - dissipated - rates + _sum(shaft, omitted)
    known = not motion.rigid.description.windings and "" not in motion.info.joints
    return Energies(
        summed["kinetic"],
        summed["strain"],
        summed["potential"] if known else None,
        dissipated,
        shaft,
        omitted,
        imbalance,
    )


def torque_of_second_degree(
    motion: ElasticMotion,
    rigid: tuple[Array, Array, Array],
    run: RunMotion,
    accelerations: Array,
    acting: ElasticForces,
    second: Shortening,
) -> Array:
    """Return the torque [N m] that the rigid motion needs, to the second degree in displacements, (times,).

    The shaft applies it to a held crank; flywheel and motor of another one are not included. It is the
    virtual work per angle of the crank, at constant displacements of the joints in fixed axes and constant
    elastic unknowns: inertia and weight act at displaced points, and forces at joints on links that rotate.
    Shortening moves masses; its slope by the angle works against the constraints of the rigid motion.
    """
    unit, still = second.unit, np.zeros_like(run.displacements)
    weights, _ = of_links(motion, run.times, *rigid)
    turned, _ = of_links(motion, run.times, rigid[0], unit, rigid[2])
    torque = np.zeros(len(run.times))
    for k, (x, by) in enumerate(zip(weights, turned, strict=True)):
        forms = EnergyForms(motion, run, accelerations, k, second)
        work = {force: x[f"{force}_rigid"] for force in _VELOCITIES}
        for force, factor, constant, orders in _WORK:
            work[force] = work[force] + x[factor] * forms(constant, orders)
        for pair, (force_x, force_y) in zip(
            motion.beams[k].joints, map(np.transpose, acting.at_joints[k]), strict=True
        ):
            s = run.displacements[:, motion.layout.of_links[k][list(pair)]]
            s[:, motion.layout.of_links[k][list(pair)] < 0] = 0.0
            work["moment"] = work["moment"] - (s[:, 0] * force_y - s[:, 1] * force_x)
        torque += sum(by[velocity] * work[force] for force, velocity in _VELOCITIES.items())
    moved = run.displacements, still if run.rates is None else run.rates, accelerations
    load = of_joints(motion, run.times, rigid, moved)[-1]
    torque -= np.sum(load * unit, axis=1)
    torque += rows_work(motion, rigid, run, acting.constraints, unit)
    return torque + second.torque(motion, rigid, run.times)


def of_links(
    motion: ElasticMotion, times: Array, q: Array, u: Array, solutions: Array
) -> tuple[Sequence[Weights], Array | None]:
    """Return factors in the energies of each link, and those of the shaft, (times, factors), if any.

    The other parameters are the first result of :meth:`ElasticMotion.rigid_motion`.
    """
    kernels = motion.rigid.analysis("elastic_motion")
    blocks = kernels.many_blocks("energies", times, q, u, solutions)
    names = next(b.columns for b in kernels.info("energies").blocks if b.name == "energies")
    links = [dict(zip(names, rows.T, strict=True)) for rows in np.moveaxis(blocks["energies"], 1, 0)]
    return links, blocks.get("shaft_energy")


def of_joints(
    motion: ElasticMotion, times: Array, rigid: Sequence[Array], elastic: Sequence[Array]
) -> tuple[Array, ...]:
    """Return energies and loads of all but elastic links, to the second degree in the displacements.

    Kinetic and potential energy [J], power of the loads less inertia [W], that of the motor on a rigid crank,
    which it includes, and these loads [N] by coordinate.

    Parameters
    ----------
    rigid
        The first result of :meth:`ElasticMotion.rigid_motion`.
    elastic
        S, S' and S'' (times, unknowns), which are added.
    """
    moved = [x[:, of_coordinates(motion)] for x in elastic]
    kernels = motion.rigid.analysis("elastic_joints")

    def at(size: float) -> tuple[Array, ...]:
        q, u = (x + size * more for x, more in zip(rigid[:2], moved[:2], strict=True))
        solutions = rigid[2].copy()
        solutions[:, : u.shape[1]] += size * moved[2]
        energy = kernels.many_blocks("energy", times, q, u, solutions)
        load = kernels.many_blocks("joints", times, q, u, solutions)["load"][:, : u.shape[1]]
        kinetic, potential = (energy[f"{name}_energy"][:, 0] for name in ("kinetic", "potential"))
        motor = energy["motor_power"][:, 0] if "motor_power" in energy else np.zeros(len(times))
        return kinetic, potential, np.sum(load * u, axis=1), motor, load

    sides = zip(at(-_STEP), at(0.0), at(_STEP), strict=True)
    return tuple(
        x + (up - down) / (2 * _STEP) + (up + down - 2 * x) / (2 * _STEP**2) for down, x, up in sides
    )


class EnergyForms:
    """Values x^T C y and C^T x of a link, (times,), of its unknowns with their rates, shortening included."""

    def __init__(
        self,
        motion: ElasticMotion,
        run: RunMotion,
        accelerations: Array,
        k: int,
        second: Shortening | None,
    ) -> None:
        states = local_motion(motion, run, accelerations, k)
        self._pieces = [(piece, [x[:, list(piece.at)] for x in states]) for piece in motion.beams[k].pieces]
        self._more = (
            {} if second is None else dict(zip(("load_x", "load_out"), second.bubbles[k], strict=True))
        )

    def __call__(self, constant: str, orders: Sequence[int]) -> Array:
        """Return the value of a matrix or load vector, with the orders of the rates that it multiplies."""
        first, *second = orders
        total = self._more[constant][first] if constant in self._more else 0.0
        for piece, states in self._pieces:
            by = states[first] @ getattr(piece, constant)
            total = total + (np.sum(by * states[second[0]], axis=1) if second else by)
        return np.asarray(total)

    def rate(self, constant: str, orders: Sequence[int]) -> Array:
        """Return the rate of the same."""
        raised = [[order + (i == k) for i, order in enumerate(orders)] for k in range(len(orders))]
        return np.sum([self(constant, places) for places in raised], axis=0)


def _energies(x: Weights, forms: EnergyForms) -> tuple[dict[str, Array], Array]:
    """Return the energies of a link by name, and the sum of their rates."""
    sums = {name: x.get(f"{name}_rigid", np.zeros(1)) for name in ("kinetic", "strain", "potential")}
    rate = x["kinetic_rigid_rate"] + x["potential_rigid_rate"]
    for name, factor, constant, orders in _TERMS:
        value = forms(constant, orders)
        sums[name] = sums[name] + x[factor] * value
        rate = rate + x[factor] * forms.rate(constant, orders) + x[f"{factor}_rate"] * value
    return sums, rate


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


def _sum(*powers: Array | None) -> Array:
    """Return the sum of the powers that are known."""
    return np.sum([x for x in powers if x is not None] or [np.zeros(1)], axis=0)


def _speed(motion: ElasticMotion, run: RunMotion, weights: Sequence[Weights], u: Array) -> Array:
    """Return the angular velocity of the crank [rad/s] in the rigid motion, (times,)."""
    links = [beam.info.link for beam in motion.beams]
    if motion.info.crank in links:
        return weights[links.index(motion.info.crank)]["kinetic_rate_load_turn"]
    rotation, _ = motion.rigid_crank(run.times, run.q)
    d = motion.rigid.description
    end = 2 * d.free.index(d.links[motion.info.crank][1])
    return np.sum(rotation * u[:, end : end + 2], axis=1)
