"""All accelerations of a pinned chain of N rods: the shipped recursion compared with Pinocchio's ABA.

Each case is one evaluation: uniform rods of 1 m and 1 kg in a random zigzag, with random velocities and
gravity; fixed seed. The kernel reads rod vectors and their rates, Pinocchio joint coordinates and velocities
of the same state. The kernel is timed in a C loop. ``pinocchio.aba`` is called in a Python loop in the same
process, which is its fastest path from Python. The time of a call for a model with one joint is subtracted
before the comparison, in Pinocchio's favour. Pinocchio's joints are revolute in the plane. In space they are
spherical, its fastest joint with the mobility of a rod's end (compared with universal and three-angle
joints); its rods require an axial moment of inertia, which is set to a thousandth of the transverse one.
Rounds are short and interleaved, and the best of many is used, because other load only increases times.

Trees of a scene have branches of ``BRANCH`` rods at their base, all in one state. In Pinocchio, whose data
would not fit, they are as many calls for one branch, in its favour.

Errors are against 30 digits, relative to the largest acceleration. The reference also eliminates rod by rod,
but by Gauss elimination with pivoting of each rod's bordered system; for N = 10 it is checked against the
solution of the whole system as one matrix. Pinocchio's error refers to the accelerations of points at its
own rounded coordinates, in the plane; in space its rods differ slightly.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
from harness import Case, Measurement, Required, Timing, arguments, measure, report_repeats
from numpy.typing import NDArray

import symgen
from symgen.runtime.chain.inputs import aligned, repeated
from symgen.runtime.kernels.library import shipped_module

Array = NDArray[np.float64]

MODULES = {"plane": "chain", "space": "chain_spatial"}
SIZES = (10, 100, 1000, 10_000)
PEER_SIZES = (10, 100)
TREES, BRANCH = (1000, 10_000), 100
PEER_REASON = "its data grow with the cube of N, 4 GB at N = 400"
SEED, ROUNDS = 8, 100
RODS_A_ROUND, CALLS_A_ROUND = 20_000, 20
DIGITS, GUARD = 30, 20
AXIAL = 1e-3
GRAVITY = 9.81
FASTER = {"plane": 8.0, "space": 5.0}
FLOPS = {"plane": 90, "space": 180}


def main() -> int:
    """Measure, print, and return the exit code."""
    options = arguments(__doc__, slack=True)
    return report_repeats(lambda: measured(options.slack), options)


def measured(slack: float) -> Measurement:
    """Measure once."""
    peer, why = _pinocchio()
    states = {(where, n): State(where, n) for where in MODULES for n in SIZES}
    kernels = {key: Kernel(state) for key, state in states.items()}
    batches = {where: Batch(states[where, 10]) for where in MODULES}
    peers = {key: Peer(peer, states[key]) for key in states if peer and key[1] in PEER_SIZES}

    cases: dict[Any, Case] = {("kernel", *key): Case(k.run, k.times) for key, k in kernels.items()}
    cases |= {("batch", where, 10): Case(b.run, b.times * b.lanes) for where, b in batches.items()}
    trees = {n: Tree(states["plane", BRANCH], n // BRANCH) for n in TREES}
    cases |= {("tree", "plane", n): Case(t.run, t.times) for n, t in trees.items()}
    cases |= {("peer", *key): Case(p.run, CALLS_A_ROUND) for key, p in peers.items()}
    if peer:
        cases["call",] = Case(Peer(peer, State("plane", 1)).run, CALLS_A_ROUND)
    timings = measure(cases, ROUNDS)
    overhead = timings["call",].best if peer else 0.0

    errors = {}
    for key, state in states.items():
        exact = state.exact()
        if state.n == 10:
            state.check(exact)
        errors["kernel", *key] = kernels[key].error(exact)
        if state.n == 10:
            errors["batch", *key] = batches[key[0]].error(exact)
        if key in peers and key[0] == "plane":
            errors["peer", *key] = peers[key].error()
    for n, tree in trees.items():
        errors["tree", "plane", n] = tree.error(tree.exact())
    rows = []
    for case, timing in timings.items():
        if case == ("call",):
            continue
        what, where, n = case
        known = {
            "kernel": "symgen",
            "tree": f"tree of a scene, branches of {BRANCH}",
            "batch": f"{batches[where].lanes} in lanes",
            "peer": "Pinocchio",
        }
        flops = kernels[where, 10].module.FLOPS if what != "peer" else None
        call = overhead if what == "peer" else None
        rows.append(_row(f"{where}, {known[what]}", n, timing, call, errors.get(case), flops))
    rows.sort(key=lambda row: (row["case"].partition(",")[0], row["N"]))
    notes = [
        f"Time of one evaluation, over {ROUNDS} rounds; in lanes, of one of the chains.",
        f"A call of Pinocchio from Python costs at most {overhead * 1e6:.2f} us, all its time for one joint; "
        "'less call' is the time without it, used in the comparison."
        if peer
        else f"Pinocchio is omitted: {why}",
    ]
    if not _has_wide_vectors():
        notes.append("Throughput in lanes is not checked: this processor has no vectors of eight doubles.")
    if peer:
        omitted = ", ".join(str(n) for n in SIZES if n not in PEER_SIZES)
        notes += [
            f"Pinocchio is omitted at N = {omitted}: {PEER_REASON}.",
            "In space Pinocchio's rods need inertia about their axes, which makes another chain: no error is "
            "given.",
        ]
    return Measurement(
        "All accelerations of a pinned chain of N rods",
        rows,
        _required(timings, errors, kernels, overhead, slack),
        notes,
    )


def _row(
    case: str, n: int, timing: Timing, call: float | None, error: float | None, flops: int | None
) -> dict[str, Any]:
    return {
        "case": case,
        "N": n,
        "best [s]": timing.best,
        "median [s]": timing.median,
        "less call [s]": None if call is None else timing.best - call,
        "ns per rod": timing.best / n * 1e9,
        "error": error,
        "operations": flops,
    }


def _required(timings: Any, errors: Any, kernels: Any, overhead: float, slack: float) -> list[Required]:
    lines = []
    for where in MODULES:
        per_rod = [timings["kernel", where, n].best / n for n in SIZES]
        spread = max(per_rod) / min(per_rod)
        lines.append(
            Required(f"{where}: time per rod, longest over shortest", spread, 1.5, False, timed=True)
        )
        if ("peer", where, 100) in timings:
            ratio = (timings["peer", where, 100].best - overhead) / timings["kernel", where, 100].best
            lines.append(
                Required(
                    f"{where}: faster than Pinocchio at N = 100",
                    ratio,
                    FASTER[where] / slack,
                    True,
                    timed=True,
                )
            )
            for n in TREES if where == "plane" else ():
                each = (timings["peer", where, BRANCH].best - overhead) * (n // BRANCH)
                lines.append(
                    Required(
                        f"tree of a scene, N = {n}: faster than Pinocchio",
                        each / timings["tree", where, n].best,
                        FASTER[where] / slack,
                        True,
                        timed=True,
                    )
                )
        flops = kernels[where, 10].module.FLOPS
        lines.append(Required(f"{where}: operations per rod", flops, FLOPS[where], False))
        worst = max(errors[case] for case in errors if case[0] != "peer" and case[1] == where)
        lines.append(Required(f"{where}: largest relative error", worst, 1e-12, False))
        gain = timings["kernel", where, 10].best / timings["batch", where, 10].best
        if _has_wide_vectors():
            lines.append(Required(f"{where}: throughput in lanes, N = 10", gain, 5 / slack, True, timed=True))
    return lines


def _has_wide_vectors() -> bool:
    """Return whether the processor has vectors of eight doubles, which the batch throughput requires."""
    info = Path("/proc/cpuinfo")
    return info.is_file() and "avx512f" in info.read_text(encoding="utf-8")


class State:
    """A pinned chain in the plane (x, z) or in space (x, y, z), and its state."""

    def __init__(self, where: str, n: int) -> None:
        rng = np.random.default_rng(SEED)
        self.where, self.n, self.dimension = where, n, 2 if where == "plane" else 3
        down = [0.0] * (self.dimension - 1) + [-1.0]
        along = rng.standard_normal((n, self.dimension)) * 0.5 + down
        self.along = along / np.linalg.norm(along, axis=1)[:, None]
        rates = rng.standard_normal((n, self.dimension)) * 0.3
        self.rates = rates - np.sum(rates * self.along, axis=1)[:, None] * self.along
        self.gravity = GRAVITY * np.array(down)
        self.chain = symgen.Chain(np.ones(n), np.ones(n), gravity=self.gravity)

    def exact(self) -> list[list[Any]]:
        """Return the exact accelerations of all points, eliminating from the tip to the base and back."""
        return exact(self.along, self.rates, self.gravity)

    def check(self, found: list[list[Any]]) -> None:
        """Compare with the solution of the whole system [M J^T; J 0] as one matrix."""
        n, dim = self.n, self.dimension
        with mpmath.workdps(DIGITS + GUARD):
            size = n * dim
            whole, rhs = mpmath.zeros(size + n), mpmath.zeros(size + n, 1)
            third, sixth = mpmath.mpf(1) / 3, mpmath.mpf(1) / 6
            for k in range(n):
                for i in range(dim):
                    outer, inner = k * dim + i, (k - 1) * dim + i
                    d, g = mpmath.mpf(float(self.along[k, i])), mpmath.mpf(float(self.gravity[i]))
                    whole[outer, outer] += third
                    rhs[outer] += g / 2
                    whole[outer, size + k] = whole[size + k, outer] = d
                    if k:
                        whole[inner, inner] += third
                        rhs[inner] += g / 2
                        whole[outer, inner] = whole[inner, outer] = sixth
                        whole[inner, size + k] = whole[size + k, inner] = -d
                rhs[size + k] = -sum(mpmath.mpf(float(w)) ** 2 for w in self.rates[k])
            solved = mpmath.lu_solve(whole, rhs)
            miss = max(abs(solved[k * dim + i] - found[k + 1][i]) for k in range(n) for i in range(dim))
            if miss > mpmath.mpf(10) ** -DIGITS:
                raise ArithmeticError(f"the exact solutions differ by {mpmath.nstr(miss, 3)}")


def exact(along: Any, rates: Any, gravity: Any) -> list[list[Any]]:
    """Return the accelerations of a pinned uniform chain of unit rods, to 30 digits.

    From the tip inwards, the outer point and the multiplier of each rod are eliminated by Gauss elimination
    with pivoting of the bordered system [S d; d^T 0], with right-hand sides for the load and for each axis of
    the inner point.
    """
    n, dim = len(along), len(gravity)
    with mpmath.workdps(DIGITS + GUARD):
        f, zero, third, sixth = mpmath.mpf, mpmath.mpf(0), mpmath.mpf(1) / 3, mpmath.mpf(1) / 6
        pull = [f(float(g)) / 2 for g in gravity]
        mass = [[third if i == j else zero for j in range(dim)] for i in range(dim)]
        load = list(pull)
        solved = []
        for k in range(n - 1, -1, -1):
            d = [f(x) if isinstance(x, mpmath.mpf) else f(float(x)) for x in along[k]]
            gamma = -sum((f(x) if isinstance(x, mpmath.mpf) else f(float(x))) ** 2 for x in rates[k])
            coupled = [[sixth if i == j else zero for j in range(dim)] for i in range(dim)] + [
                [-x for x in d]
            ]
            rows = [[*mass[i], d[i], load[i], *coupled[i]] for i in range(dim)]
            rows.append([*d, zero, gamma, *coupled[dim]])
            x = _gauss(rows)
            solved.append(x)
            middle = 2 * third if k else third
            mass = [
                [
                    (middle if i == j else zero) - sum(coupled[m][i] * x[m][1 + j] for m in range(dim + 1))
                    for j in range(dim)
                ]
                for i in range(dim)
            ]
            load = [
                (2 * pull[i] if k else pull[i]) - sum(coupled[m][i] * x[m][0] for m in range(dim + 1))
                for i in range(dim)
            ]
        motion = [[zero] * dim]
        for x in reversed(solved):
            a = motion[-1]
            motion.append([x[i][0] - sum(x[i][1 + j] * a[j] for j in range(dim)) for i in range(dim)])
        return motion


def _gauss(rows: list[list[Any]]) -> list[list[Any]]:
    """Solve a small dense system in place, with pivoting; the right-hand sides are appended as columns."""
    n = len(rows)
    for i in range(n):
        best = max(range(i, n), key=lambda k: abs(rows[k][i]))
        rows[i], rows[best] = rows[best], rows[i]
        pivot = rows[i][i]
        rows[i] = [x / pivot for x in rows[i]]
        for k in range(n):
            if k != i and rows[k][i]:
                factor = rows[k][i]
                rows[k] = [x - factor * y for x, y in zip(rows[k], rows[i], strict=True)]
    return [row[n:] for row in rows]


def relative_error(found: Array, truth: list[list[Any]]) -> float:
    """Return the largest error relative to the largest acceleration."""
    with mpmath.workdps(DIGITS):
        size = max(abs(x) for row in truth for x in row)
        pairs = zip(found.ravel().tolist(), (x for row in truth for x in row), strict=True)
        return float(max(abs(mpmath.mpf(a) - x) for a, x in pairs) / size)


class Kernel:
    """The shipped kernel at one state, called repeatedly from C."""

    lanes = 1

    def __init__(self, state: State) -> None:
        self.module = shipped_module(MODULES[state.where])
        self._prepare(state.chain, state.along, state.rates)

    def _prepare(self, chain: symgen.Chain, along: Array, rates: Array) -> None:
        n, dim = along.shape
        self.n, self.parents, self.times = n, chain._parents, max(1, RODS_A_ROUND // n)
        weight = np.broadcast_to(chain._weight, (n + 1, dim))
        inputs = (chain._coupling, chain._mass, weight, along, rates)
        self.inputs = [repeated(x.reshape(-1), self.lanes) for x in inputs]
        sizes = ((n + 1) * dim, n, dim, self.module.work_size(n))
        self.outputs = [aligned((size * self.lanes,)) for size in sizes]
        self.outputs[0][:] = 0.0

    def run(self) -> None:
        """Evaluate all accelerations ``times`` times."""
        self.module.accelerations(self.n, self.parents, True, *self.inputs, *self.outputs, self.times)

    def error(self, truth: list[list[Any]]) -> float:
        """Return the relative error of the accelerations, in the worst lane."""
        lanes = self.outputs[0].reshape(-1, self.lanes)
        return max(relative_error(lanes[:, i], truth) for i in range(self.lanes))


class Tree(Kernel):
    """Branches in one state at the base of a tree, read from a scene."""

    def __init__(self, branch: State, count: int) -> None:
        self.module = shipped_module(MODULES[branch.where])
        found = symgen.build_chain(symgen.Scene(**_tree(branch, count)))
        along, rates = (
            x[1:] - x[np.asarray(found.chain.parents)] for x in (found.positions, found.velocities)
        )
        self._prepare(found.chain, along, rates)
        places = (name[1:].split("_") for name in found.points[1:])
        order = np.lexsort(np.array([(int(k), int(b)) for b, k in places]).T)
        self.branches = 1 + order.reshape(count, branch.n)
        first = order[: branch.n]
        self.exact = partial(exact, along[first], rates[first], branch.gravity)

    def error(self, truth: list[list[Any]]) -> float:
        """Return the relative error of the accelerations, in the worst branch."""
        points = self.outputs[0].reshape(self.n + 1, -1)
        return max(relative_error(points[[0, *branch]], truth) for branch in self.branches)


def _tree(branch: State, count: int) -> dict[str, Any]:
    """Return the scene of a tree; point k of branch b has the name "Pb_k"."""
    end, velocity = np.cumsum(branch.along, axis=0), np.cumsum(branch.rates, axis=0)
    points: dict[str, Any] = {"base": {"at": ["0 m"] * branch.dimension, "ground": True}}
    links, start = {}, {}
    for b in range(count):
        inner = "base"
        for k in range(branch.n):
            name = f"P{b}_{k}"
            points[name] = {"at": [f"{x!r} m" for x in end[k].tolist()]}
            links[f"rod{name}"] = {"points": [inner, name], "mass": "1 kg"}
            start[name] = [f"{x!r} m/s" for x in velocity[k].tolist()]
            inner = name
    gravity = {"acceleration": [f"{g!r} m/s^2" for g in branch.gravity.tolist()]}
    return {
        "symgen": 1, "title": "a tree", "points": points, "links": links, "gravity": gravity,
        "start": {"velocities": start}, "analysis": {"t_end": "1 s"},
    }  # fmt: skip


class Batch(Kernel):
    """The same for a batch of chains in SIMD lanes, on one core."""

    def __init__(self, state: State) -> None:
        self.lanes = shipped_module(MODULES[state.where]).LANES
        super().__init__(state)

    def run(self) -> None:
        """Evaluate all accelerations of the group ``times`` times."""
        self.module.accelerations_lanes(
            self.n, None, True, *self.inputs, *self.outputs, 0, 1, True, self.times
        )


def _pinocchio() -> tuple[Any, str]:
    try:
        import pinocchio
    except ImportError as error:
        return None, f"{error}; 'pip install pin' (the extra 'peers') where it has a wheel for this Python"
    return (
        (pinocchio, "") if hasattr(pinocchio, "aba") else (None, "another package of the name is installed")
    )


class Peer:
    """The same chain in Pinocchio, with ``aba`` called in a Python loop."""

    def __init__(self, pin: Any, state: State) -> None:
        self.pin, self.state = pin, state
        self.model = pin.Model()
        self.model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
        inertia = pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), np.diag([AXIAL, 1.0, 1.0]) / 12)
        joint = pin.JointModelRY if state.where == "plane" else pin.JointModelSpherical
        parent = 0
        for k in range(state.n):
            place = pin.SE3.Identity()
            place.translation = np.array([1.0 if k else 0.0, 0.0, 0.0])
            parent = self.model.addJoint(parent, joint(), place, f"joint{k}")
            self.model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
        self.data = self.model.createData()
        self.q, self.v = _planar(state) if state.where == "plane" else _spatial(pin, state)
        self.torque = np.zeros(self.model.nv)
        self.form = pin.Convention.WORLD if state.where == "plane" else pin.Convention.LOCAL  # the faster one

    def run(self) -> None:
        """Evaluate all accelerations ``CALLS_A_ROUND`` times."""
        aba: Callable[..., Any] = self.pin.aba
        arguments = (self.model, self.data, self.q, self.v, self.torque, self.form)
        for _ in range(CALLS_A_ROUND):
            aba(*arguments)

    def error(self) -> float:
        """Return the relative error of the points' accelerations in the plane, at Pinocchio's coordinates."""
        with mpmath.workdps(DIGITS + GUARD):
            angle = speed = spin = mpmath.mpf(0)
            along, rates, found = [], [], [[mpmath.mpf(0)] * 2]
            joints = self.pin.aba(self.model, self.data, self.q, self.v, self.torque)
            for q, v, a in zip(self.q.tolist(), self.v.tolist(), joints.tolist(), strict=True):
                angle, speed, spin = angle + mpmath.mpf(q), speed + mpmath.mpf(v), spin + mpmath.mpf(a)
                d = [mpmath.cos(angle), -mpmath.sin(angle)]
                t = [-mpmath.sin(angle), -mpmath.cos(angle)]
                along.append(d)
                rates.append([speed * x for x in t])
                found.append([p + spin * x - speed**2 * y for p, x, y in zip(found[-1], t, d, strict=True)])
            truth = exact(along, rates, self.state.gravity)
            size = max(abs(x) for row in truth for x in row)
            pairs = zip((x for r in found for x in r), (x for r in truth for x in r), strict=True)
            return float(max(abs(a - b) for a, b in pairs) / size)


def _planar(state: State) -> tuple[Array, Array]:
    """Return joint angles and rates about y: a rod's direction is (cos, -sin) of the sum of the angles."""
    angles = np.arctan2(-state.along[:, 1], state.along[:, 0])
    speeds = -state.rates[:, 0] * np.sin(angles) - state.rates[:, 1] * np.cos(angles)
    return np.diff(angles, prepend=0.0), np.diff(speeds, prepend=0.0)


def _spatial(pin: Any, state: State) -> tuple[Array, Array]:
    """Return quaternions and joint velocities of rods along their x axes, without axial spin."""
    q, v = [], []
    before, turning = np.eye(3), np.zeros(3)
    for d, w in zip(state.along, state.rates, strict=True):
        turn = pin.Quaternion.FromTwoVectors(np.array([1.0, 0.0, 0.0]), d).matrix()
        spin = np.cross(d, w)
        q.append(pin.Quaternion(before.T @ turn).normalized().coeffs())
        v.append(turn.T @ (spin - turning))
        before, turning = turn, spin
    return np.concatenate(q), np.concatenate(v)


if __name__ == "__main__":
    sys.exit(main())
