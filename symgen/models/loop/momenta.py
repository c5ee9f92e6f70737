"""Velocities and momenta of the links of a loop by one path, written from link to link as in the source."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator

import sympy as sp

from symgen.mechanics.loop.dual_euler import Inertia
from symgen.mechanics.loop.dual_paths import ACCELERATION, NOTHING, Paths
from symgen.mechanics.sources import PATHS
from symgen.models.loop.derivation import REFERENCE, LoopDerivation, named
from symgen.models.loop.equilibrium import free_name, taken_names, unloaded_balls
from symgen.models.loop.solved import is_slider_crank, solved_motion
from symgen.scene.loop.loop import Loop
from symgen.symbolic.dual import DualVector
from symgen.symbolic.names import Names
from symgen.symbolic.quantity import AXES, quantity
from symgen.symbolic.system import Definition, Group, NamedMatrix, System

_VELOCITY = ("wx", "wy", "wz", "vx", "vy", "vz")
_MOMENTUM = ("px", "py", "pz", "hx", "hy", "hz")


def path_system(loop: Loop, path: str) -> System:
    """Return velocities, momenta and their rates by the ``forward`` or the ``backward`` path.

    Each link has those of the link before it on the path, V1_xp to V1_zd, as letters: real part (p) and dual
        part (d) of its dual velocity. A velocity without sums has no letters.
    """
    model = LoopDerivation(loop)
    meet = sum(map(len, model.rows)) if path == "forward" else 0
    names = _LinkNames(model, meet, f"{path} path")
    paths = Paths(model.rows, model.rates, names, meet)
    velocities, rates = (
        [vectors[end] for end in (0, *paths.ends)]
        for vectors in (paths.velocities, paths.accelerations(model.second, NOTHING, ""))
    )
    matrices: list[NamedMatrix] = []
    if path == "forward":
        matrices += _joints(model, paths, velocities)
    for k, link in enumerate(model.links, 1):
        here = f"of {link} by the {path} path, in its frame about its origin"
        velocity, rate = names.written(velocities[k], k), names.written(rates[k], k)
        matrices.append(_matrix(f"{link}_motion_{path}", velocity, "rad/s, m/s", f"dual velocity {here}"))
        if loop.body(k - 1) is not None:
            binor = names.binor(k, model.inertia(k))
            if path == "forward":
                about = f"inertia binor of {link}, in its frame about its origin: momentum by dual velocity"
                matrices.append(
                    named(f"{link}_binor", binor, "kg, kg*m, kg*m^2", about, _MOMENTUM, _VELOCITY)
                )
            matrices += [
                named(
                    f"{link}_momentum{word}_{path}",
                    [names.ordered(e) for e in binor * motion.column],
                    unit,
                    about + here,
                    _MOMENTUM,
                )
                for word, motion, unit, about in (
                    ("", velocity, "kg*m/s, kg*m^2/s", "dual momentum "),
                    ("_rate", rate, "N, N*m", "rate of the components of the dual momentum "),
                )
            ]
    return _system(model, path, f"Velocities and momenta by the {path} path", matrices, names)


def closure_system(loop: Loop) -> System:
    """Return the equality of velocities by both paths where they meet, and that of accelerations, A q'' = V.

    Of a slider-crank also its rates and accelerations one after another.
    """
    model = LoopDerivation(loop)
    meet = model.paths.meet
    names = _LinkNames(model, meet, "shorter path, dependent variables without accelerations")
    given = [
        sp.S.Zero if v.role == "dependent" else a for v, a in zip(model.variables, model.second, strict=True)
    ]
    ahead, behind = (Paths(model.rows, model.rates, names, to) for to in (meet, meet - 1))
    velocities = ahead.velocities[meet] - behind.velocities[meet]
    right = behind.accelerations(given, NOTHING, "")[meet] - ahead.accelerations(given, NOTHING, "")[meet]
    where = "in the frame where both paths meet"
    matrices = [
        named(
            "closure_of_velocities",
            [names.ordered(e) for e in velocities.column],
            "rad/s, m/s",
            f"dual velocity by the forward path less that by the backward path, {where}; zero",
            _VELOCITY,
            left=sp.S.Zero,
        ),
        named(
            "closure_acceleration_rhs",
            [names.ordered(e) for e in right.column],
            "rad/s^2, m/s^2",
            f"V of A q'' = V, closure of accelerations {where}; A is closure_matrix",
            _VELOCITY,
        ),
    ]
    if is_slider_crank(loop.rows, unloaded_balls(loop)):
        matrices += _solved(model, ahead, right, names)
    return _system(model, "closure", "Rates and accelerations of the joint variables", matrices, names)


def _solved(
    model: LoopDerivation, paths: Paths, right: DualVector, names: _LinkNames
) -> Iterator[NamedMatrix]:
    """Yield rates and accelerations of the dependent variables of a slider-crank, solved from A x = V."""
    screws = model.paths.columns(paths.meeting_screws, len(model.variables))
    dependent = [j for j, v in enumerate(model.variables) if v.role == "dependent"]
    matrix = {
        row: {model.variables[j].name: screws[i, j] for j in dependent} for i, row in enumerate(_VELOCITY)
    }
    given = sp.Matrix([0 if j in dependent else rate for j, rate in enumerate(model.rates)])
    for noun, side, symbols in (
        ("rate", -screws * given, [v.rate for v in model.variables]),
        ("acceleration", right.column, [v.acceleration for v in model.variables]),
    ):
        unknowns = {model.variables[j].name: symbols[j] for j in dependent}
        solved = solved_motion(
            model.loop.rows,
            matrix,
            dict(zip(_VELOCITY, side, strict=True)),
            {name: x.symbol for name, x in unknowns.items()},
            names.ordered,
        )
        about = f"{noun}s of the dependent variables one after another, each by those before it"
        units = ", ".join(unknowns[name].unit for name in solved)
        left = [unknowns[name].symbol for name in solved]
        yield named(f"joint_{noun}s", list(solved.values()), units, about, tuple(solved), left=left)


def _system(
    model: LoopDerivation, name: str, title: str, matrices: Iterable[NamedMatrix], names: _LinkNames
) -> System:
    parameters = tuple(p.quantity for p in model.loop.parameters)
    return System(
        f"{model.loop.name}_{name}",
        title,
        (
            Group("q", "joint variables", tuple(v.quantity for v in model.variables)),
            Group("u", "rates of the joint variables", tuple(v.rate for v in model.variables)),
            Group("p", "tunable parameters", parameters, per_run=True),
            Group("work", "accelerations", tuple(v.acceleration for v in model.variables)),
        ),
        tuple(matrices),
        (),
        definitions=names.definitions,
        references=(REFERENCE,),
        sources=PATHS,
    )


def _joints(model: LoopDerivation, paths: Paths, velocities: list[DualVector]) -> Iterator[NamedMatrix]:
    """Yield relative velocities of the joints, and velocities of links before they are carried on."""
    links = ["ground", *model.links, "ground"]
    for k in range(1, len(model.rows) + 1):
        relative = paths.joint_velocity(k)
        about = f"velocity of {links[k]} relative to {links[k - 1]}, in frame {{{k}}}"
        yield _matrix(f"joint_{k}_velocity", relative, "rad/s, m/s", about)
        if 1 < k < len(model.rows):
            about = f"velocity of {links[k]} in frame {{{k}}}: of {links[k - 1]}, and relative to it"
            yield _matrix(f"{links[k]}_motion_in_{k}", velocities[k - 1] + relative, "rad/s, m/s", about)


def _matrix(name: str, vector: DualVector, unit: str, about: str) -> NamedMatrix:
    return named(name, vector.column, unit, about, _VELOCITY)


class _LinkNames(Names):
    """Letters for the velocities of links and for their inertia; between links nothing is named."""

    def __init__(self, model: LoopDerivation, meet: int, path: str) -> None:
        self._taken_names = taken_names(model)
        super().__init__(self._taken_names)
        self._path, self._links = path, model.links
        self._rates = (*model.second, *model.rates)
        #: Links by the motion at the end of their path, of which ``Paths`` names the velocity.
        self._ends = {
            (row[-1] if end < meet else behind[0]).name: k
            for k, (row, behind, end) in enumerate(
                zip(model.rows, model.rows[1:], model.paths.ends, strict=False), 1
            )
            if end != meet
        }
        self._letters: dict[sp.Symbol, Definition] = {}

    @property
    def definitions(self) -> tuple[Definition, ...]:
        """All letters, each after those it uses."""
        return tuple(self._letters.values())

    def scalar(self, name: str, expression: sp.Expr, unit: str, meaning: str) -> sp.Expr:
        """Return the expression."""
        return sp.sympify(expression)

    def screw(
        self, name: str, vector: DualVector, kinds: tuple[tuple[str, str, str], tuple[str, str, str]], of: str
    ) -> DualVector:
        """Return a dual vector, of a link with letters for its components if one of them is a sum."""
        link = self._ends.get(name)
        if link is None:
            return vector
        if not any(e.has(sp.Add) for e in vector.column):
            return vector
        ending = "_rate" if kinds is ACCELERATION else ""
        written = self.written(vector, link)
        parts = []
        for letter, part, (_, unit, meaning) in zip("pd", (written.real, written.dual), kinds, strict=True):
            about = f"{meaning} {self._links[link - 1]}, {self._path}"
            ordered = [
                (f"V{link}_{a}{letter}{ending}", self.ordered(e), f"{a} component: {about}")
                for a, e in zip(AXES, part, strict=True)
            ]
            parts.append(tuple(self._letter(n, e, unit, of) if e != 0 else e for n, e, of in ordered))
        return DualVector(*parts)

    def _letter(self, name: str, e: sp.Expr, unit: str, meaning: str) -> sp.Expr:
        new = quantity(free_name(name, self._taken_names), unit, meaning)
        self._letters[new.symbol] = Definition(new, e)
        return new.symbol

    def written(self, vector: DualVector, link: int) -> DualVector:
        """Return a velocity of a link, or its rate, without the letters of this link."""
        own = {s: d.expression for s, d in self._letters.items() if s.name.startswith(f"V{link}_")}
        real, dual = (tuple(e.xreplace(own) for e in part) for part in (vector.real, vector.dual))
        return DualVector(real, dual)

    def ordered(self, e: sp.Expr) -> sp.Expr:
        """Return a sum by velocities of links, within these by rates, with common factors before it."""
        e = _grouped(sp.expand(e), (*self._letters,), lambda x: _grouped(x, self._rates, lambda y: y))
        return sp.factor_terms(e)

    def binor(self, link: int, inertia: Inertia) -> sp.ImmutableMatrix:
        """Return the inertia binor of a link with letters for its centre and its inertia about the origin."""
        of = self._links[link - 1]
        x, y, z = (
            e if e.is_Atom else self._letter(f"g{link}_{a}", e, "m", f"{a} of the centre of mass of {of}")
            for a, e in zip(AXES, inertia.centre, strict=True)
        )
        binor = Inertia(inertia.mass, (x, y, z), inertia.matrix).binor.as_mutable()
        for i, a in enumerate(AXES):
            for j, b in enumerate(AXES):
                about = f"inertia of {of} about the origin of its frame"
                name = f"I{link}_{min(a, b)}{max(a, b)}"
                if not binor[3 + i, j].is_Atom:
                    binor[3 + i, j] = self._letter(name, binor[3 + i, j], "kg*m^2", about)
        return binor.as_immutable()


def _grouped(e: sp.Expr, symbols: Collection[sp.Symbol], within: Callable[[sp.Expr], sp.Expr]) -> sp.Expr:
    """Return an expanded sum with its terms put together by their products of some symbols.

    Products with the same factor stand in one bracket.
    """
    groups: dict[sp.Expr, list[sp.Expr]] = {}
    for term in sp.Add.make_args(e):
        factor, product = term.as_independent(*symbols, as_Add=False)
        groups.setdefault(product, []).append(factor)
    merged: dict[sp.Expr, list[sp.Expr]] = {}
    for product, factors in groups.items():
        merged.setdefault(within(sp.Add(*factors)), []).append(product)
    return sp.Add(*(sp.Add(*products) * factor for factor, products in merged.items()))
