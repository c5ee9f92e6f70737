"""Evaluating a driven loop as the command line asks for it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from symgen.errors import ModelError, SceneError, nearest
from symgen.runtime.elastic_model import METHODS
from symgen.runtime.loop_model import LoopModel
from symgen.runtime.model import Model
from symgen.runtime.turn import Turn

if TYPE_CHECKING:
    from symgen.runtime.elastic_model import ElasticModel
    from symgen.runtime.elastic_result import ElasticResult
    from symgen.runtime.kinematic_model import KinematicModel
    from symgen.runtime.motion import Motion


def driven_run(
    model: Model | LoopModel | ElasticModel,
    at: Sequence[str] | None,
    samples: int | None,
    through: bool,
    options: Mapping[str, Any],
) -> Turn:
    """Return a driven loop at the values asked for, or over its whole range, ``through`` turning inputs.

    Raises
    ------
    ModelError
        When the scene is not a driven loop, a value cannot be read, or an option of time is given.
    """
    if not isinstance(model, LoopModel):
        raise ModelError(
            "--at and --through are for driven loops (scenes with a link-joint table)\n"
            "  'symgen kinematics' follows the drives of a linkage of points and links."
        )
    refuse("a driven loop: it is evaluated over its input, not in time", options)
    if not at:
        return model.turn(samples=361 if samples is None else samples, through=through)
    if samples is not None or through:
        raise ModelError(f"give --at or {'--through' if through else '--samples'}, not both")
    return model.at(at_values(model, at))


def refuse(what: str, options: Mapping[str, Any]) -> None:
    """Refuse options that were given where they mean nothing."""
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
    """Return the outputs of a scene that asks for kinematics, over its time.

    Raises
    ------
    ModelError
        When an option of the integration is given: nothing is integrated.
    """
    refuse("kinematics: its poses follow from the drives at each time", options)
    return model.kinematics(0.0, t_end, samples=201 if samples is None else samples, through=through)


def at_values(model: LoopModel, at: Sequence[str]) -> list[float]:
    """Return values of the first input [rad, m] as written, with commas between them; bare angles in degrees.

    Raises
    ------
    ModelError
        When one cannot be read.
    """
    return [_value(model, text.strip()) for group in at for text in group.split(",")]


def elastic_run(
    model: ElasticModel,
    at: Sequence[str] | None,
    samples: int | None,
    options: Mapping[str, Any],
    progress: Callable[[float], None] | None,
) -> ElasticResult:
    """Return the elastic motion as the command line asks for it.

    Raises
    ------
    ModelError
        When an option does not go with elastic links, or a value cannot be read.
    """
    given = {name: value for name, value in options.items() if value is not None}
    refused = [
        f"--{name.replace('_', '-')}" for name in given if name in ("t_end", "atol", "step", "through")
    ]
    if refused:
        raise ModelError(
            f"{', '.join(refused)} does not go with elastic links\n"
            "  Give --revolutions and --steps (a turn), or --rtol."
        )
    method = given.pop("method", "gauss")
    if method not in (known := (*METHODS, "exact")):
        raise ModelError(f"there is no method {method!r}. {nearest(method, known)}")
    if method == "exact":
        return _exact_run(model, at, samples, given, progress)
    if "segments" in given:
        raise ModelError("--segments goes with --method exact")
    if at and samples is not None:
        raise ModelError("give --at or --samples, not both")
    return model.run(
        method,
        samples=361 if samples is None else samples,
        at=angles(at) if at else None,
        progress=progress,
        **given,
    )


def _exact_run(
    model: ElasticModel,
    at: Sequence[str] | None,
    samples: int | None,
    given: Mapping[str, Any],
    progress: Callable[[float], None] | None,
) -> ElasticResult:
    own = ("segments", "revolutions", "rtol", "checkpoint", "checkpoint_every", "resume")
    others = [f"--{name.replace('_', '-')}" for name in given if name not in own]
    others += ["--at"] if at else []
    if others:
        raise ModelError(
            f"{', '.join(others)} does not go with --method exact\n"
            "  Give --segments, --revolutions, --rtol and --samples."
        )
    return model.exact(samples=361 if samples is None else samples, progress=progress, **given)


def crank_speeds(text: str) -> list[float]:
    """Return crank speeds [rad/s] from rpm as written: ``FROM:TO:COUNT`` or values with commas.

    Raises
    ------
    ModelError
        When they cannot be read.
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
            'expected crank speeds in rpm behind --speeds, such as "20:400:39" (from, to, how many) or '
            f'"60,95", none of them zero, got {text!r}'
        ) from None
    return [x * math.pi / 30 for x in found]


def angles(at: Sequence[str]) -> list[float]:
    """Return angles [rad] as written: bare ones in degrees.

    Raises
    ------
    ModelError
        When one cannot be read.
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
            raise ModelError(
                f'expected angles behind --at, such as "45" (degrees) or "0.5 rad", got {text!r}'
            )
        found.append(value)
    return found


def _value(model: LoopModel, text: str) -> float:
    """Return a value of the first input in SI: a bare angle is in degrees, a length in the scene's unit."""
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
            f'expected values of {first.name} behind --at, such as "{example}", got {text!r}'
        ) from None
    return value * d.units["length"][1] if first.is_length else math.radians(value)
