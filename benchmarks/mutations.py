"""Single faults in the derivations: each must change the result of a run, and a fast test must fail.

``python benchmarks/mutations.py`` copies the tree, and for every fault of ``FAULTS`` replaces one piece of a
file of ``symgen/mechanics`` in the copy: a sign, a factor, a missing term. The dependent equations are
regenerated, a scene and the named test are run, and the file is restored. Kernels of building blocks are not
compiled: their derived program runs in NumPy, except for those that are called by their address.
``--only WORD`` selects the faults whose file or name contains the word.

The equation of an elastic link in fixed axes (``turning_axes.py``) is for inspection, and the recursion of
chains and rigid elements are compiled blocks: no fault is put there.
"""

# ruff: noqa: E501  (the table of faults)
from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
#: Relative change of an output that counts as another result, and the longest time of one process [s].
CHANGED, PATIENCE = 1e-7, 1800
#: Outputs smaller than this, in SI, are round-off.
NOTHING = 1e-9
#: Minimum numbers of faults, in all and in elastic links.
FAULTS_WANTED, ELASTIC_WANTED = 30, 8


@dataclass(frozen=True, slots=True)
class Fault:
    """A piece of a file of ``symgen/mechanics`` and its faulty replacement.

    ``scene`` is run; one test of ``test``, a file or a name, must fail.
    """

    name: str
    file: str
    old: str
    new: str
    scene: str
    test: str


