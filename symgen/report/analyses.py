"""Terminal output of kinematic analyses, equilibria and modes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Console

from symgen.report.extremes import FEW, Components, averages_of, means, texts, times
from symgen.report.tables import MODES, print_notes, table
from symgen.runtime.model.compiled import degrees
from symgen.runtime.result.equilibrium import Equilibrium, Modes
from symgen.runtime.result.motion import Motion
from symgen.runtime.result.records import converted, converters
from symgen.runtime.result.result import Variable
from symgen.runtime.result.state import AssemblyModes, State


def print_motion(motion: Motion, _: Any, console: Console) -> None:
    """Print outputs at a few poses or their range over many, and intervals out of reach of the linkage."""
    along, label = motion.over
    unit = motion.shown_in[0]
    outputs = Components(motion.shown, motion.count)
    if motion.count <= FEW:
        heads = [f"{x:.6g}" for x in along]
        console.print(outputs.values(f"{motion.title}: outputs over {label}", heads, first=times(motion)))
    else:
        span = f"{along.min():g} {unit} to {along.max():g} {unit}"
        title, by_name = f"{motion.title}: {motion.count} poses, {span}", means(motion, averages_of(motion))
        console.print(outputs.extremes(title, along, unit, means=by_name))
    for pose in motion.singular_poses:
        console.print(pose.describe(motion.units))
    for low_end, high_end in motion.unassemblable:
        console.print(f"no assembly was found from t = {low_end:.12g} s to {high_end:.12g} s")
    for low_end, high_end in motion.out_of_reach:
        text = f"from t = {low_end:.12g} s to {high_end:.12g} s it can be assembled, but not driven there"
        console.print(text)
    console.print(
        f"constraints met within {motion.drift.constraint:.1e} m, their rates {motion.drift.velocity:.1e} m/s"
    )


def print_assemblies(modes: AssemblyModes[State], model: Any, console: Console) -> None:
    """Print the positions of moving points in every assembly mode."""
    free = model.description.free
    axes = "xyz"[: len(model.description.axes)]
    variables = [
        Variable(f"{p}.position", "m", "", tuple(axes), np.array([state.positions[p] for state in modes]))
        for p in free
    ]
    print_modes_of_assembly(variables, modes, model, console)


def print_modes_of_assembly(
    variables: Sequence[Variable], assembly_modes: AssemblyModes[Any], model: Any, console: Console
) -> None:
    """Print the values of variables in every assembly mode, and whether these are all."""
    count = len(assembly_modes)
    title = f"{model.description.title}: {count} assembly mode{'s' if count > 1 else ''}"
    shown = converted(variables, converters(model.description.units))
    console.print(Components(shown, count).values(title, [str(i + 1) for i in range(count)]))
    console.print(
        f"There may be others: {assembly_modes.incomplete}."
        if assembly_modes.incomplete
        else "These are all."
    )


def print_equilibrium(equilibrium: Equilibrium, model: Any, console: Console) -> None:
    """Print pose, reactions and outputs."""
    axes, units = "xyz"[: len(model.description.axes)], converters(model.description.units)
    (length, per_length), (force, per_force) = (units.get(u, (u, 1.0)) for u in ("m", "N"))
    where = texts(length, np.array([*equilibrium.state.positions.values()]) / per_length)
    forces = texts(force, np.array([*equilibrium.reactions.values()]) / per_force)
    reactions = dict(zip(equilibrium.reactions, forces, strict=True))
    none = [""] * len(axes) if reactions else []
    rows = [(p, *r, *reactions.get(p, none)) for p, r in zip(equilibrium.state.positions, where, strict=True)]
    head = ("point", *(f"{a} [{length}]" for a in axes))
    head += tuple(f"reaction {a} [{force}]" for a in axes) if reactions else ()
    freedom = degrees(equilibrium.freedoms)
    console.print(
        table(
            f"{model.description.title}: {equilibrium.stability} equilibrium, {freedom} of freedom",
            head,
            rows,
        )
    )
    if equilibrium.outputs:
        variables = [
            Variable(
                name, equilibrium.units[name], "", tuple(axes) if value.size > 1 else (), value.reshape(1, -1)
            )
            for name, value in ((name, np.asarray(value)) for name, value in equilibrium.outputs.items())
        ]
        console.print(Components(converted(variables, units), 1).values("Recorded", ("value",)))
    console.print(f"unbalanced {equilibrium.residual:.1e} N of {equilibrium.scale:.3g} N")
    print_notes(equilibrium.notes, console)


def print_modes(analyses: Sequence[Modes], model: Any, console: Console) -> None:
    """Print frequencies, damping ratios and mode shapes of the moving points, of one analysis."""
    (modes,) = analyses
    rows = [
        (i + 1, m.kind, m.frequency, m.omega, m.damping_ratio, f"{m.s.real:.6g}{m.s.imag:+.6g}i")
        for i, m in enumerate(modes.modes[:MODES])
    ]
    head = ("mode", "kind", "frequency [Hz]", "omega [rad/s]", "damping ratio", "s [1/s]")
    stability = modes.equilibrium.stability
    count = f"{len(modes)} mode{'s' if len(modes) > 1 else ''}"
    article = "an" if stability == "unstable" else "a"
    title = f"{model.description.title}: {count} about {article} {stability} equilibrium"
    console.print(table(title, head, rows))
    if len(modes) > MODES:
        console.print(f"and {len(modes) - MODES} more modes: --json lists all")
    moving = [p for p in modes[0].shape if any(np.any(m.shape[p]) for m in modes.modes)]
    of_points = not model.description.rates
    axes = [f".{axis}" for axis in "xyz"[: len(model.description.axes)]] if of_points else [""]
    shapes = [
        (f"{p}{axis}", *(f"{_rounded(np.atleast_1d(m.shape[p]))[i]:.4g}" for m in modes.modes[:MODES]))
        for p in moving
        for i, axis in enumerate(axes)
    ]
    numbers = [str(i + 1) for i in range(min(MODES, len(modes)))]
    of = ("Shapes in m/sqrt(kg)", "point") if of_points else ("Shapes", "coordinate")
    console.print(table(f"{of[0]}, for unit modal mass", (of[1], *numbers), shapes))
    print_notes(modes.equilibrium.notes, console)


def _rounded(shape: np.ndarray) -> np.ndarray:
    """Return a mode shape with round-off replaced by zero."""
    real, imaginary = (np.where(np.abs(part) < 1e-12, 0.0, part) for part in (shape.real, shape.imag))
    return real + 1j * imaginary if np.iscomplexobj(shape) else real
