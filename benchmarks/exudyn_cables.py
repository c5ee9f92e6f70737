"""The elastic four-bar with ANCF cables in Exudyn: the optional peer of the benchmark of elastic links.

Every link consists of ``ELEMENTS`` planar cables of Exudyn (Bernoulli beams in large rotation, cubic
positions, no rotary inertia). The crank is clamped to a shaft of constant speed, the bearings are point
masses at the ends of crank and output link, and the initial velocities are those of the rigid motion. Strain
is half the thickness times the curvature at mid-length, averaged over both sides of a node. Units: ft, slug,
s and lbf.

At 20 rpm, over an eighth of a revolution, the strains with four cables per link differ from linear theory by
5 % rms in the crank and 8 to 9 % in coupler and output link, and from symgen's rods in large rotation (16 per
link, which differ as much from linear theory) by 1.1 % and 4 to 5 %. At 373 rpm the deflected linkage
amplifies any perturbation: the method is of second order and reaches 1e-4 in the first eighth of a
revolution, but over a whole one 23,040 steps differ from 92,160 by 63 % of the peak, and those from 368,640
by 17 %.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shared.elastic_reference import RIG
from shared.elastic_rigid import left, unit

Array = NDArray[np.float64]

ELEMENTS, RADIUS, SAMPLES = 2, 0.9, 91
#: Newton's relative tolerances of the timed run and of its reference, and the absolute tolerance.
LOOSE, TIGHT, ABSOLUTE = 1e-5, 1e-8, 1e-10


def exudyn_or_why() -> tuple[Any, str]:
    """Return the package, or None and the reason why it is unavailable."""
    try:
        import exudyn
    except ImportError as error:
        return None, f"{error}; 'pip install exudyn' (the extra 'peers')"
    return (
        (exudyn, "")
        if hasattr(exudyn, "SystemContainer")
        else (None, "another package of the name is installed")
    )


class Cables:
    """The assembled linkage; every solution restarts from the initial state.

    ``part`` is the fraction of a revolution, ``elements`` the number per link.
    """

    def __init__(self, exu: Any, bar: Any = RIG, part: float = 1.0, elements: int = ELEMENTS) -> None:
        self.exu, self.bar, self.time = exu, bar, part * bar.period
        self.container = exu.SystemContainer()
        self.system = self.container.AddSystem()
        self.sensors: list[list[int]] = []
        self._assemble(elements)

    def _assemble(self, elements: int) -> None:
        from exudyn import itemInterface as items

        bar, system = self.bar, self.system
        motion, Q = bar.motion(0.0), np.array([bar.d, 0.0])
        starts = np.stack([0 * Q, motion.A[0], motion.B[0]])
        rates = motion.rates[:, 0]
        velocities = np.stack([0 * Q, rates[0] * left(motion.A[0]), rates[2] * left(motion.B[0] - Q)])
        nodes = [
            self._link(starts[k], unit(motion.directions[k, 0]), velocities[k], rates[k], length, elements)
            for k, length in enumerate(motion.lengths)
        ]

        position = self._position
        ground = system.AddObject(items.ObjectGround())
        pivot = system.AddMarker(items.MarkerBodyPosition(bodyNumber=ground, localPosition=[*Q, 0.0]))
        ends = [position(own[-1]) for own in nodes]
        for pair in ((ends[0], position(nodes[1][0])), (ends[1], position(nodes[2][0])), (ends[2], pivot)):
            system.AddObject(items.RevoluteJoint2D(markerNumbers=list(pair)))
        mass = np.diag([bar.bearing, bar.bearing, 0.0, 0.0])
        for node in (nodes[0][-1], nodes[2][0]):
            system.AddObject(items.ObjectGenericODE2(nodeNumbers=[node], massMatrix=mass))
        shaft, _ = self._shaft(bar.bearing)
        clamped = [system.AddMarker(items.MarkerNodeRigid(nodeNumber=n)) for n in (nodes[0][0], shaft)]
        system.AddObject(items.GenericJoint(markerNumbers=clamped, constrainedAxes=[1, 1, 0, 0, 0, 1]))
        system.Assemble()

    def _position(self, node: int) -> int:
        from exudyn.itemInterface import MarkerNodePosition

        return int(self.system.AddMarker(MarkerNodePosition(nodeNumber=node)))

    def _coordinate(self, node: int, which: int) -> int:
        from exudyn.itemInterface import MarkerNodeCoordinate

        return int(self.system.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=which)))

    def _link(
        self, start: Array, along: Array, velocity: Array, rate: float, length: float, elements: int
    ) -> list[int]:
        """Add the cables of a link with a sensor in their middle, and return their nodes."""
        from exudyn import itemInterface as items

        bar, system, turning = self.bar, self.system, rate * left(along)
        own = [
            system.AddNode(
                items.NodePoint2DSlope1(
                    referenceCoordinates=[*(start + x * along), *along],
                    initialVelocities=[*(velocity + x * turning), *turning],
                )
            )
            for x in np.linspace(0.0, length, elements + 1)
        ]
        cables = [
            system.AddObject(
                items.ObjectANCFCable2D(
                    length=length / elements,
                    massPerLength=bar.m,
                    bendingStiffness=bar.EI,
                    axialStiffness=bar.EA,
                    nodeNumbers=list(pair),
                )
            )
            for pair in pairwise(own)
        ]
        self.sensors.append(self._middle(cables, length / elements))
        return own

    def _shaft(self, mass: float) -> tuple[int, int]:
        """Add a rigid body that rotates at constant speed about the origin; return its node and itself."""
        from exudyn import itemInterface as items

        system, coordinate = self.system, self._coordinate
        shaft = system.AddNode(items.NodeRigidBody2D(initialVelocities=[0.0, 0.0, self.bar.speed]))
        body = system.AddObject(items.ObjectRigidBody2D(mass=mass, inertia=mass, nodeNumber=shaft))
        self.rest = coordinate(system.AddNode(items.NodePointGround()), 0)
        for which in (0, 1):
            self._hold(shaft, which)
        turned = items.CoordinateConstraint(
            markerNumbers=[self.rest, coordinate(shaft, 2)], offset=self.bar.speed, velocityLevel=True
        )
        system.AddObject(turned)
        return shaft, body

    def _hold(self, node: int, which: int) -> None:
        from exudyn.itemInterface import CoordinateConstraint

        markers = [self.rest, self._coordinate(node, which)]
        self.system.AddObject(CoordinateConstraint(markerNumbers=markers))

    def _middle(self, cables: list[int], length: float) -> list[int]:
        from exudyn.itemInterface import SensorBody

        half, odd = divmod(len(cables), 2)
        places = [(cables[half], length / 2)] if odd else [(cables[half - 1], length), (cables[half], 0.0)]
        return [
            self.system.AddSensor(
                SensorBody(
                    bodyNumber=cable,
                    localPosition=[x, 0.0, 0.0],
                    storeInternal=True,
                    writeToFile=False,
                    outputVariableType=self.exu.OutputVariableType.CurvatureLocal,
                )
            )
            for cable, x in places
        ]

    def solve(self, steps: int, tolerance: float = LOOSE, absolute: float = ABSOLUTE) -> None:
        """Integrate."""
        settings = self.exu.SimulationSettings()
        integration = settings.timeIntegration
        integration.numberOfSteps, integration.endTime = steps, self.time
        integration.generalizedAlpha.spectralRadius = RADIUS
        integration.newton.relativeTolerance, integration.newton.absoluteTolerance = tolerance, absolute
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = self.time / (SAMPLES - 1)
        self.system.SolveDynamic(settings)

    def strain(self, steps: int, tolerance: float = LOOSE, absolute: float = ABSOLUTE) -> Array:
        """Integrate, and return the bending strains (links, times)."""
        self.solve(steps, tolerance, absolute)
        stored = [[self.system.GetSensorStoredData(s)[:, 1] for s in link] for link in self.sensors]
        return self.bar.half * np.array([np.mean(link, axis=0) for link in stored])


@dataclass(frozen=True)
class SliderCrank:
    """The shipped `elastic_slider_crank` without damping, in SI units."""

    speed: float = 50 * math.pi
    crank: float = 0.05
    rod: float = 0.2
    piston: float = 0.3
    half: float = 0.002
    m: float = 7850.0 * 0.012 * 0.004
    EA: float = 210e9 * 0.012 * 0.004
    EI: float = 210e9 * 0.012 * 0.004**3 / 12

    @property
    def period(self) -> float:
        """Of a revolution [s]."""
        return 2 * math.pi / self.speed


class Rod(Cables):
    """The slider-crank with a rod of cables."""

    def __init__(
        self, exu: Any, bar: Any = SliderCrank(), part: float = 1.0, elements: int = ELEMENTS
    ) -> None:
        super().__init__(exu, bar or SliderCrank(), part, elements)

    def _assemble(self, elements: int) -> None:
        from exudyn import itemInterface as items

        bar, system = self.bar, self.system
        _, crank = self._shaft(1.0)
        pin = np.array([bar.crank, 0.0])
        rate = -bar.crank * bar.speed / bar.rod
        velocity = np.array([0.0, bar.crank * bar.speed])
        nodes = self._link(pin, np.array([1.0, 0.0]), velocity, rate, bar.rod, elements)
        at = system.AddMarker(items.MarkerBodyPosition(bodyNumber=crank, localPosition=[*pin, 0.0]))
        system.AddObject(items.RevoluteJoint2D(markerNumbers=[at, self._position(nodes[0])]))
        mass = np.diag([bar.piston, bar.piston, 0.0, 0.0])
        system.AddObject(items.ObjectGenericODE2(nodeNumbers=[nodes[-1]], massMatrix=mass))
        self._hold(nodes[-1], 1)
        system.Assemble()


def difference(found: Array, truth: Array) -> float:
    """Return the largest difference of strains (links, times) relative to the peak of each link."""
    return float(np.max(np.abs(found - truth).max(axis=1) / np.abs(truth).max(axis=1)))


#: Assemblies by name, and the fraction of a revolution that they run.
LINKAGES: dict[str, tuple[type[Cables], float]] = {"four-bar": (Cables, 1 / 8), "slider-crank": (Rod, 1.0)}


class Peer:
    """Exudyn's run of a linkage; its error is against its own solution with four times the steps."""

    work = 1

    def __init__(self, exu: Any, name: str, steps: int, part: float = 0.0) -> None:
        kind, whole = LINKAGES[name]
        self.cables, self.steps, self.error = kind(exu, part=part or whole), steps, math.nan
        self.name, self.setting = f"Exudyn, {part or whole:g} of a revolution, {name}", f"alpha, {RADIUS:g}"

    def settle(self, error: float) -> None:
        """Find the smallest number of steps within an error limit, assuming second order."""
        while not self.measure() <= error:
            more = max(math.sqrt(self.error / error), 1.03)
            self.steps = (SAMPLES - 1) * math.ceil(min(more, 4.0) * self.steps / (SAMPLES - 1))

    def measure(self) -> float:
        """Measure the error."""
        found = self.cables.strain(self.steps)
        self.error = difference(found, self.cables.strain(4 * self.steps, TIGHT))
        return self.error

    def run(self) -> None:
        """Solve once."""
        self.cables.solve(self.steps)
