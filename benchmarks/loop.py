"""Time per crank angle of a closed spatial loop, motion and all joint forces, by symgen and by NumPy.

One evaluation covers one input value: the closure solved for all joint variables, their rates and
accelerations, every joint force, and the drive. symgen follows 36,000 angles in one call. The other route
uses the same SymPy matrices through ``lambdify(cse=True)`` for the first of the same angles, with the same
algorithm (a second-order predictor, Newton's method to closure, ``numpy.linalg`` for every linear system),
with functions of ``numpy`` and of ``math``; the faster variant is compared. Rounds are interleaved, and the
best of many is used, because other load only increases times.

Errors are the largest over all outputs and a revolution, relative to max(1, |value|) in the scene's units:
for the slider-crank against the vector model of the tests (closed form, Newton and Euler, extended
precision), for the other scenes the difference between the two routes.

In Pinocchio, the slider-crank is a tree (hinge, ball, slider) with the rod's end constrained to the slider.
Its ``constraintDynamics`` does only part of the work: from closed positions, consistent rates and the torque
it computes accelerations and the constraint force. Closing the loop and the other joint forces are not timed.
The call overhead from Python is measured on a model with a single joint, and subtracted.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp
from harness import Case, Measurement, Required, Timing, arguments, measure, report_repeats
from numpy.typing import NDArray

import symgen

sys.path.append(str(Path(__file__).parents[1] / "tests"))

from shared.crank_vectors import Crank, Motion, driven
from shared.jets import Real

Array = NDArray[np.float64]

INCH = 0.0254
#: Offsets of the slider-crank: a4 and S1 in inches, alpha4 in degrees.
OFFSETS = {"a4": 20.0, "alpha4": 232.0, "S1": 3.5}
SCENES = ("slider_crank", "rccc", "planar_4r")
ANGLES, SLOW_ANGLES, CALLS, ROUNDS = 36_000, 90, 200, 15
CLOSED, TRIES = 1e-13, 20
MICROSECONDS, FASTER, LARGEST_ERROR = 3.0, 30.0, 1e-10


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__)
    return report_repeats(measured, options)


def measured() -> Measurement:
    """Measure once."""
    loops = {name: Loop(name) for name in SCENES}
    routes = {(name, how): Lambdified(loops[name], how) for name in SCENES for how in ("numpy", "math")}
    errors: dict[Any, float] = {}
    for name, loop in loops.items():
        for how in ("numpy", "math"):
            spread = loop.angles(SLOW_ANGLES)
            errors[name, how] = difference(loop.outputs(spread), routes[name, how].follow(spread))
        errors[name, "symgen"] = errors[name, "numpy"]
    truth = turn_of_vectors(SLOW_ANGLES)
    errors["slider_crank", "symgen"] = against_vectors(loops["slider_crank"], truth, SLOW_ANGLES)
    for how in ("numpy", "math"):
        errors["slider_crank", how] += errors["slider_crank", "symgen"]

    cases: dict[Any, Case] = {(name, "symgen"): Case(loop.run, ANGLES) for name, loop in loops.items()}
    cases |= {key: Case(route.run, SLOW_ANGLES) for key, route in routes.items()}
    pin, why = peer_module()
    if pin:
        peer = Peer(pin, truth)
        cases["slider_crank", "Pinocchio"] = Case(peer.run, CALLS)
        cases["call",] = Case(partial(peer.call, CALLS), CALLS)
        errors["slider_crank", "Pinocchio"] = peer.error()
    timings = measure(cases, ROUNDS)
    overhead = timings.pop(("call",)).best if pin else 0.0

    rows = [
        _row(*key, timings[key], timings, errors, overhead)
        for key in sorted(timings, key=lambda k: (SCENES.index(k[0]), timings[k].best))
    ]
    notes = [
        f"Time of one crank angle, best and median of {ROUNDS} rounds; symgen's in a call of {ANGLES}.",
        f"Newton steps of the lambdified route per angle: {routes['slider_crank', 'numpy'].steps:.2f}.",
    ]
    if pin:
        notes += [
            f"A call of Pinocchio from Python costs at most {overhead * 1e6:.2f} us, which is subtracted. It "
            "is given closed positions, rates and the torque, and finds accelerations and one joint's force.",
            "It does not support RCCC; in the planar loop its constraints are redundant in space.",
        ]
    else:
        notes.append(f"Pinocchio is omitted: {why}")
    return Measurement(
        "A crank angle of a closed loop: positions, rates, accelerations, all joint forces",
        rows,
        required(timings, errors),
        notes,
    )


def _row(
    name: str, how: str, timing: Timing, timings: Any, errors: dict[Any, float], overhead: float
) -> dict[str, Any]:
    best = timing.best - (overhead if how == "Pinocchio" else 0.0)
    return {
        "scene": name,
        "route": how if how in ("symgen", "Pinocchio") else f"lambdify, {how}",
        "best [us]": best * 1e6,
        "median [us]": timing.median * 1e6,
        "over symgen": best / timings[name, "symgen"].best,
        "error": errors[name, how],
    }


def required(timings: Any, errors: dict[Any, float]) -> list[Required]:
    """Return the criteria: either the time or the ratio, depending on the machine; and the errors."""
    lines = []
    for name in SCENES:
        best = timings[name, "symgen"].best
        slow = min(timings[name, how].best for how in ("numpy", "math"))
        speed = max(MICROSECONDS / (best * 1e6), slow / best / FASTER)
        line = f"{name}: speed over {MICROSECONDS:g} us per angle, or over {FASTER:g} times lambdify"
        lines.append(Required(line, speed, 1.0, True, timed=True))
        lines.append(Required(f"{name}: error", errors[name, "symgen"], LARGEST_ERROR, False))
    return lines


class Loop:
    """A shipped loop over its range, by symgen."""

    def __init__(self, name: str) -> None:
        self.name, self.model = name, symgen.build(name)
        if name == "slider_crank":
            a4, S1 = OFFSETS["a4"] * INCH, OFFSETS["S1"] * INCH
            self.model = self.model.with_parameters(a4=a4, S1=S1, alpha4=math.radians(OFFSETS["alpha4"]))

    def angles(self, count: int) -> Array:
        """Return ``count`` values of the input over its range."""
        return np.linspace(*self.model.description.span, count)

    def run(self) -> None:
        """Evaluate all angles in one call."""
        self.model.inverse_dynamics(at=self.angles(ANGLES))

    def outputs(self, angles: Array) -> Array:
        """Return all outputs as columns, shape (angles, columns), in the scene's units."""
        run = self.model.inverse_dynamics(at=angles)
        return np.column_stack(
            [
                run.variable(b.name).values.reshape(len(angles), -1) / run.units.get(b.unit, (b.unit, 1.0))[1]
                for b in self.model.description.kernel("outputs").blocks
            ]
        )


