"""Derivatives of every shipped scene, and their errors against references with 40 digits and more."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from functools import cache, partial
from pathlib import Path

import mpmath as mp
import numpy as np
from shared import directors_exact, elastic_exact, floating_crank, loop_slopes

import symgen
from symgen.runtime.elastic.space.sensitivity import of_run
from symgen.scene.loading import SHIPPED, read_scene

#: Derivatives along runs, written by ``benchmarks/sensitivity_reference.py``.
RUNS = Path(__file__).parents[1] / "reference" / "run_slopes.json"
#: Duration of the runs of linkages over that of their scene; directions at most.
PART, DIRECTIONS = 0.05, 8
#: Scenes with elastic links in space.
IN_SPACE = ("spatial_slider_crank", "spatial_four_bar")
#: Chains whose short rods have no direction in doubles by coordinates of points: angles are held. In this part the
#: faster rod of a micrometre swings a ninth of its period.
OF_ANGLES = {"length_ratios": 0.01}
#: Scenes with directions of ten digits in doubles: every step adds as much, so that fewer steps are better.
ROUNDED = {"far_origin": 1e-11, "length_ratios": 1e-11}
#: Parameters that contradict redundant constraints: ``sensitivity`` refuses them by name.
CONTRADICTING = {"double_four_bar": ("crank", "excess")}


@dataclass(frozen=True)
class Setting:
    """The comparison of a shipped linkage: directions are parameters, ``held`` coordinates, and their rates.

    ``near`` is the start in doubles, ``start`` its values of ``held``, ``columns`` the places of coordinates in
    ``State.q``, without any where they are angles; ``sizes`` are units in which these values change.
    """

    name: str
    scene: symgen.Scene
    model: symgen.RodModel
    directions: list[str]
    coordinates: list[str]
    near: symgen.State
    start: list[Decimal]
    columns: list[int]
    sizes: list[float]
    t_end: float

    @property
    def held(self) -> list[str]:
        """Coordinates at the start and their rates."""
        return [*self.coordinates, *(f"{c}'" for c in self.coordinates)]


def setting(name: str) -> Setting:
    """Return the comparison of a shipped linkage."""
    data = dict(read_scene(SHIPPED / f"{name}.toml").data)
    data["parameters"] = {
        key: {**(value if isinstance(value, dict) else {"value": value}), "tunable": True}
        for key, value in data.get("parameters", {}).items()
    }
    scene = symgen.Scene(**data)
    model = symgen.build(scene)
    assert isinstance(model, symgen.RodModel)
    near = model.initial_state()
    coordinates, columns = _independent(model, near)
    if name in OF_ANGLES:
        coordinates, columns = [f"{link}.angle" for link in data["links"]], []
    parameters = [x for x in model.parameters if x not in CONTRADICTING.get(name, ())]
    directions = [*parameters, *coordinates, *(f"{c}'" for c in coordinates)]
    directions = directions[:: math.ceil(len(directions) / DIRECTIONS) or 1]
    drawn = np.array([*near.positions.values()])
    distances = np.linalg.norm(drawn[:, None] - drawn, axis=2)
    length = float(np.median(np.min(np.where(distances > 0, distances, np.inf), axis=1)))
    sizes = np.repeat([length, max(np.max(np.abs(near.u)), length)], len(coordinates)).tolist()
    start = [Decimal(float(x)) for x in (*near.q[columns], *near.u[columns])]
    if name in OF_ANGLES:
        start = _directions(data["links"], near)
    end = OF_ANGLES.get(name, PART) * model.description.t_end
    return Setting(name, scene, model, directions, coordinates, near, start, columns, sizes, end)


def _independent(model: symgen.Model, start: symgen.State) -> tuple[list[str], list[int]]:
    """Return components of positions that determine the pose, and their places in ``State.q``."""
    names = [f"{p}.position.{axis}" for p in model.description.free for axis in model.description.axes]
    jacobian = model.jacobian(start)
    _, values, right = np.linalg.svd(jacobian) if len(jacobian) else (0, np.zeros(0), np.eye(len(names)))
    free = right[int(np.sum(values > 1e-9 * np.max(values, initial=0.0))) :].T
    columns: list[int] = []
    left = free.copy()
    for _ in range(free.shape[1]):
        column = int(np.argmax(np.linalg.norm(left, axis=1)))
        columns.append(column)
        direction = left[column] / np.linalg.norm(left[column])
        left = left - np.outer(left @ direction, direction)
    return [names[i] for i in columns], columns


def _directions(links, start: symgen.State) -> list[Decimal]:
    """Return angles of links and their rates, zero, at a start at rest, with 60 digits."""
    assert not np.any(start.u)
    with mp.workdps(60):
        steps = [[mp.mpf(b) - mp.mpf(a) for a, b in zip(*(start.positions[p] for p in link["points"]), strict=True)]
                 for link in links.values()]  # fmt: skip
        return [*(Decimal(mp.nstr(mp.atan2(y, x), 60)) for x, y in steps), *[Decimal(0)] * len(steps)]


def stored(name):
    """The reference of a run: its end, names and derivatives (directions, outputs)."""
    return json.loads(RUNS.read_text())[name]


def of_linkage(name, method="dop853"):
    """Error of the positions at the end of a run over the largest derivative of the direction.

    A derivative that vanishes is compared with a metre over a unit of the parameter.
    """
    case, reference = setting(name), stored(name)
    outputs = [f"{p}.position.{a}" for p in case.model.description.free for a in case.model.description.axes]
    rtol = ROUNDED.get(name, 3e-14)
    options = {"coordinates": case.coordinates, "t_end": reference["t_end"], "rtol": rtol, "atol": rtol / 300}
    found = case.model.sensitivity(outputs, [*reference["by"]], method=method, **options).derivatives[0]
    expected = np.array([*reference["by"].values()], dtype=float).T
    size = np.max(np.abs(expected), axis=0)
    return float(np.max(np.abs(found - expected) / np.where(size > 0, size, 1.0)))


def of_pump():
    """Error of the pump on a floating crank at times of its run, over the largest by the direction."""
    reference, model = stored("cssp"), symgen.build(floating_crank.scene())
    outputs = ["theta1", "S1", "S4", "theta1.acceleration"]
    found = model.sensitivity(outputs, [*reference["by"]], t_eval=reference["times"], rtol=1e-13)
    expected = np.moveaxis(np.array([*reference["by"].values()], dtype=float), 0, -1)
    return float(np.max(np.abs(found.derivatives - expected) / np.abs(expected)))


def tunable_loop(scene, **more):
    """A shipped loop with all parameters of its case tunable."""
    case = loop_slopes.CASES[scene]
    changes = {f"parameters.{n}": {"value": x, "tunable": True} for n, x in case.units.items()}
    return symgen.build(scene, set=changes | more)


def of_loop(scene):
    """Error of a driven loop: over the derivative, or a thousandth of its kind's largest over the parameter."""
    case, model = loop_slopes.CASES[scene], tunable_loop(scene)
    variables = [v.name for v in model.description.variables]
    kinds = [
        *([f"{name}{suffix}" for name in variables] for suffix in ("", ".rate", ".acceleration")),
        ["theta1.drive"],
        *([f"{link}.joint{joint}.force"] for link, joint, _ in case.forces),
    ]
    parameters, worst = [*model.parameters], 0.0
    found = model.sensitivity([name for kind in kinds for name in kind], parameters, at=case.time)
    pose = {name: found.values[found.outputs.index(name)] for name in variables}
    with mp.workdps(loop_slopes.DIGITS):
        values, slopes = loop_slopes.Motion(case, case.values(), pose).slopes(parameters)
    names = [*values]
    natural = 1 / np.abs([model.parameters[name] for name in parameters])
    for kind in kinds:
        rows = [i for i, name in enumerate(found.outputs) if name in kind or name.rpartition(".")[0] in kind]
        exact = np.array([values[found.outputs[i]] for i in rows])
        largest = max(np.max(np.abs(exact)), 1e-9)  # the jack has no accelerations
        assert np.all(np.abs(found.values[rows] - exact) <= 1e-12 * largest)
        expected = slopes[[names.index(found.outputs[i]) for i in rows]]
        size = np.abs(expected) + 1e-3 * largest * natural
        worst = max(worst, float(np.max(np.abs(found.derivatives[rows] - expected) / size)))
    return worst


