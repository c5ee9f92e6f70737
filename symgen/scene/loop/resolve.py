"""From a scene with a link-joint table to a loop: every value read, every name looked up."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

import sympy as sp

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.expressions import Names
from symgen.scene.loop.ball_turns import with_ball_turns
from symgen.scene.loop.bodies import NOWHERE, bodies, efforts, loads
from symgen.scene.loop.loop import JointVariable, Loop, LoopBody, Row, Vector
from symgen.scene.loop.reading import ZERO, LoopReader, symbols
from symgen.scene.loop.rows import LoopTable, rows_of
from symgen.scene.loop.schema import SpatialLoop
from symgen.scene.rods.loads import first_order
from symgen.scene.schema import Scene
from symgen.symbolic.constants import with_pi
from symgen.symbolic.quantity import quantity

#: Names of components of vectors of a motion or a link, and of the closing wrench, in the derivation.
OF_LOOP = re.compile(
    r"[a-z]+(_own)?_(link|net|theta|S|eta|alpha|a)\d+_(.*_)?[xyz]|vc2_link\d+|fall\d+|closing_[fm][xyz]"
)
#: Largest assembly tolerance, over the size of the loop.
_MOST_OPEN = 1e-3


def loop_of(scene: Scene, table: SpatialLoop) -> Loop:
    """Return the loop a scene describes; what needs numbers of its assembly is checked there.

    Raises
    ------
    SceneError
        For a wrong unit, an unknown name, a wrong count, a value that is not physical; with table and key.
    """
    read = LoopReader(scene, table)
    rows = rows_of(read)
    _check_names(scene, rows)
    names = read.with_variables(rows.places)
    variables = (*_variables(read, rows, efforts(read, rows, names)), *_states(read, names))
    masses = tuple(bodies(read, rows))
    size = _size(read, rows.rows, variables, masses)
    resolved = Loop(
        name=scene.name,
        file=scene.file,
        title=scene.title or scene.name,
        parameters=tuple(read.parameters),
        rows=rows.rows,
        variables=variables,
        bodies=masses,
        gravity=_gravity(read),
        loads=tuple(loads(read, rows, names)),
        span=_span(read),
        lead=next(iter(table.inputs), ""),
        t_end=read.folded(
            read.positive(scene.analysis.t_end, units.TIME, "analysis.t_end"), "analysis.t_end"
        ),
        size=size,
        assembly_tolerance=_assembly_tolerance(read, size),
        units=units.shown_units(scene.units),
        outputs=None if scene.analysis.outputs is None else tuple(scene.analysis.outputs),
        limits=tuple(read.limits),
        written=read.written,
    )
    return with_ball_turns(resolved)


def _variables(
    read: LoopReader, rows: LoopTable, drives: Mapping[str, sp.Expr | None]
) -> Iterator[JointVariable]:
    places = {p.name: p for p in rows.places}
    for name in read.loop.start:
        where = f"loop.start.{name}"
        read.known(name, places, "variable", where)
        if places[name].named is not None:
            raise SceneError(
                f"{name} does not follow from closure and needs no guess",
                where=where,
                hint="The start of a free variable is at, that of an input its value at t = 0.",
            )
    for place in rows.places:
        about = f"{place.entry} of joint {place.row + 1}, between {rows.joined(place.row)}"
        value, rate, acceleration = symbols(place.name, place.dimension, about)
        named = place.named
        guess = read.loop.start.get(place.name, 0)
        yield JointVariable(
            value,
            rate,
            acceleration,
            place.row,
            named.role if named else "dependent",
            named.motion if named else ZERO,
            named.start if named else read.value(guess, place.dimension, f"loop.start.{place.name}"),
            named.start_rate if named else ZERO,
            drives[place.name],
            guessed=place.name in read.loop.start,
        )


def _states(read: LoopReader, names: Names) -> Iterator[JointVariable]:
    """Yield the integrals of first-order states."""
    for name in read.scene.states:
        where = f"states.{name}"
        if not read.free:
            raise SceneError(
                "a state needs a motion by forces, but inputs alone move the loop",
                where=where,
                hint="Move a variable from loop.inputs to loop.free.",
            )
        state = first_order(read, name, names)
        of_state, of_rate, of_integral = state.units
        yield JointVariable(
            quantity(state.integral, of_integral, f"integral of {state.about}"),
            quantity(name, of_state, state.about),
            quantity(f"{name}_rate", of_rate, f"rate of {state.about}"),
            row=-1,
            role="state",
            motion=ZERO,
            start=ZERO,
            start_rate=read.folded(state.start, f"{where}.start"),
            effort=state.rate,
        )


def _check_names(scene: Scene, rows: LoopTable) -> None:
    """Refuse names that stand for something of the loop already."""
    variables = {p.name for p in rows.places}
    derived = {f"{name}_{derivative}" for name in variables for derivative in ("rate", "acceleration")}
    for name in sorted(variables & derived):
        raise SceneError(f"{name!r} is reserved for the rate of a variable", where=f"loop.inputs.{name}")
    of_states = {f"{name}_{word}" for name in scene.states for word in ("rate", "integral")}
    for name in sorted(variables & of_states):
        state = name.rpartition("_")[0]
        raise SceneError(
            f"{name!r} is a variable of the loop, and reserved for a quantity of the state {state}",
            where=f"states.{state}",
            hint="Choose another name.",
        )
    plain = {name for name, parameter in scene.parameters.items() if not parameter.tunable}
    tables = ("parameters", scene.parameters), ("inputs", scene.inputs), ("states", scene.states)
    for table, names in tables:
        for name in names:
            problem = ""
            if name in variables:
                problem = f"{name!r} is a variable of the loop"
            elif name not in plain and (name in derived or OF_LOOP.fullmatch(name)):
                problem = f"{name!r} is reserved for a quantity of the loop"
            if problem:
                raise SceneError(problem, where=f"{table}.{name}", hint="Choose another name.")
    for i, row in enumerate(rows.rows):
        if row.link in variables or row.link in scene.states:
            raise SceneError(
                f"{row.link!r} is a {'variable' if row.link in variables else 'state'} of the loop",
                where=f"loop.rows.{i}.link",
                hint="Choose another name.",
            )


def _gravity(read: LoopReader) -> Vector:
    if read.scene.gravity is None:
        return NOWHERE
    x, y, z = read.vector(read.scene.gravity.acceleration, units.ACCELERATION, "gravity.acceleration")
    return x, y, z


def _span(read: LoopReader) -> tuple[sp.Expr, sp.Expr] | None:
    """Return the range of the first input, by default one revolution; None where variables are free."""
    written = read.loop.range
    if read.free:
        if written is not None:
            raise SceneError(
                f"a range is that of the first input, but with {read.free[0].name} free the motion runs by "
                "the time",
                where="loop.range",
                hint="Omit range: analysis.t_end is the end of the motion.",
            )
        return None
    first = next(iter(read.named.values()))
    if written is None:
        if first.dimension == units.LENGTH:
            raise SceneError(
                f"the range of {first.name} is missing",
                where="loop.range",
                hint='Give its first and last value, as in range = ["0 mm", "100 mm"].',
            )
        return ZERO, 2 * sp.pi
    start, stop = (
        read.folded(with_pi(read.value(text, first.dimension, where)), where)
        for text, where in zip(written, ("loop.range.0", "loop.range.1"), strict=True)
    )
    if not read.number(start) < read.number(stop):
        raise SceneError(
            f"expected a range with start before stop, got {written[0]!r} and {written[1]!r}",
            where="loop.range",
        )
    return start, stop


def _size(
    read: LoopReader, rows: Sequence[Row], variables: Sequence[JointVariable], masses: Sequence[LoopBody]
) -> float:
    """Return the largest length of the table, or of its first guesses; that of the links, or 1 m, if none."""
    zeros = {v.quantity.symbol: ZERO for v in variables}
    table = [getattr(row, key).xreplace(zeros) for row in rows for key in ("a", "S")]
    guesses = [v.start for v in variables if v.quantity.unit == "m"]
    largest = 0.0
    for lengths in ((*table, *guesses), [c for body in masses for c in body.centre]):
        largest = largest or max((abs(read.number(x)) for x in lengths), default=0.0)
    return largest or 1.0


def _assembly_tolerance(read: LoopReader, size: float) -> sp.Expr:
    """Return the defect of closure [m] that is tolerated."""
    text, where = read.scene.analysis.assembly_tolerance, "analysis.assembly_tolerance"
    if text is None:
        return ZERO
    tolerance = read.folded(read.positive(text, units.LENGTH, where), where)
    if read.number(tolerance) > _MOST_OPEN * size:
        raise SceneError(
            f"expected an assembly tolerance of at most {_MOST_OPEN * size:.3g} m for a loop of "
            f"{size:.3g} m, got {text!r}",
            where=where,
            hint="Larger errors are not of manufacture: check the lengths and twists of the table.",
        )
    return tolerance
