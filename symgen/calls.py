"""Calls of the public interface: arguments are checked against the annotations before execution."""

from __future__ import annotations

import math
import numbers
import threading
from collections.abc import Callable, Mapping, Set
from functools import wraps
from operator import index
from types import FunctionType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

from symgen.errors import ArgumentError, ModelError, nearest, shown

if TYPE_CHECKING:
    import ast

#: Methods behind operators, which are public as well.
_OPERATORS = ("__getitem__", "__contains__")


class _Failures(threading.local):
    """Errors of kernels in Python, and Ctrl-C in them, by thread: compiled code between them cannot raise."""

    def __init__(self) -> None:
        self.errors: list[BaseException] = []


FAILURES = _Failures()

Target = TypeVar("Target", bound=Callable[..., Any])


def checked(target: Target) -> Target:
    """Check all calls of a function, or of the public methods of a class, against the annotations.

    A call with an argument of another type, or with arguments missing or unknown, raises ModelError, which
    names the call and the argument.
    """
    if not isinstance(target, type):
        return cast("Target", _checked(cast("FunctionType", target)))
    for name, value in [*vars(target).items()]:
        if isinstance(value, FunctionType) and (name in _OPERATORS or not name.startswith("_")):
            setattr(target, name, _checked(value))
    return target


def _checked(function: FunctionType) -> Callable[..., Any]:
    interface: list[_Interface] = []
    unchanged: set[tuple[type, ...]] = set()

    @wraps(function)
    def call(*values: Any, **named: Any) -> Any:
        types = (*map(type, values),)
        if named or types not in unchanged:
            if not interface:  # built at the first call, so that imports stay light
                interface.append(_interface(function))
            values, named = interface[0].taken(values, named)
            if not named and interface[0].by_type(len(values)):
                unchanged.add(types)
        try:
            return function(*values, **named)
        finally:
            raise_failure()

    return call


def raise_failure() -> None:
    """Raise the first error of a kernel in this thread since the last call, in place of its consequences."""
    if FAILURES.errors:
        error = FAILURES.errors[0]
        FAILURES.errors.clear()
        raise error from None


#: Calls that replace a function without an argument of this name.
_ELSEWHERE = {
    "inputs": "model.with_parameters sets constant inputs; for others integrate model.rhs(t, y, u), and "
    "model.record makes a result of the states.",
}


class _Kind(NamedTuple):
    """Values that an annotation permits: ``take`` converts one, or raises an exception.

    ``by_type`` states that all values of a type are permitted and unchanged, or none.
    """

    take: Callable[[Any], Any]
    words: str
    by_type: bool = False


class _Interface(NamedTuple):
    """Arguments of a function; ``further`` and ``others`` stand for its ``*`` and ``**`` arguments."""

    name: str
    ordered: tuple[str, ...]
    required: tuple[str, ...]
    kinds: Mapping[str, _Kind]
    further: tuple[str, _Kind] | None
    others: _Kind | None

    def by_type(self, count: int) -> bool:
        """Return whether the types of this number of arguments by position determine the answer."""
        kinds = [self.kinds[place] for place in self.ordered[:count]]
        kinds += [self.further[1]] if self.further else []
        return all(kind.by_type for kind in kinds)

    def taken(
        self, values: tuple[Any, ...], named: Mapping[str, Any]
    ) -> tuple[tuple[Any, ...], dict[str, Any]]:
        """Return the converted arguments of a call; raise ModelError for one that is not permitted."""
        for name in () if self.required == self.ordered[: len(values)] else self.required:
            if name not in named and name not in self.ordered[: len(values)]:
                raise ModelError(f"{self.name} needs {self.kinds[name].words} for {name}, got no argument")
        by_place = [
            self._take(name, value, self.kinds[name])
            for name, value in zip(self.ordered, values, strict=False)
        ]
        for value in values[len(self.ordered) :]:
            if self.further is None:
                known = ", ".join(name for name in self.ordered if name.strip("/") != "self") or "nothing"
                raise ModelError(f"{self.name} takes {known} by position, got {shown(value)} besides")
            by_place.append(self._take(self.further[0], value, self.further[1]))
        by_name = {}
        for name, value in named.items():
            kind = self.kinds.get(name) or self.others
            if kind is None or name in self.ordered[: len(values)]:
                known = (
                    f"{name} is a parameter: model.with_parameters changes it."
                    if values and name in getattr(values[0], "parameters", ())
                    else _ELSEWHERE.get(name) or nearest(name, self.kinds.keys() - {"self", "self/"})
                )
                problem = f"has no argument {name!r}. {known}" if kind is None else f"got {name!r} twice"
                raise ModelError(f"{self.name} {problem}")
            by_name[name] = self._take(name, value, kind)
        return tuple(by_place), by_name

    def _take(self, name: str, value: Any, kind: _Kind) -> Any:
        try:
            return kind.take(value)
        except Exception:  # a value of any kind may raise any exception when it is read
            words = {"before": f"expected {kind.words} for ", "after": f", got {shown(value)}"}
            raise ArgumentError(name, **words, call=self.name) from None


