"""Joint forces of an elastic motion: on every elastic link at its joints, and the torque on the crank."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from symgen.runtime import _beams
from symgen.runtime._beams import APPLIED, BeamEquations
from symgen.runtime.arrays import Array
from symgen.runtime.beams.data import STIFFNESS_OF_FORCES, Piece
from symgen.runtime.beams.frames import STIFFENING, TURNING, Frames, frames
from symgen.runtime.beams.modal.structure import forces_on_links
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.result.records import Variable

#: Selects the weight of the axial force among those of a load.
_OF_AXIAL_FORCE = np.array([weight == "stiffness_geometric_force" for weight in APPLIED], dtype=float)
#: Unknowns of a link on its own axes with their rates, (times, n) each.
States = tuple[Array, Array, Array]


@dataclass(frozen=True, slots=True)
class RunMotion:
    """An elastic motion and the rigid motion below it, at the same times.

    Attributes
    ----------
    times
        (times,) [s].
    q
        Coordinates of the rigid linkage, (times, coordinates) [m].
    links
        Motion of the elastic links, (times, links, columns).
    loads
        Weights of forces along elastic links, (times, forces, columns).
    displacements, rates
        (times, unknowns); ``rates`` is None where the elastic motion itself adds nothing: quasi-static.
    thesis
        Whether the turning of axes is taken as constant.
    """

    times: Array
    q: Array
    links: Array
    loads: Array
    displacements: Array
    rates: Array | None
    thesis: bool = False
    _axes: dict[int, Frames] = field(default_factory=dict, init=False, repr=False, compare=False)
    _local: dict[int, Array] = field(default_factory=dict, init=False, repr=False, compare=False)
    _states: dict[int, tuple[Array | None, States]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def axes(self, k: int) -> Frames:
        """Return direction and weights of constants of a link, computed once."""
        if k not in self._axes:
            self._axes[k] = frames(self.links[:, k])
        return self._axes[k]

    def local(self, motion: ElasticMotion, k: int) -> Array:
        """Return the unknowns of a link on its own axes, (times, n), computed once: not to be changed."""
        if k not in self._local:
            self._local[k] = motion.local_unknowns(k, self.links, self.displacements)
        return self._local[k]


@dataclass(frozen=True, slots=True)
class ElasticForces:
    """Forces of a motion in fixed axes.

    Attributes
    ----------
    variables
        The outputs.
    at_joints
        Forces on the elastic links at their joints [N], (times, 2) each.
    constraints
        J^T lambda of the equations of motion by constraint, (times, unknowns).
    """

    variables: list[Variable]
    at_joints: list[list[Array]]
    constraints: dict[str, Array]


def forces(
    motion: ElasticMotion, equations: BeamEquations, run: RunMotion, accelerations: Array
) -> ElasticForces:
    """Return the forces and couples on elastic links at joints and welds, and the torque on a crank not free.

    They are of the whole motion, rigid and elastic, on fixed axes: of every link M s'' + C s' + K s - Q at
    its joints, Eq. (7.27). The axial force of a link that keeps its length is of its constraint.
    """
    bound = _bound(motion, equations, run, accelerations)
    crank, free, drive, at_joints = motion.info.crank, motion.info.mode == "free", [], []
    by_modes = forces_on_links(motion.layout, motion.beams)
    rates_of_modes = modal_rates(motion, run)
    for k, beam in enumerate(motion.beams):
        axes, name = run.axes(k), beam.info.link
        rows = _link(motion, run, accelerations, k) + rates_of_modes @ by_modes[k]
        ends = [np.column_stack(axes.fixed(rows[:, u], rows[:, w])) for u, w in beam.joints]
        if name in bound:
            places = [motion.layout.of_links[k][list(end)] for end in beam.joints]
            felt = [bound[name][:, place] if place[0] >= 0 else None for place in places]
            for end, here in enumerate(felt):
                if here is not None:
                    ends[end] += here
                elif (there := felt[1 - end]) is not None:  # the ground holds it
                    ends[end] -= there
        at_joints.append(ends)
        for point, force in zip(beam.info.points, ends, strict=True):
            drive.append(joint_force(name, point, force))
        for dof, point in beam.info.welded.items():
            about = f"couple on {name} at {point}, counter-clockwise"
            drive.append(Variable(f"{name}.{point}.couple", "N*m", about, (), rows[:, beam.dofs.index(dof)]))
        if name == crank and not free:
            drive.append(torque(name, rows[:, beam.dofs.index("theta@1")]))
    if f"{crank}_drive" in bound:
        drive.append(torque(crank, _of_drive(motion, run, bound[f"{crank}_drive"])))
    return ElasticForces(drive, at_joints, bound)


def of_coordinates(motion: ElasticMotion) -> list[int]:
    """Return the unknowns that displace the coordinates of the rigid linkage, in their order."""
    d = motion.rigid.description
    return [motion.layout.names.index(f"{p}.{axis}") for p in d.free for axis in d.axes]


def joint_force(link: str, point: str, values: Array) -> Variable:
    """Return the output of the force on a link at one of its joints [N], (times, 2)."""
    about = f"force on {link} at {point}"
    return Variable(f"{link}.{point}.force", "N", about, ("x", "y"), values)


def torque(crank: str, values: Array) -> Variable:
    """Return the output of the torque of the shaft on the crank [N m], (times,)."""
    return Variable(
        f"{crank}.torque", "N*m", f"torque of the shaft on {crank}, counter-clockwise", (), values
    )


def accelerations_of(equations: BeamEquations, run: RunMotion) -> Array:
    """Return S'' at the times, (times, unknowns)."""
    accelerations = np.zeros_like(run.displacements)
    if run.rates is not None:
        order = np.argsort(run.times, kind="stable")
        states = np.column_stack([run.displacements, run.rates])[order]
        accelerations[order] = equations.solutions(run.times[order], states)[:, : equations.whole]
    return accelerations


def _link(motion: ElasticMotion, run: RunMotion, accelerations: Array, k: int) -> Array:
    """Return the external forces on a link at each of its unknowns, on its own axes, (times, n).

    Those of loads that rotate with it at a joint are among them.
    """
    beam = motion.beams[k]
    s, v, a = local_motion(motion, run, accelerations, k)
    axes, local_forces = run.axes(k), np.zeros_like(s)
    unknowns = {k for pair in beam.joints for k in pair}
    unknowns |= {j for j, dof in enumerate(beam.dofs) if dof == "theta@1" or dof in beam.info.welded}
    loads_of_link = [i for i, name in enumerate(motion.info.loads) if name == beam.info.link]
    joints = [beam.info.node(node) * beam.properties.length for node in beam.info.joint_nodes]
    profiles = motion.profiles(beam.info.link)
    at_joints = [p.is_point and bool(p.follows) and bool(np.isclose(p.at, joints).any()) for p in profiles]
    loads = [
        run.loads[:, i] * (_OF_AXIAL_FORCE if at_joint else 1.0)
        for i, at_joint in zip(loads_of_link, at_joints, strict=True)
    ]
    for piece in beam.pieces:
        if unknowns.intersection(piece.at):
            at = list(piece.at)
            local_forces[:, at] += _piece(piece, axes, loads, s[:, at], v[:, at], a[:, at], run.rates is None)
    return local_forces


def _piece(
    piece: Piece,
    axes: Frames,
    forces: Sequence[Array],
    s: Array,
    v: Array,
    a: Array,
    static: bool,
) -> Array:
    """Return M s'' + C s' + K s - Q of a superelement on the link's axes, (times, n).

    Static is K s - Q, with the axial forces in K. ``forces`` are weights of forces along it, by column.
    """
    load = axes.load(piece.load_x, piece.load_y, piece.load_out, piece.load_turn)
    by_name = [dict(zip(APPLIED, f.T, strict=True)) for f in forces]
    for f, shape_x, shape_y in zip(by_name, piece.force_x, piece.force_y, strict=True):
        load += np.outer(f["load_force_x"], shape_x) + np.outer(f["load_force_y"], shape_y)
    force: Array = s @ piece.stiffness.T - load
    for weight, constant in STIFFENING.items():
        force += getattr(axes, weight)[:, None] * (s @ getattr(piece, constant).T)
    for weight, of_force in STIFFNESS_OF_FORCES.items():
        for f, stiffness in zip(by_name, getattr(piece, of_force), strict=True):
            force += f[weight][:, None] * (s @ stiffness.T)
    if static:
        return force
    force += a @ piece.mass.T + v @ piece.damping.T
    force += axes.damping_gyroscopic[:, None] * (v @ piece.gyroscopic.T)
    for weight, constant in TURNING.items():
        force += getattr(axes, weight)[:, None] * (s @ getattr(piece, constant).T)
    return force


def local_motion(motion: ElasticMotion, run: RunMotion, accelerations: Array | None, k: int) -> States:
    """Return s, s' and s'' of a link's unknowns on its own turning axes, each (times, n), computed once.

    Without accelerations S'' those of s are not known, and not to be used.
    """
    known = run._states.get(k)
    if known is None or not (accelerations is None or known[0] is accelerations):
        known = run._states[k] = accelerations, _local_states(motion, run, accelerations, k)
    return known[1]


def _local_states(motion: ElasticMotion, run: RunMotion, accelerations: Array | None, k: int) -> States:
    derivatives = run.rates, accelerations
    s, still = run.local(motion, k), np.zeros_like(run.displacements)
    v, a = (motion.local_unknowns(k, run.links, still if x is None else x) for x in derivatives)
    if run.rates is None or run.thesis:
        return s, v, a
    axes = run.axes(k)
    by_rate, twice = axes.stiffness_damping_quarter, axes.damping_mass_quarter
    by_turn, ends = axes.stiffness_mass_quarter, axes.stiffness_mass_ends
    for u, w in motion.beams[k].joints:
        # Terms of the link's equation with S' and S are those of s' and s'' by mass and damping.
        su, sw, vu, vw = s[:, u], s[:, w], v[:, u].copy(), v[:, w].copy()
        v[:, u] += by_rate * sw
        v[:, w] -= by_rate * su
        a[:, u] += twice * vw + by_turn * sw + ends * su
        a[:, w] += -twice * vu - by_turn * su + ends * sw
    return s, v, a


def modal_rates(motion: ElasticMotion, run: RunMotion) -> Array:
    """Return the rates at which the forces of damped modes work on the strains, (times, modes) [W^(1/2)].

    Their squares are the powers that the damping of the modes takes.
    """
    rates = np.zeros((len(run.times), len(motion.layout.damped)))
    if run.rates is None or not rates.size:
        return rates
    for k, forces_of_link in enumerate(forces_on_links(motion.layout, motion.beams)):
        rates += local_motion(motion, run, None, k)[1] @ forces_of_link.T
    joints = motion.layout.joint_places[:-1]
    of_joints = motion.layout.damped[:, motion.layout.damped.shape[1] - len(joints) :]
    return rates + run.rates[:, joints[joints >= 0]] @ of_joints[:, joints >= 0].T


def _bound(
    motion: ElasticMotion, equations: BeamEquations, run: RunMotion, accelerations: Array
) -> dict[str, Array]:
    """Return J^T lambda of M S'' + C S' + K S = Q - J^T lambda by constraint, (times, unknowns) each."""
    if not motion.layout.constraints:
        return {}
    names = motion.constraints
    still = np.zeros_like(run.displacements)
    rates, accelerated, analysis = still, still, _beams.QUASI_STATIC
    if run.rates is not None:
        rates, accelerated, analysis = run.rates, accelerations, _beams.IN_MOTION
    order = np.argsort(run.times, kind="stable")
    s, v, a = (x[order] for x in (run.displacements, rates, accelerated))
    status, residuals, rows = equations.residual(run.times[order], s, v, a, analysis)
    motion.check(equations, status, equations.motion.t)
    # Least squares: constraints may be redundant.
    inverse = np.linalg.pinv(rows, rows.shape[2] * np.finfo(float).eps)
    multipliers = -(residuals[:, None, :] @ inverse)[:, 0]
    of_rows = np.empty((len(names), *residuals.shape))
    of_rows[:, order] = multipliers.T[:, :, None] * np.moveaxis(rows, 1, 0)
    return dict(zip(names, of_rows, strict=True))


def crank_rotation(motion: ElasticMotion, run: RunMotion) -> Array:
    """Return by how far the shaft of a crank that is not held turns from its rigid motion [rad], (times,)."""
    if motion.layout.shaft >= 0:
        return run.displacements[:, motion.layout.shaft]
    rotation, _ = motion.rigid_crank(run.times, run.q)
    return np.sum(rotation * run.displacements[:, _end_of_crank(motion)], axis=1)


def _of_drive(motion: ElasticMotion, run: RunMotion, bound: Array) -> Array:
    """Return the torque of the shaft of a rigid crank from the forces that hold its direction."""
    _, arm = motion.rigid_crank(run.times, run.q)
    return -np.sum(arm * bound[:, _end_of_crank(motion)], axis=1)


def _end_of_crank(motion: ElasticMotion) -> list[int]:
    """Return the unknowns of the second point of a rigid crank."""
    end = motion.rigid.description.links[motion.info.crank][1]
    return [motion.layout.names.index(f"{end}.{axis}") for axis in "xy"]
