"""The link-joint table: its rows, their variables, and links that spin idly."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import sympy as sp

from symgen.errors import SceneError
from symgen.joints import JOINTS
from symgen.joints.joint import Joint
from symgen.scene import units
from symgen.scene.loop.loop import ENTRIES, Row
from symgen.scene.loop.reading import UNKNOWN, LoopReader, PlacedVariable
from symgen.scene.loop.schema import LoopRow
from symgen.symbolic.constants import with_pi

#: Reserved name of the last link, the frame.
GROUND = "ground"
#: Equations of closure of a loop in space.
EQUATIONS = 6
#: Joint variables that the compiled solver has room for.
MOST = 24
_LENGTHS = ("S", "a")


@dataclass(frozen=True, slots=True)
class LoopTable:
    """The table, read: rows, the variables in their order, and the rows whose links spin idly."""

    rows: tuple[Row, ...]
    places: tuple[PlacedVariable, ...]
    idle: frozenset[int]

    def joined(self, row: int) -> str:
        """Return the two links of a joint, for descriptions."""
        return f"{self.rows[row - 1].link} and {self.rows[row].link}"


def rows_of(read: LoopReader) -> LoopTable:
    """Return the table of a scene, checked but for what only its assembly can tell."""
    _check_links(read)
    rows: list[Row] = []
    places: list[PlacedVariable] = []
    links_of_variable: dict[int, list[str]] = {}
    for i, written in enumerate(read.loop.rows):
        where = f"loop.rows.{i}"
        joint = _joint(written, where)
        entries = {}
        for key in ENTRIES:
            entries[key], place = _entry(read, written, joint, i, key)
            if place is None and key in joint.varies:
                links_of_variable.setdefault(i, []).append(key)
            if place is not None and all(p.name != place.name or p.row != i for p in places):
                places.append(place)
        for key, freedom in joint.coupled:
            pitch = read.value(written.pitch or 0, units.LENGTH, f"{where}.pitch")
            entries[key] += pitch * entries[freedom]
        rows.append(Row(written.joint, written.link, **entries))
    result = LoopTable(tuple(rows), tuple(places), _idle(read, rows, links_of_variable))
    _check_named(read, places)
    _check_count(read, result)
    return result


def _check_links(read: LoopReader) -> None:
    *moving, last = (row.link for row in read.loop.rows)
    if last != GROUND:
        raise SceneError(
            f"expected the last row to end on the ground, got {last!r}",
            where=f"loop.rows.{len(moving)}.link",
            hint=f'The last row closes the loop: link = "{GROUND}".',
        )
    for i, name in enumerate(moving):
        if name == GROUND or name in moving[:i]:
            which = "only the last row ends on it" if name == GROUND else "an earlier row ends on it"
            raise SceneError(
                f"the row ends on the link {name!r}, but {which}",
                where=f"loop.rows.{i}.link",
                hint="Every row ends on a link of its own.",
            )


def _joint(row: LoopRow, where: str) -> Joint:
    joint = JOINTS.get(row.joint)
    if joint is None:
        known = ", ".join(f"{j.letter} ({j.name})" for j in JOINTS.values())
        raise SceneError(f"there is no joint {row.joint!r}", where=f"{where}.joint", hint=f"Known: {known}.")
    if joint.coupled and row.pitch is None:
        raise SceneError(
            f"a {joint.name} joint needs its pitch",
            where=f"{where}.pitch",
            hint='Give the way along k for each radian, as in pitch = "lead/(2*pi)".',
        )
    if row.pitch is not None and not joint.coupled:
        raise SceneError(f"a {joint.name} joint has no pitch", where=f"{where}.pitch")
    return joint


def _entry(
    read: LoopReader, row: LoopRow, joint: Joint, i: int, key: str
) -> tuple[sp.Expr, PlacedVariable | None]:
    text = getattr(row, key)
    where, varies = f"loop.rows.{i}.{key}", key in joint.varies
    dim = units.LENGTH if key in _LENGTHS else units.NUMBER
    if isinstance(text, str) and text.strip() == UNKNOWN:
        if not varies:
            raise _fixed(joint, key, where)
        name = f"{key}{i + 1}"
        return sp.Symbol(name, real=True), PlacedVariable(name, i, key, dim, None)
    expression, named = read.entry(text or 0, dim, where)
    expression = with_pi(expression)
    if named is not None and not varies:
        raise _fixed(joint, key, where)
    if key in joint.zero and expression != 0:
        raise SceneError(
            f"a {joint.name} joint has {key} = 0: its centre is the origin of its frame, got {text!r}",
            where=where,
            hint="Place its centre by S and a of the row before.",
        )
    return expression, PlacedVariable(named.name, i, key, named.dimension, named) if named else None


def _fixed(joint: Joint, key: str, where: str) -> SceneError:
    return SceneError(
        f"a {joint.name} joint does not let {key} vary: expected a constant",
        where=where,
        hint=f"It lets {' and '.join(joint.varies)} vary.",
    )


def _between_balls(rows: Sequence[Row]) -> Iterator[int]:
    """Yield the rows of the moving links that a ball joins on either side."""
    for i in range(len(rows) - 1):
        if JOINTS[rows[i].joint].is_ball and JOINTS[rows[i + 1].joint].is_ball:
            yield i


def _idle(read: LoopReader, rows: Sequence[Row], links_of_variable: dict[int, list[str]]) -> frozenset[int]:
    """Return rows of links whose idle spin a constant alpha fixes; refuse all other fixed freedoms."""
    left, idle = dict(links_of_variable), set()
    for i in _between_balls(rows):
        for row in (i, i + 1):
            if left.get(row) == ["alpha"]:
                del left[row]
                idle.add(i)
                break
    for row, keys in left.items():
        joint = JOINTS[rows[row].joint]
        rest = [key for key in joint.varies if key not in keys]
        alike = [j for j in JOINTS.values() if set(j.varies) == set(rest) and not j.coupled]
        hint = f'Write "{UNKNOWN}" where it follows from closure, or the name of an input.'
        if alike:
            hint += f" With {' and '.join(keys)} constant it is a {alike[0].name} joint, {alike[0].letter}."
        text = getattr(read.loop.rows[row], keys[0])
        came = "nothing" if text is None else f"the constant {text!r}"
        only = " (alpha may be constant only to hold the idle spin of a link between two balls)"
        raise SceneError(
            f"a {joint.name} joint lets {keys[0]} vary, got {came}{only if joint.is_ball else ''}",
            where=f"loop.rows.{row}.{keys[0]}",
            hint=hint,
        )
    return frozenset(idle)


def _check_named(read: LoopReader, places: Sequence[PlacedVariable]) -> None:
    """Check that every named variable occurs in one row, and that variable names are unique."""
    for named in read.named.values():
        table = "inputs" if named.role == "input" else "free"
        where = f"loop.{table}.{named.name}"
        matching = [p for p in places if p.named is named]
        if not matching:
            raise SceneError(
                f"no row holds the variable {named.name}",
                where=where,
                hint=f'Name it in a row, as in theta = "{named.name}".',
            )
        if len(matching) > 1:
            rows = " and ".join(str(p.row + 1) for p in matching[:2])
            raise SceneError(f"{named.name} may occur in one row only, got rows {rows}", where=where)
        if any(p.name == named.name and p.named is None for p in places):
            raise SceneError(
                f"{named.name!r} is reserved for another variable of the table",
                where=where,
                hint="Choose another name.",
            )


def _check_count(read: LoopReader, table: LoopTable) -> None:
    """Count the variables that follow from closure, as far as no numbers are needed."""
    for i in _between_balls(table.rows):
        if read.number(table.rows[i].a) == 0:
            raise SceneError(
                f"the two balls of {table.rows[i].link} have the same centre",
                where=f"loop.rows.{i}.a",
                hint="Give its length, or make one ball of the two.",
            )
        if i not in table.idle and all(p.named is None for p in table.places if p.row in (i, i + 1)):
            raise SceneError(
                f"the link {table.rows[i].link} between two balls spins idly: its spin is not determined",
                where=f"loop.rows.{i}.alpha",
                hint="Keep alpha of one of its balls constant, or make it a free variable.",
            )
    dependent = [p.name for p in table.places if p.named is None]
    where, names = "loop.rows", ", ".join(dependent)
    if not dependent:
        raise SceneError(
            "no variable follows from closure: all variables are inputs or free",
            where=where,
            hint=f'Write "{UNKNOWN}" for the variables that the loop decides.',
        )
    if len(dependent) > EQUATIONS:
        listed = ", ".join(read.named)
        raise SceneError(
            f"{len(dependent)} dependent variables for the {EQUATIONS} equations of closure: {names} "
            f"(prescribed or free are {listed})",
            where=where,
            hint="Make inputs or free variables of the surplus ones, or take joints with fewer freedoms.",
        )
    if (count := len(table.places) + len(read.scene.states)) > MOST:
        raise SceneError(
            f"expected at most {MOST} joint variables{' and states' * bool(read.scene.states)}, got {count}",
            where=where,
            hint="Prescribe fewer motions: leave out some of the joints of the inputs.",
        )
