"""What the runtime needs to know of the elastic links of a linkage, besides the code."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from symgen.runtime.beam_data import BeamInfo


@dataclass(frozen=True, slots=True)
class ElasticInfo:
    """Elastic links, the crank, and where strains are asked for.

    ``stations`` are pairs of a name and a link, ``lumps`` and ``loads`` the links of the masses and forces
    along links, all in the order of the rows that kernels give.
    """

    beams: tuple[BeamInfo, ...]
    crank: str
    mode: str
    stations: tuple[tuple[str, str], ...]
    lumps: tuple[str, ...]
    loads: tuple[str, ...]


def read_elastic(data: dict[str, Any] | None) -> ElasticInfo | None:
    """Return what was stored as JSON; None where nothing is elastic."""
    if data is None:
        return None
    beams = []
    for beam in data["beams"]:
        lists = {k: tuple(beam[k]) for k in ("node_dofs", "inner_dofs", "moments")}
        beams.append(BeamInfo(**{**beam, **lists}))
    return ElasticInfo(
        tuple(beams),
        data["crank"],
        data["mode"],
        tuple((name, link) for name, link in data["stations"]),
        tuple(data["lumps"]),
        tuple(data["loads"]),
    )
