"""N four-bar linkages in a row in other programs: MuJoCo, Exudyn, and Pinocchio with its constraint dynamics.

Every program has the model and the integrator that were fastest for it at equal error among those tried.
A peer is made for a number of linkages, a step [s], the rate of the upright cranks [rad/s] and gravity
[m/s^2]; ``run`` returns position and velocity of the first tip [m, m/s] at evenly spaced times, (times, 4).
"""

from __future__ import annotations

import importlib
import sys
from contextlib import redirect_stdout
from io import StringIO
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Moments of inertia of a rod of 1 m and 1 kg about its centre [kg m^2]; that about its axis is negligible.
ACROSS, ALONG = 1 / 12, 1e-6


class Peer(Protocol):
    """A program; ``STEPS`` has the steps [s] to try, from the longest."""

    STEPS: ClassVar[tuple[float, ...]]

    def __init__(self, n: int, step: float, rate: float, gravity: float) -> None: ...

    def run(self, times: Array) -> Array:
        """Simulate from the start; to be called once."""


class MuJoCo:
    """Hinges in a tree, the end of every coupler connected to its crank.

    Its connections are soft: their time constant is the smallest that it accepts, twice the step. The
    integrator is the faster one for these models of the two that were tried (RK4, implicitfast).
    """

    STEPS = (2e-3, 1e-3, 5e-4, 2.5e-4)

    def __init__(self, n: int, step: float, rate: float, gravity: float) -> None:
        import mujoco

        self._mujoco: Any = mujoco
        hinge, bodies = '<joint type="hinge" axis="0 -1 0"/>', ""
        for k in range(n + 1):
            coupler = (
                f'<body name="coupler{k}" pos="0 0 1">{hinge}'
                f'<inertial pos="0.5 0 0" mass="1" diaginertia="{ALONG} {ACROSS} {ACROSS}"/></body>'
            )
            bodies += (
                f'<body name="crank{k}" pos="{k} 0 0">{hinge}'
                f'<inertial pos="0 0 0.5" mass="1" diaginertia="{ACROSS} {ACROSS} {ALONG}"/>'
                f"{coupler if k < n else ''}</body>"
            )
        held = "".join(
            f'<connect body1="coupler{k}" body2="crank{k + 1}" anchor="1 0 0" solref="{2 * step} 1" '
            'solimp="0.9999 0.9999 0.001"/>'
            for k in range(n)
        )
        self._model: Any = mujoco.MjModel.from_xml_string(
            f'<mujoco><option integrator="implicitfast" timestep="{step}" gravity="0 0 -{gravity}"/>'
            f"<worldbody>{bodies}</worldbody><equality>{held}</equality></mujoco>"
        )
        self._data: Any = mujoco.MjData(self._model)
        for k in range(n + 1):
            self._data.qvel[self._hinge(f"crank{k}")] = rate
            if k < n:
                self._data.qvel[self._hinge(f"coupler{k}")] = -rate
        self._step = step

    def _hinge(self, body: str) -> int:
        """Return the number of the hinge of a body, of its angle and of its rate."""
        return int(self._model.body_jntadr[self._model.body(body).id])

    def run(self, times: Array) -> Array:
        """Simulate in steps of the integrator, which are C."""
        angles, rates = np.empty(len(times)), np.empty(len(times))
        first, steps = self._hinge("crank0"), round((times[1] - times[0]) / self._step)
        for i in range(len(times)):
            if i:
                self._mujoco.mj_step(self._model, self._data, steps)
            angles[i], rates[i] = self._data.qpos[first], self._data.qvel[first]
        return _tip(angles + np.pi / 2, rates)


class Exudyn:
    """Bodies in the plane in redundant coordinates, sparse matrices, and the generalised-alpha method.

    Joints are closed in position (index 3), where the form of index 2 stops at positions with more degrees
    of freedom. The modified Newton method and the sparse solver were the fastest that were tried, and the
    build is the one without range checks.
    """

    STEPS = (1e-2, 5e-3, 2.5e-3, 1.25e-3)

    def __init__(self, n: int, step: float, rate: float, gravity: float) -> None:
        sys.exudynFast = True  # type: ignore[attr-defined]  # selects the build without range checks
        with redirect_stdout(StringIO()):  # suppress the message of the import
            self._exudyn: Any = importlib.import_module("exudyn")
        self._items: Any = importlib.import_module("exudyn.itemInterface")
        self._container = self._exudyn.SystemContainer()
        self._system: Any = self._container.AddSystem()
        self._gravity, self._step = gravity, step
        ground = self._system.AddObject(self._items.ObjectGround())
        nodes, end = [], None
        for k in range(n + 1):
            node, crank = self._body((k, 0.5, np.pi / 2), (-rate / 2, 0.0, rate))
            nodes.append(node)
            self._joint(self._marker(ground, float(k)), self._marker(crank, -0.5))
            if end is not None:
                self._joint(end, self._marker(crank, 0.5))
            if k < n:
                _, coupler = self._body((k + 0.5, 1.0, 0.0), (-rate, 0.0, 0.0))
                self._joint(self._marker(crank, 0.5), self._marker(coupler, -0.5))
                end = self._marker(coupler, 0.5)
        kinds = self._exudyn.OutputVariableType
        self._sensors = [
            self._system.AddSensor(
                self._items.SensorNode(
                    nodeNumber=nodes[0], storeInternal=True, writeToFile=False, outputVariableType=kind
                )
            )
            for kind in (kinds.Coordinates, kinds.Coordinates_t)
        ]
        self._system.Assemble()

    def _body(self, place: tuple[float, ...], velocity: tuple[float, ...]) -> tuple[Any, Any]:
        """Return node and body of a rod with the centre and angle ``place``."""
        items, system = self._items, self._system
        node = system.AddNode(
            items.NodeRigidBody2D(referenceCoordinates=list(place), initialVelocities=list(velocity))
        )
        body = system.AddObject(items.ObjectRigidBody2D(mass=1.0, inertia=ACROSS, nodeNumber=node))
        mass = system.AddMarker(items.MarkerBodyMass(bodyNumber=body))
        weight = [0.0, -self._gravity, 0.0]
        system.AddLoad(items.LoadMassProportional(markerNumber=mass, loadVector=weight))
        return node, body

    def _marker(self, body: Any, along: float) -> Any:
        """Return a point of a body on its axis."""
        return self._system.AddMarker(
            self._items.MarkerBodyPosition(bodyNumber=body, localPosition=[along, 0.0, 0.0])
        )

    def _joint(self, one: Any, other: Any) -> None:
        self._system.AddObject(self._items.ObjectJointRevolute2D(markerNumbers=[one, other]))

    def run(self, times: Array) -> Array:
        """Simulate in one call."""
        settings = self._exudyn.SimulationSettings()
        integration = settings.timeIntegration
        integration.endTime = times[-1]
        integration.numberOfSteps = round(times[-1] / self._step)
        integration.adaptiveStep = False
        integration.newton.useModifiedNewton = True
        integration.generalizedAlpha.spectralRadius = 0.9
        settings.linearSolver.solverType = self._exudyn.LinearSolverType.EigenSparse
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = times[1]
        self._system.SolveDynamic(settings)
        angles, rates = (self._system.GetSensorStoredData(sensor)[:, 3] for sensor in self._sensors)
        return _tip(angles + np.pi / 2, rates)


