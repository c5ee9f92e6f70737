"""Equilibrium of the links of a loop in letters: against the source's print, and met by the derived wrenches."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest
import sympy as sp
from shared.commands import call

import symgen
from symgen.errors import ModelError
from symgen.pipeline.subject import Subject


def equilibrium(scene, link):
    return Subject(scene, {}).choose(f"{link}_equilibrium").matrices[0]


def test_the_print():
    """(62a)-(62f) and (63a)-(63f) with the letters of the source.

    Corrected: one sign for action and reaction, and (62c), which repeats F1j.
    """
    crank, rod = (equilibrium("slider_crank", link) for link in ("crank", "rod"))
    letters = {str(s): s for m in (crank, rod) for s in m.matrix.free_symbols}
    t1, t2, e2, s1, a1, a2 = (letters[n] for n in ("theta1", "theta2", "eta2", "s1", "a1", "a2"))
    f1i, f1j, f1k, t1i, t1j, t1k = (letters[f"{x}1_{i}"] for x in "FT" for i in "ijk")
    f2i, f2j, f2k = (letters[f"F2_{i}"] for i in "ijk")
    f3i, f3j, f3k = (letters[f"F3_{i}"] for i in "ijk")
    f1, f2 = ([letters[f"f{k}_{a}{p}"] for p in "pd" for a in "xyz"] for k in (1, 2))
    s, c = sp.sin, sp.cos
    of_crank = [
        f1i * c(t1) + f1j * s(t1) - f2i - f1[0],
        -f1i * s(t1) + f1j * c(t1) - f2j - f1[1],
        f1k - f2k - f1[2],
        t1i * c(t1) - f1i * s1 * s(t1) + f1j * s1 * c(t1) + t1j * s(t1) - f1[3],
        -t1i * s(t1) - f1i * s1 * c(t1) + t1j * c(t1) - f1j * s1 * s(t1) + a1 * f1k - f1[4],
        f1i * a1 * s(t1) - f1j * a1 * c(t1) + t1k - f1[5],
    ]
    of_rod = [
        f2i * c(t2) * c(e2) + f2j * s(t2) * c(e2) - f2k * s(e2) - f3i - f2[0],
        -f2i * s(t2) + f2j * c(t2) - f3j - f2[1],
        f2i * c(t2) * s(e2) + f2j * s(t2) * s(e2) + f2k * c(e2) - f3k - f2[2],
        -f2[3],
        f2i * a2 * c(t2) * s(e2) + f2j * a2 * s(t2) * s(e2) + f2k * a2 * c(e2) - f2[4],
        f2i * a2 * s(t2) - f2j * a2 * c(t2) - f2[5],
    ]
    for found, printed in ((crank, of_crank), (rod, of_rod)):
        assert sp.expand(found.matrix - sp.Matrix(printed)) == sp.zeros(6, 1)


def test_the_signs_of_the_page():
    """With the forces of the thesis, its inertia forces enter as the page of errata says: -f1, +f2, -f3.

    Its F2 and F4 act on the link before the joint. A rod that joint 2 pushes gains momentum: +F2 is f2.
    """
    mapped = {"F2": -1, "T2": -1, "F4": -1, "T4": -1, "f1": 1, "f2": 1, "f3": 1}
    for link, of_print, printed in (("crank", 1, -1), ("rod", -1, 1), ("slider", 1, -1)):
        matrix = equilibrium("slider_crank", link).matrix
        signs = {s: mapped.get(s.name.split("_")[0], 1) * s for s in matrix.free_symbols}
        of_thesis = of_print * matrix.xreplace(signs)
        inertia = [s for s in matrix.free_symbols if s.name[0] == "f"]
        assert {c for s in inertia for c in of_thesis.diff(s) if c != 0} == {printed}
        behind = [
            s for s in matrix.free_symbols if s.name[:2] == {"crank": "F2", "rod": "F3", "slider": "F4"}[link]
        ]
        assert {c for s in behind for c in of_thesis.diff(s) if c != 0} == {1}


@pytest.mark.parametrize("scene", ["slider_crank", "rssr", "rccc"])
def test_derived_wrenches_meet_it(scene):
    """Wrenches of joints and inertia at a random state, with the closing wrench that leaves balls no moment."""
    subject = Subject(scene, {})
    assert not subject.resolved.loads
    system = subject.system
    generator = np.random.default_rng(3)
    state = {x.symbol: float(generator.uniform(0.3, 1.2)) for x in system.quantities()}
    closing = [s for s in state if s.name.startswith("closing_")]
    balls = [k for k, row in enumerate(subject.resolved.rows, 1) if row.joint == "S"]
    moments = [e for k in balls for e in list(system[f"joint_{k}_wrench"].matrix)[3:]]

    def at(wrench):
        values = state | dict(zip(closing, map(float, wrench), strict=True))
        for d in (*system.constants, *system.definitions):
            values[d.quantity.symbol] = float(d.expression.xreplace(values))
        return values

    def of_balls(wrench):
        values = at(wrench)
        return np.array([float(e.xreplace(values)) for e in moments])

    still = of_balls(np.zeros(6))
    slopes = np.column_stack([of_balls(unit) - still for unit in np.eye(6)])
    values = at(np.linalg.lstsq(slopes, -still, rcond=1e-9)[0])
    assert len(balls) == (0 if scene == "rccc" else 2)
    links = [
        m.name.removesuffix("_inertia_wrench") for m in system.matrices if m.name.endswith("_inertia_wrench")
    ]
    wrenches = {}
    for k, link in enumerate(links, 1):
        f = system[f"{link}_inertia_wrench"].matrix.xreplace(values)
        names = [f"f{k}_{a}{p}" for p in "pd" for a in "xyz"]
        wrenches |= dict(zip(names, map(float, f), strict=True))
    for k in range(1, len(links) + 2):
        w = system[f"joint_{k}_wrench"].matrix.xreplace(values)
        names = [f"{x}{k}_{i}" for x in "FT" for i in "ijk"]
        wrenches |= dict(zip(names, map(float, w), strict=True))
    size = max(map(abs, wrenches.values()))
    known = {str(s): x for s, x in values.items()} | wrenches
    for link in links:
        matrix = equilibrium(scene, link).matrix
        left = [float(e.subs({s: known[str(s)] for s in e.free_symbols})) for e in matrix]
        assert np.max(np.abs(left)) < 1e-12 * size, link


def test_it_is_shown_with_its_number_and_in_the_record():
    text = " ".join(call("show", "slider_crank", "rod_equilibrium").split())
    assert "Rahman (63) times -1; F2 in it is -F2 here" in text
    assert "F2_i i component of the force of crank on rod at joint 2 [N]" in text
    assert "crank_equilibrium" in call("show", "slider_crank", "derivation")
    model = symgen.build("slider_crank")
    assert model.equations["slider_equilibrium"].shape == (6, 1)
    with pytest.raises(ModelError, match="nothing called"):
        Subject("bennett", {}).choose("ground_equilibrium")


def test_moments_that_vanish_at_a_ball_are_said_to_and_absent():
    """Those of joints 2 and 3: letters of (66), (67), which the thesis leaves out of (62)-(64)."""
    subject = Subject("slider_crank", {})
    for link, driven in (("crank", {"T1"}), ("rod", set()), ("slider", {"T4"})):
        (chosen,) = subject.found(f"{link}_equilibrium")
        assert {s.name[:2] for s in chosen.matrices[0].matrix.free_symbols if s.name[0] == "T"} == driven
    noted = {x.name for x in chosen.system.symbols() if "zero at a ball joint" in x.description}
    assert noted == {f"T{k}_{a}" for k in "23" for a in "ijk"}


def test_letters_of_tunable_parameters_stay_theirs(tmp_path):
    """A parameter with the name of a force at a joint keeps it; the force gets another."""
    text = (files("symgen") / "scenes" / "rssr.toml").read_text("utf-8")
    head, _, rest = text.partition("[parameters]\n")
    file = tmp_path / "named.toml"
    file.write_text(f'{head}[parameters]\nF1_i = {{ value = "1 m", tunable = true }}\n{rest}')
    link = Subject(str(file), {}).resolved.rows[0].link
    names = {str(s) for s in equilibrium(str(file), link).matrix.free_symbols}
    assert "F1_i_" in names and "F1_i" not in names


def test_a_universal_joint_transmits_a_moment():
    """Where joint 2 is one, the form without T2 is not shown, and T2 is not said to vanish; a run tells which do."""
    outputs = {2: "crank.joint2.moment", 3: "slider.joint3.moment"}
    scene = {
        "loop.rows.1.joint": "U",
        "loop.links.rod.centre": ["-a2/2", "a2/9", "a2/7"],
        "analysis.outputs": [*outputs.values()],
    }
    run = symgen.build("slider_crank", set=scene).inverse_dynamics(at=[0.1, 0.4, 0.9])
    sizes = {
        k: max(np.abs(run.variable(f"{name}.{x}").values).max() for x in "xyz") for k, name in outputs.items()
    }
    assert sizes[3] < 1e-12 and sizes[2] > 1.0
    subject = Subject("slider_crank", scene)
    noted = {
        x.name
        for x in subject.choose("rod_equilibrium").system.symbols()
        if "zero at a ball joint" in x.description
    }
    assert noted == {f"T3_{a}" for a in "ijk"}
    with pytest.raises(ModelError, match="nothing called"):
        subject.choose("joint_components")
