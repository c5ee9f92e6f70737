"""Mass properties of the links of a loop, the loads on them and the drives at its joints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import sympy as sp

from symgen.errors import SceneError
from symgen.scene import units
from symgen.scene.expressions import Names
from symgen.scene.inertia import check_real, inertia_matrix
from symgen.scene.loop.loop import LoopBody, LoopLoad, Vector
from symgen.scene.loop.reading import UNKNOWN, ZERO, LoopReader, PlacedVariable
from symgen.scene.loop.rows import GROUND, LoopTable
from symgen.scene.loop.schema import LinkLoad
from symgen.scene.rods.linkage import number

NOWHERE: Vector = (ZERO, ZERO, ZERO)
#: By what tunable parameters are multiplied to see whether two expressions are one, and how near they come.
_TRIALS, _SAME = (1.0, 1.37, 0.71), 1e-12


def bodies(read: LoopReader, table: LoopTable) -> Iterator[LoopBody]:
    """Yield the mass properties of the links that have any, in the order of the rows."""
    rows = _rows_by_link(table)
    for name in read.loop.links:
        read.known(name, rows, "moving link", f"loop.links.{name}")
    for name, row in rows.items():
        if name not in read.loop.links:
            continue
        written, where = read.loop.links[name], f"loop.links.{name}"
        matrix = sp.zeros(3, 3)
        if written.inertia is not None:
            matrix = inertia_matrix(read, written.inertia, f"{where}.inertia")
            check_real(read, matrix, f"{where}.inertia")
        body = LoopBody(
            link=name,
            row=row,
            mass=read.not_negative(written.mass, units.MASS, f"{where}.mass"),
            centre=_vector(read, written.centre, units.LENGTH, f"{where}.centre"),
            inertia=tuple(tuple(matrix[i, j] for j in range(3)) for i in range(3)),  # type: ignore[arg-type]
            idle=row in table.idle,
        )
        if body.idle:
            _check_round(read, body, where)
        yield body


def loads(read: LoopReader, table: LoopTable, names: Names) -> Iterator[LoopLoad]:
    """Yield the loads on the links."""
    rows = _rows_by_link(table)
    for i, written in enumerate(read.loop.loads):
        where = f"loop.loads.{i}"
        read.known(written.link, rows, "moving link", f"{where}.link")
        if written.force is None and written.torque is None:
            raise SceneError("a load has a force, a torque, or both", where=where)
        if written.force is None and written.at is not None:
            raise SceneError("only a force acts at a point", where=f"{where}.at")
        load = LoopLoad(
            name=f"load_{i}",
            link=written.link,
            row=rows[written.link],
            at=_vector(read, written.at, units.LENGTH, f"{where}.at"),
            force=_vector(read, written.force, units.FORCE, f"{where}.force", names),
            torque=_vector(read, written.torque, units.TORQUE, f"{where}.torque", names),
            in_ground=written.frame == GROUND,
        )
        if load.row in table.idle:
            _check_no_twist(load, written, where)
        yield load


def efforts(read: LoopReader, table: LoopTable, names: Names) -> Mapping[str, sp.Expr | None]:
    """Return the effort of the drive at each variable, None where it is to be found."""
    places = {p.name: p for p in table.places}
    by_variable: dict[str, sp.Expr | None] = {
        p.name: None if p.named is not None and p.named.role == "input" else ZERO for p in table.places
    }
    for name, text in read.loop.drives.items():
        where = f"loop.drives.{name}"
        read.known(name, places, "variable", where)
        _check_not_idle(table, places[name], where)
        dim = units.FORCE if places[name].dimension == units.LENGTH else units.TORQUE
        unknown = isinstance(text, str) and text.strip() == UNKNOWN
        by_variable[name] = None if unknown else read.value(text, dim, where, names)
    inputs = [v.name for v in read.named.values() if v.role == "input"]
    wrong = [name for name in read.loop.drives if (by_variable[name] is None) != (name in inputs)]
    if read.free and wrong:
        raise SceneError(
            "where variables are free, the motion follows from the known efforts: only an input's drive can "
            f"be found, and it always is; got {read.loop.drives[wrong[0]]!r}",
            where=f"loop.drives.{wrong[0]}",
            hint=f'Write "{UNKNOWN}", or nothing.'
            if wrong[0] in inputs
            else "Give the effort; it is 0 if absent.",
        )
    unknown_ = [name for name, effort in by_variable.items() if effort is None]
    if len(unknown_) != len(inputs):
        raise SceneError(
            f"expected as many unknown drives as inputs, {len(inputs)} ({', '.join(inputs) or 'none'}), "
            f"got {len(unknown_)} ({', '.join(unknown_) or 'none'})",
            where="loop.drives",
            hint=f'Where the drive of an input is given, another one is "{UNKNOWN}"; every input has an '
            "unknown drive unless its effort is given.",
        )
    return by_variable


def _rows_by_link(table: LoopTable) -> dict[str, int]:
    return {row.link: i for i, row in enumerate(table.rows[:-1])}


def _vector(
    read: LoopReader,
    texts: Sequence[str | int | float] | None,
    dim: units.Dimension,
    where: str,
    names: Names | None = None,
) -> Vector:
    if texts is None:
        return NOWHERE
    x, y, z = read.vector(list(texts), dim, where, names)
    return x, y, z


def _check_round(read: LoopReader, body: LoopBody, where: str) -> None:
    """Check that a link which spins idly is axisymmetric about the line of its balls."""
    (_, xy, xz), (_, yy, yz), (_, _, zz) = body.inertia
    wrong = {
        "centre": [(body.centre[1], ZERO), (body.centre[2], ZERO)],
        "inertia": [(yy, zz), (xy, ZERO), (xz, ZERO), (yz, ZERO)],
    }
    for key, pairs in wrong.items():
        if not all(_same(read, a, b) for a, b in pairs):
            raise SceneError(
                f"{body.link} spins idly between its two balls, and alpha of one of them holds that spin "
                "constant: this requires a link with rotational symmetry about the line of its balls",
                where=f"{where}.{key}",
                hint="Put the centre on that line and make yy = zz with no products, or let alpha of both "
                'balls vary and make one of them free: alpha = "spin", free = { spin = { at = ... } }.',
            )


def _same(read: LoopReader, a: sp.Expr, b: sp.Expr) -> bool:
    """Return whether two values are equal for all values of the tunable parameters."""
    if a == b:
        return True
    for factor in _TRIALS:
        values = {s: v * sp.nsimplify(factor) for s, v in read.defaults.items()}
        x, y = (number(e, values) for e in (a, b))
        if not abs(x - y) <= _SAME * max(abs(x), abs(y)):
            return False
    return True


def _check_no_twist(load: LoopLoad, written: LinkLoad, where: str) -> None:
    """Check that a load leaves an idle spin alone, and does not depend on it."""
    across = load.force[1:] if not load.in_ground else ()
    wrong = {
        "torque": load.torque,
        "at": load.at[1:],
        "force": across,
    }
    for key, values in wrong.items():
        if any(value != 0 for value in values):
            raise SceneError(
                f"{load.link} spins idly between its two balls, and its frame does not follow that spin: "
                "a load on it is a force at a point of the line of its balls, along that line or in the "
                f"frame of the ground, got {getattr(written, key)!r}",
                where=f"{where}.{key}",
                hint='Give at = [x, 0, 0], no torque, and frame = "ground" for a force across the line; or '
                "make its spin a free variable.",
            )


def _check_not_idle(table: LoopTable, place: PlacedVariable, where: str) -> None:
    for link in table.idle:
        if place.row in (link, link + 1):
            raise SceneError(
                f"the ball of {place.name} joins {table.rows[link].link}, which spins idly: its angles are "
                "no axes of a drive",
                where=where,
                hint="Drive a joint with an axis, or put a load on a link.",
            )
