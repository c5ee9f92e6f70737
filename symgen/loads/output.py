"""An output of a scene: an expression of the time and the state, which acts on nothing."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import Field

from symgen.errors import SceneError
from symgen.loads.load import Reading, StatedOutput
from symgen.scene import table, units
from symgen.scene.expressions import parse_any
from symgen.scene.faults import at


class Output(table.Table):
    """An output as an expression of the time and the state, such as the camber of a wheel (rigid links)."""

    name: table.Name = Field(description="Its name in results and in analysis.outputs.")
    value: table.Value = Field(description="May use the time t, parameters, inputs, states and the state.")
    unit: str | None = table.absent("Its unit, such as deg, where it is an angle.")
    about: table.Text = Field("", description="Meaning, for reports.")


@dataclass(frozen=True, slots=True)
class SceneOutput(StatedOutput):
    """An output of the scene."""

    noun, plural, schema = "output", "outputs by expressions", Output

    @classmethod
    def read(cls, read: Reading, table: Output, name: str, where: str) -> SceneOutput:
        names = read.with_state()
        with at(f"{where}.value"):
            dim = parse_any(table.value, names)[1]
        value, unit = read.value(table.value, dim, f"{where}.value", names), dim.unit
        if table.unit is not None:
            with at(f"{where}.unit"):
                unit = units.shown_unit(f"1 {table.unit}")
                if units.without_angles(unit) != dim.unit:
                    raise SceneError(f"expected a unit like {dim.unit} of the value, got {table.unit!r}")
        return cls(name, table.name, unit, table.about.strip() or f"output {table.name}", value)
