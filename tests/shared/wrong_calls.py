"""Wrong calls of the public interface: every public function and method, with wrong values of each argument.

Arguments are taken from the signatures, so that new functions are included. A call must succeed or raise a
SymgenError with a readable message; anything else is a fault.
"""

from __future__ import annotations

import inspect
import math
import random
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
from shared.mutations import check_message, within

import symgen
from symgen.errors import SymgenError

#: Seconds that a wrong call may take.
PATIENCE = 20.0


class Opaque:
    """An object whose representation fails."""

    def __repr__(self) -> str:
        raise RuntimeError("no representation")


#: Values that are wrong for most arguments.
WRONG: tuple[Any, ...] = (
    None, True, -1, 0, 3, 2.5, -0.5, math.nan, math.inf, -math.inf, 1e308, 1e-320, 10**30, 1j, "", "x", "nan", "10", "A",
    "\x00", "../x", b"x", (), [], ["x"], [None], [1.0, "x"], [[1.0], [2.0, 3.0]], [math.nan], [1.0], (1, 2, 3),
    {}, {"x": 1}, {1: 2}, {"A": None}, {"A": [1.0]}, {"A": "x"}, {"x"}, range(3), Opaque(), object, len, lambda *_: None,
    lambda *_: "x", np.array(1.5), np.array([1.0, np.nan]), np.array(["x"]), np.zeros((0, 3)), np.zeros((2, 2)),
    np.float32(1.0), np.bool_(True), Decimal("1.5"), Path("x"), Path("/nowhere/x.nc"), Exception("x"),
)  # fmt: skip


@dataclass(frozen=True)
class Callee:
    """A public function or method, and good arguments by name, with which wrong ones go along."""

    name: str
    function: Callable[..., Any]
    good: dict[str, Any]

    def arguments(self) -> list[inspect.Parameter]:
        """Return its arguments."""
        return list(inspect.signature(self.function).parameters.values())


@dataclass(frozen=True, eq=False)
class Call:
    """A wrong call: the function and its arguments."""

    callee: Callee
    values: tuple[Any, ...]
    named: dict[str, Any]

    def __str__(self) -> str:
        return f"{self.callee.name}(*{_text(self.values)}, **{_text(self.named)})"


def _text(value: object) -> str:
    try:
        return repr(value)[:200]
    except RuntimeError:
        return "an opaque object"


def wrong_calls(folder: Path) -> list[Call]:
    """Return every public function and method with every wrong value of each argument, none, and others."""
    made, good = _objects(folder)
    wrong = (*WRONG, *made.values())
    calls = []
    for callee in callees(made, good):
        if not callee.name.endswith("__"):  # Python itself checks the number of arguments of operators
            calls += [Call(callee, (), {**callee.good, "no_such": 1})]
            # If all have defaults, a call without arguments is valid and may take long.
            if any(a.default is a.empty for a in callee.arguments()):
                calls += [Call(callee, (), {})]
            calls += [Call(callee, (*callee.good.values(), *range(30)), {})]
        for argument in callee.arguments():
            if argument.kind is argument.VAR_POSITIONAL:
                calls += [Call(callee, (value,), callee.good) for value in wrong]
                continue
            name = "rho" if argument.kind is argument.VAR_KEYWORD else argument.name
            # Exceptions of a user's function are passed on unchanged.
            fitting = [
                v for v in wrong if name not in ("forces", "progress") or (v is not len and v is not object)
            ]
            calls += [Call(callee, (), {**callee.good, name: value}) for value in fitting]
    return calls


def callees(made: dict[str, Any], good: dict[str, dict[str, Any]]) -> list[Callee]:
    """Return every public function and method of symgen and of the objects that these give."""
    found = [
        Callee(name, value, good.get(name, {}))
        for name in symgen.__all__
        if callable(value := getattr(symgen, name)) and not isinstance(value, type)
    ]
    found += [Callee("Chain", symgen.Chain, good["Chain"]), Callee("Scene", symgen.Scene, {})]
    for what, thing in made.items():
        for name, function in _methods(thing):
            found.append(Callee(f"{what}.{name}", function, good.get(f"{what}.{name}", {})))
    return found


def _methods(thing: object) -> Iterator[tuple[str, Callable[..., Any]]]:
    """Yield the public methods of an object that its own class or those of symgen define."""
    for name in dir(type(thing)):
        public = not name.startswith("_") or name in ("__getitem__", "__contains__")
        defined = next((c for c in type(thing).__mro__ if name in vars(c)), object)
        callable_ = callable(getattr(type(thing), name)) and hasattr(thing, name)
        if public and defined.__module__.startswith("symgen.") and callable_:
            yield name, getattr(thing, name)


