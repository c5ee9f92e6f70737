"""The falling chain of ``work_precision.py`` in other programs, each called in its fastest way.

A peer offers sweeps, each of settings from loose to tight. A setting is a call from Python that begins with
the initial state and returns joint angles at the sample times; tips are found from them afterwards, untimed.
Models and their memory are made beforehand.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import partial
from io import StringIO
from typing import Any

import numpy as np
from chain_reference import BEND, GRAVITY, SAMPLES, T_END
from numpy.typing import NDArray

Array = NDArray[np.float64]

G, BETWEEN = float(GRAVITY), SAMPLES - 1
TIMES = np.linspace(0.0, T_END, SAMPLES)
#: Steps between two samples, and tolerances.
STEPS = tuple(dict.fromkeys(round(2 ** (k / 2)) for k in range(2, 20)))
TOLERANCES = tuple(10.0**-k for k in range(2, 14))
#: What MuJoCo does in a step besides the dynamics of the tree.
LEFT_OUT = (
    "contact", "constraint", "equality", "frictionloss", "limit", "spring", "damper", "actuation", "sensor",
    "island", "midphase", "warmstart", "filterparent", "refsafe", "clampctrl",
)  # fmt: skip


@dataclass(frozen=True)
class Attempt:
    """One setting: ``run`` is timed, ``tips`` makes positions [m] at the sample times of what it returned.

    Where only the end is recorded at its time, ``tips`` gives that alone.
    """

    program: str
    series: str
    text: str
    run: Callable[[], Any]
    tips: Callable[[Any], Array]


def relative_angles(n: int) -> Array:
    """Return the angles [rad] between the rods at the start, the first from the horizontal."""
    return float(BEND) * (np.arange(n) % 2)


def tips_of(angles: Array) -> Array:
    """Return positions of the tip from joint angles (times, rods)."""
    total = np.cumsum(angles, axis=-1)
    return np.stack([np.cos(total).sum(axis=-1), np.sin(total).sum(axis=-1)], axis=-1)


def mujoco_sweeps(n: int) -> list[Iterator[Attempt]]:
    """Runge-Kutta of order 4; contacts, constraints and sensors are switched off."""
    mujoco = _needed("mujoco", "MjModel")
    moment, bodies = 1 / 12, ""
    for k in range(n):
        bodies += (
            f'<body pos="{int(k > 0)} 0 0"><joint type="hinge" axis="0 -1 0"/>'
            f'<inertial pos="0.5 0 0" mass="1" diaginertia="{moment} {moment} {moment}"/>'
        )
    flags = " ".join(f'{name}="disable"' for name in LEFT_OUT)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option integrator="RK4" gravity="0 0 -{G}"><flag {flags}/></option>'
        f"<worldbody>{bodies}{'</body>' * n}</worldbody></mujoco>"
    )
    data, start, step = mujoco.MjData(model), relative_angles(n), mujoco.mj_step

    def run(steps: int) -> Array:
        model.opt.timestep = T_END / (BETWEEN * steps)
        data.time, data.qpos[:], data.qvel[:] = 0.0, start, 0.0
        found = np.empty((SAMPLES, n))
        found[0] = start
        for i in range(1, SAMPLES):
            step(model, data, steps)
            found[i] = data.qpos
        return found

    return [(Attempt("MuJoCo", "RK4", f"{BETWEEN * s} steps", partial(run, s), tips_of) for s in STEPS)]


def _pinocchio(n: int) -> tuple[Callable[[Array, Array], Array], Array]:
    """Return accelerations by ``aba``, and the start; a turn about y is positive downwards."""
    pin = _needed("pinocchio", "aba")
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -G])
    inertia = pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), np.diag([0.0, 1.0, 1.0]) / 12)
    parent = 0
    for k in range(n):
        place = pin.SE3.Identity()
        place.translation = np.array([float(k > 0), 0.0, 0.0])
        parent = model.addJoint(parent, pin.JointModelRY(), place, f"joint{k}")
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    aba, data, torque, form = pin.aba, model.createData(), np.zeros(n), pin.Convention.WORLD
    return lambda q, v: aba(model, data, q, v, torque, form), np.concatenate(
        [-relative_angles(n), np.zeros(n)]
    )


def scipy_sweeps(n: int) -> list[Iterator[Attempt]]:
    """Pinocchio's accelerations integrated by SciPy's DOP853, at two absolute tolerances."""
    from scipy.integrate import solve_ivp

    accelerations, start = _pinocchio(n)

    def rates(_: float, y: Array) -> Array:
        return np.concatenate((y[n:], accelerations(y[:n], y[n:])))

    def run(rtol: float, part: float) -> Array:
        return solve_ivp(
            rates, (0.0, T_END), start, "DOP853", t_eval=TIMES, rtol=rtol, atol=part * rtol
        ).y  # fmt: skip

    def sweep(part: float) -> Iterator[Attempt]:
        for rtol in TOLERANCES:
            call = partial(run, rtol, part)
            series = f"DOP853, atol {part:g} rtol"
            yield Attempt("Pinocchio + SciPy", series, f"rtol {rtol:.0e}", call, lambda y: tips_of(-y[:n].T))

    return [sweep(part) for part in (1.0, 1e-2)]


def cvode_sweeps(n: int) -> list[Iterator[Attempt]]:
    """Pinocchio's accelerations integrated by SUNDIALS' CVODE, by Adams' methods and by BDF."""
    cvode = _needed("sksundae.cvode", "CVODE")
    accelerations, start = _pinocchio(n)

    def rates(_: float, y: Array, rate: Array) -> None:
        rate[:n] = y[n:]
        rate[n:] = accelerations(y[:n], y[n:])

    def sweep(method: str, part: float) -> Iterator[Attempt]:
        for rtol in TOLERANCES:
            solver = cvode.CVODE(rates, rtol=rtol, atol=part * rtol, method=method, max_num_steps=1_000_000)
            yield Attempt(
                "Pinocchio + CVODE", f"{method}, atol {part:g} rtol", f"rtol {rtol:.0e}",
                partial(solver.solve, TIMES, start), lambda found: tips_of(-found.y[:, :n]),
            )  # fmt: skip

    return [sweep(method, part) for method in ("Adams", "BDF") for part in (1.0, 1e-2)]


