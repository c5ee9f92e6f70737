"""Limit positions of slider-cranks."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from symgen.mechanics.synthesis import limits as relations
from symgen.synthesis.limits.kind import LimitKind, time_ratio
from symgen.synthesis.slider_crank import SliderCrank

#: Angle below zero, or length, that counts as zero: rounding.
_ROUNDING = 1e-9


def _random(generator: np.random.Generator) -> list[float]:
    share, part = generator.uniform(0.05, 0.95, 2)
    return [float(share * part), 1.0, float(share * (1 - part))]


def _derived(lengths: list[float]) -> dict[str, float]:
    r, l, e = lengths
    out = {"crank": r, "coupler": l, "offset": e}
    for pose, side in (("extended", l + r), ("folded", l - r)):
        out[f"crank_{pose}"] = float(np.arcsin(e / side))
        out[f"slider_{pose}"] = float(np.sqrt(side * side - e * e))
    out["stroke"] = out["slider_extended"] - out["slider_folded"]
    out["transmission_least"], out["transmission_greatest"] = (
        float(np.arccos(x / l)) for x in (e + r, e - r)
    )
    return out | {"time_ratio": time_ratio(out["crank_folded"] - out["crank_extended"])}


def _accepts(x: dict[str, float]) -> bool:
    """Return whether a root is a slider-crank whose crank turns, and no mirror image."""
    return (
        min(x["crank"], x["coupler"], x["slider_folded"]) > 0
        and -_ROUNDING < x["offset"] < x["coupler"] - x["crank"]
        and all(-_ROUNDING < x[f"crank_{pose}"] < np.pi / 2 for pose in ("extended", "folded"))
        and all(0 < x[f"transmission_{end}"] < np.pi for end in ("least", "greatest"))
    )


def _drawn(x: dict[str, float]) -> SliderCrank:
    """Return the linkage in its extended limit position, the guide in the direction of the axis."""
    r, l, theta = (x[name] for name in ("crank", "coupler", "crank_extended"))
    direction = np.array([np.cos(theta), np.sin(theta)])
    places = (np.zeros(2), r * direction, (r + l) * direction, (r + l / 2) * direction)
    return SliderCrank(*places, guide=0.0, error=x["error"])


def _measured(linkage: SliderCrank) -> Iterator[tuple[str, float]]:
    r, l, e = linkage.lengths.values()
    yield from linkage.lengths.items()
    extended, folded = np.arcsin(e / (l + r)), np.arcsin(e / (l - r))
    run = linkage.angles([extended, folded + np.pi, 1.5 * np.pi, 0.5 * np.pi])
    slider = run["B.position"].values[:, 0]
    # From the normal of the guide that points to the crank.
    transmission = np.pi / 2 - run["coupler.angle"].values
    yield "crank_extended", float(extended)
    yield "crank_folded", float(folded)
    yield "slider_extended", float(slider[0])
    yield "slider_folded", float(slider[1])
    yield "stroke", float(slider[0] - slider[1])
    yield "transmission_least", float(transmission[2])
    yield "transmission_greatest", float(transmission[3])
    yield "time_ratio", time_ratio(folded - extended)


SLIDER_CRANK = LimitKind(
    "synthesis_slider_limits", "a slider-crank", relations.SLIDER_QUANTITIES, 8, relations.slider_necessary,
    _random, _derived, _accepts, _drawn, _measured,
)  # fmt: skip
