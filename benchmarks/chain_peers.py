"""The falling chain of ``work_precision.py`` in other programs, each in its fastest configuration.

A program has sweeps of settings from loose to tight. A setting is a Python call that starts at the initial
state and returns joint angles at the sample times; positions of the tip are computed from them afterwards.
Models and their memory are prepared in advance.
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

#: Numbers of steps between samples, and tolerances.
STEPS = tuple(dict.fromkeys(round(2 ** (k / 2)) for k in range(2, 20)))
TOLERANCES = tuple(10.0**-k for k in range(2, 14))
#: Times of the samples [s], numbers of intervals between them, and acceleration of gravity [m/s^2].
TIMES, BETWEEN, G = np.linspace(0.0, T_END, SAMPLES), SAMPLES - 1, float(GRAVITY)
#: Moment of inertia [kg m^2] of a rod of 1 m and 1 kg about its centre of mass.
INERTIA = 1 / 12
#: Features of MuJoCo that are switched off: those other than the dynamics of the tree.
LEFT_OUT = (
    "contact", "constraint", "equality", "frictionloss", "limit", "spring", "damper", "actuation", "sensor",
    "island", "midphase", "warmstart", "filterparent", "refsafe", "clampctrl",
)  # fmt: skip


@dataclass(frozen=True)
class Attempt:
    """One setting: ``run`` is timed, ``tips`` converts its result to tip positions [m] at the sample times.

    If only the final state has an exact time, ``tips`` returns that position alone.
    """

    program: str
    series: str
    text: str
    run: Callable[[], Any]
    tips: Callable[[Any], Array]


def start(n: int) -> Array:
    """Return the joint angles [rad] at the start, at rest."""
    return float(BEND) * (np.arange(n) % 2)


def tips(angles: Array) -> Array:
    """Return positions of the tip (times, 2) [m] for joint angles (times, rods) [rad]."""
    total = np.cumsum(angles, axis=-1)
    return np.stack([np.cos(total).sum(axis=-1), np.sin(total).sum(axis=-1)], axis=-1)


def mujoco_sweeps(n: int) -> list[Iterator[Attempt]]:
    """Yield settings of the fourth-order Runge-Kutta method, without contacts, constraints and sensors."""
    mujoco = _needed("mujoco", "MjModel")
    bodies = "".join(
        f'<body pos="{float(k > 0)!r} 0 0"><joint type="hinge" axis="0 -1 0"/>'
        f'<inertial pos="0.5 0 0" mass="1.0" diaginertia="{INERTIA!r} {INERTIA!r} {INERTIA!r}"/>'
        for k in range(n)
    )
    flags = " ".join(f'{name}="disable"' for name in LEFT_OUT)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option integrator="RK4" gravity="0 0 {-G!r}"><flag {flags}/></option>'
        f"<worldbody>{bodies}{'</body>' * n}</worldbody></mujoco>"
    )
    data, step, begin = mujoco.MjData(model), mujoco.mj_step, start(n)

    def run(steps: int) -> Array:
        model.opt.timestep = T_END / (BETWEEN * steps)
        data.time, data.qpos[:], data.qvel[:] = 0.0, begin, 0.0
        found = np.empty((SAMPLES, n))
        found[0] = begin
        for i in range(1, SAMPLES):
            step(model, data, steps)
            found[i] = data.qpos
        return found

    return [(Attempt("MuJoCo", "RK4", f"{BETWEEN * s} steps", partial(run, s), tips) for s in STEPS)]


def _pinocchio(n: int) -> tuple[Callable[[Array, Array], Array], Array]:
    """Return accelerations by ``aba``, and the initial state; rotation about y is positive downwards."""
    pin = _needed("pinocchio", "aba")
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -G])
    parent, own = 0, pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), np.diag([0.0, INERTIA, INERTIA]))
    for k in range(n):
        place = pin.SE3.Identity()
        place.translation = np.array([float(k > 0), 0.0, 0.0])
        parent = model.addJoint(parent, pin.JointModelRY(), place, f"joint{k}")
        model.appendBodyToJoint(parent, own, pin.SE3.Identity())
    aba, data, torque, form = pin.aba, model.createData(), np.zeros(n), pin.Convention.WORLD
    begin = -np.concatenate([start(n), np.zeros(n)])
    return lambda q, v: aba(model, data, q, v, torque, form), begin


def scipy_sweeps(n: int) -> list[Iterator[Attempt]]:
    """Return sweeps of SciPy's DOP853 with Pinocchio's accelerations, at two absolute tolerances."""
    from scipy.integrate import solve_ivp

    accelerations, begin = _pinocchio(n)

    def rates(_: float, y: Array) -> Array:
        return np.concatenate((y[n:], accelerations(y[:n], y[n:])))

    def run(rtol: float, part: float) -> Any:
        return solve_ivp(rates, (0.0, T_END), begin, "DOP853", t_eval=TIMES, rtol=rtol, atol=part * rtol).y

    def sweep(part: float) -> Iterator[Attempt]:
        for rtol in TOLERANCES:
            call, series = partial(run, rtol, part), f"DOP853, atol {part:g} rtol"
            yield Attempt("Pinocchio + SciPy", series, f"rtol {rtol:.0e}", call, lambda y: tips(-y[:n].T))

    return [sweep(part) for part in (1.0, 1e-2)]


def cvode_sweeps(n: int) -> list[Iterator[Attempt]]:
    """Return sweeps of SUNDIALS' CVODE (Adams, BDF) with Pinocchio's accelerations."""
    cvode = _needed("sksundae.cvode", "CVODE")
    accelerations, begin = _pinocchio(n)

    def rates(_: float, y: Array, rate: Array) -> None:
        rate[:n] = y[n:]
        rate[n:] = accelerations(y[:n], y[n:])

    def sweep(method: str, part: float) -> Iterator[Attempt]:
        for rtol in TOLERANCES:
            solver = cvode.CVODE(rates, rtol=rtol, atol=part * rtol, method=method, max_num_steps=1_000_000)
            yield Attempt(
                "Pinocchio + CVODE", f"{method}, atol {part:g} rtol", f"rtol {rtol:.0e}",
                partial(solver.solve, TIMES, begin), lambda found: tips(-found.y[:, :n]),
            )  # fmt: skip

    return [sweep(method, part) for method in ("Adams", "BDF") for part in (1.0, 1e-2)]


def exudyn_sweeps(n: int) -> list[Iterator[Attempt]]:
    """Return sweeps of Exudyn's explicit methods on a tree in minimal coordinates, without range checks."""
    sys.exudynFast = True  # type: ignore[attr-defined]  # selects the build without range checks
    with redirect_stdout(StringIO()):  # suppress the message of the import
        exu = _needed("exudyn", "SystemContainer")
    container = exu.SystemContainer()
    system = container.AddSystem()
    sensor = _exudyn_tree(exu, system, n)
    system.Assemble()
    solver, settings = exu.DynamicSolverType, exu.SimulationSettings()
    integration = settings.timeIntegration
    integration.endTime, settings.solution.file.write = T_END, False
    settings.solution.sensors.writePeriod = T_END / BETWEEN
    integration.explicit.computeEndOfStepAccelerations = False

    def run(method: str, steps: int, rtol: float) -> Array:
        _ = container  # keep the owner of the system alive
        integration.automaticStepSize, integration.numberOfSteps = rtol > 0, steps
        if rtol:
            integration.absoluteTolerance = integration.relativeTolerance = rtol
        system.SolveDynamic(settings, solverType=getattr(solver, method))
        return np.asarray(system.GetSensorStoredData(sensor)[:, 1:])

    def fixed(method: str) -> Iterator[Attempt]:
        for s in STEPS:
            call = partial(run, method, BETWEEN * s, 0.0)
            yield Attempt("Exudyn", method, f"{BETWEEN * s} steps", call, tips)

    def adapted(method: str) -> Iterator[Attempt]:
        # With adaptive steps, only the last sample is recorded at its exact time.
        for rtol in TOLERANCES:
            call = partial(run, method, BETWEEN, rtol)
            yield Attempt("Exudyn", method, f"rtol {rtol:.0e}", call, lambda angles: tips(angles[-1:]))

    return [fixed("RK44"), fixed("RK67"), adapted("DOPRI5")]


