"""Random single loops as scenes, and an account of their closures by plain homogeneous transformations.

Nothing of symgen evaluates a loop here: rows are products of 4x4 matrices, derivatives are differences, and
closures are searched for by Levenberg's method from many starts at once.
"""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import dataclass, field

import numpy as np

import symgen
from symgen.errors import SymgenError

VARIES = {"R": "t", "P": "s", "C": "ts", "H": "t", "S": "tea", "U": "te"}
ENTRIES = ("theta", "S", "eta", "alpha", "a")
_COLUMN = {"t": 0, "s": 1, "e": 2, "a": 3}
_TURNS = (0, 2, 3)


@dataclass
class Loop:
    """Rows of constants (rows, 5), pitches, and which entries vary: (row, column), the input first."""

    joints: list[str]
    table: np.ndarray
    pitch: np.ndarray
    places: list[tuple[int, int]] = field(default_factory=list)
    start: float = 0.0
    guess: dict[str, float] = field(default_factory=dict)

    @property
    def names(self) -> list[str]:
        return [f"{ENTRIES[c]}{r + 1}" for r, c in self.places]

    @property
    def lengths(self) -> np.ndarray:
        return np.array([c == 1 for _, c in self.places])

    def closure(self, q: np.ndarray) -> np.ndarray:
        """The product of all rows at many poses (poses, variables): (poses, 4, 4)."""
        table = np.repeat(self.table[None], len(q), axis=0)
        for k, (r, c) in enumerate(self.places):
            table[:, r, c] += q[:, k]
        table[:, :, 1] += self.pitch * table[:, :, 0]
        whole = np.repeat(np.eye(4)[None], len(q), axis=0)
        for r in range(len(self.joints)):
            theta, shift, eta, alpha, length = table[:, r].T
            for axis, angle, along in ((2, theta, shift), (1, eta, None), (0, alpha, length)):
                whole = whole @ _step(axis, angle, along)
        return whole

    def defect(self, q) -> float:
        return float(np.max(np.abs(self.closure(np.atleast_2d(q))[0] - np.eye(4))))

    def dependent_jacobian(self, q) -> np.ndarray:
        """Derivative of the closure by all variables (12, n), by central differences."""
        h, n = 1e-6, len(q)
        ends = self.closure(np.vstack([q + h * np.eye(n), q - h * np.eye(n)]))[:, :3]
        return ((ends[:n] - ends[n:]) / (2 * h)).reshape(n, 12).T

    def scene(self, name: str) -> symgen.Scene:
        rows = []
        for r, joint in enumerate(self.joints):
            row = {"joint": joint, "link": f"link{r + 1}" if r < len(self.joints) - 1 else "ground"}
            for c, entry in enumerate(ENTRIES):
                x = self.table[r, c]
                if (r, c) == self.places[0]:
                    row[entry] = self.names[0]
                elif (r, c) in self.places:
                    row[entry] = "?"
                elif x:
                    row[entry] = written(x, c in _TURNS)
            if joint == "H":
                row["pitch"] = f"{float(self.pitch[r])!r} m"
            rows.append(row)
        lead, turns = self.names[0], self.places[0][1] in _TURNS
        first = written(self.start, turns)
        loop = {
            "rows": rows,
            "inputs": {lead: "first + speed*t"},
            "range": [first, written(self.start + 0.1, turns)],
        }
        if self.guess:
            loop["start"] = {k: written(x, k[0] != "S") for k, x in self.guess.items()}
        parameters = {"first": first, "speed": "1 rad/s" if turns else "1 m/s"}
        made = symgen.Scene(parameters=parameters, loop=loop, analysis={"outputs": self.names[1:]})
        return made.called(name)


def written(x: float, turns: bool) -> str:
    """An entry as text: special angles in degrees, so that symgen takes them as exact."""
    x = float(x)
    degrees = round(math.degrees(x))
    if turns and degrees % 15 == 0 and x == math.radians(degrees):
        return f"{degrees} deg"
    return f"{x!r} {'rad' if turns else 'm'}"


