"""Operation list of a kernel: values with many digits, and derivatives of its results."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from symgen.lowering.expressions import (
    DIGITS,
    GUARDED_INVERSE,
    Call,
    Constant,
    Lookup,
    Negative,
    Node,
    Product,
    Quotient,
    Reference,
    Sum,
    children,
    signs,
)
from symgen.lowering.kernel import Kernel
from symgen.symbolic.exact import number
from symgen.symbolic.switch import as_fraction

Array = NDArray[np.float64]
Number = Any  # mpmath has no types


@dataclass(frozen=True, slots=True)
class Operation:
    """One operation on the results of earlier ones, given by their indices on the tape.

    ``node`` is the operation; a reference to an argument array is an input. ``kernel`` and ``name`` identify
    its origin: the kernel, and the assignment or ``array[index]`` in which it occurs.
    """

    node: Node
    operands: tuple[int, ...]
    kernel: str
    name: str


class Tape:
    """All operations of a kernel and the kernels it calls, in order, preceded by those of ``setup``.

    ``out`` maps every entry of ``out``, and ``inputs`` every entry that is read before it is written, by
    array and index, to its index on the tape. ``fixed`` entries of arrays are numbers.
    """

    def __init__(
        self, kernel: Kernel, setup: Kernel | None = None, fixed: Mapping[str, str] | None = None
    ) -> None:
        self._fixed = dict(fixed or {})
        self.operations: list[Operation] = []
        self.inputs: dict[tuple[str, int], int] = {}
        self._arrays: dict[str, int] = {}
        if setup:
            self._append(setup)
            ((array, offset),) = setup.inputs
            self._arrays |= {
                f"{array}[{offset + i}]": self._arrays.pop(f"out[{i}]") for i in range(setup.out_size)
            }
        self._append(kernel)
        self.out = {int(name[4:-1]): place for name, place in self._arrays.items() if name.startswith("out[")}

    def _append(self, kernel: Kernel) -> None:
        for called in kernel.first:
            self._append(called)
        known: dict[str, int] = {}
        for a in kernel.assignments:
            known[a.target] = self._place(a.value, known, kernel.name, a.target)
        stored = [(f"{s.array}[{s.index}]", s.value) for s in kernel.stores]
        # All loads precede all stores.
        self._arrays |= {name: self._place(value, known, kernel.name, name) for name, value in stored}
        for called in kernel.then:
            self._append(called)

    def _place(self, node: Node, known: Mapping[str, int], kernel: str, name: str) -> int:
        if isinstance(node, Reference):
            return known[node.name] if node.name in known else self._load(node, kernel)
        operands = tuple(self._place(part, known, kernel, name) for part in children(node))
        self.operations.append(Operation(node, operands, kernel, name))
        return len(self.operations) - 1

    def _load(self, node: Reference, kernel: str) -> int:
        if node.name in self._fixed:
            self.operations.append(Operation(Constant(self._fixed[node.name]), (), kernel, node.name))
            return len(self.operations) - 1
        if node.name not in self._arrays:
            array, _, index = node.name.rstrip("]").partition("[")
            self.operations.append(Operation(node, (), kernel, node.name))
            place = self._arrays[node.name] = len(self.operations) - 1
            self.inputs[array, int(index)] = place
        return self._arrays[node.name]

    def values(self, arguments: Mapping[str, Any]) -> list[Number]:
        """Return the result of every operation for these arrays, to 40 digits."""
        known: dict[int, Number] = {
            place: number(arguments[array][index]) for (array, index), place in self.inputs.items()
        }
        with mpmath.workdps(DIGITS):
            numbers: list[Number] = []
            for place, operation in enumerate(self.operations):
                if place in known:
                    numbers.append(known[place])
                else:
                    numbers.append(_value(operation.node, [numbers[i] for i in operation.operands]))
        return numbers

    def conditions(self, values: list[Number]) -> dict[int, float]:
        """Return sum |x_j df/dx_j| of every entry f of ``out``, over all inputs x_j.

        The slopes are taken operation by operation at the 40-digit values and added in double precision,
        of which the first digits matter.
        """
        slopes: list[Array | None] = []
        numbers = {place: i for i, place in enumerate(self.inputs.values())}
        for place, operation in enumerate(self.operations):
            total: Array | None = None
            if place in numbers and values[place]:
                total = np.zeros(len(numbers))
                total[numbers[place]] = float(values[place])
            for i, slope in zip(operation.operands, self._slopes(place, values), strict=True):
                inner = slopes[i]
                if slope and inner is not None:
                    total = slope * inner if total is None else total + slope * inner
            slopes.append(total)
        of_out = ((index, slopes[place]) for index, place in self.out.items())
        return {index: 0.0 if row is None else float(np.sum(np.abs(row))) for index, row in of_out}

    def influence(self, values: list[Number], entry: int) -> list[float]:
        """Return the derivative of one entry of ``out`` by the result of every operation."""
        adjoints = [0.0] * len(self.operations)
        adjoints[self.out[entry]] = 1.0
        for place in range(len(self.operations) - 1, -1, -1):
            if adjoints[place]:
                operands = self.operations[place].operands
                for i, slope in zip(operands, self._slopes(place, values), strict=True):
                    adjoints[i] += adjoints[place] * slope
        return adjoints

    def _slopes(self, place: int, values: list[Number]) -> tuple[float, ...]:
        """Return the derivative of an operation by each of its operands."""
        operation = self.operations[place]
        x = [values[i] for i in operation.operands]
        match operation.node:
            case Sum():
                return tuple(map(float, signs(operation.node)))
            case Negative():
                return (-1.0,)
            case Product():
                return tuple(float(mpmath.fprod(x[:i] + x[i + 1 :])) for i in range(len(x)))
            case Quotient():
                return float(1 / x[1]), float(-values[place] / x[1])
            case Lookup():
                return (0.0,) * len(x)
            case Call(function, _):
                return tuple(float(d) for d in _DERIVATIVES[function](values[place], *x))
        return ()


def _value(node: Node, x: list[Number]) -> Number:
    match node:
        case Constant(text):
            return mpmath.mpf(text)
        case Sum():
            return mpmath.fsum(sign * value for sign, value in zip(signs(node), x, strict=True))
        case Negative():
            return -x[0]
        case Product():
            return mpmath.fprod(x)
        case Quotient():
            return x[0] / x[1]
        case Lookup(column=column):
            found = column(*map(as_fraction, x))
            return mpmath.mpf(found.numerator) / found.denominator
        case Call(function, _):
            return _FUNCTIONS[function](*x)
    raise TypeError(f"not an operation: {node!r}")


def _guarded(pivot: Number, sound: Number, tolerance: Number) -> Number:
    return mpmath.mpf(0) if abs(pivot) <= tolerance * abs(sound) else 1 / pivot


_OF_MPMATH = "sin cos tan asin acos atan atan2 sinh cosh tanh exp log sqrt"
_FUNCTIONS: dict[str, Callable[..., Number]] = {
    **{name: getattr(mpmath, name) for name in _OF_MPMATH.split()},
    "fabs": abs,
    "fmax": max,
    "pow": mpmath.power,
    GUARDED_INVERSE: _guarded,
}

#: Partial derivatives of each function, from its value and its arguments.
_DERIVATIVES: dict[str, Callable[..., tuple[Number, ...]]] = {
    "sin": lambda _, x: (mpmath.cos(x),),
    "cos": lambda _, x: (-mpmath.sin(x),),
    "tan": lambda f, _: (1 + f * f,),
    "asin": lambda _, x: (1 / mpmath.sqrt(1 - x * x),),
    "acos": lambda _, x: (-1 / mpmath.sqrt(1 - x * x),),
    "atan": lambda _, x: (1 / (1 + x * x),),
    "atan2": lambda _, y, x: (x / (x * x + y * y), -y / (x * x + y * y)),
    "sinh": lambda _, x: (mpmath.cosh(x),),
    "cosh": lambda _, x: (mpmath.sinh(x),),
    "tanh": lambda f, _: (1 - f * f,),
    "exp": lambda f, _: (f,),
    "log": lambda _, x: (1 / x,),
    "sqrt": lambda f, _: (1 / (2 * f) if f else mpmath.mpf(0),),
    "fabs": lambda _, x: (mpmath.sign(x),),
    "fmax": lambda f, x, _: (1, 0) if f == x else (0, 1),
    "pow": lambda f, x, n: (n * x ** (n - 1), f * mpmath.log(x) if x > 0 else mpmath.mpf(0)),
    GUARDED_INVERSE: lambda f, *_: (-f * f, 0, 0),
}
