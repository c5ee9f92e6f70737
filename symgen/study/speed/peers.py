"""Open chains of rods in other programs, each in its fastest configuration: MuJoCo, Pinocchio, Exudyn.

A peer provides sweeps of settings from loose to tight. A setting is a Python call that starts at the
initial state and returns joint angles at the sample times; point positions are computed from them
afterwards. Models and their memory are prepared in advance.
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
from numpy.typing import NDArray

from symgen.study.speed.planar_chain import PlanarChain

Array = NDArray[np.float64]

#: Numbers of steps between samples, and tolerances.
STEPS = tuple(dict.fromkeys(round(2 ** (k / 2)) for k in range(2, 20)))
TOLERANCES = tuple(10.0**-k for k in range(2, 14))
#: Features of MuJoCo that are switched off: those other than the dynamics of the tree.
LEFT_OUT = (
    "contact", "constraint", "equality", "frictionloss", "limit", "spring", "damper", "actuation", "sensor",
    "island", "midphase", "warmstart", "filterparent", "refsafe", "clampctrl",
)  # fmt: skip


@dataclass(frozen=True)
class PeerSetting:
    """One setting of a peer: ``angles`` converts the result of ``run`` to joint angles [rad], (times, rods).

    If only the final state has an exact time, ``angles`` returns that state alone.
    """

    program: str
    series: str
    text: str
    run: Callable[[], Any]
    angles: Callable[[Any], Array]


def mujoco_sweeps(chain: PlanarChain) -> list[Iterator[PeerSetting]]:
    """Yield settings of the fourth-order Runge-Kutta method, without contacts, constraints and sensors."""
    mujoco = _needed("mujoco", "MjModel")
    bodies, before = "", 0.0
    for length, mass, centre, inertia in chain.rods:
        about = f'mass="{mass!r}" diaginertia="{inertia!r} {inertia!r} {inertia!r}"'
        bodies += (
            f'<body pos="{before!r} 0 0"><joint type="hinge" axis="0 -1 0"/>'
            f'<inertial pos="{centre!r} 0 0" {about}/>'
        )
        before = length
    flags = " ".join(f'{name}="disable"' for name in LEFT_OUT)
    gx, gy = chain.gravity
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option integrator="RK4" gravity="{gx!r} 0 {gy!r}"><flag {flags}/></option>'
        f"<worldbody>{bodies}{'</body>' * len(chain)}</worldbody></mujoco>"
    )
    data, step, between = mujoco.MjData(model), mujoco.mj_step, chain.samples - 1

    def run(steps: int) -> Array:
        model.opt.timestep = chain.t_end / (between * steps)
        data.time, data.qpos[:], data.qvel[:] = 0.0, chain.angles, chain.rates
        found = np.empty((chain.samples, len(chain)))
        found[0] = chain.angles
        for i in range(1, chain.samples):
            step(model, data, steps)
            found[i] = data.qpos
        return found

    counts = ((s, f"{between * s} steps") for s in STEPS)
    return [(PeerSetting("MuJoCo", "RK4", text, partial(run, s), np.asarray) for s, text in counts)]


def _pinocchio(chain: PlanarChain) -> tuple[Callable[[Array, Array], Array], Array]:
    """Return accelerations by ``aba``, and the initial state; rotation about y is positive downwards."""
    pin = _needed("pinocchio", "aba")
    model = pin.Model()
    gx, gy = chain.gravity
    model.gravity.linear = np.array([gx, 0.0, gy])
    parent, before = 0, 0.0
    for k, (length, mass, centre, inertia) in enumerate(chain.rods):
        own = pin.Inertia(mass, np.array([centre, 0.0, 0.0]), np.diag([0.0, inertia, inertia]))
        place = pin.SE3.Identity()
        place.translation = np.array([before, 0.0, 0.0])
        parent = model.addJoint(parent, pin.JointModelRY(), place, f"joint{k}")
        model.appendBodyToJoint(parent, own, pin.SE3.Identity())
        before = length
    aba, data, torque, form = pin.aba, model.createData(), np.zeros(len(chain)), pin.Convention.WORLD
    start = -np.concatenate([chain.angles, chain.rates])
    return lambda q, v: aba(model, data, q, v, torque, form), start


def scipy_sweeps(chain: PlanarChain) -> list[Iterator[PeerSetting]]:
    """Return sweeps of SciPy's DOP853 with Pinocchio's accelerations, at two absolute tolerances."""
    from scipy.integrate import solve_ivp

    accelerations, start = _pinocchio(chain)
    n, times = len(chain), chain.times

    def rates(_: float, y: Array) -> Array:
        return np.concatenate((y[n:], accelerations(y[:n], y[n:])))

    def run(rtol: float, part: float) -> Any:
        span = (0.0, chain.t_end)
        return solve_ivp(rates, span, start, "DOP853", t_eval=times, rtol=rtol, atol=part * rtol).y

    def sweep(part: float) -> Iterator[PeerSetting]:
        for rtol in TOLERANCES:
            call, series = partial(run, rtol, part), f"DOP853, atol {part:g} rtol"
            yield PeerSetting("Pinocchio + SciPy", series, f"rtol {rtol:.0e}", call, lambda y: -y[:n].T)

    return [sweep(part) for part in (1.0, 1e-2)]


def cvode_sweeps(chain: PlanarChain) -> list[Iterator[PeerSetting]]:
    """Return sweeps of SUNDIALS' CVODE (Adams, BDF) with Pinocchio's accelerations."""
    cvode = _needed("sksundae.cvode", "CVODE")
    accelerations, start = _pinocchio(chain)
    n, times = len(chain), chain.times

    def rates(_: float, y: Array, rate: Array) -> None:
        rate[:n] = y[n:]
        rate[n:] = accelerations(y[:n], y[n:])

    def sweep(method: str, part: float) -> Iterator[PeerSetting]:
        for rtol in TOLERANCES:
            solver = cvode.CVODE(rates, rtol=rtol, atol=part * rtol, method=method, max_num_steps=1_000_000)
            yield PeerSetting(
                "Pinocchio + CVODE", f"{method}, atol {part:g} rtol", f"rtol {rtol:.0e}",
                partial(solver.solve, times, start), lambda found: -found.y[:, :n],
            )  # fmt: skip

    return [sweep(method, part) for method in ("Adams", "BDF") for part in (1.0, 1e-2)]


def exudyn_sweeps(chain: PlanarChain) -> list[Iterator[PeerSetting]]:
    """Return sweeps of Exudyn's explicit methods on a tree in minimal coordinates, without range checks."""
    sys.exudynFast = True  # type: ignore[attr-defined]  # selects the build without range checks
    with redirect_stdout(StringIO()):  # suppress the message of the import
        exu = _needed("exudyn", "SystemContainer")
    container = exu.SystemContainer()
    system = container.AddSystem()
    sensor = _exudyn_tree(exu, system, chain)
    system.Assemble()
    solver, settings, between = exu.DynamicSolverType, exu.SimulationSettings(), chain.samples - 1
    integration = settings.timeIntegration
    integration.endTime, settings.solution.file.write = chain.t_end, False
    settings.solution.sensors.writePeriod = chain.t_end / between
    integration.explicit.computeEndOfStepAccelerations = False

    def run(method: str, steps: int, rtol: float) -> Array:
        _ = container  # keep the owner of the system alive
        integration.automaticStepSize, integration.numberOfSteps = rtol > 0, steps
        if rtol:
            integration.absoluteTolerance = integration.relativeTolerance = rtol
        system.SolveDynamic(settings, solverType=getattr(solver, method))
        return np.asarray(system.GetSensorStoredData(sensor)[:, 1:])

    def fixed(method: str) -> Iterator[PeerSetting]:
        for s in STEPS:
            call = partial(run, method, between * s, 0.0)
            yield PeerSetting("Exudyn", method, f"{between * s} steps", call, np.asarray)

    def adapted(method: str) -> Iterator[PeerSetting]:
        # With adaptive steps, only the last sample is recorded at its exact time.
        for rtol in TOLERANCES:
            call = partial(run, method, between, rtol)
            yield PeerSetting("Exudyn", method, f"rtol {rtol:.0e}", call, lambda angles: angles[-1:])

    return [fixed("RK44"), fixed("RK67"), adapted("DOPRI5")]