class Lambdified:
    """The same loop with the same matrices, lambdified, and NumPy for every linear system."""

    def __init__(self, loop: Loop, functions: str) -> None:
        from symgen.runtime.result.records import converters

        d = loop.model.description
        system = symgen.derive(loop.name).in_numbers()
        given = [x.symbol for g in system.groups for x in g.quantities]
        self.functions: dict[str, Callable[..., list[float]]] = {}
        for export in system.exports:
            entries = [e for m in export.matrices for e in sp.Matrix(system.expanded(m))]
            self.functions[export.kernel] = sp.lambdify(given, entries, modules=functions, cse=True)
        self.parameters = list(loop.model.parameters.values())
        self.solved, self.inputs = list(d.having("dependent")), list(d.having("input"))
        self.count, self.size = d.coordinates, d.size
        # displacements over the size of the loop, to balance the rows of the equations
        self.scale = np.array([d.size if v.is_length else 1.0 for v in d.variables])
        self.rows = np.array([1.0, 1.0, 1.0, d.size, d.size, d.size])
        units, info = converters(d.units), d.kernel("outputs")
        shapes = [(units.get(b.unit, (b.unit, 1.0))[1], b.shape[0] * b.shape[1]) for b in info.blocks]
        self.units = np.repeat([size for size, _ in shapes], [n for _, n in shapes])
        begun = loop.model.inverse_dynamics(at=loop.angles(2)[:1])
        # the input is linear in time
        low, high = loop.angles(2)
        first, last = loop.model.inverse_dynamics(at=np.array([low, high])).time
        self.per_angle = (last - first) / (high - low)
        self.offset = first - low * self.per_angle
        self.piece = loop.angles(ANGLES)[:SLOW_ANGLES]
        self.start = np.array([begun.variable(v.name).values[0] for v in d.variables])
        self.steps = 0.0

    def call(self, kernel: str, t: float, q: Array, u: Array, work: Array) -> Array:
        """Return all entries of the matrices of a kernel."""
        return np.array(self.functions[kernel](t, *q, *u, *self.parameters, *work), dtype=float)

    def run(self) -> None:
        """Evaluate the first of the angles timed for symgen."""
        self.follow(self.piece)

    def follow(self, angles: Array) -> Array:
        """Follow the loop over these angles from the start of its range; return all outputs."""
        times = angles * self.per_angle + self.offset
        n, q = self.count, self.start.copy()
        u, work, before = np.zeros(n), np.zeros(n + 6), times[0]
        found, steps = [], 0
        for t in times:
            h = t - before
            q = q + h * u + h * h / 2 * work[:n]
            before = t
            moved = self.call("inputs", t, q, u, work).reshape(-1, 3)
            q[self.inputs] = moved[:, 0]
            q, taken, screws = self.close(t, q, work)
            u, work = self.motion(t, q, moved, screws)
            steps += taken
            found.append(self.call("outputs", t, q, u, work) / self.units)
        self.steps = steps / len(times)
        return np.array(found)

    def close(self, t: float, q: Array, work: Array) -> tuple[Array, int, Array]:
        """Solve the closure by Newton's method; return the pose, the steps, and the scaled screws."""
        still = np.zeros(self.count)
        for step in range(TRIES):
            entries = self.call("position", t, q, still, work)
            defect, screws = entries[:12].reshape(3, 4), entries[12:].reshape(6, -1)
            screws = screws / self.rows[:, None] * self.scale
            if max(np.max(np.abs(defect[:, :3])), np.max(np.abs(defect[:, 3])) / self.size) < CLOSED:
                return q, step, screws
            turn = [defect[2, 1] - defect[1, 2], defect[0, 2] - defect[2, 0], defect[1, 0] - defect[0, 1]]
            gap = np.concatenate([np.array(turn) / 2, defect[:, 3] / self.size])
            q = q.copy()
            q[self.solved] -= solve(screws[:, self.solved], gap) * self.scale[self.solved]
        raise ArithmeticError("the lambdified route does not close the loop")

    def motion(self, t: float, q: Array, moved: Array, screws: Array) -> tuple[Array, Array]:
        """Return rates, and accelerations with the closing wrench."""
        n, own, driving = self.count, screws[:, self.solved], screws[:, self.inputs]
        lengths, given = self.scale[self.solved], self.scale[self.inputs]
        u, work = np.zeros(n), np.zeros(n + 6)
        u[self.inputs], work[self.inputs] = moved[:, 1], moved[:, 2]
        u[self.solved] = -solve(own, driving @ (moved[:, 1] / given)) * lengths
        drift = self.call("motion", t, q, u, work)[6 * n :] / self.rows
        work[self.solved] = -solve(own, driving @ (moved[:, 2] / given) + drift) * lengths
        if "inverse" in self.functions:
            needed = self.call("inverse", t, q, u, work)
            known = self.call("given", t, q, u, work)
            # the reciprocal product of each screw with (force, moment over size) is its effort
            across = np.vstack([own[3:], own[:3]]).T
            wrench = solve(across, (known - needed)[self.solved] * lengths / self.size)
            work[n:] = np.concatenate([wrench[:3], wrench[3:] * self.size])
        return u, work


