"""The slider-crank in space with an elastic rod, in Exudyn and in symgen: errors, convergence and time.

The scene is ``spatial_slider_crank`` with a ball joint at the slider too, over a fifth of a revolution, and
without damping, which beams of Exudyn in space do not apply. Exudyn has its geometrically exact beam
elements, with Euler parameters at their nodes; a wheel of large inertia at constant speed moves the crank
pin. The shear stiffness there is raised until shear does not matter, since elements of symgen do not shear.
Compared is the deflection of the middle of the rod from the line between its ends, over its peak; the truth
is the run of symgen with most elements and steps. Elements of symgen are of the fourth order in bending,
and of the second in stretch, which vibrates from the abrupt start here; those of Exudyn are of the second
order.
"""

from __future__ import annotations

import math
import sys
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "tests"))

from exudyn_cables import exudyn_or_why
from harness import Case, Measurement, Required, arguments, measure, report_repeats
from numpy.typing import NDArray

import symgen
from symgen.runtime.beams.methods import GAUSS8
from symgen.runtime.elastic.large.collocation import SystemRun
from symgen.runtime.elastic.space.linkage import LinkageInSpace
from symgen.scene.loading import read_scene

Array = NDArray[np.float64]

#: Duration [s], samples, wanted error over the peak, and rounds of timing.
END, SAMPLES, ERROR, ROUNDS = 0.02, 21, 1e-2, 3
#: Elements and steps of the truth.
TRUTH = 16, 320
#: Factor of the shear stiffness, and moment of inertia of the wheel [kg m^2].
STIFFER, WHEEL = 1e2, 1e5
#: Bounds of the ratio of times, and of the order of convergence by elements.
FASTER, ORDER = 10.0, 1.7


def ball_jointed() -> symgen.Scene:
    """Return the scene without its universal joint and its damping."""
    tables = dict(read_scene("spatial_slider_crank").data)
    tables["joints"] = [joint for joint in tables["joints"] if joint["links"] == ["crank"]]
    rod = tables["links"]["rod"]
    elastic = {k: v for k, v in rod["elastic"].items() if k != "damping"}
    links = {**tables["links"], "rod": {**rod, "elastic": elastic}}
    return symgen.Scene(**{**tables, "links": links})


