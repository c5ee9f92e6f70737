"""Exceptions of symgen, one class per stage.

All derive from :class:`SymgenError`, so ``except symgen.SymgenError`` catches them and nothing else.
Each docstring states the remedy.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Sequence
from functools import partial
from typing import Any

#: Characters without a place in terminals and generated comments, as in a class of a regular expression:
#: control characters, also those of the direction of writing.
CONTROL = r"\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"
#: Maximum number of characters of one part of a message; texts in a scene may be of any length.
_LONGEST = 1000


class SymgenError(Exception):
    """Base class of all exceptions of symgen; its text contains printable characters only."""

    def __init__(self, problem: str = "") -> None:
        super().__init__(_printable(problem))


class SceneError(SymgenError):
    """Invalid scene. Correct the table and key that the message names.

    Parameters
    ----------
    problem
        The expected and the given value, as one sentence.
    where
        Table and key inside the scene, such as ``links.OA.mass``; empty for the whole file.
    file
        The scene file, or a name for a scene defined in Python.
    hint
        The remedy.
    """

    def __init__(self, problem: str, *, where: str = "", file: str = "", hint: str = "") -> None:
        self.problem, self.hint = _readable(problem), _readable(hint)
        self.where, self.file = _readable(where).replace("\n", "\\n"), _readable(file)
        super().__init__(self.problem)

    def located(self, *, where: str = "", file: str = "") -> SceneError:
        """Return the same error with the outer table or the file in front of its location."""
        place = ".".join(part for part in (where, self.where) if part)
        return type(self)(self.problem, where=place, file=self.file or file, hint=self.hint)

    def __str__(self) -> str:
        *path, key = self.where.split(".")
        if key.isdecimal() and len(path) > 1:  # an index of a list
            key = f"{path.pop()}[{key}]"
        table = ".".join(path)
        place = f"[{table}] {key}" if table else (f"[{key}]" if key else "")
        head = " ".join(part for part in (f"{self.file}:" if self.file else "", place) if part)
        text = f"{head}: {self.problem}" if place else f"{head} {self.problem}".strip()
        return f"{text}\n  {self.hint}" if self.hint else text


class NoLinkageError(SceneError):
    """No linkage with the prescribed properties was found, or none exists. Change the prescribed values."""


#: Least distance of joints of an elastic link from its ends and from each other, over its length.
_APART = 1e-3


def check_joints(link: str, ends: Sequence[str], joints: Iterable[tuple[str, float]]) -> None:
    """Check the fractions of the length of an elastic link at which components are joined to it.

    Parameters
    ----------
    link, ends
        Its name, and those of its end points.
    joints
        Point and fraction of each joint.

    Raises
    ------
    SceneError
        For a fraction off the link, and for joints at or next to an end or each other.
    """
    before: list[tuple[str, float]] = []
    for name, fraction in joints:
        where = f"points.{name}.fraction"
        if not 0.0 <= fraction <= 1.0:
            raise SceneError(
                f"a point of the elastic link {link} lies between its ends: a fraction from 0 to 1, "
                f"got {fraction:g}",
                where=where,
            )
        for end, place in zip(ends, (0.0, 1.0), strict=True):
            if abs(fraction - place) < _APART:
                raise SceneError(
                    f"{name} joins another component to the elastic link {link} at its end, {end}",
                    where=where,
                    hint=f"Name {end} instead, or move {name} away from it.",
                )
        for other, place in before:
            if abs(fraction - place) < _APART:
                raise SceneError(
                    f"{name} and {other} are joints of the elastic link {link} at the same place, or nearer "
                    f"than {_APART:g} of its length",
                    where=where,
                    hint=f"Name {other} in place of {name}, or move them apart.",
                )
        before.append((name, fraction))


def _readable(text: str) -> str:
    """Return a text of limited length, without unprintable characters and terminal control sequences."""
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"
    return _printable(text)


def _printable(text: str) -> str:
    if text.replace("\n", "").isprintable():
        return text
    return "".join(c if c == "\n" or c.isprintable() else ascii(c)[1:-1] for c in text)


def shown(value: Any, longest: int = 100) -> str:
    """Return a value as shown in messages: its representation, or its type if that is unreadable."""
    try:
        text = repr(value)
    except Exception:
        text = ""
    if not text or "\n" in text or " at 0x" in text:
        return f"an object of type {type(value).__name__}"
    return text if len(text) <= longest else f"{text[: longest - 3]}..."


class DerivationError(SymgenError):
    """The equations cannot be derived. Correct the model in ``mechanics/`` or ``models/``."""


class GenerationError(SymgenError):
    """Code cannot be generated, or ``generated/`` differs from the derivation.

    Run ``symgen generate`` in a checkout, read the difference, and commit it.
    """


class BuildError(SymgenError):
    """The C compiler failed. The message contains its output; flags come from ``SYMGEN_CFLAGS``."""


class CacheError(SymgenError):
    """The cache folder cannot be read or written. Free space, or point ``SYMGEN_CACHE`` elsewhere."""


#: Remedy for compiled modules that are missing, or of other sources than those of Python.
COMPILE_AGAIN = "  Compile it again: 'pip install -e .' in a checkout, 'symgen cache clear' for a scene."


class StaleBinaryError(SymgenError):
    """A compiled module does not belong to the equations next to it. Reinstall symgen to recompile it."""


class ModelError(SymgenError):
    """A compiled model was called with wrong names, shapes or values. Correct the call."""


class ArgumentError(ModelError):
    """An argument of a call has a wrong value. Correct the call.

    Parameters
    ----------
    argument
        Name of the argument.
    before, after
        The message before and after the name.
    call
        The call, which starts the message; empty if there is none.
    """

    def __init__(self, argument: str, *, before: str, after: str, call: str = "") -> None:
        self.argument, self._before, self._after, self._call = argument, before, after, call
        super().__init__(f"{call}{': ' if call else ''}{self.named(argument)}")

    def __reduce__(self) -> tuple[Any, ...]:
        constructor = partial(type(self), before=self._before, after=self._after, call=self._call)
        return constructor, (self.argument,), self.__dict__

    def named(self, argument: str) -> str:
        """Return the message without the call, with the argument under another name."""
        return f"{self._before}{argument}{self._after}"


class OptionsError(ModelError):
    """Arguments of a call exclude each other, or one is missing. Correct the call.

    Parameters
    ----------
    problem
        The message, with the arguments in braces: ``give {rtol} and {atol}``, ``{step}=1e-3``.
    """

    def __init__(self, problem: str) -> None:
        self._problem = problem
        super().__init__(self.named(str))

    def named(self, option: Callable[[str], str]) -> str:
        """Return the message with the arguments as options: ``--step 1e-3``."""

        def written(found: re.Match[str]) -> str:
            name, equals = option(found[1]), found[2]
            return name + (" " if equals and name.startswith("-") else equals)

        return re.sub(r"\{(\w+)\}(=?)", written, self._problem)


class CapabilityError(SymgenError, AttributeError):
    """A model does not support an analysis. The message has the reason; ``hasattr(model, "modes")`` is False.

    It is raised when the analysis is accessed, before any call. ``model.capabilities`` lists the supported
    analyses.
    """


class InitialStateError(ModelError):
    """The initial state contradicts the constraints. Correct positions, rates or velocities of the start.

    Parameters
    ----------
    problem
        The contradiction and its remedy.
    where
        Table and key of the scene that prescribe the state.
    """

    def __init__(self, problem: str, *, where: str = "start") -> None:
        self.where = where
        super().__init__(problem)


class RangeError(ModelError):
    """The motion of an input does not reach a value, or parameters give a value of the scene a wrong sign.

    Request another value, or another range of time.
    """


class ResultError(SymgenError):
    """A result file cannot be read or written, or a result has no such quantity. Correct the name."""


class OutputError(ResultError):
    """A file or standard output cannot be written. Free space, correct permissions, or write elsewhere."""

    @classmethod
    def of(cls, target: object, error: OSError) -> OutputError:
        """Return the error of the system for a target, such as ``the result to run.nc``."""
        return cls(f"cannot write {target}: {error.strerror or error}")


class SimulationError(SymgenError):
    """A run ended prematurely. ``time`` is the time reached [s], ``partial`` the result up to then.

    Parameters
    ----------
    problem
        The cause, the time and the remedy.
    time
        Time of the last accepted step [s].
    partial
        The result up to that time, or None if not even the first sample was reached.
    """

    def __init__(self, problem: str, *, time: float = float("nan"), partial: Any = None) -> None:
        self.time, self.partial = time, partial
        super().__init__(problem)


class Interrupted(KeyboardInterrupt):
    """A run was interrupted, as by Ctrl-C. ``partial`` is the result up to then, None without a sample."""

    def __init__(self, remedy: str, partial: Any) -> None:
        self.partial = partial
        super().__init__(*filter(None, [remedy]))


#: Maximum number of known words listed in a message, and of the nearest of more words.
_LISTED, _NEAREST = 30, 5


def nearest(name: str, known: Iterable[str], otherwise: str = "") -> str:
    """Return a hint with the known word nearest to ``name``, if one is near: a few letters may differ.

    Else ``otherwise``, by default a list of the known words, or of the nearest if they are many.
    """
    from difflib import get_close_matches

    words = sorted(set(known))
    folded = name.casefold()
    close = [w for w in words if w.casefold() == folded] or get_close_matches(name, words, n=1, cutoff=0.75)
    alike = [w for w in words if w[:1] == name[:1] or folded in w.casefold()]
    close = close or get_close_matches(name, alike, n=1, cutoff=0.6)
    close = close or [w for w in words if w.casefold().startswith(folded)]
    close = close or [w for w in words if folded.endswith(f".{w.casefold()}")]
    if close:
        return f"Did you mean {close[0]!r}?"
    if otherwise:
        return otherwise
    if len(words) > _LISTED:
        closest = get_close_matches(name, words, n=_NEAREST, cutoff=0.0)
        return f"The nearest of {len(words)} names are {', '.join(closest)}."
    return f"Known: {', '.join(words)}." if words else "None are defined."


def no_component(whole: str, part: str, components: Iterable[str]) -> str:
    """Return the message on a component that an output does not have."""
    known = ", ".join(components)
    return f"{whole} has no component {part!r}: " + (f"it has {known}" if known else "it is one number")


def check_known(name: str, known: Collection[str], problem: str) -> None:
    """Raise ModelError with the nearest name unless a name is known; ``problem`` precedes the name."""
    if name not in known:
        raise ModelError(f"{problem} {name!r}. {nearest(name, known)}")


def check_tunable(name: str, known: Collection[str], model: str) -> None:
    """Raise ModelError with the nearest name, or how to make one tunable, unless a parameter is tunable."""
    if name not in known:
        near = nearest(name, known) if known else "No parameter of it is tunable."
        raise ModelError(
            f"{model} has no tunable parameter {name!r}. {near}\n"
            "  To change another parameter of the scene, write it as { value = ..., tunable = true }"
            f", or build the scene with set={{{name!r}: ...}}."
        )


class SlowBackendWarning(UserWarning):
    """A model runs without kernels compiled for it, or with kernels compiled without optimisation."""


class SlowRunWarning(UserWarning):
    """A run is estimated to take long. Loosen its tolerance, or limit it by ``max_wall``."""
