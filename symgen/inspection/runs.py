"""Evaluation of driven loops, kinematics and elastic links with command-line options."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, cast

from symgen.errors import ModelError, SceneError, nearest
from symgen.runtime.elastic.model import METHODS
from symgen.runtime.loop.model import LoopModel
from symgen.runtime.model.rods import RodModel
from symgen.runtime.result.turn import Turn

if TYPE_CHECKING:
    from symgen.runtime.elastic.model import ElasticModel
    from symgen.runtime.model.kinematic import KinematicModel
    from symgen.runtime.result.elastic import ElasticResult
    from symgen.runtime.result.motion import Motion


def driven_run(
    model: RodModel | LoopModel | ElasticModel,
    at: Sequence[str] | None,
    samples: int | None,
    through: bool,
    options: Mapping[str, Any],
) -> Turn:
    """Return a driven loop at the given values or over its whole range, ``through`` past turning points.

    Raises
    ------
    ModelError
        If the scene is not a driven loop, a value cannot be read, or an option for time integration is given.
    """
    if not isinstance(model, LoopModel):
        raise ModelError(
            "--at and --through are for driven loops (scenes with a link-joint table)\n"
            "  'symgen kinematics' follows the drives of a linkage of points and links."
        )
    t_end = options.get("t_end")
    refuse("a driven loop: its poses follow from its inputs", {**options, "t_end": None})
    if t_end is not None:
        if at or through:
            raise ModelError(f"give --t-end or {'--at' if at else '--through'}, not both")
        return cast(Turn, model.inverse_dynamics(stop=t_end, over="time", samples=samples))
    if not at:
        return cast(Turn, model.inverse_dynamics(samples=samples, through=through))
    if samples is not None or through:
        raise ModelError(f"give --at or {'--through' if through else '--samples'}, not both")
    times = [_time(text.strip()) for group in at for text in group.split(",")]
    if all(t is not None for t in times):
        return cast(Turn, model.inverse_dynamics(at=[t for t in times if t is not None], over="time"))
    return cast(Turn, model.inverse_dynamics(at=at_values(model, at)))


def refuse(what: str, options: Mapping[str, Any]) -> None:
    """Raise ModelError if options are given that do not apply."""
    given = [f"--{name.replace('_', '-')}" for name, value in options.items() if value is not None]
    if given:
        raise ModelError(f"{', '.join(given)} does not go with {what}")


def kinematic_run(
    model: KinematicModel,
    t_end: float | None,
    samples: int | None,
    through: bool,
    options: Mapping[str, Any],
) -> Motion:
    """Return the outputs of a kinematic scene over its time range.

    Raises
    ------
    ModelError
        If an integration option is given: kinematics involves no integration.
    """
    refuse("kinematics: its poses follow from the drives at each time", options)
    found = model.kinematics(stop=t_end, samples=201 if samples is None else samples, through=through)
    return cast("Motion", found)


def at_values(model: LoopModel, at: Sequence[str]) -> list[float]:
    """Return values of the first input [rad, m] from comma-separated text; bare angles are in degrees.

    Raises
    ------
    ModelError
        If a value cannot be read.
    """
    return [_value(model, text.strip()) for group in at for text in group.split(",")]


def elastic_run(
    model: ElasticModel,
    at: Sequence[str] | None,
    samples: int | None,
    options: Mapping[str, Any],
    progress: Callable[[float], None] | None,
) -> ElasticResult:
    """Return the motion of elastic links for the given command-line options.

    Raises
    ------
    ModelError
        If an option does not apply to elastic links, or a value cannot be read.
    """
    given = {name: value for name, value in options.items() if value is not None}
    refused = [
        f"--{name.replace('_', '-')}" for name in given if name in ("t_end", "atol", "step", "through")
    ]
    if refused:
        raise ModelError(
            f"{', '.join(refused)} does not go with elastic links\n"
            "  Give --revolutions and --steps (per revolution), or --rtol."
        )
    method = given.pop("method", "gauss")
    if method not in (known := (*METHODS, "quasi-static", "periodic", "exact")):
        raise ModelError(f"there is no method {method!r}. {nearest(method, known)}")
    if method == "exact":
        return _exact_run(model, at, samples, given, progress)
    if "segments" in given:
        raise ModelError("--segments goes with --method exact")
    if at and samples is not None:
        raise ModelError("give --at or --samples, not both")
    if method in ("quasi-static", "periodic") and not given.keys().isdisjoint({"checkpoint", "resume"}):
        raise ModelError(f"there are no checkpoints of {method} motions")
    directions = angles(at) if at else None
    return by_method(model, method, samples=samples, at=directions, progress=progress, **given)


def by_method(model: ElasticModel, method: str, **options: Any) -> ElasticResult:
    """Return the elastic motion by an integration method, or the one called periodic or quasi-static."""
    analyses: dict[str, Callable[..., ElasticResult]] = {
        "periodic": model.periodic,
        "quasi-static": model.quasi_static,
    }
    if method in analyses:
        return analyses[method](**options)
    return cast("ElasticResult", model.simulate(method=method, **options))


def _exact_run(
    model: ElasticModel,
    at: Sequence[str] | None,
    samples: int | None,
    given: Mapping[str, Any],
    progress: Callable[[float], None] | None,
) -> ElasticResult:
    own = {"segments", "revolutions", "rtol", "max_step", "max_wall"}
    own |= {"checkpoint", "checkpoint_every", "resume"}
    others = [f"--{name.replace('_', '-')}" for name in given if name not in own]
    others += ["--at"] if at else []
    if others:
        raise ModelError(
            f"{', '.join(others)} does not go with --method exact\n"
            "  Give --segments, --revolutions, --rtol and --samples."
        )
    return model.large_rotation(samples=samples, progress=progress, **given)


def crank_speeds(text: str) -> list[float]:
    """Return crank speeds [rad/s] from text in rpm: ``FROM:TO:COUNT`` or comma-separated values.

    Raises
    ------
    ModelError
        If they cannot be read.
    """
    try:
        if ":" in text:
            first, last, count = text.split(":")
            if int(count) < 2:
                raise ValueError
            low, step = float(first), (float(last) - float(first)) / (int(count) - 1)
            found = [low + step * k for k in range(int(count))]
        else:
            found = [float(part) for part in text.split(",")]
        if not all(math.isfinite(x) and x != 0.0 for x in found):
            raise ValueError
    except ValueError:
        raise ModelError(
            'expected crank speeds in rpm after --speeds, such as "20:400:39" (from, to, count) or '
            f'"60,95", none of them zero, got {text!r}'
        ) from None
    return [x * math.pi / 30 for x in found]


def angles(at: Sequence[str]) -> list[float]:
    """Return angles [rad] from text; bare angles are in degrees.

    Raises
    ------
    ModelError
        If an angle cannot be read.
    """
    from symgen.scene.units import NUMBER, parse_quantity

    found = []
    for text in (part.strip() for group in at for part in group.split(",")):
        try:
            value = math.radians(float(text))
        except ValueError:
            try:
                number, dimension = parse_quantity(text)
                value = float(number) if dimension == NUMBER else math.nan
            except SceneError:
                value = math.nan
        if not math.isfinite(value):
            raise ModelError(f'expected angles after --at, such as "45" (degrees) or "0.5 rad", got {text!r}')
        found.append(value)
    return found


def _time(text: str) -> float | None:
    """Return a time [s] written with its unit; None for any other text."""
    from symgen.scene.units import TIME, parse_quantity

    with suppress(SceneError):
        number, dimension = parse_quantity(text)
        return float(number) if dimension == TIME else None
    return None


def _value(model: LoopModel, text: str) -> float:
    """Return a value of the first input in SI units; bare angles are degrees, lengths in the scene's unit."""
    from symgen.scene.units import LENGTH, NUMBER, parse_quantity

    d = model.description
    first = d.variables[d.having("input")[0]] if d.having("input") else None
    if first is None:
        return 0.0
    try:
        try:
            value = float(text)
        except ValueError:
            number, dimension = parse_quantity(text)
            if dimension != (LENGTH if first.is_length else NUMBER):
                raise SceneError("") from None
            return float(number)
        if not math.isfinite(value):
            raise SceneError("")
    except SceneError:
        example = "3 in" if first.is_length else "45 deg"
        raise ModelError(
            f'expected values of {first.name} after --at, such as "{example}", got {text!r}'
        ) from None
    return value * d.units["length"][1] if first.is_length else math.radians(value)