def _interface(function: FunctionType) -> _Interface:
    from inspect import Parameter, signature

    ordered, required, kinds = [], [], {}
    further = others = None
    for name, p in signature(function).parameters.items():
        kind = _ANY if p.annotation is Parameter.empty else _of_annotation(p.annotation)
        if p.kind is Parameter.VAR_POSITIONAL:
            further = name, kind
        elif p.kind is Parameter.VAR_KEYWORD:
            others = kind
        else:
            place = f"{name}/" if p.kind is Parameter.POSITIONAL_ONLY else name  # no keyword is called so
            kinds[place] = kind
            ordered += [place] if p.kind is not Parameter.KEYWORD_ONLY else []
            required += [place] if p.default is Parameter.empty else []
    name = function.__qualname__.removesuffix(".__init__")
    return _Interface(name, tuple(ordered), tuple(required), kinds, further, others)


def _of_annotation(annotation: str) -> _Kind:
    import ast

    parts = [_of_part(node) for node in _alternatives(ast.parse(annotation, mode="eval").body)]
    words = " or ".join(dict.fromkeys(part.words for part in parts if part is not _KINDS["None"]))
    by_type = all(part.by_type for part in parts)
    return parts[0] if len(parts) == 1 else _Kind(lambda value: _first(value, parts), words, by_type)


def _first(value: Any, kinds: list[_Kind]) -> Any:
    for kind in kinds[:-1]:
        try:
            return kind.take(value)
        except Exception:  # noqa: S112 - the next alternative
            continue
    return kinds[-1].take(value)


def _alternatives(node: ast.expr) -> list[ast.expr]:
    left, right = getattr(node, "left", None), getattr(node, "right", None)
    return [*_alternatives(left), *_alternatives(right)] if left and right else [node]


def _of_part(node: ast.expr) -> _Kind:
    """Return the kind of one alternative; a class is recognised by its name, without importing it."""
    import ast

    inner = [ast.unparse(n) for n in _inner(node)]
    outer = node.value if isinstance(node, ast.Subscript) else node
    name = ast.unparse(outer).rpartition(".")[2]
    if name in _KINDS:
        return _KINDS[name]
    if name == "Mapping":
        of_value = _of_annotation(inner[1])
        return _Kind(lambda v: _table(v, of_value), f"a mapping from names to {of_value.words}")
    if name == "Sequence":
        return _LISTS[inner[0]]
    return _typed(lambda v: any(c.__name__ == name for c in type(v).__mro__), f"an object of type {name}")


def _inner(node: ast.expr) -> list[ast.expr]:
    part = getattr(node, "slice", None)
    return list(getattr(part, "elts", [part])) if part else []


def _that(holds: Callable[[Any], bool], words: str) -> _Kind:
    """Return the kind of values for which a test holds; these are returned unchanged."""

    def take(value: Any) -> Any:
        if not holds(value):
            raise ValueError(words)
        return value

    return _Kind(take, words)


def _typed(holds: Callable[[Any], bool], words: str) -> _Kind:
    """Return the kind of values for which a test holds that looks at their type alone."""
    return _that(holds, words)._replace(by_type=True)


def _number(value: Any) -> float:
    if type(value) is float and math.isfinite(value):  # abstract classes of numbers take ten times as long
        return value
    if isinstance(value, numbers.Real):
        real = not isinstance(value, bool)
    else:
        real = value.ndim == 0 and value.dtype.kind in "iuf"
    if not real or not math.isfinite(value):
        raise ValueError
    return float(value)


def _whole(value: Any) -> int:
    if isinstance(value, bool):
        raise TypeError
    return index(value)


def _is_flag(value: Any) -> bool:
    return isinstance(value, bool) or type(value).__name__ in ("bool_", "bool")


def _is_array(value: Any) -> bool:
    """Return whether NumPy converts a value to an array of real numbers; an empty array counts."""
    import numpy as np

    array = np.asarray(value)
    if array.dtype.kind == "O":
        return array.size > 0 and all(isinstance(x, numbers.Real) for x in array.flat)
    return array.dtype.kind in "iuf"


def as_doubles(value: Any) -> Any:
    """Return real numbers as a contiguous array; None for others, such as complex numbers and dates."""
    import numpy as np

    try:
        return np.ascontiguousarray(value, dtype=float) if _is_array(value) else None
    except (TypeError, ValueError, OverflowError):
        return None


def _is_list_of_numbers(value: Any) -> bool:
    import numpy as np

    return np.ndim(value) == 1 and not isinstance(value, Mapping | Set | str) and _is_array(value)


def _is_list_of_names(value: Any) -> bool:
    return isinstance(value, list | tuple) and all(isinstance(x, str) for x in value)


def _table(value: Any, of_value: _Kind) -> Any:
    for key, inner in value.items():
        if not isinstance(key, str):
            raise TypeError
        of_value.take(inner)
    return value


_ANY = _Kind(lambda value: value, "a value", by_type=True)
#: Kinds of annotations, by their last word.
_KINDS = {
    "Any": _ANY,
    "object": _ANY,
    "None": _typed(lambda value: value is None, "None"),
    "float": _Kind(_number, "a finite number"),
    "int": _Kind(_whole, "a whole number"),
    "bool": _typed(_is_flag, "True or False"),
    "str": _typed(lambda value: isinstance(value, str), "text"),
    "PathLike": _that(lambda value: isinstance(value.__fspath__(), str), "a path"),
    "ArrayLike": _that(_is_array, "numbers"),
    "NDArray": _that(_is_array, "numbers"),
    "Array": _that(_is_array, "numbers"),
    "Indices": _that(_is_array, "numbers"),
    "Callable": _typed(callable, "a function"),
}
_LISTS = {
    "float": _that(_is_list_of_numbers, "a list of numbers"),
    "int": _that(_is_list_of_numbers, "a list of numbers"),
    "str": _that(_is_list_of_names, "a list of names"),
}
