"""Switching points of loads: the jumps and kinks in their expressions, with a branch that runs hold."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import replace
from functools import partial
from itertools import count
from typing import Any

import sympy as sp

from symgen.scene.loop.loop import JointVariable, Loop, LoopLoad
from symgen.scene.rods.linkage import TIME, Linkage, Vector, state_symbol
from symgen.scene.rods.run_parameters import Parameter, Switch
from symgen.symbolic.quantity import quantity
from symgen.symbolic.switch import PiecewisePolynomial, Sign, written

#: Functions that change about an argument of zero, and hardly elsewhere.
_EDGES = (sp.tanh, sp.cosh, sp.atan)


def with_switches(linkage: Linkage) -> Linkage:
    """Return a linkage whose loads have a branch b for each of their jumps: sign(x) as b + (1 - b^2) sign(x).

    At b = 0, the value of the parameter that is added, this is sign(x); runs hold b at 1 or -1 during a step.
    Smooth pulses in the time have one in their middle, on which no load depends: a step ends there.
    Branches that loads have are omitted first. A linkage restricted to kinematics has no loads.
    """
    linkage = _without_switches(linkage)
    words = {state_symbol(f"{s.name}.state"): sp.Symbol(s.name) for s in linkage.states}
    switches, crank = _Switches(linkage.parameters, words), linkage.crank
    changed = linkage
    if not linkage.kinematic:
        changed = replace(
            linkage,
            loads=tuple(
                load.with_expressions(partial(switches.with_branches, _place(table, i), this=load.name))
                if load.acts
                else load
                for table, i, load in linkage.placed_loads
            ),
            states=tuple(
                replace(s, rate=switches.with_branches(f"[states] {s.name}", s.rate)) for s in linkage.states
            ),
            crank=crank
            and replace(crank, torque=switches.with_branches("[crank]", crank.torque, crank.link)),
        )
    changed = replace(changed, **_prescribed(linkage, switches))
    for where, expressions, variable in loads_of(linkage) if not linkage.kinematic else ():
        switches.stop_at_pulses(where, expressions, variable)
    if crank and not linkage.kinematic:
        switches.stop_at_pulses("[crank]", (crank.torque,), crank.link)
    if not switches.switches:
        return linkage
    return replace(
        changed,
        parameters=(*linkage.parameters, *switches.branches),
        switches=switches.switches,
    )


def _prescribed(linkage: Linkage, switches: _Switches) -> dict[str, Any]:
    """Return the prescribed motions of a linkage, whose tables have knots."""
    return {
        "drivers": tuple(
            replace(d, angle=switches.with_branches(f"the drive of {d.link}", d.angle))
            for d in linkage.drivers
        ),
        "motions": tuple(
            replace(m, value=switches.with_branches(f"the motion of {m.text}", m.value))
            for m in linkage.motions
        ),
        "points": tuple(
            replace(p, motion=tuple(switches.with_branches(f"the motion of {p.name}", x) for x in p.motion))
            for p in linkage.points
        ),
        "links": tuple(
            replace(k, length=switches.with_branches(f"the length of {k.name}", k.length))
            for k in linkage.links
        ),
    }


def with_switches_of_loop(loop: Loop) -> Loop:
    """Return a loop whose loads and drives have a branch for each of their jumps, as :func:`with_switches`.

    Loops that inputs alone move have no runs that hold it.
    """
    if not loop.having("free"):
        return loop
    words = {v.rate.symbol: sp.Symbol(f"{v.name}.rate") for v in loop.variables if not v.is_state}
    switches = _Switches(loop.parameters, words)

    def loaded(index: int, load: LoopLoad) -> LoopLoad:
        where = _place("loop.loads", index)
        switches.stop_at_pulses(where, (*load.force, *load.torque))
        force, torque = (
            tuple(switches.with_branches(where, x) for x in v) for v in (load.force, load.torque)
        )
        return replace(load, force=force, torque=torque)

    def driven(variable: JointVariable) -> JointVariable:
        where = f"the motion of {variable.name}"
        variable = replace(variable, motion=switches.with_branches(where, variable.motion))
        if variable.effort is None:
            return variable
        where = f"[states] {variable.name}" if variable.is_state else f"the drive of {variable.name}"
        switches.stop_at_pulses(where, (variable.effort,))
        return replace(variable, effort=switches.with_branches(where, variable.effort))

    changed = replace(
        loop,
        loads=tuple(loaded(i, load) for i, load in enumerate(loop.loads)),
        variables=tuple(driven(v) for v in loop.variables),
    )
    return replace(changed, parameters=(*loop.parameters, *switches.branches), switches=switches.switches)


def _without_switches(linkage: Linkage) -> Linkage:
    """Return a linkage whose loads have no branches."""
    old: dict[sp.Expr, sp.Expr] = {s.branch.symbol: sp.Integer(0) for s in linkage.switches}
    if not old:
        return linkage
    quantities = {s.branch for s in linkage.switches}
    return replace(
        linkage,
        loads=tuple(load.with_expressions(lambda x: x.xreplace(old)) for load in linkage.loads),
        states=tuple(replace(s, rate=s.rate.xreplace(old)) for s in linkage.states),
        parameters=tuple(p for p in linkage.parameters if p.quantity not in quantities),
        switches=(),
    )


def loads_of(linkage: Linkage) -> Iterator[tuple[str, Vector, str]]:
    """Yield the loads written as expressions: where, these, and the owner of the state called ``this``.

    Rates of first-order states are behind them.
    """
    for table, i, load in linkage.placed_loads:
        if load.acts and load.expressions:
            yield _place(table, i), load.expressions, load.name
    for state in linkage.states:
        yield f"[states] {state.name}", (state.rate,), ""


def _place(table: str, index: int) -> str:
    """Return the name of the table of a load in messages."""
    return f"[[{table}]] no. {index + 1}"


class _Switches:
    """The switching points found; ``words`` are symbols as the scene writes them, where names differ."""

    def __init__(
        self, parameters: Sequence[Parameter], words: Mapping[sp.Symbol, sp.Symbol] | None = None
    ) -> None:
        self._constant = {p.quantity.symbol for p in parameters}
        self._taken = {str(s.name) for s in self._constant}
        self._words = words or {}
        self._this = ""
        self._branches: dict[sp.Expr, sp.Expr] = {}
        self._found: list[Switch] = []

    @property
    def switches(self) -> tuple[Switch, ...]:
        """The switching points, those of tables behind the others."""
        return tuple(sorted(self._found, key=lambda s: s.pieces))

    @property
    def branches(self) -> tuple[Parameter, ...]:
        """The parameters to add: a branch of each switching point, 0 outside runs."""
        return tuple(Parameter(s.branch, sp.Integer(0)) for s in self.switches)

    def with_branches(self, where: str, expression: sp.Expr, this: str = "") -> sp.Expr:
        """Return an expression with the branches of its jumps put in, from the inside out.

        ``this`` is the owner of the state that the scene calls ``this``.
        """
        self._this = this
        return self._of(where, expression)

    def stop_at_pulses(self, where: str, expressions: Vector, this: str = "") -> None:
        """Add a switching point in the middle of every smooth pulse and edge in the time alone."""
        self._this = this
        for node in (n for e in expressions for n in sp.preorder_traversal(e)):
            gap = _middle(node, self._constant)
            if gap is not None:
                self._branch(where, gap, node, smooth=True)

    def _of(self, where: str, expression: sp.Expr) -> sp.Expr:
        if not expression.has(sp.Abs, Sign, PiecewisePolynomial):
            return expression
        rebuilt = expression.func(*(self._of(where, a) for a in expression.args))
        if isinstance(rebuilt, PiecewisePolynomial):
            return rebuilt if rebuilt.free_symbols <= self._constant else self._knots(where, rebuilt)
        if rebuilt.func not in (sp.Abs, Sign) or rebuilt.free_symbols <= self._constant:
            return rebuilt
        (gap,) = rebuilt.args
        sign = self._branch(where, gap, expression)
        return gap * sign if rebuilt.func is sp.Abs else sign

    def _knots(self, where: str, of: PiecewisePolynomial) -> sp.Expr:
        """Return a function in pieces as a run holds it; functions of equal knots have one branch."""
        x, pieces = of.args[0], of.pieces
        knots = sp.Tuple(x, *map(sp.Rational, (*pieces.knots, pieces.period)))
        if knots not in self._branches:
            name = self._name()
            text = f"{pieces.of(written(x.xreplace(self._words), self._this))} in {where}"
            b = quantity(name, "1", f"branch of {text}: 0, or the piece while a run holds it")
            self._found.append(Switch(pieces.gap(x, b.symbol), b, text, pieces=True))
            self._branches[knots] = b.symbol
        return of.func(x, self._branches[knots])

    def _name(self) -> str:
        name = next(n for n in map("switch_{}".format, count()) if n not in self._taken)
        self._taken.add(name)
        return name

    def _branch(self, where: str, gap: sp.Expr, node: sp.Expr, smooth: bool = False) -> sp.Expr:
        """Return the sign of a gap with its branch; gaps that differ by a sign have one branch."""
        if -gap in self._branches:
            return -self._branches[-gap]
        if gap not in self._branches:
            name = self._name()
            text = f"{written(node.xreplace(self._words), self._this)} in {where}"
            b = quantity(name, "1", f"branch of {text}: 0, or 1 and -1 while a run holds it")
            self._found.append(Switch(gap, b, text, smooth))
            self._branches[gap] = b.symbol + (1 - b.symbol**2) * Sign(gap)
        return self._branches[gap]


def _middle(node: sp.Basic, constant: Set[sp.Symbol]) -> sp.Expr | None:
    """Return the switching expression in the middle of a pulse or an edge of a polynomial in time, if any.

    Polynomials have few extrema: a periodic load has no such point, and needs none.
    """
    t = TIME.symbol
    divides = isinstance(node, sp.Pow) and not (node.exp.is_Integer and node.exp > 0)
    if not (divides or isinstance(node, (sp.exp, *_EDGES))):
        return None
    u = node.args[0]
    if t not in u.free_symbols or not u.free_symbols <= constant | {t} or not u.is_polynomial(t):
        return None
    slope = sp.diff(u, t)
    return slope if t in slope.free_symbols else u if isinstance(node, _EDGES) else None
