"""Models of linkages with elastic links in space."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, cast

from symgen.pipeline.build import ModelParts, linkage_model

if TYPE_CHECKING:
    from symgen.runtime.elastic.space.model import SpatialModel
    from symgen.runtime.rods.model.rods import RodModel


def spatial_model(parts: ModelParts) -> SpatialModel:
    """Return the model of a linkage with elastic links in space."""
    from symgen.runtime.elastic.space.model import SpatialModel

    of_rigid = replace(parts, equations=replace(parts.equations, rigid=True))
    return SpatialModel(cast("RodModel", linkage_model(of_rigid)))
