"""Steps by collocation of rigid linkages, which have an integrator of their own."""

from __future__ import annotations

import numpy as np
import pytest

import symgen
from symgen.runtime._constrained import Rigid
from symgen.runtime.beams.layout import entries_of
from symgen.runtime.beams.methods import GAUSS8, gauss
from symgen.runtime.elastic.large.collocation import ConstrainedSystem, MotionState, SystemRun


class Rods(ConstrainedSystem):
    """A linkage of rigid rods and particles."""

    def __init__(self, model):
        d, joints = model.description, model.analysis("elastic_joints")
        blocks = {block.name: block for block in joints.info("joints").blocks}
        place = {
            f"{p}_{axis}": len(d.axes) * k + i for k, p in enumerate(d.free) for i, axis in enumerate(d.axes)
        }
        entries = [entries_of(blocks, name, place) for name in ("mass_matrix", "damping", "stiffness")]
        rows = [d.constraints.index(name) for name in blocks["jacobian"].rows]
        self._at = model.initial_state()
        scales = model.evaluator.blocks("constraints", 0.0, self._at.q, self._at.u)["constraint_scale"][rows]
        part = Rigid(model.evaluator, joints, rows, range(len(rows)), np.ravel(scales), entries)
        super().__init__(model.name, [part], np.ones(d.coordinates), len(rows), 0)

    def start(self):
        return MotionState(0.0, self._at.q, self._at.u, np.zeros(self.unknowns), np.zeros(self.multipliers))

    def prescribed(self, t):
        return np.zeros((2, len(t), 0))


@pytest.mark.parametrize("scene", ["four_bar", "peaucellier"])
def test_more_steps_have_no_larger_errors(scene):
    """Newton's method leaves no error in the rates that each step adds."""
    model = symgen.build(scene)
    final = model.simulate(1.0, rtol=1e-13, atol=1e-15, samples=2).final
    places = np.concatenate([final[p]["position"] for p in model.description.free])
    for steps in (64, 128, 256, 512, 1024):
        found = SystemRun(Rods(model), GAUSS8, np.linspace(0.0, 1.0, 2), steps).run().moments()
        np.testing.assert_allclose(found[-1].q, places, atol=1e-10)


@pytest.mark.parametrize(("stages", "counts"), [(2, (64, 128)), (4, (16, 32))])
@pytest.mark.parametrize("scene", ["four_bar", "peaucellier"])
def test_order_of_steps_of_rigid_parts_is_twice_the_number_of_stages(scene, stages, counts):
    """Of places, rates, and energy less the work of loads and drives."""
    model, times = symgen.build(scene), np.linspace(0.0, 1.0, 2)

    def end(stages, steps):
        at = SystemRun(Rods(model), gauss("", stages), times, steps, close=1e-14).run().moments()[-1]
        energies = model.evaluator.blocks("energy", at.t, at.q, at.v)
        return at.q, at.v, energies["kinetic_energy"] + energies["potential_energy"] - at.work

    exact = end(4, 128)
    errors = np.array(
        [[np.max(np.abs(x - y)) for x, y in zip(end(stages, n), exact, strict=True)] for n in counts]
    )
    orders = np.log2(errors[0] / errors[1])
    assert orders[:2] == pytest.approx(2 * stages, abs=0.8)
    assert orders[2] > 2 * stages - 0.3