def _exudyn_tree(exu: Any, system: Any, n: int) -> Any:
    """Add the chain to an Exudyn system; return the sensor of its angles."""
    items = importlib.import_module("exudyn.itemInterface")
    node = system.AddNode(
        items.NodeGenericODE2(
            referenceCoordinates=[0.0] * n,
            initialCoordinates=start(n).tolist(),
            initialCoordinates_t=[0.0] * n,
            numberOfODE2Coordinates=n,
        )
    )
    offsets, centres = exu.Vector3DList(), exu.Vector3DList()
    inertias, turns = exu.Matrix3DList(), exu.Matrix3DList()
    for k in range(n):
        offsets.Append([float(k > 0), 0.0, 0.0])
        centres.Append([0.5, 0.0, 0.0])
        inertias.Append(np.diag([0.0, INERTIA, INERTIA]))
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
    return system.AddSensor(
        items.SensorNode(
            nodeNumber=node,
            storeInternal=True,
            writeToFile=False,
            outputVariableType=exu.OutputVariableType.Coordinates,
        )
    )


def heyoka_sweeps(n: int) -> list[Iterator[Attempt]]:
    """Return sweeps of heyoka's power series, of equations in angles and in symgen's coordinates."""
    import heyoka_peer

    _needed("heyoka", "taylor_adaptive")

    def sweep(form: Any, ends: Callable[[Array], Array]) -> Iterator[Attempt]:
        for rtol in TOLERANCES[::2]:
            call = partial(form.sampled, form.integrator(rtol), TIMES)
            yield Attempt("heyoka", form.name, f"tol {rtol:.0e}", call, lambda y: ends(joints(form, y, n)[0]))

    return [sweep(form, lambda places: places[:, -1]) for form in heyoka_peer.chains(n)]


