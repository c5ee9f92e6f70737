"""Exact derivatives of runs and frequencies of linkages with elastic links in space.

The linkage along each parameter has a start with tangents. Those of a run follow its steps
(:mod:`.tangents`), those of an equilibrium its balance. The differentials of the rigid start are those of
:mod:`symgen.runtime.linearisation.sensitivity`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from symgen.errors import ModelError
from symgen.runtime.arrays import Array
from symgen.runtime.beams.methods import GAUSS8
from symgen.runtime.elastic.derivatives.poses import derived, frequency_slopes, frequency_units
from symgen.runtime.elastic.large.collocation import MotionState, SystemRun
from symgen.runtime.elastic.large.statics import equilibrium, held
from symgen.runtime.elastic.space.linkage import LinkageInSpace, ParameterDirection
from symgen.runtime.elastic.space.modes import modes_in_space
from symgen.runtime.elastic.space.outputs import outputs as outputs_of
from symgen.runtime.elastic.space.tangents import RunTangents, by_parameters, matrices
from symgen.runtime.kernels.evaluate import UNIT
from symgen.runtime.linearisation.record import Sensitivity, sensitivity_of
from symgen.runtime.linearisation.sensitivity import check_starts, moved_pose
from symgen.runtime.linearisation.state_space import derivatives
from symgen.runtime.result.records import Variable
from symgen.runtime.rods.model.rods import RodModel

#: Number of solutions for the change of an equilibrium, each for the residual of the previous one, since the
#: matrix is shifted.
_REFINED = 3


def of_run(
    rigid: RodModel,
    outputs: Sequence[str],
    parameters: Sequence[str],
    coordinates: Sequence[str],
    times: Array,
    steps: int,
) -> Sensitivity:
    """Return derivatives of outputs at equally spaced times [s] of a run, with so many steps between two.

    ``coordinates`` are held at the start of the linkage with rigid links, with their rates.

    Raises
    ------
    ModelError
        For an unknown output, loads that jump, and coordinates that do not determine the rigid start.
    SimulationError
        When a derivative is not finite.
    """
    if rigid.description.switches:
        raise ModelError(
            f"{rigid.name}: derivatives of its runs are not available: loads jump: "
            f"{rigid.description.switches[0]}"
        )
    linkage, directions = LinkageInSpace(rigid), [*_directions(rigid, parameters, coordinates)]
    tangents = RunTangents(linkage, directions, GAUSS8, float(times[1] - times[0]) / steps)
    run = SystemRun(linkage, GAUSS8, times, steps)
    for step in run.each_step():
        tangents.step(*step)
    moments = run.moments()
    by = [(*x, *tangents.settled(m, *x)) for m, x in zip(moments, tangents.directions[::steps], strict=True)]

    def along(j: int) -> list[Variable]:
        duals = []
        for m, changes in zip(moments, by, strict=True):
            q, v, a, multipliers = (1j * UNIT * x[:, j] for x in changes)
            duals.append(MotionState(m.t, m.q + q, m.v + v, m.a + a, m.multipliers + multipliers))
        return outputs_of(directions[j], duals)

    each = map(along, range(len(directions)))
    units, values, slopes = derived(outputs, each, "of a run of elastic links in space")
    return sensitivity_of(rigid.description, units, parameters, values, slopes, times)


def of_frequencies(
    rigid: RodModel, parameters: Sequence[str], coordinates: Sequence[str], t: float
) -> Sensitivity:
    """Return derivatives of the frequencies [Hz] about the equilibrium with the input held at a time [s].

    Raises
    ------
    ModelError
        Where there is no equilibrium, or it is unstable; for equal frequencies; as :func:`of_run`.
    """
    modes = modes_in_space(rigid, t)
    frequencies, shapes = modes.frequencies[modes.rigid :], modes.shapes[:, modes.rigid :]
    linkage, each = LinkageInSpace(rigid), []
    at, n = equilibrium(linkage, t), linkage.unknowns
    solve = held(linkage, at)
    # An inverse iteration takes rounding in the stiffest directions out of the shapes.
    slopes = linkage.slopes(t, at.q, at.v, at.a, at.multipliers)
    mass = linkage.pattern.matrix(slopes.mass)[:n, :n]
    matrix = linkage.pattern.matrix(slopes.stiffness + slopes.jacobian)
    shapes = solve(np.vstack([mass @ shapes, np.zeros((linkage.multipliers, shapes.shape[1]))]))[:n]
    for along in _directions(rigid, parameters, coordinates):
        moved_by = by_parameters(along, [at])
        right, change = np.append(moved_by.forces[0], moved_by.errors[0]), np.zeros(n + linkage.multipliers)
        for _ in range(_REFINED):
            change = change - solve(right + matrix @ change)
        q, multipliers = at.q + 1j * UNIT * change[:n], at.multipliers + 1j * UNIT * change[n:]
        each.append(matrices(along, replace(at, q=q, multipliers=multipliers)))
    by_parameter = frequency_slopes(rigid.name, modes.rigid, frequencies, shapes, each)
    units = frequency_units(modes.rigid, len(frequencies))
    return sensitivity_of(rigid.description, units, parameters, frequencies, by_parameter, t)


def _directions(
    rigid: RodModel, parameters: Sequence[str], coordinates: Sequence[str]
) -> Iterator[LinkageInSpace]:
    """Yield the linkage along each parameter."""
    check_starts(rigid, parameters)
    coordinates = [*coordinates, *rigid.description.integrals]
    names = tuple(derivatives(rigid.description, coordinates))
    tangents = rigid._tangents(rigid.initial_state(), names, "sensitivity")
    tangents.check_closed()
    dq, du = moved_pose(tangents, parameters, coordinates)
    for j, name in enumerate(parameters):
        change = np.zeros(len(rigid.evaluator.parameter_values))
        change[[*rigid.parameters].index(name)] = 1.0
        yield LinkageInSpace(rigid, along=ParameterDirection(change, dq[:, j], du[:, j]))