def solve(matrix: Array, rhs: Array) -> Array:
    """Solve linear equations; the minimum-norm least-squares solution if they are not square."""
    if matrix.shape[0] == matrix.shape[1]:
        return np.linalg.solve(matrix, rhs)
    return np.linalg.lstsq(matrix, rhs, rcond=1e-10)[0]


def difference(found: Array, expected: Array) -> float:
    """Return the largest difference relative to max(1, |value|)."""
    return float(np.max(np.abs(found - expected) / np.maximum(1.0, np.abs(expected))))


def turn_of_vectors(count: int) -> Motion:
    """Return the slider-crank over a revolution by the vector model, in inches and pounds."""
    crank = Crank(a4=OFFSETS["a4"], alpha4=Real(math.radians(OFFSETS["alpha4"])))
    speed = Real(50) * 8 * np.arctan(Real(1)) / 60
    return crank.motion(*driven(np.linspace(0, 2 * math.pi, count), speed, OFFSETS["S1"], 0))


def against_vectors(loop: Loop, truth: Motion, count: int) -> float:
    """Return the largest error of motion and forces against the vector model."""
    run, forces = loop.model.inverse_dynamics(at=loop.angles(count)), truth.forces()
    values = {v.name: v.values for v in run.shown} | {run.coordinate.name: run.coordinate.values}
    wrenches = {
        "F1": "crank.joint1.force",
        "T1": "crank.joint1.moment",
        "F2": "crank.joint2.force",
        "F3": "slider.joint3.force",
        "F4": "slider.joint4.force",
        "theta1.drive": "theta1.drive",
    }
    pairs = [(values[name], forces[ours]) for ours, name in wrenches.items()]
    for ours, variable in truth.variables().items():
        for suffix, part in zip(("", ".rate", ".acceleration"), variable.parts, strict=True):
            found = values[("s1" if ours == "S1" else ours) + suffix]
            if not suffix and ours[0] != "S":  # angles are continuous over whole revolutions
                found = found - 2 * math.pi * np.round((found - part.astype(float)) / (2 * math.pi))
            pairs.append((found, part))
    return max(difference(found, np.asarray(expected, dtype=float)) for found, expected in pairs)


