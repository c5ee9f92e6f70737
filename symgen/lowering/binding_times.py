"""Per-run precomputation: terms that depend on parameters only are evaluated once, in a separate kernel.

Parameters are constant during a run (:attr:`symgen.symbolic.system.Group.per_run`). Every part of a kernel
that depends on them alone moves into the kernel 'setup', whose results are appended to the parameter
array: ``setup(t, q, u, p, work, p + n)`` for ``n`` parameters. All other kernels read them from there.
Arguments of a building block vary from call to call, so there is nothing to precompute.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from symgen.errors import DerivationError
from symgen.lowering.expressions import (
    ONE,
    Call,
    Constant,
    Negative,
    Node,
    Product,
    Quotient,
    Reference,
    Sum,
    children,
    negative,
    references,
    signs,
)
from symgen.lowering.kernel import RANK_TOLERANCE, SETUP, Assignment, Block, Kernel, Store
from symgen.lowering.straight_line import StraightLine
from symgen.symbolic.system import LIMITS, Group


def with_setup(kernels: Sequence[Kernel], parameters: Group) -> tuple[Kernel, ...]:
    """Move the terms that depend on per-run parameters only into a setup kernel, and return all kernels.

    The kernels are returned unchanged if no parameter is constant per run or no term qualifies. So is the
    kernel of limits, which is called before a run is set up.

    Raises
    ------
    DerivationError
        If a kernel already has the name of the setup kernel.
    """
    if not (parameters.per_run and parameters.quantities):
        return tuple(kernels)
    setup = _SetUp(parameters)
    splits = {k.name: _Split(setup, k) for k in kernels if k.name != LIMITS}
    if SETUP in splits:
        raise DerivationError(f"a kernel is called {SETUP!r}, which is reserved for the setup kernel")
    if not setup.places:
        return tuple(kernels)
    size = len(parameters.quantities) + len(setup.places)
    lowered: dict[str, Kernel] = {}

    def rest(kernel: Kernel) -> Kernel:
        if kernel.name == LIMITS:
            return kernel
        if kernel.name not in lowered:
            first, then = (tuple(map(rest, called)) for called in (kernel.first, kernel.then))
            lowered[kernel.name] = splits[kernel.name].kernel(parameters.name, size, first, then)
        return lowered[kernel.name]

    return (setup.kernel(), *map(rest, kernels))


class _SetUp:
    """Collects the terms that depend on parameters only; equal terms of different kernels are stored once."""

    def __init__(self, parameters: Group) -> None:
        self.array, self.offset = parameters.name, len(parameters.quantities)
        self.places: dict[Node, int] = {}
        self._line = StraightLine()
        self._count = 0

    def name(self, node: Node) -> Node:
        """Return the name of a term whose operands are already named."""
        self._count += 1
        return self._line.name(node, f"s{self._count - 1}")

    def place(self, node: Node) -> Node:
        """Return the reference of other kernels to a term; terms that cost at most a sign are not moved."""
        bare = node.value if isinstance(node, Negative) else node
        if isinstance(bare, Constant) or (isinstance(bare, Reference) and "[" in bare.name):
            return node
        place = self.places.setdefault(node, len(self.places))
        return Reference(f"{self.array}[{self.offset + place}]")

    def kernel(self) -> Kernel:
        """Return the kernel that computes all stored terms."""
        array, offset = self.array, self.offset
        return Kernel(
            SETUP,
            f"what depends on the parameters alone, once before all else: out is {array} + {offset}",
            ((array, offset),),
            self._line.assignments(self.places),
            tuple(Store("out", place, node) for node, place in self.places.items()),
            (Block("derived", 0, (len(self.places), 1), "SI", "for all other kernels to read"),),
        )


class _Split:
    """Partition of a kernel: terms that depend on parameters only go to the setup, the rest remains."""

    def __init__(self, setup: _SetUp, kernel: Kernel) -> None:
        self._setup, self._of = setup, kernel
        self._known: dict[str, Node] = {}
        self._assignments: list[Assignment] = []
        for a in kernel.assignments:
            value, fixed = self._part(a.value)
            if fixed:
                self._known[a.target] = value
            else:
                self._assignments.append(Assignment(a.target, value))
        self._stores = tuple(Store(s.array, s.index, self._varying(s.value)) for s in kernel.stores)

    def kernel(self, array: str, size: int, first: tuple[Kernel, ...], then: tuple[Kernel, ...]) -> Kernel:
        """Return the remaining kernel, with ``size`` entries in the parameter array."""
        values = [a.value for a in self._assignments] + [s.value for s in self._stores]
        reads = any(name.startswith(f"{array}[") for name in references(values))
        inputs = tuple(
            (name, size if name == array else count)
            for name, count in self._of.inputs
            if name != array or reads
        )
        rest = tuple(self._assignments)
        return replace(self._of, inputs=inputs, assignments=rest, stores=self._stores, first=first, then=then)

    def _varying(self, node: Node) -> Node:
        """Return a node as it appears in the remaining kernel."""
        value, fixed = self._part(node)
        return self._setup.place(value) if fixed else value

    def _part(self, node: Node) -> _Part:
        """Return the node in the setup and True, or the node in the remaining kernel and False."""
        match node:
            case Constant():
                return node, True
            case Reference(name):
                if name in self._known:
                    return self._known[name], True
                return node, name.startswith(f"{self._setup.array}[") and name != RANK_TOLERANCE
            case Negative(value):
                inner, fixed = self._part(value)
                return (negative(inner) if fixed else Negative(inner)), fixed
            case Sum():
                return self._sum(tuple(zip(signs(node), map(self._part, children(node)), strict=True)))
            case Product(factors):
                return self._product(tuple(map(self._part, factors)))
            case Quotient(numerator, denominator):
                return self._quotient(numerator, denominator)
            case Call(arguments=arguments):
                parts = tuple(map(self._part, arguments))
                if all(fixed for _, fixed in parts):
                    return self._setup.name(replace(node, arguments=tuple(x for x, _ in parts))), True
                return replace(node, arguments=tuple(map(self._placed, parts))), False
        raise TypeError(f"not a node: {node!r}")

    def _placed(self, part: _Part) -> Node:
        return self._setup.place(part[0]) if part[1] else part[0]

    def _sum(self, terms: tuple[tuple[int, _Part], ...]) -> _Part:
        """Partition a sum: its constant terms are combined at the position of the first one."""
        fixed = [(sign, node) for sign, (node, is_fixed) in terms if is_fixed]
        above, below = ([node for node_sign, node in fixed if node_sign == sign] for sign in (1, -1))
        if len(fixed) > 1:
            one = self._setup.name(Sum((*above, *map(Negative, below)) if above else tuple(below))), True
            if len(fixed) == len(terms):
                return one
            at = next(i for i, (_, part) in enumerate(terms) if part[1])
            moving = [term for term in terms if not term[1][1]]
            terms = (*moving[:at], (1 if above else -1, one), *moving[at:])
        first, *others = ((sign, self._placed(part)) for sign, part in terms)
        return Sum((first[1], *(node if sign > 0 else Negative(node) for sign, node in others))), False

    def _product(self, factors: _Parts) -> _Part:
        fixed = _fixed(factors)
        if len(fixed) == len(factors):
            return self._setup.name(Product(fixed)), True
        if len(fixed) > 1:
            factors = _merged(factors, (self._setup.name(Product(fixed)), True))
        return Product(tuple(map(self._placed, factors))), False

    def _quotient(self, numerator: Node, denominator: Node) -> _Part:
        """Partition a quotient: a constant denominator becomes a factor, constant factors a quotient."""
        above, below = (tuple(map(self._part, _factors(x))) for x in (numerator, denominator))
        over, under = _fixed(above), _fixed(below)
        if len(over) == len(above) and len(under) == len(below):
            return self._setup.name(Quotient(_joined(over, self._setup), _joined(under, self._setup))), True
        if not under or (len(under) < len(below) and not over):
            top, bottom = (self._product(x) if len(x) > 1 else x[0] for x in (above, below))
            return Quotient(self._placed(top), self._placed(bottom)), False
        one = self._setup.name(Quotient(_joined(over, self._setup), _joined(under, self._setup)))
        moving = [self._setup.place(one), *(x for x, fixed in above if not fixed)]
        top_node = Product(tuple(moving)) if len(moving) > 1 else moving[0]
        rest = [x for x, fixed in below if not fixed]
        if not rest:
            return top_node, False
        return Quotient(top_node, Product(tuple(rest)) if len(rest) > 1 else rest[0]), False


#: A node of the setup or of the kernel, and whether it depends on the parameters only.
_Part = tuple[Node, bool]
_Parts = tuple[_Part, ...]


def _fixed(parts: _Parts) -> tuple[Node, ...]:
    return tuple(x for x, fixed in parts if fixed)


def _merged(parts: _Parts, one: _Part) -> _Parts:
    """Return the parts with ``one`` in place of the first constant part, without the other constant parts."""
    at = next(i for i, part in enumerate(parts) if part[1])
    moving = [part for part in parts if not part[1]]
    return (*moving[:at], one, *moving[at:])


def _factors(node: Node) -> tuple[Node, ...]:
    return node.factors if isinstance(node, Product) else (node,)


def _joined(factors: tuple[Node, ...], setup: _SetUp) -> Node:
    if not factors:
        return ONE
    return setup.name(Product(factors)) if len(factors) > 1 else factors[0]
