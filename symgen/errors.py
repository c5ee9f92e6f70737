"""Every error symgen raises on purpose, one class per stage.

All derive from :class:`SymgenError`, so ``except symgen.SymgenError`` catches them and nothing else.
Each class says who can mend the cause, and how.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

#: Characters of one part of a message about a scene; what a scene says may be of any length.
_LONGEST = 1000


class SymgenError(Exception):
    """Base of all errors that symgen raises on purpose."""


class SceneError(SymgenError):
    """A scene says something wrong. Whoever wrote the scene mends it at the file, table and key named.

    Parameters
    ----------
    problem
        What was expected and what came, as one sentence.
    where
        Table and key inside the scene, such as ``links.OA.mass``; empty for the whole file.
    file
        The scene file, or a name for a scene made in Python.
    hint
        What to do next.
    """

    def __init__(self, problem: str, *, where: str = "", file: str = "", hint: str = "") -> None:
        self.problem, self.hint = _readable(problem), _readable(hint)
        self.where, self.file = _readable(where).replace("\n", "\\n"), _readable(file)
        super().__init__(self.problem)

    def located(self, *, where: str = "", file: str = "") -> SceneError:
        """Return the same error with the outer table or the file added in front of its place."""
        place = ".".join(part for part in (where, self.where) if part)
        return SceneError(self.problem, where=place, file=self.file or file, hint=self.hint)

    def __str__(self) -> str:
        *path, key = self.where.split(".")
        if key.isdecimal() and len(path) > 1:  # a place in a list, counted from 0
            key = f"{path.pop()}[{key}]"
        table = ".".join(path)
        place = f"[{table}] {key}" if table else (f"[{key}]" if key else "")
        head = " ".join(part for part in (f"{self.file}:" if self.file else "", place) if part)
        text = f"{head}: {self.problem}" if place else f"{head} {self.problem}".strip()
        return f"{text}\n  {self.hint}" if self.hint else text


def _readable(text: str) -> str:
    """Return a text for one look: no character that prints nothing or steers a terminal, and not endless."""
    if len(text) > _LONGEST:
        text = f"{text[: _LONGEST // 2]} ... {text[-_LONGEST // 2 :]}"
    if text.replace("\n", "").isprintable():
        return text
    return "".join(c if c == "\n" or c.isprintable() else ascii(c)[1:-1] for c in text)


class DerivationError(SymgenError):
    """The equations cannot be derived. The author of the model in ``mechanics/`` or ``models/`` mends it."""


class GenerationError(SymgenError):
    """Code cannot be generated, or what stands in ``generated/`` is not what the derivation gives.

    Run ``symgen generate`` in a checkout, read the difference, and commit it.
    """


class BuildError(SymgenError):
    """The C compiler failed. Its own text is in the message; flags come from ``SYMGEN_CFLAGS``."""


class CacheError(SymgenError):
    """The cache folder cannot be read or written. Free space, or point ``SYMGEN_CACHE`` elsewhere."""


class StaleBinaryError(SymgenError):
    """A compiled module does not belong to the equations beside it. Reinstall symgen to recompile it."""


class ModelError(SymgenError):
    """A compiled model was called with wrong names, shapes or values. The caller mends it."""


class InitialStateError(ModelError):
    """The initial state contradicts the constraints. Mend positions, rates or velocities of the start.

    Parameters
    ----------
    problem
        What is contradictory, and what to do next.
    where
        Table and key of the scene that asks for it.
    """

    def __init__(self, problem: str, *, where: str = "start") -> None:
        self.where = where
        super().__init__(problem)


class ResultError(SymgenError):
    """A result file cannot be read or written, or a result holds no such quantity."""


class SimulationError(SymgenError):
    """A run could not go on. ``time`` is where it stopped [s], ``partial`` what it had by then.

    Parameters
    ----------
    problem
        The cause, the time and what to do next.
    time
        Time of the last accepted step [s].
    partial
        The result up to that time, or None when not even the first sample was reached.
    """

    def __init__(self, problem: str, *, time: float = float("nan"), partial: Any = None) -> None:
        self.time, self.partial = time, partial
        super().__init__(problem)


def nearest(name: str, known: Iterable[str]) -> str:
    """Return a hint that names the known word nearest to ``name``, or lists what is known."""
    from difflib import get_close_matches

    words = sorted(known)
    folded = name.casefold()
    close = [w for w in words if w.casefold() == folded] or get_close_matches(name, words, n=1, cutoff=0.6)
    close = close or [w for w in words if w.casefold().startswith(folded)]
    if close:
        return f"Did you mean {close[0]!r}?"
    return f"Known: {', '.join(words)}." if words else "None is known here."


class SlowBackendWarning(UserWarning):
    """A model runs without kernels compiled for it. Install a C compiler to make it fast."""