INCH, POUND = mp.mpf("0.0254"), mp.mpf("4.4482216152605")
CRANK, ROD = 12 * INCH, 50 * INCH
ROD_MASS, SLIDER_MASS = (mp.mpf("0.28") / mp.mpf("386.4") * POUND / INCH * x for x in (50 * mp.pi, 27))
ROD_INERTIA = ROD_MASS * (3 * INCH**2 + ROD**2) / 12


def _slider(angle, offset, _=None):
    """Place of the slider; with alpha4 = 270 deg and S1 = 0 the loop is in a plane, the crank from its normal."""
    return CRANK * mp.sin(angle) + mp.sqrt(ROD**2 - (CRANK * mp.cos(angle) + offset) ** 2)


def _torque(angle, offset, speed):
    """Derivative of the kinetic energy by the angle at constant speed; the energy of the crank is constant."""

    def energy(x):
        def rate(f):
            return speed * mp.diff(f, x)

        along = rate(lambda y: (CRANK * mp.sin(y) + _slider(y, offset)) / 2)
        across = rate(lambda y: (CRANK * mp.cos(y) - offset) / 2)
        turning = rate(lambda y: mp.asin((CRANK * mp.cos(y) + offset) / ROD))
        sliding = rate(lambda y: _slider(y, offset))
        of_rod = ROD_MASS * (along**2 + across**2) + ROD_INERTIA * turning**2
        return (of_rod + SLIDER_MASS * sliding**2) / 2

    return mp.diff(energy, angle)


