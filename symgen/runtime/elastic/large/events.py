"""Events of a scene in runs by collocation: zeros of their gaps on the polynomials of the steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from symgen.runtime.arrays import Array
from symgen.runtime.beams.methods import BeamMethod
from symgen.runtime.elastic.large.collocation import MotionState
from symgen.runtime.result.recording import motion
from symgen.runtime.result.records import LocatedEvent
from symgen.runtime.rods.model.rods import RodModel

#: Fractions of a step at which gaps are evaluated.
_SHARES = np.linspace(0.0, 1.0, 5)


@dataclass(frozen=True, slots=True)
class _Step:
    """Coordinates of the free points in a step: the polynomial with second rates of its stages."""

    before: MotionState
    after: MotionState
    powers: Array

    def at(self, shares: Array) -> tuple[Array, Array, Array]:
        """Return times, places and rates at fractions of the step."""
        first, last, n, h = self.before, self.after, self.powers.shape[1], self.after.t - self.before.t
        places, rates = self._free(shares)
        # The end is on the constraints.
        over = [x[0] - y for x, y in zip(self._free(np.ones(1)), (last.q[:n], last.v[:n]), strict=True)]
        return first.t + h * shares, places - np.outer(shares, over[0]), rates - np.outer(shares, over[1])

    def _free(self, shares: Array) -> tuple[Array, Array]:
        first, n, h = self.before, self.powers.shape[1], self.after.t - self.before.t
        k = np.arange(len(self.powers))
        of_rates, of_places = (shares[:, None] ** (k + more) for more in (1, 2))
        rates = first.v[:n] + h * of_rates @ (self.powers / (k + 1)[:, None])
        of_second = of_places @ (self.powers / ((k + 1) * (k + 2))[:, None])
        return first.q[:n] + h * np.outer(shares, first.v[:n]) + h * h * of_second, rates


class Events:
    """The events of one run, located in its steps.

    Parameters
    ----------
    rigid
        The linkage with rigid links, whose kernel ``events`` gives the gaps.
    method
        Method of the steps.

    Attributes
    ----------
    located
        Events in the order of time, up to one that ends the run.
    ended
        Whether an event ended the run.
    blind
        Name and time of the first gap that is not finite.
    """

    def __init__(self, rigid: RodModel, method: BeamMethod) -> None:
        self._of, self._known = rigid.evaluator, rigid.description.events
        self._points = rigid.description.coordinates
        self._powers = np.linalg.inv(np.vander(method.c, increasing=True))
        self.located: list[LocatedEvent] = []
        self.ended = False
        self.blind: tuple[str, float] | None = None

    def step(self, before: MotionState, a: Array, multipliers: Array, after: MotionState) -> bool:
        """Locate the events in a step with these second rates of stages; return whether one ends the run."""
        step = _Step(before, after, self._powers @ a[:, : self._points])
        gaps, zeros = self._gaps(step, _SHARES), list[tuple[float, int, bool]]()
        for k, event in enumerate(self._known):
            blind = np.flatnonzero(~np.isfinite(gaps[:, k]))
            if len(blind) and self.blind is None:
                self.blind = event.name, float(step.at(_SHARES[blind[:1]])[0][0])
            for i in np.flatnonzero(
                (gaps[:-1, k] * gaps[1:, k] < 0) | ((gaps[1:, k] == 0) & (gaps[:-1, k] != 0))
            ):
                rising = bool(gaps[i + 1, k] > gaps[i, k])
                if not event.direction or rising == (event.direction > 0):
                    zeros.append((self._zero(step, k, *_SHARES[i : i + 2]), k, rising))
        for share, k, rising in sorted(zeros):
            (t,), (q,), (v,) = step.at(np.array([share]))
            event = self._known[k]
            self.located.append(
                LocatedEvent(event.name, float(t), rising, motion(self._of, t, np.concatenate([q, v])))
            )
            if event.ends_run:
                self.ended = True
                break
        return self.ended

    def notes(self) -> list[str]:
        """Return the notes on the event that ended the run, and on one without a value."""
        notes = []
        if self.ended:
            last = self.located[-1]
            notes.append(f"the event {last.name!r} ended the run at t = {last.time:.9g} s")
        if self.blind:
            name, t = self.blind
            notes.append(
                f"the event {name!r} has no finite value near t = {t:.6g} s, where its expression is not "
                "defined: that it passes its value may have been missed"
            )
        return notes

    def _gaps(self, step: _Step, shares: Array) -> Array:
        """Return the gaps of all events at fractions of a step, (fractions, events)."""
        return self._of.many_blocks("events", *step.at(shares))["events"].reshape(len(shares), -1)

    def _zero(self, step: _Step, k: int, low: float, high: float) -> float:
        from scipy.optimize import brentq

        return brentq(lambda share: self._gaps(step, np.array([share]))[0, k], low, high, xtol=1e-14)
