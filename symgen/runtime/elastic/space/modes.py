"""Small vibrations of a linkage with elastic links in space about its equilibrium with its input held."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.beams.modal.structure import modes_at_rest
from symgen.runtime.elastic.large.statics import equilibrium, linearised
from symgen.runtime.elastic.space.linkage import LinkageInSpace
from symgen.runtime.result.modes import ElasticModes, relative
from symgen.runtime.rods.model.rods import RodModel


def modes_in_space(rigid: RodModel, t: float) -> ElasticModes:
    """Return the modes about the equilibrium with the input held at a time [s], with errors of elements.

    Raises
    ------
    ModelError
        When there is no equilibrium, or it is unstable.
    """
    modes = modes_of(LinkageInSpace(rigid), t)

    def estimate() -> Array:
        finer = modes_of(LinkageInSpace(rigid, divided=2), t).frequencies[: len(modes.frequencies)]
        return relative(modes.frequencies[: len(finer)], finer)

    return replace(modes, estimate=estimate)


def modes_of(linkage: LinkageInSpace, t: float) -> ElasticModes:
    """Return the same of the equations of a linkage, without errors of elements."""
    of = linearised(linkage, equilibrium(linkage, t))
    speeds, shapes, rigid = modes_at_rest(linkage.name, of.mass, of.stiffness, of.sizes)
    damped = np.sum(shapes * (of.damping @ shapes), axis=0)
    return ElasticModes(
        linkage.name,
        math.nan,
        speeds / (2 * math.pi),
        of.basis @ shapes,
        linkage.names,
        rigid=rigid,
        ratios=np.divide(damped, 2 * speeds, out=np.zeros_like(speeds), where=speeds > 0.0),
        t=t,
        elements={link.info.link: len(link.elements) for link in linkage.links},
    )