def of_slider_crank():
    """Error of the slider's place and the torque, relative to each derivative."""
    t, offset, speed = mp.mpf(0.2), 10 * INCH, 50 * 2 * mp.pi / 60
    model = symgen.build("slider_crank", set={"a4": "10 in"})
    found = model.sensitivity(["S4", "theta1.drive"], ["a4", "rpm"], at=0.2)
    with mp.workdps(40):
        exact = [
            [mp.diff(lambda e, of=of: of(speed * t, e, speed), offset),
             mp.diff(lambda w, of=of: of(w * t, offset, w), speed)]
            for of in (_slider, _torque)
        ]  # fmt: skip
    expected = np.array(exact, dtype=float)
    return float(np.max(np.abs(found.derivatives / expected - 1)))


#: Numbers of scenes that are parameters here, by key.
PLACED = {
    "elastic_four_bar_motor": {"crank.flywheel": "flywheel"},
    "elastic_slider_crank": {
        "links.rod.section.width": "width", "links.rod.section.thickness": "thickness",
        "links.rod.density": "density", "links.rod.elastic.E": "E", "masses.0.mass": "piston",
    },
    "rotating_cantilever": {
        "links.strip.section.width": "width", "links.strip.section.thickness": "thickness",
        "links.strip.density": "density", "links.strip.elastic.E": "E",
    },
    "spatial_slider_crank": {
        "links.rod.section.width": "width", "links.rod.section.thickness": "thickness",
        "links.rod.density": "density", "links.rod.elastic.E": "E", "masses.0.mass": "piston",
    },
    "spatial_four_bar": {"links.rocker.density": "density", "links.coupler.elastic.E": "E"},
}  # fmt: skip
UNITS = {
    "flywheel": "slug*ft^2", "piston": "kg", "density": "kg/m^3", "E": "Pa", "width": "m", "thickness": "m",
}  # fmt: skip