def joints(form: Any, y: Array, n: int) -> tuple[Array, Array]:
    """Return positions [m] and velocities [m/s] of joints (times, rods, 2), for states of heyoka."""
    if form.in_angles:
        along = np.stack([np.cos(y[:, :n]), np.sin(y[:, :n])], axis=-1)
        turned = np.stack([-along[..., 1], along[..., 0]], axis=-1) * y[:, n:, None]
        return np.cumsum(along, axis=1), np.cumsum(turned, axis=1)
    places, rates = np.split(y.reshape(len(y), 2 * n, 2), 2, axis=1)
    return places, rates


def drift(places: Array, rates: Array) -> tuple[float, float]:
    """Return the largest change of a chain's energy [J] and of a rod's length [m] over the samples."""
    ends, speeds = (np.pad(x, ((0, 0), (1, 0), (0, 0))) for x in (places, rates))
    a, b, va, vb = ends[:, :-1], ends[:, 1:], speeds[:, :-1], speeds[:, 1:]
    kinetic = np.sum(va * va + va * vb + vb * vb, axis=(1, 2)) / 6
    energy = kinetic + G * np.sum(a[..., 1] + b[..., 1], axis=1) / 2
    lengths = np.linalg.norm(b - a, axis=-1)
    return float(np.max(np.abs(energy - energy[0]))), float(np.max(np.abs(lengths - 1.0)))


#: All peers: pip packages, and sweeps for a chain of n rods.
PEERS: dict[str, tuple[str, Callable[[int], list[Iterator[Attempt]]]]] = {
    "MuJoCo": ("mujoco", mujoco_sweeps),
    "Pinocchio + SciPy": ("pin", scipy_sweeps),
    "Pinocchio + CVODE": ("pin scikit-sundae", cvode_sweeps),
    "Exudyn": ("exudyn", exudyn_sweeps),
    "heyoka": ("heyoka", heyoka_sweeps),
}


def _needed(name: str, part: str) -> Any:
    """Import a package; raise ImportError if it is missing or another package has its name."""
    found = importlib.import_module(name)
    if not hasattr(found, part):
        raise ImportError(f"another package of the name {name} is installed: it has no {part}")
    return found
