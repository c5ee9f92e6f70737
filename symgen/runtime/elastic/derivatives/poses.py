"""Exact derivatives of linkages with elastic links by parameters, in the pose of a time.

Parameters change the rigid motion, whose differentials are those of
:mod:`symgen.runtime.linearisation.sensitivity`, and through it and the properties of links all matrices.
These are assembled once for each parameter with complex numbers, whose imaginary parts are tangents: those of
kernels are derived, and those of sums and products follow, since the tangents are so small that their
products vanish.

Unknowns S obey constraints J S = 0 with forces J^T mu. A mode (K - w^2 M) phi + J^T mu = 0 of the structure
at rest has d(w^2) = phi^T (dK - w^2 dM) phi + 2 mu^T dJ phi where phi^T M phi = 1. Quasi-static
displacements, K S + J^T mu = Q, have the differentials of :mod:`.balance`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from symgen.errors import ModelError
from symgen.runtime._beams import APPLIED, AT_REST, MOTION, QUASI_STATIC, BeamEquations
from symgen.runtime.arrays import Array, Dual
from symgen.runtime.beams.links import Beam, beam
from symgen.runtime.beams.pieces import whole
from symgen.runtime.elastic.derivatives.balance import Balance
from symgen.runtime.elastic.derivatives.matrices import Assembled, assembled, damped
from symgen.runtime.elastic.mesh import properties_of
from symgen.runtime.elastic.modes import elastic_modes
from symgen.runtime.elastic.motion import ElasticMotion
from symgen.runtime.elastic.outputs import outputs as outputs_of
from symgen.runtime.elastic.static import quasi_static
from symgen.runtime.kernels.evaluate import UNIT, Duals
from symgen.runtime.linearisation.record import Sensitivity, sensitivity_of, with_outputs
from symgen.runtime.linearisation.sensitivity import moved_motion
from symgen.runtime.linearisation.tangents import Tangents
from symgen.runtime.linearisation.vibration import eigenvalue_slopes
from symgen.runtime.result.records import Variable, columns, of_names, unknown

#: The part of its length by which places along a link may move over it.
_MOVED = 1e-12
#: Analyses of the kernels of motion and joints; that with tangents has the ending.
_KINDS, _TANGENTS = ("elastic_motion", "elastic_joints"), "_tangents"


def sensitivity(
    motion: ElasticMotion, outputs: Sequence[str], parameters: Sequence[str], t: float
) -> Sensitivity:
    """Return the derivatives of frequencies at rest and of quasi-static outputs in the pose of a time.

    Raises
    ------
    ModelError
        For an unknown output, equal frequencies, links reduced to modes, places along a link that move over
        it with a parameter, and parameters that contradict redundant constraints.
    SimulationError
        Where the linkage cannot be assembled; when a derivative is not finite.
    """
    motion.check_determined()
    pose, d = Pose(motion, parameters, t), motion.rigid.description
    result = sensitivity_of(d, {}, parameters, np.zeros(0), np.zeros((0, len(parameters))), t)
    if "frequencies" in outputs:
        rigid, values, slopes = pose.frequencies()
        result = with_outputs(result, frequency_units(rigid, len(values)), values, slopes)
    requested = [name for name in outputs if name != "frequencies"]
    return with_outputs(result, *pose.static(requested)) if requested else result


def frequency_units(rigid: int, count: int) -> dict[str, str]:
    """Return the names of so many frequencies as outputs, with their unit; rigid modes precede them."""
    return {f"frequency.{rigid + i}": "Hz" for i in range(1, count + 1)}


class Pose:
    """The rigid motion at a time, with its differentials."""

    def __init__(
        self,
        motion: ElasticMotion,
        parameters: Sequence[str],
        t: float,
        equations: BeamEquations | None = None,
    ) -> None:
        self.motion, self.parameters, self.t = motion, tuple(parameters), t
        rigid = motion.rigid
        self.equations = equations or motion.equations()
        (q, u, _), _, _ = motion.rigid_motion(self.equations, np.array([t]))
        self.q, self.u = q[0], u[0]
        if rigid.description.windings:  # angles in loads count revolutions
            rigid = rigid.counting(rigid.reached(t))
        tangents: Tangents = rigid._tangents(rigid._state(t, self.q, self.u), (), "sensitivity")
        self.work = np.asarray(tangents.solution)
        dq, du, dw = moved_motion(tangents, parameters, ())
        # Those of all that kernels take: references and branches, which runs set, are constant.
        directions = np.zeros((len(rigid.parameter_values), len(parameters)))
        directions[[[*rigid.parameters].index(name) for name in parameters], range(len(parameters))] = 1.0
        #: Differentials of coordinates, rates, parameters, and accelerations with multipliers.
        self.moved = [dq, du, directions, dw]
        self.kernels = {kind: (rigid.analysis(kind), rigid.analysis(kind + _TANGENTS)) for kind in _KINDS}

    def duals(self, kind: str, kernel: str, j: int, resting: bool = False) -> dict[str, Dual]:
        """Return the results of a kernel by name, with tangents along parameter j."""
        q, u, p, w = (moved[:, j] for moved in self.moved)
        state = [x + 1j * UNIT * dx for x, dx in ((self.q, q), (self.u, u), (self.work, w))]
        if resting:
            state[1:] = (np.zeros_like(x) for x in state[1:])
        blocks = Duals(*self.kernels[kind], p)(kernel, np.array([self.t]), *(x[None] for x in state))
        return {name: x[0] for name, x in blocks.items()}

    def linkage(self, j: int) -> ElasticMotion:
        """Return the motion with links and tables that have tangents along parameter j."""
        tables = self.duals("elastic_motion", "constants", j)
        tables = {name: np.atleast_2d(rows) for name, rows in tables.items()}
        bare = self.motion.with_constants(tables)
        cause = self.parameters[j]
        links = [self._link(bare, k, row, cause) for k, row in enumerate(tables["properties"])]
        return self.motion.with_constants(tables, links)

    def _link(self, motion: ElasticMotion, k: int, row: Dual, parameter: str) -> Beam:
        info = self.motion.beams[k].info
        if info.modes:
            raise ModelError(
                f"link {info.link} is reduced to modes, of which derivatives are not available\n"
                '  Leave out the reduction, or take reduction = "guyan".'
            )
        properties = properties_of(row)
        lumps, profiles = motion.lumps(info.link), motion.profiles(info.link)
        places = [*(x.at for x in lumps), *(x.at for x in profiles)] if info.nodes else []
        if any(abs((at / properties.length).imag) > _MOVED * UNIT / properties.length.real for at in places):
            raise ModelError(
                f"elements of link {info.link} end at loads or masses that move along it with {parameter}: "
                "derivatives by it are not available"
            )
        link = beam(info, replace(properties, ratio=0.0), lumps, profiles)
        link = replace(link, pieces=(whole(link.pieces, len(link.dofs)),))
        return damped(link, properties.ratio) if properties.ratio else link

    def assembled(self, j: int, analysis: int) -> tuple[ElasticMotion, Dual, Assembled]:
        """Return links with tangents along parameter j, their rigid motion, and the matrices."""
        motion = self.linkage(j)
        rows, loads, joined = self.of_motion(j, analysis == AT_REST)
        matrices = assembled(motion, rows, loads, joined, analysis)
        if self.motion.has_motor and (shaft := motion.layout.shaft) >= 0:
            matrices.mass[shaft, shaft] += self.duals("elastic_motion", "shaft", j)["shaft"].flat[0]
        return motion, rows, matrices.narrowed()

    def of_motion(self, j: int, resting: bool = False) -> tuple[Dual, Dual, dict[str, Dual]]:
        """Return weights of links, of forces along them, and blocks of joints, with tangents along j.

        ``resting``: the joints of the structure at rest.
        """
        rows = self.duals("elastic_motion", "links", j)["links"].reshape(-1, len(MOTION))
        loads = np.zeros((0, len(APPLIED)), complex)
        if self.motion.info.loads:
            loads = self.duals("elastic_motion", "loads", j)["loads"].reshape(-1, len(APPLIED))
        return rows, loads, self.duals("elastic_joints", "joints", j, resting)

    def frequencies(self) -> tuple[int, Array, Array]:
        """Return the number of rigid modes, frequencies at rest of the others [Hz], and their derivatives."""
        modes = elastic_modes(self.motion, self.equations, self.t)
        frequencies, shapes = modes.frequencies[modes.rigid :], modes.shapes[:, modes.rigid :]
        each = (self.assembled(j, AT_REST)[2] for j in range(len(self.parameters)))
        matrices = [(at.mass, at.stiffness, at.bound) for at in each]
        slopes = frequency_slopes(self.motion.rigid.name, modes.rigid, frequencies, shapes, matrices)
        return modes.rigid, frequencies, slopes

    def static(self, requested: Sequence[str]) -> tuple[dict[str, str], Array, Array]:
        """Return units of scalar quasi-static outputs by name, their values and their derivatives."""
        if self.motion.rigid.redundant:
            raise ModelError(
                f"{self.motion.rigid.name}: redundant constraints leave axial forces undetermined, and "
                "derivatives of quasi-static outputs with them"
            )
        shape = quasi_static(self.motion, self.equations, np.array([self.t]))

        def along() -> Iterator[list[Variable]]:
            balance = None
            for j in range(len(self.parameters)):
                motion, rows, at = self.assembled(j, QUASI_STATIC)
                balance = balance or Balance([at], np.zeros((1, 1)))
                moved = shape + 1j * UNIT * balance.differential([at])
                yield outputs_of(motion, rows[None], moved.astype(complex))

        units, values, slopes = derived(requested, along(), "with elastic links", ("frequencies",))
        return units, values[0], slopes[0]


def check_smooth(motion: ElasticMotion, noun: str, cause: str) -> None:
    """Raise ModelError where ``noun`` of a motion has no derivatives: for a cause, if any, or another one."""
    switches = motion.rigid.description.switches
    causes = [cause] if cause else []
    if switches:
        causes.append(f"loads jump: {switches[0]}")
    if len(motion.layout.damped):
        causes.append("modes of the structure, or of a link of many elements, have damping ratios")
    if motion.rigid.redundant:
        causes.append("redundant constraints leave axial forces undetermined")
    if causes:
        raise ModelError(f"{motion.rigid.name}: derivatives of its {noun} are not available: {causes[0]}")
    motion.check_determined()


def frequency_slopes(
    name: str, rigid: int, frequencies: Array, shapes: Array, matrices: Sequence[tuple[Dual, Dual, Dual]]
) -> Array:
    """Return derivatives of frequencies [Hz], (modes, parameters), by M, K, J with tangents along each.

    The number of ``rigid`` modes precedes theirs.

    Raises
    ------
    ModelError
        For equal frequencies.
    """
    values, both = 2j * np.pi * frequencies, [(phi, phi) for phi in shapes.T]
    pencils = [(m, (k + k.T) / 2, np.zeros_like(m), bound) for m, k, bound in matrices]
    at = tuple(x.real for x in pencils[0])
    along = [tuple(x.imag / UNIT for x in of) for of in pencils]
    held = np.linalg.pinv(at[-1].T)
    slopes = eigenvalue_slopes(f"frequencies of {name}", values, both, at, held, along, rigid + 1)
    return slopes.imag / (2 * np.pi)


def derived(
    requested: Sequence[str], along: Iterable[Sequence[Variable]], where: str, others: Sequence[str] = ()
) -> tuple[dict[str, str], Array, Array]:
    """Return the units of scalar outputs by name, their values (times, scalars), and their derivatives.

    Derivatives are (times, scalars, parameters); ``along`` has all outputs, with tangents by each parameter.

    Raises
    ------
    ModelError
        For a name that is not known, ``where``; ``others`` are further names for the hint.
    """
    each = [_scalars(requested, [*variables], where, others) for variables in along]
    units, duals = each[-1]
    return units, duals.real, np.stack([x.imag for _, x in each], axis=-1) / UNIT


def _scalars(
    requested: Sequence[str], known: Sequence[Variable], where: str, others: Sequence[str]
) -> tuple[dict[str, str], Dual]:
    """Return the units of scalar outputs by name, each once, and their values (times, scalars)."""
    units: dict[str, str] = {}
    rows: list[Dual] = []
    found = of_names(known, requested)
    for name in requested:
        if name not in found:
            raise ModelError(f"there are no derivatives of {name!r} {where}. {unknown(name, known, others)}")
        for scalar in columns([found[name]]):
            if scalar.name not in units:
                units[scalar.name] = scalar.unit
                rows.append(scalar.values)
    return units, np.array(rows).T
