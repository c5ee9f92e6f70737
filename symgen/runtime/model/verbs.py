"""Analyses of models: one declaration each, carried out by every model that supports it."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from copy import deepcopy
from dataclasses import fields
from functools import cache, wraps
from inspect import Parameter, signature
from types import MappingProxyType, MethodType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from symgen.calls import checked, raise_failure
from symgen.display import Shown
from symgen.errors import CapabilityError, ModelError

F = TypeVar("F", bound=Callable[..., Any])


class Verb:
    """An analysis that :class:`~symgen.runtime.model.model.Model` declares, with signature and description.

    A model carries out the analysis NAME by its method ``_NAME``, which receives the arguments that differ
    from the declared defaults, by name or as the record that it :func:`takes
    <symgen.runtime.model.arguments.takes>`. Arguments that it does not accept are refused by name.
    """

    def __init__(self, declared: Callable[..., Any]) -> None:
        self.name = declared.__name__
        self.call, self.shared = _checked_call(declared), _checked_call(declared, True)

    def __get__(self, model: Any, owner: type | None = None) -> Any:
        """Return the bound analysis; raise CapabilityError where the model does not support it."""
        if model is None:
            return self.call
        if self.name not in model._supported:
            reason = model._refused(self.name)
            if reason is not None:
                raise CapabilityError(
                    f"{model.name} does not support {self.name.replace('_', ' ')}: {reason}"
                )
            model._supported.add(self.name)
        return MethodType(self.call, model)


def _checked_call(declared: Callable[..., Any], common: bool = False) -> Callable[..., Any]:
    name, known = declared.__name__, dict[Hashable, _Call]()
    carried_out_by = f"_{name}"

    @wraps(declared)
    def prepare(model: Any, *values: Any, **named: Any) -> _Call:
        return _prepared(model, declared, values, named, common)

    prepare.__qualname__ = f"Model.{name}"
    prepare = checked(prepare)

    @wraps(declared)
    def call(model: Any, *values: Any, **named: Any) -> Any:
        carrier, further = model._carrier(name), named.values()
        types = (*map(type, values), *map(type, further))
        key = type(carrier), types, values, *named, *further
        try:
            found = known.get(key)  # runs of a few steps take less time than the checks
        except TypeError:  # an argument without a hash
            found = None
        if found is None:
            found = prepare(model, *values, **named)
            if _PLAIN.issuperset(types) and len(known) < _MOST_KNOWN:
                known[key] = found
        method, record = getattr(carrier, carried_out_by), found.record
        try:
            result = method(**found.arguments) if record is None else method(record)
        finally:
            raise_failure()
        if found.kept is not None:
            result._of_analysis(model, name, found.kept)
        elif isinstance(result, Shown):
            result._of_analysis(model, name)
        return result

    call.__qualname__ = f"Model.{name}"
    return call


def with_common_axis(model: Any, name: str) -> Callable[..., Any]:
    """Return a supported analysis; of a range it has those samples that a linkage reaches."""
    declared = next(vars(c)[name] for c in type(model).__mro__ if isinstance(vars(c).get(name), Verb))
    return MethodType(declared.shared, model)


if TYPE_CHECKING:

    def verb(declared: F) -> F:
        """Declare an analysis of models."""
        return declared

else:
    verb = Verb


class _Call(NamedTuple):
    """A checked call: arguments that differ from the defaults, also as a record where the model takes one.

    ``kept`` are those that results keep, of analyses with a motion, in values that the caller cannot change.
    """

    arguments: dict[str, Any]
    record: Any
    kept: Mapping[str, Any] | None


def _prepared(
    model: Any,
    declared: Callable[..., Any],
    values: tuple[Any, ...],
    named: dict[str, Any],
    common: bool,
) -> _Call:
    name, arguments = declared.__name__, dict[str, Any]()
    if values or named:
        defaults = _defaults(declared)
        arguments |= {n: v for n, v in zip(defaults, values, strict=False) if v is not defaults[n]}
        arguments |= {n: v for n, v in named.items() if v is not defaults[n]}
    if arguments:
        known = accepted(model, name)
        refused = [n for n in arguments if n not in known]
        if refused:
            raise ModelError(
                f"{name} of {model.name} does not accept {', '.join(refused)}\n"
                f"  It accepts {', '.join(sorted(known)) or 'no arguments'}."
            )
    record, kept = getattr(getattr(model._carrier(name), f"_{name}"), "record", None), None
    if name in _MOVING:
        kept = MappingProxyType({n: _kept(v) for n, v in arguments.items() if n not in _OUTSIDE})
    if record is None:
        return _Call(arguments, None, kept)
    shared = {"common": True} if common and any(f.name == "common" for f in fields(record)) else {}
    return _Call(arguments, record(**arguments, **shared), kept)


def _kept(value: Any) -> Any:
    """Return a value that the caller cannot change."""
    return value if type(value) in _PLAIN or callable(value) else deepcopy(value)


#: Analyses whose results have an animation, and arguments without effect on these results.
_MOVING = (
    "simulate",
    "record",
    "kinematics",
    "inverse_dynamics",
    "periodic",
    "quasi_static",
    "large_rotation",
)
_OUTSIDE = frozenset(("checkpoint", "checkpoint_every", "resume", "progress"))


#: Types of arguments of which checked calls are remembered, and how many of an analysis.
_PLAIN = frozenset((float, int, str, bool, type(None)))
_MOST_KNOWN = 256


def accepted(model: Any, name: str) -> frozenset[str]:
    """Return the arguments that an analysis of a model accepts."""
    carrier: Any = type(model._carrier(name))
    return _accepted(carrier, name)


@cache
def _defaults(declared: Callable[..., Any]) -> dict[str, Any]:
    """Return the default of every argument in order, without ``self``."""
    return {n: p.default for n, p in [*signature(declared).parameters.items()][1:]}


@cache
def _accepted(of: type, name: str) -> frozenset[str]:
    """Return the arguments that a class of models accepts."""
    names = set[str]()
    for base in of.__mro__:
        method = vars(base).get(f"_{name}")
        if method is None:
            continue
        if hasattr(method, "record"):
            return frozenset(names | {f.name for f in fields(method.record) if not f.metadata})
        parameters = [*signature(method).parameters.values()][1:]
        names |= {p.name for p in parameters if p.kind is not Parameter.VAR_KEYWORD}
        if all(p.kind is not Parameter.VAR_KEYWORD for p in parameters):
            break
    return frozenset(names)


#: Names for other parts of symgen, which ``dir`` does not list.
INTERNAL = {
    *("MISSING", "analysis", "beams", "closed_start", "constraints", "counting", "crank_speed", "evaluator"),
    *("in_lanes", "in_mode", "is_changed", "kernels", "layout", "library", "lowest_frequency", "motion"),
    *("number_type", "parameter_values", "rigid", "tolerances", "typed"),
}
