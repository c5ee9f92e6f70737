"""Derivatives of all shipped scenes against references with 40 digits and more."""

from __future__ import annotations

import pytest
from shared.exact_slopes import IN_SPACE, SCENES, of_linkage, of_space
from shared.full import full_unless

from symgen.scene.loading import SHIPPED

#: Scenes of every kind that are compared in every run of the tests.
QUICK = {"four_bar", "crank_rocker", "cssp", "rssr", "elastic_four_bar", "spatial_slider_crank"}


@pytest.mark.parametrize("scene", full_unless(lambda scene: scene in QUICK, SCENES))
def test_derivatives_of_shipped_scenes_are_exact(scene):
    _, digits, error = SCENES[scene]
    assert digits >= 40 and error() <= 1e-9


#: Linkages with moving ground, springs and dampers, a drive, a body in space, and lengths of a micrometre.
SERIES = ["andrews_squeezer", "car_axis", "crank_rocker", "length_ratios", "tumbling_body", "whip"]


@pytest.mark.parametrize("scene", SERIES)
def test_derivatives_along_power_series_are_exact(scene):
    assert of_linkage(scene, "taylor") <= 1e-9


@pytest.mark.parametrize("scene", full_unless(lambda scene: scene == "spatial_slider_crank", IN_SPACE))
def test_frequencies_of_links_in_space_have_exact_derivatives(scene):
    assert of_space(scene, "frequencies") <= 1e-9


def test_every_shipped_scene_is_compared():
    assert {path.stem for path in SHIPPED.glob("*.toml")} == {*SCENES}