def _step(axis, angle, along):
    made = np.zeros((len(angle), 4, 4))
    j, k = (axis + 1) % 3, (axis + 2) % 3
    made[:, axis, axis] = made[:, 3, 3] = 1.0
    made[:, j, j] = made[:, k, k] = np.cos(angle)
    made[:, k, j] = np.sin(angle)
    made[:, j, k] = -made[:, k, j]
    if along is not None:
        made[:, axis, 3] = along
    return made


# -- drawing ---------------------------------------------------------------------------------------------------


def draw(seed: int, with_helical: bool = False) -> Loop:
    """A random loop of one of four kinds, with special angles and zero lengths."""
    rng = np.random.default_rng([seed, int(with_helical)])
    while True:
        kind = ("any", "closed", "closed", "closed", "parallel", "spherical")[int(rng.integers(6))]
        joints = _joints(rng, kind, with_helical)
        if joints:
            break
    count, special = len(joints), 0.3 if kind == "closed" else 0.6
    table = np.zeros((count, 5))
    for r, joint in enumerate(joints):
        table[r, [1, 4]] = [_length(rng, special), _length(rng, special)]
        table[r, 3] = _angle(rng, special)
        if rng.random() < 0.15:
            table[r, 2] = _angle(rng)
        if rng.random() < 0.3:
            table[r, 0] = _angle(rng)
        if kind == "parallel":
            table[r, [2, 3]] = 0.0, math.pi * (rng.random() < 0.1)
        if kind == "spherical":
            table[r, [1, 4]] = 0.0
        for v in VARIES[joint]:
            table[r, _COLUMN[v]] = 0.0
        if joint in "SU":
            table[r, 1] = 0.0
    places = [(r, _COLUMN[v]) for r, joint in enumerate(joints) for v in VARIES[joint]]
    for r in range(count - 1):
        if joints[r] == joints[r + 1] == "S":
            table[r, 4] = table[r, 4] or 0.3
            places.remove((r, 3))
    lead = places.pop(_lead(rng, joints, places))
    leads = np.array([0.004, 0.02, 0.1, 0.4, -0.05]) / (2 * math.pi)
    pitch = np.array([rng.choice(leads) if j == "H" else 0.0 for j in joints])
    loop = Loop(joints, table, pitch, [lead, *places])
    loop.start = _length(rng) if lead[1] == 1 else _angle(rng)
    if kind == "closed" or (kind != "any" and rng.random() < 0.3):
        _close(rng, loop, kind)
    if rng.random() < 0.3:
        loop.guess = {n: round(float(rng.normal()), 2) for n in loop.names[1:] if rng.random() < 0.7}
    return loop


def _joints(rng, kind, with_helical):
    letters = {"parallel": "RRPCH", "spherical": "RRRUS"}.get(kind, "RRRPCHSU")
    count = int(rng.integers(3, 8))
    joints = [letters[int(i)] for i in rng.integers(len(letters), size=count)]
    if with_helical and "H" not in joints:
        joints[int(rng.integers(count))] = "H"
    balls = sum(a == b == "S" for a, b in itertools.pairwise(joints))
    runs = any(joints[i : i + 3] == ["S"] * 3 for i in range(count))
    dependent = sum(len(VARIES[j]) for j in joints) - balls - 1
    least = 6 if kind in ("any", "closed") and rng.random() < 0.8 else 2
    return joints if least <= dependent <= 6 and not runs else None


def _lead(rng, joints, places):
    plain = [i for i, (r, _) in enumerate(places) if joints[r] in "RPCH"] or list(range(len(places)))
    return int(rng.choice(plain))


def _angle(rng, special=0.6):
    if rng.random() < special:
        return math.radians(int(rng.choice([0, 0, 90, -90, 180, 45, 30, 60])))
    return round(float(rng.uniform(-3, 3)), 3)


