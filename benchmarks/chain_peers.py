"""The falling chain of ``work_precision.py`` in other programs, with results as positions of the tip."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from chain_reference import BEND, GRAVITY, SAMPLES, T_END
from numpy.typing import NDArray

from symgen.study.speed import peers
from symgen.study.speed.planar_chain import PlanarChain

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Attempt:
    """One setting: ``run`` is timed, ``tips`` converts its result to tip positions [m] at the sample times.

    If only the final state has an exact time, ``tips`` returns that position alone.
    """

    program: str
    series: str
    text: str
    run: Callable[[], Any]
    tips: Callable[[Any], Array]


def falling_chain(n: int) -> PlanarChain:
    """Return the chain: rods of 1 m and 1 kg, with alternating small relative angles."""
    return PlanarChain(
        rods=((1.0, 1.0, 0.5, 1 / 12),) * n,
        names=tuple(f"P{k + 1}" for k in range(n)),
        angles=float(BEND) * (np.arange(n) % 2),
        rates=np.zeros(n),
        origin=(0.0, 0.0),
        gravity=(0.0, -float(GRAVITY)),
        t_end=float(T_END),
        samples=SAMPLES,
    )


def _sweeps(name: str, n: int) -> list[Iterator[Attempt]]:
    chain = falling_chain(n)

    def attempts(sweep: Iterator[peers.PeerSetting]) -> Iterator[Attempt]:
        for peer in sweep:
            yield Attempt(peer.program, peer.series, peer.text, peer.run, _tips(chain, peer))

    return [attempts(sweep) for sweep in peers.PEERS[name][1](chain)]


def _tips(chain: PlanarChain, peer: peers.PeerSetting) -> Callable[[Any], Array]:
    return lambda found: chain.places(peer.angles(found))[:, -1]


#: All peers: pip packages, and sweeps for a chain of n rods.
PEERS: dict[str, tuple[str, Callable[[int], list[Iterator[Attempt]]]]] = {
    name: (packages, lambda n, name=name: _sweeps(name, n))  # type: ignore[misc]
    for name, (packages, _) in peers.PEERS.items()
}