def exudyn_sweeps(n: int) -> list[Iterator[Attempt]]:
    """Exudyn's tree in minimal coordinates and its explicit methods, of the build without range checks."""
    sys.exudynFast = True  # type: ignore[attr-defined]  # how it is asked for
    with redirect_stdout(StringIO()):  # it says so when imported
        exu = _needed("exudyn", "SystemContainer")
    items = importlib.import_module("exudyn.itemInterface")
    container = exu.SystemContainer()
    system = container.AddSystem()
    node = system.AddNode(
        items.NodeGenericODE2(
            referenceCoordinates=[0.0] * n,
            initialCoordinates=relative_angles(n).tolist(),
            initialCoordinates_t=[0.0] * n,
            numberOfODE2Coordinates=n,
        )
    )
    offsets, centres = exu.Vector3DList(), exu.Vector3DList()
    inertias, turns = exu.Matrix3DList(), exu.Matrix3DList()
    for k in range(n):
        offsets.Append([float(k > 0), 0.0, 0.0])
        centres.Append([0.5, 0.0, 0.0])
        inertias.Append(np.diag([0.0, 1 / 12, 1 / 12]))
        turns.Append(np.eye(3))
    system.AddObject(
        items.ObjectKinematicTree(
            nodeNumber=node,
            jointTypes=[exu.JointType.RevoluteZ] * n,
            linkParents=list(range(-1, n - 1)),
            jointTransformations=turns,
            jointOffsets=offsets,
            linkInertiasCOM=inertias,
            linkCOMs=centres,
            linkMasses=[1.0] * n,
            gravity=[0.0, -G, 0.0],
        )
    )
    sensor = system.AddSensor(
        items.SensorNode(
            nodeNumber=node,
            storeInternal=True,
            writeToFile=False,
            outputVariableType=exu.OutputVariableType.Coordinates,
        )
    )
    system.Assemble()
    solver, settings = exu.DynamicSolverType, exu.SimulationSettings()
    integration = settings.timeIntegration
    integration.endTime, settings.solution.file.write = T_END, False
    settings.solution.sensors.writePeriod = T_END / BETWEEN
    integration.explicit.computeEndOfStepAccelerations = False

    def run(method: str, steps: int, rtol: float) -> Array:
        integration.automaticStepSize, integration.numberOfSteps = rtol > 0, steps
        if rtol:
            integration.absoluteTolerance = integration.relativeTolerance = rtol
        system.SolveDynamic(settings, solverType=getattr(solver, method))
        return np.asarray(system.GetSensorStoredData(sensor)[:, 1:])

    def ends(angles: Array) -> Array:
        """Of steps that adapt, only the last is recorded at its time."""
        return tips_of(angles[-1:])

    def fixed(method: str) -> Iterator[Attempt]:
        for s in STEPS:
            call = partial(run, method, BETWEEN * s, 0.0)
            yield Attempt("Exudyn", method, f"{BETWEEN * s} steps", call, tips_of)

    def adapted(method: str) -> Iterator[Attempt]:
        for rtol in TOLERANCES:
            call = partial(run, method, BETWEEN, rtol)
            yield Attempt("Exudyn", method, f"rtol {rtol:.0e}", call, ends)

    return [fixed("RK44"), fixed("RK67"), adapted("DOPRI5")]


#: All of them: how each is installed, and its sweeps for a chain of n rods.
PEERS: dict[str, tuple[str, Callable[[int], list[Iterator[Attempt]]]]] = {
    "MuJoCo": ("mujoco", mujoco_sweeps),
    "Pinocchio + SciPy": ("pin", scipy_sweeps),
    "Pinocchio + CVODE": ("pin scikit-sundae", cvode_sweeps),
    "Exudyn": ("exudyn", exudyn_sweeps),
}


def _needed(name: str, part: str) -> Any:
    """Import a package; raise ImportError when there is none, or another one of the name."""
    found = importlib.import_module(name)
    if not hasattr(found, part):
        raise ImportError(f"another package of the name {name} is installed: it has no {part}")
    return found
