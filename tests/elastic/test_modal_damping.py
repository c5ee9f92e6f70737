"""Damping ratios of the modes of the assembled structure, against closed forms and balances."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import shared.elastic_scenes as bars
from scipy.linalg import eigh

import symgen
from symgen.errors import ModelError, SceneError
from symgen.runtime import _beams
from symgen.runtime.beams.pieces import whole

#: sqrt(E I / rho A) / L^2 [rad/s] of the bar of the scenes.
BENT = float(np.sqrt(bars.E * bars.INERTIA / (bars.RHO * bars.AREA)) / bars.LENGTH**2)
#: Roots of cos x cosh x = -1.
CLAMPED = np.array([1.875104068711961, 4.694091132974175])
SHIPPED = Path(symgen.__file__).parent / "scenes"


def damped(ratio):
    return f"[modal_damping]\nratio = {ratio}\n"


def shipped(folder, name, ratio, change=lambda text: text):
    file = folder / f"{name}.toml"
    file.write_text(change((SHIPPED / f"{name}.toml").read_text()) + "\n" + damped(ratio))
    return symgen.build(str(file))


def without_other_damping(text):
    return re.sub(r", damping = \{[^}]*\}", "", text)


def decays(model):
    """Eigenvalues of M z^2 + C z + K at rest, one of each pair, by rising frequency."""
    _, mass, damping, stiffness, _, _ = model.motion(True).equations().matrices(0.0, _beams.AT_REST)
    n = len(mass)
    inverse = np.linalg.inv(mass)
    matrix = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
    values = np.linalg.eigvals(matrix)
    values = values[values.imag > 0]
    return values[np.argsort(values.imag)]


@pytest.mark.parametrize("ratio", [0.03, 0.4])
def test_modes_of_a_cantilever_decay_by_their_ratio(tmp_path, ratio):
    """z = w (-ratio + i sqrt(1 - ratio^2)) with w of a clamped bar."""
    found = decays(bars.cantilever(tmp_path, ", elements = 4", more=damped(ratio)))[:2]
    exact = CLAMPED**2 * BENT
    assert found.real == pytest.approx(-ratio * exact, rel=1e-6)
    assert found.imag == pytest.approx(np.sqrt(1 - ratio**2) * exact, rel=1e-6)


def test_modes_of_a_pinned_bar_decay_by_their_ratios(tmp_path):
    """One ratio for each of the first modes; the third has none. Rigid links and a slider hold the ends."""
    file = tmp_path / "pinned.toml"
    bars.pinned(tmp_path, ", elements = 8")
    scene = next(tmp_path.glob("*.toml")).read_text()
    file.write_text(scene + "\n" + damped([0.02, 0.1]))
    model = symgen.build(str(file))
    found = decays(model)[:3]
    exact = (np.pi * np.arange(1, 4)) ** 2 * BENT
    ratios = np.array([0.02, 0.1, 0.0])
    assert found.real == pytest.approx(-ratios * exact, rel=1e-5, abs=1e-5)
    assert found.imag == pytest.approx(np.sqrt(1 - ratios**2) * exact, rel=1e-5)
    printed = model.simulate(steps=90, samples=3).statistics["damping_ratios"]
    assert printed[:3] == pytest.approx(ratios, rel=1e-9, abs=1e-12)


def test_free_vibration_of_a_bar_decays_by_its_ratio(tmp_path):
    """A tip load at the start of a run leaves a vibration of the first mode; its peaks fall as exp(-ratio w t)."""
    load = '[[forces]]\npoint = "tip"\nforce = ["0 N", "1 N"]\n[analysis]\nt_end = "0.3 s"\n'
    model = bars.cantilever(tmp_path, ", elements = 2", more=load + damped([0.05]))
    found = model.simulate(t_end=0.3, samples=1201, method="gauss", steps=2400)
    tip = found["tip.displacement"].values[:, 1]
    still = 1.0 * bars.LENGTH**3 / (3 * bars.E * bars.INERTIA)
    w, ratio = CLAMPED[0] ** 2 * BENT, 0.05
    # Halves of a period apart the first mode, which has 0.9707 of the static deflection, is at its peaks.
    t = np.pi / (w * np.sqrt(1 - ratio**2))
    first = [np.interp(k * t, found.time, tip) - still for k in (1, 2, 3)]
    expected = 0.9707 * still * np.exp(-ratio * w * t * np.arange(1, 4)) * [1, -1, 1]
    assert first == pytest.approx(expected, rel=0.04)


def test_a_bar_that_turns_is_damped_as_one_at_rest(tmp_path):
    """Its steady deflection in turning axes strains at no rate: no torque, whatever the damping."""
    loose = bars.cantilever(tmp_path, ", elements = 2", speed="40 rad/s")
    steady = loose.periodic(rtol=1e-9, samples=5)
    model = bars.cantilever(tmp_path, ", elements = 2", speed="40 rad/s", more=damped(0.2))
    assert model.modes(at=2.0).ratios == pytest.approx(0.2, rel=1e-9)
    found = model.periodic(rtol=1e-9, samples=5)
    for name in ("tip.displacement", "bar.O.force"):
        assert found[name].values == pytest.approx(steady[name].values, rel=1e-6, abs=1e-7)
    size = float(np.max(np.abs(found["bar.O.force"].values)))
    assert np.max(np.abs(found["bar.torque"].values)) < 1e-7 * size * bars.LENGTH


@pytest.mark.parametrize("angle", [0.4, 2.5])
def test_rigid_motions_in_other_poses_are_not_damped(tmp_path, angle):
    """A free crank of elastic links turns without strain: neither C nor its products with rates feel it."""
    model = shipped(tmp_path, "elastic_four_bar_free", 0.1, without_other_damping)
    motion = model.motion(True)
    equations = motion.equations()
    t = motion.time_at(angle)
    _, _, damping, stiffness, _, _ = equations.matrices(t, _beams.AT_REST)
    _, sizes, right = np.linalg.svd(stiffness)
    assert sizes[-1] < 1e-9 * sizes[0]
    assert np.abs(damping @ right[-1]).max() < 1e-8 * np.abs(damping).max()


def test_modes_of_a_linkage_have_the_ratio_where_it_starts(tmp_path):
    model = shipped(tmp_path, "thesis_four_bar", 0.02, without_other_damping)
    here, there = model.modes(), model.modes(at=float(model.motion(True).angle) + 1.0)
    assert here.ratios == pytest.approx(0.02, rel=1e-6)
    assert np.all(there.ratios > 0) and there.ratios != pytest.approx(0.02, rel=1e-3)


def in_proportion(frequencies, ratio):
    """The ratio for the first 24, above in proportion to the frequency."""
    return ratio * np.maximum(1.0, frequencies / frequencies[23])


def test_modes_above_the_24th_have_ratios_in_proportion_to_their_frequencies(tmp_path):
    model = bars.cantilever(tmp_path, ", elements = 14", more=damped(0.03))
    modes, layout = model.modes(), model.motion(True).layout
    assert modes.ratios == pytest.approx(in_proportion(modes.frequencies, 0.03), rel=1e-6)
    assert layout.apart and len(layout.damped) == 23 and layout.band < 9


def test_a_link_of_many_elements_has_its_ratio_in_its_first_modes(tmp_path):
    link = bars.cantilever(tmp_path, ", elements = 10, damping = { ratio = 0.05 }").motion(True).beams[0]
    total = whole(link.pieces, len(link.dofs))
    places = np.concatenate([piece.at for piece in link.pieces])
    forces = np.zeros((len(link.damped), len(link.dofs)))
    for mode, force in zip(forces, link.damped, strict=True):
        np.add.at(mode, places, force)
    free = [k for k in range(len(link.dofs)) if k not in link.fixed]
    squares, shapes = eigh(total.stiffness[np.ix_(free, free)], total.mass[np.ix_(free, free)])
    damping = (total.damping + forces.T @ forces)[np.ix_(free, free)]
    speeds, shapes = np.sqrt(squares[3:]), shapes[:, 3:]
    ratios = np.diagonal(shapes.T @ damping @ shapes) / (2 * speeds)
    assert len(link.pieces) == 10 and len(ratios) > 24
    assert ratios == pytest.approx(in_proportion(speeds, 0.05), rel=1e-6)


@pytest.mark.parametrize("ratios", [[0.01] * 100, 1.0, -0.1, []])
def test_ratios_that_cannot_be_had_are_refused(tmp_path, ratios):
    with pytest.raises((ModelError, SceneError), match="ratio"):
        bars.cantilever(tmp_path, ", elements = 1", more=damped(ratios)).modes()