PARTICLES, LOADS = "tests/mechanics/test_particles.py", "tests/runtime/rods/test_equilibrium.py"
EULER, ROWS = "tests/mechanics/test_dual_euler.py", "tests/mechanics/test_dual_rows.py"
LOOPS = "tests/loop/test_loop_kernels.py"
HAMILTON, WEIGHTS = "tests/mechanics/test_hamilton.py", "tests/elastic/test_weights.py"
LARGE, ENERGIES = "tests/elastic/test_corotational.py", "tests/elastic/test_elastic_energies.py"
LUGS = "tests/elastic/test_offset_points.py"
SPACE = "tests/elastic/test_directors.py"
JOINED = "tests/elastic/test_joints_in_space.py"
BENT = "tests/elastic/test_statics_in_space.py::test_bending_in_both_planes_with_twist_has_the_fourth_order"
SYNTHESIS, NINE = "tests/synthesis/test_four_bar_synthesis.py", "tests/synthesis/test_nine_points.py"
SLIDERS, SPHERES = "tests/synthesis/test_slider_cranks.py", "tests/synthesis/test_spherical.py"
ARCS = "tests/synthesis/test_spherical_limits.py"
FAULTS = (
    Fault("end masses exchanged", "rods/particles.py", "EndMass(about_end / squared, between / squared, about_start / squared", "EndMass(about_start / squared, between / squared, about_end / squared", "rods", PARTICLES),
    Fault("inertia in the coupling of ends", "rods/particles.py", "centre * rest - across - inertia", "centre * rest - across + inertia", "rods", PARTICLES),
    Fault("offset left out of the ends", "rods/particles.py", "inertia + mass * part**2 + across for", "inertia + mass * part**2 for", "rods", PARTICLES),
    Fault("offset left out of the coupling", "rods/particles.py", "centre * rest - across - inertia", "centre * rest - inertia", "rods", PARTICLES),
    Fault("offset to the right", "rods/particles.py", "about_start / squared, mass * offset / length)", "about_start / squared, -mass * offset / length)", "rods", PARTICLES),
    Fault("cross product", "../symbolic/vectors.py", "return a[0] * b[1] - a[1] * b[0]", "return a[0] * b[1] + a[1] * b[0]", "rods", PARTICLES),
    Fault("weight upwards", "rods/loads.py", "return -mass * dot", "return mass * dot", "rods", LOADS),
    Fault("rotating velocity", "loop/dual_euler.py", "tuple(a + x for a, x in zip(self._rate.dual, turned", "tuple(a - x for a, x in zip(self._rate.dual, turned", "loop", EULER),
    Fault("gyroscopic moment", "loop/dual_euler.py", "cross(w, self.spin),", "cross(self.spin, w),", "loop", EULER),
    Fault("moment of the inertia force", "loop/dual_euler.py", "cross(self.body.centre, force),", "cross(force, self.body.centre),", "loop", EULER),
    Fault("inertia force doubled", "loop/dual_euler.py", "tuple(self.body.mass * x for x in rate.dual)", "tuple(2 * self.body.mass * x for x in rate.dual)", "loop", EULER),
    Fault("sum of wrenches", "loop/dual_euler.py", "wrench + inertia_wrench, WRENCH", "wrench - inertia_wrench, WRENCH", "loop", LOOPS),
    Fault("velocity at the centre", "loop/dual_euler.py", "tuple(v + x for v, x in zip(motion.dual, moved", "tuple(v - x for v, x in zip(motion.dual, moved", "loop", EULER),
    Fault("sign of efforts", "loop/dual_euler.py", "return motion.screw.dot(wrench).dual", "return -motion.screw.dot(wrench).dual", "loop", LOOPS),
    Fault("moment of a screw", "loop/dual_rows.py", "moved = cross(self.origin, real)", "moved = cross(real, self.origin)", "loop", ROWS),
    Fault("translation backwards", "loop/dual_rows.py", "[p + shift * x for", "[p - shift * x for", "loop", ROWS),
    Fault("translation on the way back", "loop/dual_rows.py", "-motion.value if back else motion.value", "motion.value", "loop", LOOPS),
    Fault("velocity on the way back doubled", "loop/dual_paths.py", "self._named(seen - m.screw * m.rate(self.rates)", "self._named(seen - m.screw * (2 * m.rate(self.rates))", "rocker", LOOPS),
    Fault("acceleration outward", "loop/dual_paths.py", "self._named(outward[-1] + of_joint,", "self._named(outward[-1] - of_joint,", "loop", LOOPS),
    Fault("acceleration on the way back", "loop/dual_paths.py", "self._named(seen - of_joint,", "self._named(seen + of_joint,", "loop", LOOPS),
    Fault("rate of screws outward", "loop/dual_paths.py", "moved = velocity + self._fixed(i)", "moved = velocity - self._fixed(i)", "loop", LOOPS),
    Fault("rate of screws on the way back", "loop/dual_paths.py", "moved = velocity - self._fixed(i)", "moved = velocity + self._fixed(i)", "loop", LOOPS),
    Fault("velocity of a turning point", "elastic/hamilton.py", 'VX.symbol + _F["u_t"] - omega * place[1]', 'VX.symbol + _F["u_t"] + omega * place[1]', "elastic", HAMILTON),
    Fault("kinetic energy doubled", "elastic/hamilton.py", "kinetic=mu * (velocity[0] ** 2 + velocity[1] ** 2) / 2 + turning", "kinetic=mu * (velocity[0] ** 2 + velocity[1] ** 2) + turning", "elastic", HAMILTON),
    Fault("rotary inertia halved", "elastic/hamilton.py", '(omega + _F["phi_t"]) ** 2 / 2', '(omega + _F["phi_t"]) ** 2 / 4', "elastic", HAMILTON),
    Fault("strain energy doubled", "elastic/hamilton.py", "for stiffness, strain in stiff)) / 2", "for stiffness, strain in stiff))", "elastic", HAMILTON),
    Fault("geometric stiffness doubled", "elastic/hamilton.py", 'stretching=force * _F["w_x"] ** 2 / 2', 'stretching=force * _F["w_x"] ** 2', "elastic", HAMILTON),
    Fault("axial force by loads", "elastic/hamilton.py", "-PX.symbol * PROFILE_BEFORE.symbol", "PX.symbol * PROFILE_BEFORE.symbol", "elastic", WEIGHTS),
    Fault("axial force by rotation", "elastic/hamilton.py", "moved - OMEGA.symbol * rigid[1]", "moved + OMEGA.symbol * rigid[1]", "elastic", WEIGHTS),
    Fault("work of loads across", "elastic/hamilton.py", "PY.symbol * place[1])", "2 * PY.symbol * place[1])", "elastic", WEIGHTS),
    Fault("follower force reversed", "elastic/hamilton.py", 'PROFILE.symbol * PX.symbol * _F["phi"]', '-PROFILE.symbol * PX.symbol * _F["phi"]', "elastic", WEIGHTS),
    Fault("loads reversed", "elastic/weights.py", "sign = -1 if order is None else 1", "sign = 1 if order is None else 1", "elastic", HAMILTON),
    Fault("Coriolis term halved", "elastic/weights.py", '("mass", "damping", "quarter", 2 * first)', '("mass", "damping", "quarter", first)', "elastic", HAMILTON),
    Fault("centripetal term reversed", "elastic/weights.py", '("mass", "stiffness", "ends", ends)', '("mass", "stiffness", "ends", -ends)', "elastic", HAMILTON),
    Fault("damping of turning ends", "elastic/weights.py", '("damping", "stiffness", "quarter", first)', '("damping", "stiffness", "quarter", -first)', "elastic", HAMILTON),
    Fault("force on the first point", "elastic/moving_frame.py", "(N0, -local(force, cosine, sine)[0])", "(N0, local(force, cosine, sine)[0])", "elastic", WEIGHTS),
    Fault("components along the link", "elastic/moving_frame.py", "cosine * vector[0] + sine * vector[1]", "cosine * vector[0] - sine * vector[1]", "elastic", WEIGHTS),
    Fault("angular acceleration", "elastic/moving_frame.py", "second.subs(known) - a_n", "second.subs(known) + a_n", "elastic", WEIGHTS),
    Fault("mass at one place", "elastic/places.py", "density.xreplace(unit)", "density.xreplace(unit) * (2 if name == 'gyroscopic' else 1)", "elastic", WEIGHTS),
    Fault("load by a mass at one place", "elastic/places.py", "density.xreplace(unit)", "density.xreplace(unit) * (-1 if name == 'load_turn' else 1)", "elastic", WEIGHTS),
    Fault("moment of inertia at one place", "elastic/places.py", "ROTARY.symbol: one", "ROTARY.symbol: 2 * one", "elastic", "tests/elastic/test_tip_inertia.py"),
    Fault("inertia of the flywheel doubled", "elastic/shaft.py", "(OMEGA.symbol + _PHI_T) ** 2 / 2", "(OMEGA.symbol + _PHI_T) ** 2", "motor", WEIGHTS),
    Fault("torque of a motor by its rate", "elastic/shaft.py", "+ sp.diff(torque, rate) * _PHI_T", "- sp.diff(torque, rate) * _PHI_T", "motor", WEIGHTS),
    Fault("couple on a section reversed", "elastic/shaft.py", "shaft(sp.Integer(0), torque", "shaft(sp.Integer(0), -torque", "elastic", "tests/elastic/test_couples.py"),
    Fault("arm of a rigid crank", "elastic/shaft.py", "sp.diff(length * c, theta)", "sp.diff(-length * c, theta)", "elastic", WEIGHTS),
    Fault("mass before a place", "elastic/beam_matrices.py", "(c, _L * _XI ** (k + 1) / (k + 1))", "(c, _L * _XI ** (k + 1))", "elastic", "tests/elements/test_elements.py"),
    Fault("integral over the element", "elastic/beam_matrices.py", "(1 - first ** (i + 1)) / (i + 1)", "(1 - first ** (i + 1)) / (i + 2)", "elastic", "tests/elements/test_elements.py"),
    Fault("rotation of the chord reversed", "elastic/corotational.py", "sp.Integer(int(x == t)) - r for", "sp.Integer(int(x == t)) + r for", "large", LARGE),
    Fault("strain by the stretched chord", "elastic/corotational.py", "axial = chord / length - 1", "axial = 1 - length / chord", "large", LARGE),
    Fault("mean slopes in the axial strain", "elastic/corotational.py", "2 * b1**2 - b1 * b2 + 2 * b2**2", "2 * b1**2 + b1 * b2 + 2 * b2**2", "large", LARGE),
    Fault("power of damping halved", "elastic/corotational.py", "stiffness * rate**2", "stiffness * rate**2 / 2", "large", LARGE),
    Fault("antisymmetric bending", "elastic/corotational.py", "3 * bending / (length", "2 * bending / (length", "large", LARGE),
    Fault("damping reversed", "elastic/corotational.py", "strain + DAMPING.symbol * rate", "strain - DAMPING.symbol * rate", "large", LARGE),
    Fault("slope of the kinetic energy left out", "elastic/corotational.py", "        - slope\n", "", "large", LARGE),
    Fault("rate of the mass matrix reversed", "elastic/corotational.py", "+ sp.Add(*(d * u for d, u in zip(slopes(momentum)", "- sp.Add(*(d * u for d, u in zip(slopes(momentum)", "large", LARGE),
    Fault("gravity on tangents reversed", "elastic/corotational.py", "ends / 2 + length * tangents / 12", "ends / 2 - length * tangents / 12", "large", LARGE),
    Fault("normals for tangents", "elastic/corotational.py", "cubic[row + 1, column + 2] * normals[j]", "-cubic[row + 1, column + 2] * normals[j]", "large", LARGE),
    Fault("coupling of end rotations", "elastic/corotational.py", "cosine[0] * cosine[1] + sine[0] * sine[1]", "cosine[0] * cosine[1] - sine[0] * sine[1]", "large", LARGE),
    Fault("rotary inertia between ends", "elastic/corotational.py", "rotary / (3 if i == j else 6)", "rotary / (3 if i == j else 3)", "large", LARGE),
    Fault("axial force of a link reversed", "elastic/nodes.py", "fixed = c * PX.symbol", "fixed = -c * PX.symbol", "large", LARGE),
    Fault("angle of a weld reversed", "elastic/nodes.py", "along = c * x - s * y", "along = c * x + s * y", "lug", LUGS),
    Fault("direction of a line reversed", "elastic/nodes.py", "sp.atan2(_Y2 - _Y1", "sp.atan2(_Y1 - _Y2", "large", LARGE),
    Fault("stretch of the chord halved", "directors/beam.py", "dot(chord, chord) - 1) / 2", "dot(chord, chord) - 1) / 4", "space", SPACE),
    Fault("twist by a sum of products", "directors/beam.py", "- dot(second[3], first[2])", "+ dot(second[3], first[2])", "space", SPACE),
    Fault("mean slopes in the axial strain", "directors/beam.py", "2 * a**2 - a * b + 2 * b**2", "2 * a**2 + a * b + 2 * b**2", "space", SPACE),
    Fault("bending planes exchanged", "directors/beam.py", "length, (in_z, in_y, torsion) = LENGTH.symbol, (q.symbol for q in (BENDING_Z, BENDING_Y, TORSION))", "length, (in_z, in_y, torsion) = LENGTH.symbol, (q.symbol for q in (BENDING_Y, BENDING_Z, TORSION))", "space", SPACE),
    Fault("antisymmetric bending", "directors/beam.py", "(slope_z, 3 * in_z / length)", "(slope_z, 2 * in_z / length)", "space", SPACE),
    Fault("angles of a longer line", "directors/beam.py", "1 - stretch + (z**2", "1 + stretch + (z**2", "bent", BENT),
    Fault("angles of the other plane reversed", "directors/beam.py", "(z**2 + y**2) / 6", "(z**2 - y**2) / 6", "bent", BENT),
    Fault("curvatures by the twist reversed", "directors/beam.py", "1 + twist**2 / 12", "1 - twist**2 / 12", "bent", BENT),
    Fault("axes that do not turn with the section", "directors/beam.py", "z1 + z2 + twist * (y1 - y2) / 3", "z1 + z2", "bent", BENT),
    Fault("rotation of the line left out of the twist", "directors/beam.py", " + z1 * y2 - y1 * z2]", "]", "bent", BENT),
    Fault("twist by a sine to the third degree", "directors/beam.py", "twist + twist**3 / 6", "twist - twist**3 / 6", "bent", BENT),
    Fault("twist within the element reversed", "directors/beam.py", "change = (in_z - in_y)", "change = (in_y - in_z)", "bent", BENT),
    Fault("twist within the element stiffer", "directors/beam.py", "torsion / (12 * length)", "torsion / (6 * length)", "bent", BENT),
    Fault("curvature by the twist within the element", "directors/beam.py", "z - change * y / 12", "z + change * y / 12", "bent", BENT),
    Fault("damping reversed", "directors/beam.py", "+ tau * strain_rates)", "- tau * strain_rates)", "space", SPACE),
    Fault("gravity on tangents reversed", "directors/beam.py", "*(-x for x in leant)", "*leant", "space", SPACE),
    Fault("inertias of fibres exchanged", "directors/beam.py", "(2, JZ.symbol), (3, JY.symbol)", "(2, JY.symbol), (3, JZ.symbol)", "space", SPACE),
    Fault("power of damping in space halved", "directors/beam.py", "tau * k * v**2", "tau * k * v**2 / 2", "space", SPACE),
    Fault("fibres of one side exchanged", "directors/beam.py", "b * y - a * z", "b * y + a * z", "space", JOINED),
    Fault("slopes of a direction by itself", "directors/directions.py", "(factors[3:], a))", "(factors[3:], b))", "space", SPACE),
    Fault("rate of gravity in rotating axes", "elastic/energies.py", "GY.symbol: -OMEGA.symbol * GX.symbol", "GY.symbol: OMEGA.symbol * GX.symbol", "weight", ENERGIES),
    Fault("lift left out of the potential", "elastic/energies.py", '-steps["gravity_work"][0] - MU.symbol * LIFT.symbol', '-steps["gravity_work"][0]', "weight", ENERGIES),
    Fault("rotation of displacements in the virtual work", "elastic/energies.py", "moved[t.test] * t.motion", 'moved[t.test] * (-1 if t.test == "w" else 1) * t.motion', "elastic", ENERGIES),
    Fault("masses along a link in its energy", "elastic/energies.py", "distribution[k] * at**power", "2 * distribution[k] * at**power", "elastic", ENERGIES),
    Fault("crank and coupler in line", "synthesis/limits.py", "*triangle(b - a, c, d, folded)", "*triangle(b - a / 2, c, d, folded)", "limits", SYNTHESIS),
    Fault("swing of the rocker doubled", "synthesis/limits.py", '- x["swing"]', '- 2 * x["swing"]', "limits", SYNTHESIS),
    Fault("cosine rule", "synthesis/limits.py", "b**2 + c**2 - 2 * b * c", "b**2 + c**2 - b * c", "limits", SYNTHESIS),
    Fault("rotation of the coupler reversed", "synthesis/points.py", "sin * joint[0] + cos * joint[1]", "cos * joint[1] - sin * joint[0]", "motion", SYNTHESIS),
    Fault("Freudenstein's ratios exchanged", "synthesis/points.py", "first * sp.cos(rocker) - second * sp.cos(crank)", "second * sp.cos(rocker) - first * sp.cos(crank)", "function", SYNTHESIS),
    Fault("time ratio inverted", "synthesis/limits.py", '(sp.pi + more) - x["time_ratio"] * (sp.pi - more)', '(sp.pi - more) - x["time_ratio"] * (sp.pi + more)', "ratio", SLIDERS),
    Fault("offset of the guide halved", "synthesis/limits.py", 'sp.sin(x[f"crank_{pose}"]) - e', 'sp.sin(x[f"crank_{pose}"]) - e / 2', "ratio", SLIDERS),
    Fault("slider across its guide", "synthesis/points.py", "sp.cos(angle) * y - sp.sin(angle) * x", "sp.cos(angle) * y + sp.sin(angle) * x", "slide", SLIDERS),
    Fault("slider's closure", "synthesis/points.py", "offset - crank * sp.sin(angle)", "offset + crank * sp.sin(angle)", "slider", SLIDERS),
    Fault("coupler of a spherical dyad turns backwards", "synthesis/points.py", "ground.dot(rotation * joint)", "ground.dot(rotation.T * joint)", "sphere", SPHERES),
    Fault("crank on a sphere turns backwards", "synthesis/points.py", "sp.rot_axis3(-crank)", "sp.rot_axis3(crank)", "spherical", SPHERES),
    Fault("spherical cosine rule", "synthesis/limits.py", "sp.sin(b) * sp.sin(c) * sp.cos(angle) - sp.cos(side)", "2 * sp.sin(b) * sp.sin(c) * sp.cos(angle) - sp.cos(side)", "arcs", ARCS),
    Fault("rotation eliminated by a wrong sign", "synthesis/points.py", "turned * back - common**2", "turned * back + common**2", "nine", NINE),
)  # fmt: skip

