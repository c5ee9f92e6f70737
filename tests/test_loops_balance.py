"""Every shipped loop under Newton's and Euler's laws link by link, without screws: see ``table_vectors``.

The recorded motion closes the table with its rates and accelerations; every link obeys its laws of motion under the
recorded joint forces; joints do not push along their freedoms; action is reaction; and the drives and loads together
give what the kinetic energy takes, at every value of the input.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from jets import cross, dot
from table_vectors import TableMotion, link_power, load_wrench, moving

import symgen
from symgen.scene.loop import Loop
from symgen.scene.resolve import resolve
from symgen.scene.units import parse_quantity

SCENES = [name for name in symgen.shipped_scenes() if symgen.load_scene(name).loop is not None]
EXACT = 1e-12
#: Components of joint forces that redundant constraints leave open, as many as the loop has: 6 less the rank.
OPEN = {"planar_4r": 3, "cardan": 3, "bennett": 3, "bricard": 1, "screw_jack": 4}
#: Offsets with which the loops that have none in their scene are looked at.
VALUES = {"slider_crank": {"a4": 0.508, "alpha4": 4.2, "S1": 0.2, "ratio": 2.0}}


def size_of(unit):
    return 1.0 if unit == "1" else float(parse_quantity("1 " + unit)[0])


@dataclass
class Judged:
    """A run of a scene with all that can be recorded, and the account of it by vectors."""

    loop: Loop
    run: symgen.Result
    motion: TableMotion

    def si(self, name):
        recorded = self.run.variable(name)
        return recorded.values * size_of(recorded.unit)

    def wrench(self, row, link):
        """Recorded wrench on a link at the joint of a row, in {1} about its origin."""
        joint = f"{link}.joint{row + 1}"
        return self.motion.joint_wrench(row, self.si(f"{joint}.force"), self.si(f"{joint}.moment"))

    def on_links(self):
        """Of every joint on the link that follows it."""
        return [self.wrench(row, r.link) for row, r in enumerate(self.loop.rows)]


def everything(loop):
    names = [f"{v.name}{s}" for v in loop.variables for s in ("", ".rate", ".acceleration", ".drive")]
    links = [r.link for r in loop.rows]
    for i, link in enumerate(links):
        for side in (link, links[i - 1]):
            names += [f"{side}.joint{i + 1}.force", f"{side}.joint{i + 1}.moment"]
    return [*names, "kinetic_energy", "potential_energy", "power"]


@cache
def judged(name) -> Judged:
    scene = symgen.load_scene(name)
    loop = resolve(scene)
    data = scene.model_dump(exclude_unset=True)
    data["analysis"] = {**data.get("analysis", {}), "outputs": everything(loop)}
    model = symgen.build(symgen.Scene(**data)).with_parameters(**VALUES.get(name, {}))
    if model.is_driven:
        run = model.turn(samples=361)
    else:
        run = model.simulate(t_end=0.5, rtol=1e-10, samples=41)
    return Judged(loop, run, TableMotion(loop, moving(loop, run, size_of), model.parameters))


def largest(*arrays):
    return max(float(np.max(np.abs(a))) for a in arrays)


def test_all_loops_are_here():
    assert {"slider_crank", "planar_4r", "cardan", "rssr", "rccc", "bennett", "bricard", "cssp"} <= set(
        SCENES
    )


@pytest.mark.parametrize("name", SCENES)
def test_motion_closes_the_table(name):
    j = judged(name)
    gap, rate, acceleration = j.motion.closure()
    rates = largest(*(m.rate for m in j.motion.moving.values() if m.rate.any()))
    assert gap <= EXACT
    assert rate <= EXACT * max(1.0, rates)
    assert acceleration <= EXACT * max(1.0, rates**2)


@pytest.mark.parametrize("name", SCENES)
def test_every_link_obeys_newton_and_euler(name):
    j = judged(name)
    wrenches = j.on_links()
    force_size = max(1e-3, largest(*(f for f, _ in wrenches)))
    moment_size = max(force_size * j.loop.size, largest(*(m for _, m in wrenches)))
    for row in range(len(j.loop.rows) - 1):
        need, load = j.motion.inertia_wrench(row), load_wrench(j.motion, row, j.run.time)
        for part, size in ((0, force_size), (1, moment_size)):
            left = wrenches[row][part] - wrenches[row + 1][part] + load[part] - need[part]
            assert largest(left) <= EXACT * size


@pytest.mark.parametrize("name", SCENES)
def test_joints_push_only_where_they_hold_or_are_driven(name):
    j = judged(name)
    wrenches = j.on_links()
    for v in j.loop.variables:
        force, moment = wrenches[v.row]
        effort, drive = j.motion.effort(v.name, force, moment), j.si(f"{v.name}.drive")
        size = max(1e-3, largest(force, moment))
        assert largest(effort - drive) <= EXACT * size
        if v.effort is not None and v.effort == 0:
            assert largest(drive) <= EXACT * size


@pytest.mark.parametrize("name", SCENES)
def test_action_is_reaction(name):
    j = judged(name)
    for i, row in enumerate(j.loop.rows):
        before = j.loop.rows[i - 1].link
        for what in ("force", "moment"):
            here, there = (j.si(f"{link}.joint{i + 1}.{what}") for link in (row.link, before))
            assert np.array_equal(here, -there)


@pytest.mark.parametrize("name", SCENES)
def test_drives_and_loads_give_what_the_energy_takes(name):
    j = judged(name)
    taken, of_a_link = j.motion.kinetic_power()
    given, size = 0.0, of_a_link
    for v in j.loop.variables:
        power = j.si(f"{v.name}.drive") * j.motion.moving[v.name].rate
        given, size = given + power, np.maximum(size, np.abs(power))
    for row in range(len(j.loop.rows) - 1):
        power = link_power(j.motion, row, *load_wrench(j.motion, row, j.run.time))
        given, size = given + power, np.maximum(size, np.abs(power))
    assert largest(given - taken) <= EXACT * float(np.max(size))
    energy = j.motion.kinetic_energy()
    assert largest(j.si("kinetic_energy") - energy) <= EXACT * largest(energy)
    assert largest(j.si("power") - given) <= EXACT * float(np.max(size))


@pytest.mark.parametrize("name", SCENES)
def test_what_nothing_determines_is_reported(name):
    """Least norm is only a convention: the named components, no others, may be changed freely."""
    j = judged(name)
    if name == "cssp":
        return
    count = OPEN.get(name, 0)
    assert bool(j.run.indeterminate) == bool(count)
    assert not [n for n in j.run.indeterminate if n.endswith((".drive", ".rate", ".acceleration"))]
    if not count:
        return
    # of the closing wrench, what no freedom feels: 6 less the rank of the freedoms' axes
    axes = []
    for i in (0, 90, 271):
        rows = []
        for v in j.loop.variables:
            rows.append([j.motion.effort(v.name, f, m)[i] for f, m in unit_wrenches(j)])
        axes.append(np.linalg.matrix_rank(np.array(rows, dtype=float), tol=1e-9))
    assert 6 - max(axes) == count


def unit_wrenches(j):
    shape = j.run.time.shape
    for k in range(6):
        wrench = np.zeros((*shape, 6))
        wrench[..., k] = 1.0
        yield wrench[..., :3], wrench[..., 3:]


def test_third_joint_of_the_planar_loop_names_what_acts_across_the_plane():
    run = judged("planar_4r").run
    assert {"coupler.joint2.force.z", "coupler.joint2.moment.x", "coupler.joint2.moment.y"} <= set(
        run.indeterminate
    )
    assert not {n for n in run.indeterminate if n.endswith(("force.x", "force.y", "moment.z"))}


def test_vectors_are_vectors():
    """The judge can fail: a wrong inertia of one link shows."""
    j = judged("rssr")
    force, _ = j.motion.inertia_wrench(1)
    wrenches = j.on_links()
    left = wrenches[1][0] - wrenches[2][0] - force
    assert largest(left) < 1e-9 < 1e-3 * largest(force)
    assert largest(left + 1e-3 * force) > 1e-9
    assert largest(cross(force, force)) == 0.0
    assert largest(dot(force, force)) > 0.0
