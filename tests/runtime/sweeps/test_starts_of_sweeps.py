"""Sweeps of runs that start in equilibria, against the closed form of a truss that snaps through."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from scipy.optimize import brentq
from shared.linkages import G
from typer.testing import CliRunner

import symgen
from symgen.cli import app

STIFFNESS, FREE = 100.0, 1.2
#: A mass on an upright rail, on a spring from the side that is shorter in line with it than free.
TRUSS = f"""
symgen = 1
[parameters]
m = {{ value = "0.1 kg", tunable = true }}
[points]
O = {{ at = ["-1 m", "0 m"], ground = true }}
L = {{ at = ["0 m", "-3 m"], ground = true }}
U = {{ at = ["0 m", "3 m"], ground = true }}
A = {{ at = ["0 m", "0.6 m"] }}
[links]
rail = {{ points = ["L", "U"] }}
[[guides]]
points = ["A"]
along = "rail"
[[masses]]
point = "A"
mass = "m"
[[springs]]
between = ["O", "A"]
stiffness = "{STIFFNESS} N/m"
damping = "5 N*s/m"
length = "{FREE} m"
[gravity]
acceleration = ["0 m/s^2", "-{G} m/s^2"]
[start]
equilibrium = true
[analysis]
t_end = "10 ms"
outputs = ["A.position"]
"""
MASSES = np.linspace(0.1, 0.5, 9)


@pytest.fixture(scope="module")
def truss(tmp_path_factory):
    file = tmp_path_factory.mktemp("truss") / "truss.toml"
    file.write_text(TRUSS, encoding="utf-8")
    return file


def pull(y):
    length = np.hypot(1, y)
    return STIFFNESS * (length - FREE) * y / length


def test_neighbours_in_different_equilibria_are_named(truss):
    model = symgen.build(truss)
    runs = model.sweep({"m": MASSES}, "simulate", reduce="final")
    top = np.sqrt(FREE ** (2 / 3) - 1)  # where the raised truss bears the largest weight
    last = int(np.flatnonzero(-pull(top) > MASSES * G)[-1])
    ranges = [(top, 0.7) if i <= last else (-3, -0.7) for i in range(len(MASSES))]
    places = [brentq(lambda y, m=m: pull(y) + m * G, *ends) for m, ends in zip(MASSES, ranges, strict=True)]
    assert runs["A.position.final"].values[:, 1] == pytest.approx(places, abs=1e-9)
    pair = f"at m = {MASSES[last]:.6g} kg and at m = {MASSES[last + 1]:.6g} kg"
    way = places[last] - places[last + 1]
    assert runs.attrs["notes"] == f"runs {pair} start in different equilibria, {way:.3g} m apart"
    assert "notes" not in model.sweep({"m": MASSES[: last + 1]}, "simulate", reduce="final").attrs


def test_a_scene_far_from_the_origin_has_the_same_note(truss, tmp_path):
    far = re.sub(r'at = \["(\S+) m"', lambda m: f'at = ["{float(m[1]) + 1000:g} m"', TRUSS)
    file = tmp_path / "far.toml"
    file.write_text(far + '[units]\nlength = "mm"\n', encoding="utf-8")
    near, shifted = (symgen.build(x).sweep({"m": MASSES}, "simulate", reduce="final") for x in (truss, file))
    words, metres = near.attrs["notes"].removesuffix(" m apart").rsplit(" ", 1)
    assert shifted.attrs["notes"] == f"{words} {float(metres) * 1e3:.3g} mm apart"


def test_the_command_prints_them(truss):
    arguments = ["sweep", str(truss), "--vary", "m=0.1 kg:0.5 kg:9", "--analysis", "simulate"]
    shown = CliRunner().invoke(app, arguments)
    assert "start in different equilibria" in " ".join(shown.stdout.split()), shown.output
    content = json.loads(CliRunner().invoke(app, [*arguments, "--json"]).stdout)
    assert "start in different equilibria" in content["starts"]