#: Shipped scenes that are run for faults.
SHIPPED = {"loop": "slider_crank", "rocker": "rssr", "motor": "elastic_four_bar_motor"}
SHIPPED |= dict.fromkeys(("large", "weight"), "elastic_four_bar")
#: Gravity and damping that the elastic four-bar does not have.
HEAVY = {
    "gravity.acceleration": ["2 m/s^2", "-9.81 m/s^2"],
    "links.coupler.elastic.damping": {"stiffness": "1e-4 s"},
}
#: Tasks of synthesis: a limit task of the thesis, angles of a function, and poses with given pivots.
TASKS = {
    "limits": {"kind": "limits", "swing": "60 deg", "rocker_folded": "40 deg", "transmission_least": "40 deg", "fixed_link": "1 m"},
    "function": {"kind": "function", "input": [0.3, 1.0, 1.7], "output": [1.2, 1.5, 1.9], "crank_start": 0, "rocker_start": 0},
    "motion": {
        "kind": "motion", "points": [["0 m", "0 m"], ["0.1 m", "0.2 m"], ["0.3 m", "0.3 m"]], "angles": [0.0, 0.2, 0.5],
        "ground_x": ["0 m", "1 m"], "ground_y": ["-1 m", "-1 m"],
    },
    "arcs": {"kind": "limits", "linkage": "spherical", "swing": "60 deg", "rocker_folded": "40 deg", "transmission_least": "40 deg", "fixed_link": "80 deg"},
    "ratio": {"kind": "limits", "linkage": "slider-crank", "time_ratio": 1.2, "stroke": "0.2 m", "coupler": "0.4 m"},
    "slide": {
        "kind": "motion", "linkage": "slider-crank", "points": [["0 m", "0 m"], ["0.1 m", "0.2 m"], ["0.3 m", "0.3 m"]],
        "angles": [0.0, 0.2, 0.5], "ground_x": "0 m", "ground_y": "-1 m", "guide_angle": 0.2,
    },
    "slider": {
        "kind": "function", "linkage": "slider-crank", "input": [0.3, 1.0, 1.7], "output": ["1 m", "0.8 m", "0.5 m"],
        "crank_start": 0, "slider_start": "0 m",
    },
    "sphere": {
        "kind": "motion", "linkage": "spherical", "rotations": [[0, 0, 0], [0.2, 0.1, 0.4], [0.1, 0.5, 0.9]],
        "ground_azimuth": [0, 0], "ground_elevation": ["80 deg", "5 deg"],
    },
    "spherical": {
        "kind": "function", "linkage": "spherical", "input": [0.3, 1.3, 2.3, 3.3], "output": [1.373718324206, 1.167194706524, 1.466633976774, 2.036597689368],
        "crank_start": 0, "rocker_start": 0,
    },
    "nine": {
        "kind": "path",
        "points": [[f"{x} m", f"{y} m"] for x, y in (
            (0.25, 0.00), (0.52, 0.10), (0.80, 0.70), (1.20, 1.00), (1.40, 1.30), (1.10, 1.48), (0.70, 1.40), (0.20, 1.00), (0.02, 0.40)
        )],
    },
}  # fmt: skip