def _exudyn_tree(exu: Any, system: Any, chain: PlanarChain) -> Any:
    """Add the chain to an Exudyn system; return the sensor of its angles."""
    items = importlib.import_module("exudyn.itemInterface")
    n = len(chain)
    node = system.AddNode(
        items.NodeGenericODE2(
            referenceCoordinates=[0.0] * n,
            initialCoordinates=chain.angles.tolist(),
            initialCoordinates_t=chain.rates.tolist(),
            numberOfODE2Coordinates=n,
        )
    )
    offsets, centres = exu.Vector3DList(), exu.Vector3DList()
    inertias, turns = exu.Matrix3DList(), exu.Matrix3DList()
    before = 0.0
    for length, _, centre, inertia in chain.rods:
        offsets.Append([before, 0.0, 0.0])
        centres.Append([centre, 0.0, 0.0])
        inertias.Append(np.diag([0.0, inertia, inertia]))
        turns.Append(np.eye(3))
        before = length
    system.AddObject(
        items.ObjectKinematicTree(
            nodeNumber=node,
            jointTypes=[exu.JointType.RevoluteZ] * n,
            linkParents=list(range(-1, n - 1)),
            jointTransformations=turns,
            jointOffsets=offsets,
            linkInertiasCOM=inertias,
            linkCOMs=centres,
            linkMasses=[mass for _, mass, _, _ in chain.rods],
            gravity=[*chain.gravity, 0.0],
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


#: All peers: pip packages, and sweeps for a chain.
PEERS: dict[str, tuple[str, Callable[[PlanarChain], list[Iterator[PeerSetting]]]]] = {
    "MuJoCo": ("mujoco", mujoco_sweeps),
    "Pinocchio + SciPy": ("pin", scipy_sweeps),
    "Pinocchio + CVODE": ("pin scikit-sundae", cvode_sweeps),
    "Exudyn": ("exudyn", exudyn_sweeps),
}


def _needed(name: str, part: str) -> Any:
    """Import a package; raise ImportError if it is missing or another package has its name."""
    found = importlib.import_module(name)
    if not hasattr(found, part):
        raise ImportError(f"another package of the name {name} is installed: it has no {part}")
    return found