class Ours:
    """Runs of symgen; the equations are assembled again in each of them."""

    #: Elements of the rod, of which the first is the coarsest, and steps from which a run is chosen.
    name, elements, steps = "symgen", (2, 4, 8), (20, 40, 80, 160)

    def __init__(self) -> None:
        self.model = symgen.build(ball_jointed())

    def deflection(self, elements: int, steps: int) -> Array:
        """Return the deflection of the middle, (times, 3) [m]."""
        linkage = LinkageInSpace(self.model.rigid, elements=elements)
        times = np.linspace(0.0, END, SAMPLES)
        found = SystemRun(linkage, GAUSS8, times, steps // (SAMPLES - 1)).run().moments()
        places = linkage.links[0].places
        first, middle, last = (np.array([m.q[places[k, :3]] for m in found]) for k in (0, elements // 2, -1))
        return middle - (first + last) / 2


class Theirs:
    """Runs of Exudyn; the system is assembled again in each of them."""

    name, elements, steps = "Exudyn", (8, 16, 32), (20, 40, 80, 200, 800)

    def __init__(self, exu: Any, ours: Ours) -> None:
        self.exu, linkage = exu, LinkageInSpace(ours.model.rigid)
        at = linkage.start()
        places = linkage.links[0].places
        self.section, self.directors = linkage.links[0].section, at.q[places[0, 3:]].reshape(3, 3)
        self.ends, self.speeds = (x[places[[0, -1], :3]] for x in (at.q, at.v))
        self.rate = float(ours.model.parameters["rate"])

    def deflection(self, elements: int, steps: int) -> Array:
        """Return the deflection of the middle, (times, 3) [m]."""
        from exudyn import itemInterface as items
        from exudyn.rigidBodyUtilities import (
            AngularVelocity2EulerParameters_t,
            RotationMatrix2EulerParameters,
        )

        container = self.exu.SystemContainer()
        system = container.AddSystem()
        length, mu, j_y, j_z, axial, about_y, about_z, torsion = self.section[:8]
        section = self.exu.BeamSection()
        shear = STIFFER * axial / 3
        section.stiffnessMatrix = np.diag([axial, shear, shear, torsion, about_y, about_z])
        section.inertia, section.massPerLength = np.diag([j_y + j_z, j_y, j_z]), mu
        turned = RotationMatrix2EulerParameters(self.directors.T)
        (first, last), (speed, other) = self.ends, self.speeds
        spin = np.cross(self.directors[0], other - speed) / length
        turning = AngularVelocity2EulerParameters_t(spin, turned)
        nodes = [
            system.AddNode(
                items.NodeRigidBodyEP(
                    referenceCoordinates=[*(1 - x) * first + x * last, *turned],
                    initialVelocities=[*(1 - x) * speed + x * other, *turning],
                )
            )
            for x in np.linspace(0.0, 1.0, elements + 1)
        ]
        for pair in pairwise(nodes):
            system.AddObject(
                items.ObjectBeamGeometricallyExact(
                    nodeNumbers=list(pair), length=length / elements, sectionData=section
                )
            )
        axis = self.rate * np.array([1.0, 0.0, -1.0]) / math.sqrt(2)
        still = np.array([1.0, 0.0, 0.0, 0.0])
        wheel = system.AddNode(
            items.NodeRigidBodyEP(
                referenceCoordinates=[0.0, 0.0, 0.0, *still],
                initialVelocities=[0.0, 0.0, 0.0, *AngularVelocity2EulerParameters_t(axis, still)],
            )
        )
        body = system.AddObject(
            items.ObjectRigidBody(mass=1.0, inertia=[WHEEL, WHEEL, WHEEL, 0, 0, 0], nodeNumber=wheel)
        )
        ground = system.AddObject(items.ObjectGround())

        def ball(one: int, two: int, axes: tuple[int, int, int] = (1, 1, 1)) -> None:
            system.AddObject(items.SphericalJoint(markerNumbers=[one, two], constrainedAxes=list(axes)))

        def of_body(number: int, place: Array) -> int:
            return int(
                system.AddMarker(items.MarkerBodyPosition(bodyNumber=number, localPosition=list(place)))
            )

        of_ends = [system.AddMarker(items.MarkerNodePosition(nodeNumber=n)) for n in (nodes[0], nodes[-1])]
        ball(of_body(ground, np.zeros(3)), of_body(body, np.zeros(3)))
        ball(of_body(body, first), of_ends[0])
        mass = system.AddNode(items.NodePoint(referenceCoordinates=list(last), initialVelocities=list(other)))
        system.AddObject(items.ObjectMassPoint(mass=0.3, nodeNumber=mass))
        slider = system.AddMarker(items.MarkerNodePosition(nodeNumber=mass))
        ball(slider, of_ends[1])
        ball(of_body(ground, np.zeros(3)), slider, (0, 1, 1))
        sensors = [
            system.AddSensor(
                items.SensorNode(
                    nodeNumber=n,
                    storeInternal=True,
                    writeToFile=False,
                    outputVariableType=self.exu.OutputVariableType.Position,
                )
            )
            for n in (nodes[0], nodes[elements // 2], nodes[-1])
        ]
        system.Assemble()
        settings = self.exu.SimulationSettings()
        integration = settings.timeIntegration
        integration.numberOfSteps, integration.endTime = steps, END
        integration.generalizedAlpha.spectralRadius = 0.9
        integration.newton.useModifiedNewton = True
        settings.linearSolver.solverType = self.exu.LinearSolverType.EigenSparse
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = END / (SAMPLES - 1)
        try:
            system.SolveDynamic(settings)
        except self.exu.SolverError:  # Newton's method does not converge
            return np.full((SAMPLES, 3), math.inf)
        one, middle, two = (system.GetSensorStoredData(s)[:, 1:4] for s in sensors)
        return np.asarray(middle - (one + two) / 2)


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__, slack=True)
    return report_repeats(lambda: measured(options.slack), options)


def measured(slack: float) -> Measurement:
    """Measure once."""
    ours = Ours()
    truth = ours.deflection(*TRUTH)
    exudyn, why = exudyn_or_why()
    programs: list[Ours | Theirs] = [ours, *([Theirs(exudyn, ours)] if exudyn else [])]
    rows, required, cases, errors = [], list[Required](), dict[str, Case](), dict[str, float]()

    def error(program: Ours | Theirs, elements: int, steps: int) -> float:
        difference = program.deflection(elements, steps) - truth
        return float(np.max(np.abs(difference)) / np.max(np.abs(truth)))

    for program in programs:
        by_elements = [error(program, n, program.steps[-1]) for n in program.elements]
        chosen = next(n for n, e in zip(program.elements, by_elements, strict=True) if e <= ERROR)
        by_steps = {n: error(program, chosen, n) for n in program.steps}
        steps = next(n for n, e in by_steps.items() if e <= ERROR)
        order = math.log2(by_elements[-2] / by_elements[-1])
        required.append(Required(f"{program.name}: order by elements", order, ORDER, True))
        errors[program.name] = by_steps[steps]
        cases[program.name] = Case(partial(program.deflection, chosen, steps), 1)
        for n, e in zip(program.elements, by_elements, strict=True):
            rows.append({"program": program.name, "elements": n, "steps": program.steps[-1], "error": e})
        rows += [
            {"program": program.name, "elements": chosen, "steps": n, "error": e} for n, e in by_steps.items()
        ]
        required.append(Required(f"{program.name}: error over the peak", by_steps[steps], ERROR, False))
    times = {name: timing.processor for name, timing in measure(cases, ROUNDS, 0).items()}
    rows = [{**row, "processor time [s]": None} for row in rows]
    rows += [
        {
            "program": n,
            "elements": case.run.args[0],
            "steps": case.run.args[1],
            "error": errors[n],
            "processor time [s]": times[n],
        }
        for n, case in cases.items()
    ]
    notes = [f"Timed runs: the fewest elements and steps of each program with an error of at most {ERROR:g}."]
    if exudyn:
        ratio = times["Exudyn"] / times["symgen"]
        required.append(
            Required("faster than Exudyn at equal error", ratio, FASTER / slack, True, timed=True)
        )
    else:
        notes.append(f"Exudyn is omitted: {why}")
    return Measurement("Spatial slider-crank with an elastic rod", rows, required, notes)


if __name__ == "__main__":
    raise SystemExit(main())
