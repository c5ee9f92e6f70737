"""Derivatives of all shipped scenes against references with 40 digits and more."""

from __future__ import annotations

import pytest
from shared.exact_slopes import SCENES
from shared.full import full_unless

from symgen.scene.loading import SHIPPED

#: Scenes of every kind that are compared in every run of the tests.
QUICK = {"four_bar", "crank_rocker", "cssp", "rssr", "elastic_four_bar"}


@pytest.mark.parametrize("scene", full_unless(lambda scene: scene in QUICK, SCENES))
def test_derivatives_of_shipped_scenes_are_exact(scene):
    _, digits, error = SCENES[scene]
    assert digits >= 40 and error() <= 1e-9


def test_every_shipped_scene_is_compared():
    """Elastic links in space have no derivatives; test_sensitivity_scenes has length_ratios at its start."""
    without = {"length_ratios", "spatial_four_bar", "spatial_slider_crank"}
    assert {path.stem for path in SHIPPED.glob("*.toml")} - {*SCENES} == without