@cache
def tunable(scene):
    """A shipped scene with all parameters of the reference tunable."""
    in_space = directors_exact.cases()
    values = in_space[scene][1] if scene in in_space else elastic_exact.CASES[scene][0]
    known = read_scene(SHIPPED / f"{scene}.toml").data["parameters"]
    changes = dict(PLACED.get(scene, {}))
    for name, value in values.items():
        given = known.get(
            name, "0.5 slug*ft^2" if name == "flywheel" else f"{float(value)!r} {UNITS.get(name)}"
        )
        given = given["value"] if isinstance(given, dict) else given
        changes[f"parameters.{name}"] = {"value": given, "tunable": True}
    return symgen.build(scene, set=changes)


def of_elastic(scene, quantity="frequencies"):
    """Error over each derivative, or a thousandth of value over parameter (all of it where one vanishes)."""
    values, t = elastic_exact.CASES[scene]
    reference = json.loads(elastic_exact.REFERENCE.read_text())[quantity][scene]
    model, outputs = tunable(scene), ["frequencies"]
    if quantity == "displacements":
        outputs = [*dict.fromkeys(name.rpartition(".")[0] for name in elastic_exact.OF_JOINTS[scene])]
    found = model.sensitivity(outputs, [*values], at=t)
    count = len(reference["values"])
    exact = np.array(reference["values"], dtype=float)
    np.testing.assert_allclose(found.values[:count], exact, rtol=1e-10, atol=1e-20)
    expected = np.array([*reference["by"].values()], dtype=float).T
    natural = np.abs(exact)[:, None] / np.array([model.parameters[name] for name in values])
    size = np.abs(expected) + np.where(np.any(expected, axis=0), 1e-3, 1.0) * natural
    return float(np.max(np.abs(found.derivatives[:count] - expected) / size))


def of_space(scene, quantity="run"):
    """Error of a place and a deflection after some steps over the largest derivative of the direction.

    Or of frequencies at the start, over each derivative, or value over parameter where this is larger.
    """
    reference, model = stored(scene)[quantity], tunable(scene)
    _, values, (point, node), coordinates = directors_exact.cases()[scene]
    natural = np.abs([model.parameters[name] for name in values])
    exact = np.array(reference["values"], dtype=float)
    expected = np.array([*reference["by"].values()], dtype=float).T
    if quantity == "frequencies":
        found = model.sensitivity(["frequencies"], [*values], coordinates=coordinates)
        np.testing.assert_allclose(found.values[: len(exact)], exact, rtol=1e-9)
        size = np.maximum(np.abs(expected), exact[:, None] / natural)
        return float(np.max(np.abs(found.derivatives[: len(exact)] - expected) / size))
    times = np.array([0.0, directors_exact.END])
    outputs = [f"{point}.position", f"{node}.deflection"]
    found = of_run(model.rigid, outputs, [*values], coordinates, times, directors_exact.STEPS)
    np.testing.assert_allclose(found.values[-1], exact, rtol=1e-11, atol=1e-13)
    error = np.max(np.abs(found.derivatives[-1] - expected), axis=0)
    return float(np.max(error / np.max(np.abs(expected), axis=0)))


#: Of each scene the quantity that is differentiated, the digits of the reference, and the error.
SCENES: dict[str, tuple[str, int, Callable[[], float]]] = {
    **{
        path.stem: ("positions after a run", 40, partial(of_linkage, path.stem))
        for path in sorted(SHIPPED.glob("*.toml"))
        if path.stem in json.loads(RUNS.read_text()) and path.stem not in ("cssp", *IN_SPACE)
    },
    "cssp": ("positions and an acceleration along a run", 40, of_pump),
    **{
        name: ("motion, drive effort, joint forces", loop_slopes.DIGITS, partial(of_loop, name))
        for name in loop_slopes.CASES
    },
    "slider_crank": ("place of the slider, torque", 40, of_slider_crank),
    **{name: ("frequencies", 40, partial(of_elastic, name)) for name in elastic_exact.CASES},
    **{name: ("positions and deflection after steps", 40, partial(of_space, name)) for name in IN_SPACE},
}