def main() -> int:
    """Put in every fault, print what came of it, and return the exit code."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--only", default="", help="faults whose file or name has this word")
    options.add_argument("--probe", help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.probe:
        print(json.dumps(results(given.probe)))
        return 0
    chosen = [f for f in FAULTS if given.only in f"{f.file} {f.name}"]
    with tempfile.TemporaryDirectory() as folder:
        tree = copied(Path(folder) / "tree")
        before = {scene: probe(tree, scene) for scene in sorted({f.scene for f in chosen})}
        wrong = [scene for scene, found in before.items() if isinstance(found, str)]
        if wrong:
            raise SystemExit(f"without a fault: {before[wrong[0]]}")
        missed = [f for f in chosen if not is_caught(tree, f, before[f.scene])]
    print(f"{len(chosen)} faults, {len(missed)} not caught")
    elastic = sum(f.file.startswith("elastic/") for f in FAULTS)
    return int(bool(missed) or len(FAULTS) < FAULTS_WANTED or elastic < ELASTIC_WANTED)


def copied(tree: Path) -> Path:
    """Return a copy of the tree, compiled modules included."""
    for part in ("symgen", "generated", "templates", "tests", "benchmarks"):
        shutil.copytree(ROOT / part, tree / part, ignore=shutil.ignore_patterns("__pycache__"))
    for file in ("pyproject.toml", "setup.py", "README.md"):
        shutil.copy(ROOT / file, tree)
    for part in ("generated", "templates"):
        if not (tree / "symgen" / part).exists():
            (tree / "symgen" / part).symlink_to(tree / part)
    return tree


def is_caught(tree: Path, fault: Fault, before: Any) -> bool:
    """Insert a fault, run scene and test, restore the file, and print and return whether it is caught."""
    path = tree / "symgen" / "mechanics" / fault.file
    text = path.read_text()
    if text.count(fault.old) != 1:
        raise SystemExit(f"{fault.file} has {text.count(fault.old)} times: {fault.old}")
    began = time.perf_counter()
    try:
        path.write_text(text.replace(fault.old, fault.new))
        after = probe(tree, fault.scene)
        failed = failing(tree, fault.test)
    finally:
        path.write_text(text)
    by = after if isinstance(after, str) else f"results change by {change(before, after):.1e}"
    changed = isinstance(after, str) or change(before, after) > CHANGED
    verdict = "caught" if changed and failed else "NOT CAUGHT"
    print(
        f"{verdict}: {fault.file}: {fault.name}: {by}; {failed or 'no test fails'} "
        f"({time.perf_counter() - began:.0f} s)",
        flush=True,
    )
    return verdict == "caught"


def change(before: dict[str, list[float]], after: dict[str, list[float]]) -> float:
    """Return the largest change of an output over its largest value; infinite if an output is missing."""
    found = [0.0]
    for name, values in before.items():
        a, b = np.array(values), np.array(after.get(name, []))
        if a.shape != b.shape or not np.all(np.isfinite(b)):
            return float("inf")
        size = max(float(np.max(np.abs([a, b]), initial=0.0)), NOTHING)
        found.append(float(np.max(np.abs(a - b), initial=0.0)) / size)
    return max(found)


def _environment(tree: Path) -> dict[str, str]:
    path = os.pathsep.join([str(tree), str(tree / "tests"), str(tree / "benchmarks")])
    return {**os.environ, "PYTHONPATH": path, "SYMGEN_CACHE": str(tree.parent / "cache")}


def _done(tree: Path, command: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command,
        cwd=tree,
        env=_environment(tree),
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )


def probe(tree: Path, scene: str) -> Any:
    """Return the results of a scene in the copy, or the last line of its error."""
    command = [sys.executable, str(tree / "benchmarks" / "mutations.py"), "--probe", scene]
    done = _done(tree, command)
    if done.returncode:
        return f"refused: {(done.stderr.strip().splitlines() or ['no word'])[-1][:150]}"
    return json.loads(done.stdout.splitlines()[-1])


def failing(tree: Path, test: str) -> str:
    """Return the first of the named tests that fails, "" if none does."""
    options = ["-q", "-x", "--no-header", "-p", "no:cacheprovider", "-p", "mutations"]
    command = [sys.executable, "-m", "pytest", *options, test]
    done = _done(tree, command)
    lines = done.stdout.splitlines()
    failed = [x.split(" ")[1] for x in lines if x.startswith(("FAILED ", "ERROR "))]
    return failed[0].rpartition("/")[2] if failed else ""


def results(scene: str) -> dict[str, list[float]]:
    """Return every output of a run as a list of numbers."""
    uncompiled_blocks()
    import symgen

    if scene in TASKS:
        designs = symgen.synthesise(TASKS[scene]).designs
        return {f"design {i}": [*d.linkage.lengths.values()] for i, d in enumerate(designs)}
    file = ROOT / "tests" / "cases" / f"mutated_{scene}.toml"
    heavy = HEAVY if SHIPPED.get(scene) == "elastic_four_bar" else {}
    model = symgen.build(SHIPPED.get(scene, str(file)), set=heavy)
    if scene == "bent":
        return {name: np.ravel(x).tolist() for name, x in model.equilibrium().outputs.items()}
    if scene in ("loop", "rocker"):
        run = model.inverse_dynamics(samples=7)
    elif scene == "rods":
        run = model.simulate(0.4, samples=5)
    elif scene == "space":
        run = model.simulate(0.0005, rtol=0.5, samples=3)
    elif scene in ("large", "lug"):
        run = model.large_rotation(elements=2, revolutions=0.02, rtol=0.5, samples=3)
    else:
        run = model.simulate(method="gauss", steps=90, samples=7, revolutions=0.25)
    checks = {"rods": lambda: run.drift.energy, "weight": lambda: run.statistics["power_balance"]}
    drift = {"drift": [checks[scene]()]} if scene in checks else {}
    return drift | {v.name: np.ravel(v.values).tolist() for v in run.variables}


def uncompiled_blocks() -> None:
    """Replace the compiled kernels of building blocks by their present derivation, in NumPy."""
    from symgen.codegen.emit import emit
    from symgen.codegen.target import Target
    from symgen.lowering.program import lower_system
    from symgen.models import BLOCKS, SHIPPED_BLOCKS
    from symgen.runtime.kernels import library

    compiled, made = library.shipped_module, {}

    def module(name: str) -> Any:
        if name not in SHIPPED_BLOCKS or name == "rigid_element":  # called by its address
            return compiled(name)
        if name not in made:
            program = lower_system(BLOCKS[name]())
            (source,) = emit(program, Target("numpy"), "")
            functions: dict[str, Any] = {}
            exec(source.text, functions)

            def call(kernel: Any) -> Any:
                def evaluate(q: Any = None, u: Any = None, p: Any = None) -> Any:
                    out = np.zeros(kernel.out_size)
                    functions[kernel.name](None, q, u, p, None, out)
                    return out

                return evaluate

            made[name] = Derived(block=name, **{k.name: call(k) for k in program.kernels})
        return made[name]

    library.shipped_module = module


class Derived(SimpleNamespace):
    """Kernels of a block in NumPy; when their addresses are read, they are compiled."""

    def __getattr__(self, name: str) -> Any:
        if name != "ADDRESSES":
            raise AttributeError(name)
        self.compiled = compiled_block(self.block)
        self.ADDRESSES = self.compiled.ADDRESSES
        return self.ADDRESSES


def compiled_block(name: str) -> Any:
    """Return the kernels of a building block, derived and compiled as those of a user-defined system."""
    import symgen

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{name}.py"
        file.write_text(
            f"from symgen.models import BLOCKS\n\n\ndef system():\n    return BLOCKS[{name!r}]()\n"
        )
        model: Any = symgen.build(file)
        model.operations  # noqa: B018  (derived while the file is there)

    def call(kernel: str) -> Any:
        def evaluate(q: Any = (), u: Any = None, p: Any = (), work: Any = ()) -> Any:
            rates = np.zeros(12) if u is None else u
            blocks = model.evaluate(kernel, q=q, u=rates, p=p, work=work)
            return np.concatenate([block.ravel() for block in blocks.values()])

        return evaluate

    return SimpleNamespace(ADDRESSES=model.library.addresses, **{k: call(k) for k in model.library.addresses})


def pytest_configure() -> None:
    """As a plugin of pytest: before any module that takes kernels of blocks is loaded."""
    uncompiled_blocks()


if __name__ == "__main__":
    sys.exit(main())