def _length(rng, special=0.6):
    return (
        float(rng.choice([0.0, 0.0, 0.1, 0.2, 0.3]))
        if rng.random() < special
        else round(float(rng.uniform(-0.5, 0.5)), 3)
    )


def _close(rng, loop, kind):
    """Change constants of the last two rows so that the loop closes at a random pose."""
    unit = np.where(loop.lengths, 0.3, 2.0)
    target = rng.uniform(-1, 1, len(loop.places)) * unit
    target[0] = loop.start
    count = len(loop.joints)
    free = [(r, c) for r in (count - 2, count - 1) for c in (1, 4, *(() if kind == "parallel" else (3, 2)))]
    free = [p for p in free if p not in loop.places and not (p[1] == 1 and loop.joints[p[0]] in "SU")]
    if kind == "spherical":
        free = [p for p in free if p[1] in _TURNS]
    given = Loop(loop.joints, loop.table.copy(), loop.pitch, free)

    def at(x):
        for k, (r, c) in enumerate(loop.places):
            given.table[r, c] = target[k]
        return given.closure(x)

    poses = levenberg(at, rng.uniform(-1, 1, (40, len(free))) * np.where(given.lengths, 0.5, 3.0))
    best = min(poses, key=lambda x: np.max(np.abs(at(x[None])[0] - np.eye(4))))
    if np.max(np.abs(at(best[None])[0] - np.eye(4))) < 1e-13:
        for (r, c), x in zip(free, best, strict=True):
            loop.table[r, c] += x


# -- searching -------------------------------------------------------------------------------------------------


def levenberg(closure, starts: np.ndarray, steps: int = 60) -> np.ndarray:
    """Least squares of closure(q) - 1 from many starts at once."""
    q, n = starts.copy(), starts.shape[1]
    damping = np.full(len(q), 1e-2)

    def residual(x):
        return (closure(x)[:, :3] - np.eye(4)[:3]).reshape(len(x), 12)

    f = residual(q)
    with np.errstate(all="ignore"):
        for _ in range(steps):
            h = 1e-6
            wide = np.concatenate([q[:, None] + h * np.eye(n), q[:, None] - h * np.eye(n)], axis=1)
            ends = residual(wide.reshape(-1, n)).reshape(len(q), 2 * n, 12)
            jac = (ends[:, :n] - ends[:, n:]) / (2 * h)  # (poses, n, 12)
            size = np.sum(f * f, axis=1)
            normal = jac @ jac.transpose(0, 2, 1) + (damping * size + 1e-12)[:, None, None] * np.eye(n)
            step = np.linalg.solve(normal, (jac @ f[:, :, None]))[:, :, 0]
            tried = q - step
            found = residual(tried)
            better = np.sum(found * found, axis=1) < size
            q[better], f[better] = tried[better], found[better]
            damping = np.clip(np.where(better, damping * 0.1, damping * 10.0), 1e-12, 1e12)
    return q


