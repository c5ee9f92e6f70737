"""Results of driven loops: outputs over the values of the input, or over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from symgen.calls import checked
from symgen.display import seconds
from symgen.runtime.arrays import Array
from symgen.runtime.kernels.loop_description import LoopDescription
from symgen.runtime.result.records import Variable
from symgen.runtime.result.result import Result


@dataclass(frozen=True, slots=True)
class Pole:
    """A dead centre at which no finite load balances the given efforts, so that efforts have a pole.

    Attributes
    ----------
    at
        Value of the input at the pole [rad or m].
    residues
        For each component with a pole, the limit of its value times (input - at) [SI].
    """

    at: float
    residues: Mapping[str, float]


@checked
class Turn(Result):
    """A driven loop over values of its first input, or over time. ``turn["theta2"]`` is an array over them.

    ``time`` holds the times at which the input has these values. At a pole an output is nan, and
    :attr:`poles` has its residue.
    """

    KIND = "loop"

    def __repr__(self) -> str:
        return (
            f"<Turn {self.name!r}: {self.count} values of {self.coordinate.about}, "
            f"{len(self.variables)} outputs, closed within {self.closure:.1e}>"
        )

    @property
    def input(self) -> str:
        """Name of the first input."""
        return str(self.statistics["input"])

    @property
    def closure(self) -> float:
        """Largest defect of closure: of rotations in radians, of displacements over the size of the loop."""
        return float(self.statistics["closure"])

    @property
    def facts(self) -> tuple[tuple[str, str], ...]:
        """Names and values of facts about the poses; the error measure comes last."""
        wall = float(self.statistics["wall_s"])
        return (
            ("evaluated", f"{self.count} poses"),
            ("time", f"{seconds(wall)}, {seconds(wall / max(1, self.count))} per pose"),
            ("closed within", f"{self.closure:.1e}"),
        )

    @property
    def poles(self) -> tuple[Pole, ...]:
        """The poles of the efforts in the range, in order."""
        return tuple(Pole(p["at"], dict(p["residues"])) for p in self.statistics["poles"])

    @property
    def indeterminate(self) -> tuple[str, ...]:
        """Force components that redundant constraints leave undetermined at any pose.

        Their values are those of the closing wrench of minimum norm; :attr:`undetermined` has the poses.
        """
        return tuple(self.statistics["undetermined"])

    @property
    def undetermined(self) -> dict[str, NDArray[np.bool_]]:
        """By component: the poses at which redundant constraints leave it undetermined (True)."""
        by_name = {}
        for name, ranges in self.statistics["undetermined"].items():
            mask = by_name[name] = np.zeros(self.count, dtype=bool)
            for first, last in ranges:
                mask[first : last + 1] = True
        return by_name

    @property
    def headline(self) -> str:
        """Title line of plots: poses and closure error."""
        return f"{self.count} poses, closed within {self.closure:.1e}"


def variables(description: LoopDescription, out: Array) -> list[Variable]:
    """Return the outputs in rows of the kernel 'outputs', (samples, entries), or blocks of rows, as views."""
    info = description.kernel("outputs")
    result = []
    for b in info.blocks if info else ():
        count = b.shape[0] * b.shape[1]
        values = out[..., b.offset : b.offset + count]
        result.append(
            Variable(
                b.name, b.unit, b.about, b.rows if count > 1 else (), values if count > 1 else values[..., 0]
            )
        )
    return result
