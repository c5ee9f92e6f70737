"""A run of a loop with all that can be recorded, compared with the vector equations of ``table_vectors``.

The recorded motion closes the table with its rates and accelerations; every link obeys Newton's and Euler's laws
under the recorded joint forces; joint wrenches do no work on the freedoms; action is reaction; and the power of drives
and loads is the rate of the kinetic energy, at every value of the input.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from shared.table_vectors import TableMotion, link_power, load_wrench, moving

import symgen
from symgen.scene.loop.loop import Loop
from symgen.scene.resolve import resolve
from symgen.scene.units import parse_quantity

EXACT = 1e-12


def size_of(unit):
    return 1.0 if unit == "1" else float(parse_quantity("1 " + unit)[0])


def largest(*arrays):
    return max(float(np.max(np.abs(a))) for a in arrays)


def account(scene, values=None, samples=361):
    """Run a scene with everything recorded."""
    loop = resolve(scene)
    data = scene.model_dump(exclude_unset=True)
    data["analysis"] = {**data.get("analysis", {}), "outputs": everything(loop)}
    model = symgen.build(symgen.Scene(**data)).with_parameters(**(values or {}))
    run = (
        model.inverse_dynamics(samples=samples)
        if model.is_driven
        else model.simulate(0.5, rtol=1e-10, samples=41)
    )
    return Account(loop, run, TableMotion(loop, moving(loop, run, size_of), model.parameters))


def everything(loop):
    names = [f"{v.name}{s}" for v in loop.variables for s in ("", ".rate", ".acceleration", ".drive")]
    links = [r.link for r in loop.rows]
    for i, link in enumerate(links):
        for side in (link, links[i - 1]):
            names += [f"{side}.joint{i + 1}.force", f"{side}.joint{i + 1}.moment"]
    return [*names, "kinetic_energy", "potential_energy", "power", "shaking_force", "shaking_moment"]


@dataclass
class Account:
    """A run of a scene, and the same motion by vectors."""

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
        """Wrenches of every joint on the link that follows it."""
        return [self.wrench(row, r.link) for row, r in enumerate(self.loop.rows)]

    def closes(self):
        gap, rate, acceleration = self.motion.closure()
        rates = largest(*(m.rate for m in self.motion.moving.values() if m.rate.any()))
        assert gap <= EXACT
        assert rate <= EXACT * max(1.0, rates)
        assert acceleration <= EXACT * max(1.0, rates**2)

    def links_obey_newton_and_euler(self):
        wrenches = self.on_links()
        force_size = max(1e-3, largest(*(f for f, _ in wrenches)))
        moment_size = max(force_size * self.loop.size, largest(*(m for _, m in wrenches)))
        for row in range(len(self.loop.rows) - 1):
            need, load = self.motion.inertia_wrench(row), load_wrench(self.motion, row, self.run.time)
            for part, size in ((0, force_size), (1, moment_size)):
                left = wrenches[row][part] - wrenches[row + 1][part] + load[part] - need[part]
                assert largest(left) <= EXACT * size

    def joints_push_only_where_they_hold(self):
        wrenches = self.on_links()
        for v in self.loop.variables:
            force, moment = wrenches[v.row]
            effort, drive = self.motion.effort(v.name, force, moment), self.si(f"{v.name}.drive")
            size = max(1e-3, largest(force, moment))
            assert largest(effort - drive) <= EXACT * size
            if v.effort is not None and v.effort == 0:
                assert largest(drive) <= EXACT * size

    def action_is_reaction(self):
        for i, row in enumerate(self.loop.rows):
            before = self.loop.rows[i - 1].link
            for what in ("force", "moment"):
                here, there = (self.si(f"{link}.joint{i + 1}.{what}") for link in (row.link, before))
                assert np.array_equal(here, -there)

    def the_ground_is_shaken(self):
        """By both joints on the ground, and by Newton's laws: weights and loads less inertia of all links."""
        wrenches, rows = self.on_links(), range(len(self.loop.rows) - 1)
        own = [self.motion.inertia_wrench(row) for row in rows]
        loads = [load_wrench(self.motion, row, self.run.time) for row in rows]
        for part, name in enumerate(("force", "moment")):
            found = self.si(f"shaking_{name}")
            size = max(1e-3, *(largest(w[part]) for w in (*own, *loads, *wrenches)))
            left = sum(w[part] for w in loads) - sum(w[part] for w in own)
            assert largest(found - left) <= EXACT * size
            assert largest(found - (wrenches[-1][part] - wrenches[0][part])) <= 10 * EXACT * size

    def powers_balance(self):
        taken, size = self.motion.kinetic_power()
        given = 0.0
        for v in self.loop.variables:
            power = self.si(f"{v.name}.drive") * self.motion.moving[v.name].rate
            given, size = given + power, np.maximum(size, np.abs(power))
        for row in range(len(self.loop.rows) - 1):
            power = link_power(self.motion, row, *load_wrench(self.motion, row, self.run.time))
            given, size = given + power, np.maximum(size, np.abs(power))
        assert largest(given - taken) <= EXACT * float(np.max(size))
        energy = self.motion.kinetic_energy()
        assert largest(self.si("kinetic_energy") - energy) <= EXACT * largest(energy)
        assert largest(self.si("power") - given) <= EXACT * float(np.max(size))

    def open_components(self):
        """Number of wrench components around the loop that do no work on any freedom: 6 less the rank."""
        shape, ranks = self.run.time.shape, []
        for i in (0, len(self.run.time) // 4, 3 * len(self.run.time) // 4):
            felt = np.zeros((len(self.loop.variables), 6))
            for k in range(6):
                wrench = np.zeros((*shape, 6))
                wrench[..., k] = 1.0
                felt[:, k] = [
                    self.motion.effort(v.name, wrench[..., :3], wrench[..., 3:])[i]
                    for v in self.loop.variables
                ]
            ranks.append(np.linalg.matrix_rank(felt, tol=1e-9))
        return 6 - max(ranks)

    def everything_holds(self):
        self.closes()
        self.links_obey_newton_and_euler()
        self.joints_push_only_where_they_hold()
        self.action_is_reaction()
        self.the_ground_is_shaken()
        self.powers_balance()
