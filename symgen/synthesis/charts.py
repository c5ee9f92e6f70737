"""Design charts: linkages of prescribed limit positions over values of one of the quantities."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from symgen.calls import checked
from symgen.errors import NoLinkageError, SceneError, nearest
from symgen.scene.units import LENGTH, NUMBER, Shown
from symgen.synthesis.synthesise import LIMITS, Design, Synthesis, synthesise
from symgen.synthesis.tasks import LimitTask, read_task, value


@checked
@dataclass(frozen=True, slots=True)
class DesignChart:
    """Linkages over values of a quantity.

    Attributes
    ----------
    title, linkage
        Those of the task.
    name, unit, values
        The varied quantity in SI units: rad, m or 1.
    designs
        The linkages found without faults, by value.
    reasons
        The reason why there is none, by value; empty if there are linkages.
    units
        Those of tables and plots, by ``length`` and ``angle``.
    """

    title: str
    linkage: str
    name: str
    unit: str
    values: tuple[float, ...]
    designs: tuple[tuple[Design, ...], ...]
    reasons: tuple[str, ...]
    units: Shown

    def summary(self) -> dict[str, Any]:
        """Return the chart in plain SI numbers: the output of ``symgen synthesise --vary --json``."""
        rows = zip(self.values, self.designs, self.reasons, strict=True)
        return {
            "title": self.title,
            "linkage": self.linkage,
            "varied": self.name,
            "rows": [
                {self.name: x, "designs": [d.quantities for d in designs], "reason": reason}
                for x, designs, reason in rows
            ],
        }


@checked
def design_chart(
    task: str | os.PathLike[str] | Mapping[str, Any], name: str, values: Sequence[float]
) -> DesignChart:
    """Return the linkages of a task of limit positions over values of one of its quantities.

    Parameters
    ----------
    task
        As for :func:`symgen.synthesise`; the value that it prescribes for the quantity is not used.
    name
        The quantity, such as ``swing``.
    values
        Its values in SI units.

    Raises
    ------
    SceneError
        For anything wrong in the task, a quantity that the linkage does not have, or no linkage at any value.
    """
    head, fields = read_task(task)
    if not isinstance(fields, LimitTask):
        raise SceneError(f"expected a task of limit positions, got {fields.kind!r}", where="kind")
    units = {n: unit for n, unit, _ in LIMITS[fields.linkage].quantities}
    if name not in units:
        raise SceneError(f"{fields.linkage} has no quantity {name!r}", hint=nearest(name, units))
    task_values = {k: v for k, v in fields.model_dump().items() if v is not None}
    unit = units[name]
    designs, reasons = [], []
    for x in values:
        text = float(x) if unit == "1" else f"{float(x)!r} {unit}"
        try:
            synthesis: Synthesis | None = synthesise({**task_values, name: text})
            reason = ""
        except NoLinkageError as error:
            synthesis, reason = None, str(error).partition("\n")[0]
        faultless = tuple(d for d in synthesis.designs if not d.faults) if synthesis else ()
        if synthesis and not faultless:
            reason = synthesis.designs[0].faults[0]
        designs.append(faultless)
        reasons.append(reason)
    if not designs:
        raise SceneError(f"expected values of {name}, got none")
    if not any(designs):
        raise NoLinkageError(f"no linkage at any of the {len(designs)} values of {name}: {reasons[0]}")
    numbers = tuple(float(x) for x in values)
    return DesignChart(
        head.title, fields.linkage, name, unit, numbers, tuple(designs), tuple(reasons), head.units
    )


def values_of(task: str | os.PathLike[str], option: str) -> tuple[str, list[float]]:
    """Return quantity and values of ``--vary NAME=START:STOP:COUNT``, in SI units.

    Raises
    ------
    SceneError
        When the option has another form.
    """
    name, _, text = option.partition("=")
    parts = text.split(":")
    if len(parts) != 3 or not parts[2].strip().isdecimal() or int(parts[2]) < 2:
        raise SceneError(f"expected NAME=START:STOP:COUNT, such as swing=20deg:90deg:15, got {option!r}")
    _, fields = read_task(task)
    dim = LENGTH if fields.kind == "limits" and name in LIMITS[fields.linkage].lengths else NUMBER
    start, stop = (value(part, dim, name) for part in parts[:2])
    count = int(parts[2])
    return name, [start + i * (stop - start) / (count - 1) for i in range(count)]