def _objects(folder: Path) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Return one object of every public class, and good arguments where a call needs some or would take long."""
    own = folder / "own.py"
    own.write_text(_USER_FILE)
    build = {"backend": "numpy"}
    linkage = symgen.build("four_bar", **build)
    driven = symgen.build("crank_rocker", **build)
    loop = symgen.build("slider_crank", **build)
    elastic = symgen.build("thesis_four_bar")
    chain = symgen.Chain([1.0, 1.0], [1.0, 1.0])
    straight = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]
    made: dict[str, Any] = {
        "Model": linkage,
        "driven": driven,
        "LoopModel": loop,
        "free": symgen.build("cssp", **build),
        "ElasticModel": elastic,
        "SystemModel": symgen.build(own, **build),
        "Chain": chain,
        "Result": linkage.simulate(0.01, samples=3, rtol=1e-4),
        "Motion": driven.kinematics(samples=3),
        "Turn": loop.inverse_dynamics(samples=3),
        "ElasticResult": elastic.quasi_static(samples=3),
        "Equilibrium": linkage.equilibrium(),
        "Modes": linkage.modes(),
        "ElasticModes": elastic.modes(),
        "Accelerations": linkage.accelerations(),
        "State": linkage.initial_state(),
    }
    short = {"t_end": 0.01, "samples": 3, "max_steps": 2000}
    good: dict[str, dict[str, Any]] = {
        "build": {"scene": "four_bar", **build},
        "derive": {"scene": "four_bar"},
        "load_scene": {"source": "four_bar"},
        "load_result": {"file": "result.nc"},
        "Chain": {"lengths": [1.0, 1.0], "masses": [1.0, 1.0]},
        "Chain.simulate": {"t_end": 0.01, "positions": straight, "step": 0.005},
        "Chain.accelerations": {"positions": straight},
        "Chain.kinetic_energy": {"velocities": straight},
        "Chain.potential_energy": {"positions": straight},
        "Model.simulate": short,
        "driven.simulate": short,
        "driven.kinematics": {"samples": 3},
        "driven.inverse_dynamics": {"samples": 3},
        "Model.batch": {"what": "accelerations", "t": 0.0, "q": np.zeros((1, 4))},
        "driven.batch": {"what": "accelerations", "t": 0.0, "q": np.zeros((1, 4))},
        "LoopModel.kinematics": {"samples": 3},
        "LoopModel.inverse_dynamics": {"samples": 3},
        "free.simulate": short,
        "free.batch": {"what": "position", "t": 0.0, "q": np.zeros((1, 4))},
        "LoopModel.batch": {"what": "position", "t": 0.0, "q": np.zeros((1, 4))},
        "ElasticModel.simulate": {"steps": 64, "revolutions": 0.01, "samples": 3},
        "ElasticModel.kinematics": {"samples": 3},
        "ElasticModel.inverse_dynamics": {"samples": 3},
        "ElasticModel.periodic": {"steps": 64, "samples": 3},
        "ElasticModel.quasi_static": {"samples": 3},
        "ElasticModel.large_rotation": {"elements": 1, "revolutions": 0.001, "samples": 3},
        "ElasticModel.batch": {"what": "accelerations", "t": 0.0, "q": np.zeros((1, 4))},
        "ElasticModel.speed_response": {"speeds": [10.0], "samples": 8, "rtol": 0.5, "max_wall": 5.0},
        "SystemModel.evaluate": {"kernel": "motion", "q": [0.3], "p": [1.0, 0.5, 9.81]},
    }
    return made, good


#: A derivation of the user's own.
_USER_FILE = """
import sympy as sp
from symgen.symbolic.quantity import quantity
from symgen.symbolic.system import Export, Group, NamedMatrix, System

theta = quantity("theta", "rad", "angle from the vertical")
m, l, g = (quantity(*x) for x in (("m", "kg", "mass"), ("l", "m", "length"), ("g", "m/s^2", "gravity")))


def system():
    moment = sp.ImmutableMatrix([[-m.symbol * g.symbol * l.symbol * sp.sin(theta.symbol)]])
    return System(
        name="pendulum",
        title="Pendulum by hand",
        groups=(Group("q", "angle", (theta,)), Group("p", "parameters", (m, l, g))),
        matrices=(NamedMatrix("moment", moment, "N*m", "moment of gravity about the pivot"),),
        exports=(Export("motion", "moment", ("moment",)),),
    )
"""


def judge(call: Call, patience: float = PATIENCE) -> str:
    """Make a wrong call; return the outcome, or raise the exception that is not permitted."""
    try:
        with warnings.catch_warnings(), within(patience):
            warnings.simplefilter("ignore")
            call.callee.function(*call.values, **call.named)
    except SymgenError as error:
        check_message(str(error))
        return type(error).__name__
    return "accepted"


def sample(calls: list[Call], count: int, seed: int) -> list[Call]:
    """Return a repeatable sample of the calls, with at least one of every function and method."""
    chosen = random.Random(seed).sample(calls, len(calls))
    first = list({call.callee.name: call for call in chosen}.values())
    return first + [call for call in chosen if call not in first][: max(0, count - len(first))]