class Pinocchio:
    """Revolute joints in a tree, closed by rigid constraints with the stabilisation of J. Baumgarte.

    Each coupler is numbered before the crank that it is connected to: otherwise accelerations become
    infinite (Pinocchio 4.1). The classical Runge-Kutta method is in Python, its time small against that of
    ``constraintDynamics``.
    """

    STEPS = (5e-2, 2.5e-2, 1.25e-2, 6.25e-3)
    #: Stabilisation [1/s^2, 1/s], regularisation and accuracy of the proximal method, and its iterations.
    STIFFNESS, DAMPING, PROXIMAL = 100.0, 20.0, (1e-10, 1e-8, 20)

    def __init__(self, n: int, step: float, rate: float, gravity: float) -> None:
        pin: Any = importlib.import_module("pinocchio")
        if not hasattr(pin, "RigidConstraintModel"):
            raise ImportError("another package of the name pinocchio is installed")
        model = pin.Model()
        model.gravity.linear = np.array([0.0, -gravity, 0.0])
        rod = pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), np.diag([0.0, ACROSS, ACROSS]))

        def along(x: float) -> Any:
            return pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))

        def link(parent: int, x: float, name: str) -> int:
            joint = model.addJoint(parent, pin.JointModelRZ(), along(x), name)
            model.appendBodyToJoint(joint, rod, pin.SE3.Identity())
            return int(joint)

        cranks, couplers = [link(0, 0.0, "crank0")], []
        for k in range(n):
            couplers.append(link(cranks[k], 1.0, f"coupler{k}"))
            cranks.append(link(0, k + 1.0, f"crank{k + 1}"))
        closed, data = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
        for coupler, crank in zip(couplers, cranks[1:], strict=True):
            kind, frame = pin.ContactType.CONTACT_3D, pin.ReferenceFrame.LOCAL
            closed.append(
                pin.RigidConstraintModel(kind, model, coupler, along(1.0), crank, along(1.0), frame)
            )
            closed[-1].m_baumgarte_parameters.Kp = self.STIFFNESS
            closed[-1].m_baumgarte_parameters.Kd = self.DAMPING
            data.append(closed[-1].createData())
        own, settings, nothing = model.createData(), pin.ProximalSettings(*self.PROXIMAL), np.zeros(model.nv)
        pin.initConstraintDynamics(model, own, closed, data)
        self._accelerations = lambda q, v: pin.constraintDynamics(
            model, own, q, v, nothing, closed, data, settings
        ).copy()
        self._q, self._v, self._step = np.zeros(model.nq), np.zeros(model.nv), step
        self._first = model.joints[cranks[0]].idx_q
        for joints, angle, turning in ((cranks, np.pi / 2, rate), (couplers, -np.pi / 2, -rate)):
            for joint in joints:
                at = model.joints[joint].idx_q
                self._q[at], self._v[at] = angle, turning

    def run(self, times: Array) -> Array:
        """Simulate with the classical Runge-Kutta method."""
        q, v, h, of = self._q, self._v, self._step, self._accelerations
        angles, rates = np.empty(len(times)), np.empty(len(times))
        steps = round((times[1] - times[0]) / h)
        for i in range(len(times)):
            for _ in range(steps if i else 0):
                a1 = of(q, v)
                v2 = v + h / 2 * a1
                a2 = of(q + h / 2 * v, v2)
                v3 = v + h / 2 * a2
                a3 = of(q + h / 2 * v2, v3)
                v4 = v + h * a3
                a4 = of(q + h * v3, v4)
                q, v = q + h / 6 * (v + 2 * v2 + 2 * v3 + v4), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
            angles[i], rates[i] = q[self._first], v[self._first]
        return _tip(angles, rates)


def _tip(angles: Array, rates: Array) -> Array:
    """Return position and velocity of the tip of a crank at its angle from the horizontal."""
    x, y = np.cos(angles), np.sin(angles)
    return np.stack([x, y, -rates * y, rates * x], axis=1)


#: All peers by name.
PEERS: dict[str, type[Peer]] = {"MuJoCo": MuJoCo, "Exudyn": Exudyn, "Pinocchio": Pinocchio}
