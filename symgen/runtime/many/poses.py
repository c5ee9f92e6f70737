"""Values of runs without samples: equilibria, frequencies, stability of steady states, notes, early ends."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from symgen.runtime.many.dataset import KeptSamples, chosen, of_one
from symgen.runtime.result.modes import ElasticModes
from symgen.runtime.result.records import Variable

if TYPE_CHECKING:
    from symgen.runtime.result.equilibrium import Equilibrium, Modes
    from symgen.runtime.result.result import Result

#: Name of the largest Floquet multiplier of a steady state.
FLOQUET = "floquet"
#: Name of the notes of a run of elastic links.
NOTES = "notes"
#: Most natural frequencies of a run.
_FREQUENCIES = 6


def at_one_pose(
    equilibrium: Equilibrium, axes: tuple[str, ...], outputs: Sequence[str] | None
) -> KeptSamples:
    """Return outputs, positions, ground reactions and stability of an equilibrium."""
    named = {
        name: (equilibrium.units[name], "output", values) for name, values in equilibrium.outputs.items()
    }
    for name, place in equilibrium.state.positions.items():
        named.setdefault(f"{name}.position", ("m", "position", place))
    for name, force in equilibrium.reactions.items():
        named.setdefault(f"{name}.reaction", ("N", "force of the ground on the linkage", force))
    single = tuple(
        Variable(
            name,
            unit,
            about,
            axes if np.size(v) > 1 else (),
            np.asarray(v).reshape(np.shape(v)[: np.size(v) > 1]),
        )
        for name, (unit, about, v) in named.items()
    )
    stability = Variable(
        "stability", "1", "stable, neutral or unstable", (), np.array(equilibrium.stability, dtype=object)
    )
    return KeptSamples(single=of_one([*chosen(single, outputs), stability]), axes=axes)


def of_modes(modes: Modes | ElasticModes, outputs: Sequence[str] | None) -> KeptSamples:
    """Return the lowest natural frequencies [Hz], ``frequency.1`` and so on; nan where nothing oscillates.

    Of elastic links in motion there is also ``growth`` [1/s], the fastest growth of a mode.
    """
    if isinstance(modes, ElasticModes):
        frequencies, growth = modes.frequencies, modes.growth
    else:
        frequencies, growth = np.full(modes.equilibrium.linearised.freedoms, np.nan), np.zeros(0)
        frequencies[: len(modes.frequencies)] = modes.frequencies[: len(frequencies)]
    single = [
        Variable(f"frequency.{i}", "Hz", f"natural frequency {i}", (), np.array(value))
        for i, value in enumerate(frequencies[:_FREQUENCIES], 1)
    ]
    if growth.size:
        single.append(Variable("growth", "1/s", "fastest growth of a mode", (), np.array(np.max(growth))))
    return KeptSamples(single=of_one(chosen(tuple(single), outputs)))


def with_notes(record: KeptSamples, notes: Sequence[str]) -> KeptSamples:
    """Return the values of a run of elastic links with its ``notes``, one per line."""
    text = Variable(
        NOTES,
        "",
        "notes of the run, such as where linear theory does not hold",
        (),
        np.array("\n".join(notes), object),
    )
    return replace(record, single=(*record.single, *of_one([text])))


def ended_early(result: Result, ending: Collection[str]) -> str:
    """Return why a run did not cover its range, such as an event that ends runs; '' where it did."""
    if result.events and result.events[-1].name in ending:
        return f"the event {result.events[-1].name!r} at t = {result.events[-1].time:.9g} s"
    missed = [*result.statistics.get("unassemblable", ()), *result.statistics.get("out_of_reach", ())]
    if not missed:
        return ""
    ends = result.time[[0, -1]]
    dead = min(result.dead_centres, key=lambda p: np.min(np.abs(ends - p.t)), default=None)
    if dead:
        return dead.describe(result.units)
    return f"no assembly from t = {missed[0][0]:.9g} s to {missed[0][1]:.9g} s"


def with_stability(record: KeptSamples, statistics: Mapping[str, Any]) -> KeptSamples:
    """Return the values of a steady state with ``floquet``, the largest magnitude of a Floquet multiplier."""
    largest = max((abs(complex(*z)) for z in statistics["floquet"]), default=np.nan)
    about = "largest magnitude of a Floquet multiplier"
    stability = Variable(FLOQUET, "1", about, (), np.array(largest))
    return replace(record, single=(*record.single, *of_one([stability])))