def peer_module() -> tuple[Any, str]:
    """Return Pinocchio, or None and the reason why it is not measured."""
    try:
        import pinocchio
    except ImportError as error:
        return None, f"{error}; 'pip install pin' (the extra 'peers') where it has a wheel for this Python"
    if not hasattr(pinocchio, "constraintDynamics") or int(pinocchio.__version__.partition(".")[0]) < 4:
        return (
            None,
            "its constraintDynamics is called as of version 4, or another package of the name is installed",
        )
    return pinocchio, ""


class Peer:
    """The slider-crank in Pinocchio: a tree of hinge, ball and slider, with the rod's end on the slider."""

    def __init__(self, pin: Any, truth: Motion) -> None:
        self.pin, self.truth = pin, truth
        crank = truth.crank
        a1, a2 = crank.a1, crank.a2
        m1, m2, m3 = (float(x) for x in crank.masses)
        x = np.array([1.0, 0.0, 0.0])
        model = self.model = pin.Model()
        model.gravity.linear = np.zeros(3)
        bearing = pin.SE3(np.eye(3), np.array([0.0, 0.0, OFFSETS["S1"]]))
        first = model.addJoint(0, pin.JointModelRZ(), bearing, "crank")
        inertias = [np.array(i, dtype=float) for i in (crank.inertia_of_crank(), crank.inertia_of_rod())]
        model.appendBodyToJoint(first, pin.Inertia(m1, x * a1 / 2, inertias[0]), pin.SE3.Identity())
        ball = model.addJoint(first, pin.JointModelSpherical(), pin.SE3(np.eye(3), x * a1), "ball")
        model.appendBodyToJoint(ball, pin.Inertia(m2, x * a2 / 2, inertias[1]), pin.SE3.Identity())
        guide = pin.SE3(np.array(truth.frame4.value[0], dtype=float), -x * crank.a4)
        slider = model.addJoint(0, pin.JointModelPZ(), guide, "slider")
        model.appendBodyToJoint(slider, pin.Inertia(m3, np.zeros(3), m3 * np.eye(3)), pin.SE3.Identity())
        tie = pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D,
            model,
            ball,
            pin.SE3(np.eye(3), x * a2),
            slider,
            pin.SE3.Identity(),
            pin.ReferenceFrame.LOCAL,
        )
        self.ties, self.tie_data = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
        self.ties.append(tie)
        self.tie_data.append(tie.createData())
        self.data = model.createData()
        self.settings = pin.ProximalSettings(1e-12, 1e-14, 1)
        pin.initConstraintDynamics(model, self.data, self.ties, self.tie_data)
        self.states = [self._state(i) for i in range(len(truth.theta1.value))]
        self.single = pin.Model()
        self.single.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "one")
        self.single_data = self.single.createData()
        self.nothing = np.zeros(1)

    def _state(self, i: int) -> tuple[Array, Array, Array]:
        """Return positions, rates and efforts of the tree at an angle; the rod has no axial spin."""
        t, pin = self.truth, self.pin
        crank, rod = (np.array(f.value[i], dtype=float) for f in (t.frame2, t.frame3))
        turn = pin.Quaternion(crank.T @ rod).normalized().coeffs()
        spin = np.cross(t.u.value[i].astype(float), t.u.rate[i].astype(float))
        speed = float(t.theta1.rate[i])
        relative = rod.T @ (spin - np.array([0.0, 0.0, speed]))
        q = np.concatenate([[float(t.theta1.value[i])], turn, [-float(t.S4.value[i])]])
        v = np.concatenate([[speed], relative, [-float(t.S4.rate[i])]])
        torque = float(t.forces()["theta1.drive"][i])
        return q, v, np.array([torque, 0.0, 0.0, 0.0, 0.0])

    def accelerations(self, state: tuple[Array, Array, Array]) -> Array:
        """Return the accelerations of the constrained tree."""
        found: Array = self.pin.constraintDynamics(
            self.model, self.data, *state, self.ties, self.tie_data, self.settings
        )
        return found

    def run(self) -> None:
        """Evaluate ``CALLS`` times at successive angles."""
        for k in range(CALLS):
            self.accelerations(self.states[k % len(self.states)])

    def call(self, times: int) -> None:
        """Call the function for a model with a single joint."""
        for _ in range(times):
            self.pin.aba(self.single, self.single_data, self.nothing, self.nothing, self.nothing)

    def error(self) -> float:
        """Return the largest error of the accelerations of crank and slider, and of the constraint force."""
        t, forces, worst = self.truth, self.truth.forces(), 0.0
        for i, state in enumerate(self.states):
            found = self.accelerations(state)
            force = np.array(self.tie_data[0].contact_force.linear)
            expected = np.concatenate([[0.0, -t.S4.second[i]], forces["F3"][i]]).astype(float)
            # the constraint force acts on the rod
            worst = max(worst, difference(np.concatenate([found[[0, 4]], -force]), expected))
        return worst


if __name__ == "__main__":
    sys.exit(main())