def closures(loop: Loop, count: int = 120, seed: int = 1) -> np.ndarray:
    """Poses that close the loop, found from many starts; its input has its value at the start."""
    rng = np.random.default_rng(seed)
    unit = np.where(loop.lengths, 1.5, math.pi)[1:]
    starts = rng.uniform(-1, 1, (count, len(unit))) * unit
    for k, (r, c) in enumerate(loop.places[1:]):
        if c == 0 and loop.pitch[r]:
            starts[count // 2 :, k] = rng.uniform(-1.5, 1.5, count - count // 2) / loop.pitch[r]

    def at(x):
        return loop.closure(np.column_stack([np.full(len(x), loop.start), x]))

    found = levenberg(at, starts)
    closed = [x for x in found if np.max(np.abs(at(x[None])[0] - np.eye(4))) < 1e-8]
    return np.array([[loop.start, *x] for x in closed]).reshape(-1, len(loop.places))


def null_space(jacobian: np.ndarray, tolerance: float = 1e-6) -> np.ndarray:
    """Rows that span the null space of some columns."""
    _, values, right = np.linalg.svd(jacobian)
    return right[int(np.sum(values > tolerance * max(values.max(initial=0.0), 1e-300))) :]


# -- judging ---------------------------------------------------------------------------------------------------


def judge(loop: Loop, name: str, backend: str = "auto") -> tuple[str, str]:
    """Build a loop and compare with its closures; return the outcome, and the fault ('' if none)."""
    try:
        model = symgen.build(loop.scene(name), backend=backend)
    except SymgenError as error:
        return _refused(loop, str(error))
    names = [v.name for v in model.description.variables]
    q = np.array(model.closed_start().q)[[names.index(n) for n in loop.names]]
    wrong = []
    if not loop.defect(q) < 1e-10 * max(1.0, np.max(np.abs(q))):
        wrong.append(f"closed, with a defect of {loop.defect(q):.2g}")
    if abs(q[0] - loop.start) > 1e-12:
        if len(closures(loop)):
            wrong.append(f"closed where the input is {q[0]}, though it closes at {loop.start} too")
        return "built beyond the beginning", "; ".join(wrong)
    for k, pose in enumerate(model.assemblies()):
        if not loop.defect([pose[n] for n in loop.names]) < 1e-10 * max(1.0, *map(abs, pose.values())):
            wrong.append(f"assembly {k} has a defect of {loop.defect([pose[n] for n in loop.names]):.2g}")
    values = np.linalg.svd(loop.dependent_jacobian(q)[:, 1:], compute_uv=False)
    if values[-1] < 1e-9 * values[0] or len(values) < len(q) - 1:
        wrong.append("built with a freedom that nothing determines")
    wrong += _nearer(loop, q)
    return "built", "; ".join(wrong)


def _nearer(loop, q):
    """Closures nearer to the guess than the one taken, by the variables with a guess, or all."""
    by = [k for k, n in enumerate(loop.names) if n in loop.guess] or list(range(1, len(q)))
    guess = np.array([loop.guess.get(n, 0.0) for n in loop.names])
    screws = np.array([c == 0 and loop.pitch[r] != 0.0 for r, c in loop.places])

    def away(pose):
        gap = pose - guess
        gap = np.where(loop.lengths | screws, gap, (gap + np.pi) % (2 * np.pi) - np.pi)
        return np.linalg.norm(np.where(loop.lengths, gap / size, gap / np.pi)[by])

    held = loop.table[:, [1, 4]]
    size = max(np.max(np.abs(held)), *(abs(x) for n, x in loop.guess.items() if n[0] == "S"), 0.0) or 1.0
    others = [away(x) for x in closures(loop, 60)]
    nearest = min(others, default=np.inf)
    if nearest < away(q) - 1e-4:
        return [f"a closure at {nearest:.4g} of the guess, where that at {away(q):.4g} was taken"]
    return []


def _refused(loop, text):
    """Compare a refusal with the closures and the mobility of the loop."""
    what = next((w for w in ("cannot be assembled", "idle", "dead centre", "cannot follow") if w in text), "")
    if not what:
        return "other", text.partition("\n")[0]
    found = closures(loop)
    if what == "cannot be assembled":
        return what, f"refused, but it closes at {found[0]}" if len(found) else ""
    if not len(found):
        return what, ""  # symgen found a closure that the search here did not
    jacobians = [loop.dependent_jacobian(q) for q in found]
    if what == "cannot follow":
        apart = [
            np.linalg.matrix_rank(j, tol=1e-6) > np.linalg.matrix_rank(j[:, 1:], tol=1e-6) for j in jacobians
        ]
        return what, "" if any(apart) else "the input can be followed"
    named = re.findall(r"(\w+) of row", text.partition("\n")[2])
    for j in jacobians:
        space = null_space(j[:, 1:], 1e-4 if what == "dead centre" else 1e-6)
        moving = [
            n for k, n in enumerate(loop.names[1:]) if len(space) and np.max(np.abs(space[:, k])) > 1e-4
        ]
        if set(moving) == set(named):
            return what, ""
    return what, f"named {named}, moving {moving} and others"
