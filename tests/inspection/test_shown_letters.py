"""Letters of a scene's constants in what is shown: those that occur, with plain meanings, in every format."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

import symgen
from symgen.cli import app
from symgen.errors import SymgenError
from symgen.regeneration.sources import systems
from symgen.scene.loading import check_scene, override, read_scene
from symgen.scene.resolve import resolve
from symgen.scene.rods.letters import in_letters


def shown(*arguments):
    done = CliRunner().invoke(app, ["show", *arguments])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.stdout


def listed(scene):
    """Return the rows of the table of constants by name."""
    lines = iter(shown(scene).splitlines())
    rows = {}
    for line in lines:
        if line.startswith("─"):
            break
    for line in lines:
        if line.startswith(("Zero", symgen.derive(scene).title)):
            return rows
        name, *_ = line.split("  ")
        rows[name] = line
    return rows


def test_only_letters_that_occur_are_listed():
    """The rail of the car axis has no mass: its centre occurs nowhere."""
    names = listed("car_axis")
    assert "l_rail" in names and "s_rail" not in names
    assert "s_rail" in {c.quantity.name for c in symgen.derive("car_axis").constants}


def test_numbered_letters_of_one_value_are_one_row():
    rows = listed("whip")
    assert set(rows) == {"l_rod1, ..., l_rod25", "m_rod1, ..., m_rod25", "g"}
    assert "0.04" in rows["m_rod1, ..., m_rod25"] and "mass of link rod1, ..." in rows["m_rod1, ..., m_rod25"]


def test_shared_terms_have_a_legend():
    text = shown("crank_rocker", "mass_matrix", "--format", "shared")
    assert "m_crank    mass of link crank [kg] = 0.1" in text


def test_values_in_the_derivation():
    text = shown("crank_rocker", "derivation", "--with", "m_crank=7")
    assert "m_crank" not in text and "m_coupler" in text
    assert "m_coupler" not in shown("crank_rocker", "derivation", "--with", "m_crank=7", "--numeric")
    with pytest.raises(SymgenError, match="the derivation of crank_rocker has no symbol 'm_cranc'"):
        shown("crank_rocker", "derivation", "--with", "m_cranc=7")


def test_all_compared_systems_have_letters():
    every = systems("elastic_four_bar").all
    assert len(every) > 1
    for prefix, system in every.items():
        assert {"a", "b", "bearing"} <= {c.quantity.name for c in system.constants}, prefix


def test_letters_say_of_what_they_are():
    names = ("car_axis", "andrews_squeezer", "rssr", "tumbling_body", "double_four_bar")
    scenes = [*map(read_scene, names), override(read_scene("rccc"), {"loop.rows.1.alpha": "40 deg"})]
    meanings = {
        c.quantity.name: c.quantity.description
        for scene in scenes
        for c in in_letters(resolve(check_scene(scene)))[1].constants
    }
    assert meanings["m_at_L"] == "mass at L"
    assert meanings["s_rail"] == "distance of the centre of mass of link rail from W, along its line"
    assert "alpha of joint 2, between input and coupler" in meanings.values()
    assert not [m for m in meanings.values() if " of row " in m or "mass of the mass" in m or "{" in m]
