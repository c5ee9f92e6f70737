"""What pages and explanations show of spatial loops."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from symgen.display import seconds
from symgen.inspection.picture import drawn_of_loop, loop_sketch, pose_of_loop
from symgen.inspection.view import View
from symgen.joints import JOINTS
from symgen.models.loop.structure import general, loop_structure
from symgen.pipeline.systems import system_of
from symgen.report.mathematics.saving import saving_lines
from symgen.report.page.drawing import Drawing, Sketch
from symgen.report.page.page import Fact, TableView
from symgen.runtime.result.result import Result
from symgen.scene.loop.loop import Loop
from symgen.symbolic.system import System


class LoopView(View):
    """A loop of joints, driven or free."""

    kind = "loop"

    def structure(self, resolved: Loop, system: System) -> Iterator[str]:
        """Yield the joints and the operations saved by missing offsets."""
        yield from loop_structure(resolved, system)
        yield from saving_lines(system, system_of(general(resolved)), "general offsets")

    def facts(self, resolved: Loop, model: Any) -> tuple[Fact, ...]:
        """Return joints, variables and rank."""
        d = model.description
        free = len(d.having("input", "free"))
        return (
            Fact("loop", "–".join(d.joints)),
            Fact("joints", ", ".join(f"{JOINTS[j].name} {j}" for j in dict.fromkeys(d.joints))),
            Fact("variables", f"{d.coordinates}, of which {len(d.having('dependent'))} dependent"),
            Fact("degrees of freedom", str(free)),
            Fact("rank of the screws", f"{d.rank} of 6"),
        )

    def sketch(self, resolved: Loop, model: Any, result: Result | None) -> Sketch:
        """Return the links between their joint axes."""
        start = model.closed_start()
        return loop_sketch(resolved, pose_of_loop(resolved, model, start.t, start.q))

    film_caption = (
        "Dashed lines are joint axes and translations along them; thin lines are the paths of joints."
    )

    def drawn_outputs(self, resolved: Loop) -> Sequence[str]:
        """Return the places of joints on links, and the axes of joints."""
        return drawn_of_loop(resolved)

    def plotted_outputs(self, resolved: Loop) -> Sequence[str]:
        """Return the joint variables."""
        return [v.name for v in resolved.variables]

    def arrows(self, resolved: Loop, plotted: Sequence[str]) -> Sequence[str]:
        """Return the plotted joint forces, which are in frames of links, in the axes of the picture."""
        vectors = (f"{name}_in_ground" for name in plotted if name.endswith(".force"))
        return [name for name in vectors if name not in plotted]

    def moved(self, model: Any, samples: int, **options: Any) -> Result:
        """Return the range of a driven loop, with forces if it has masses, or the motion of a free one."""
        if not model.is_driven:
            return super().moved(model, samples, **options)
        verb = "inverse_dynamics" if "inverse_dynamics" in model.capabilities else "kinematics"
        if "t_end" in options:
            options |= {"start": 0.0, "stop": options.pop("t_end"), "over": "time"}
        return getattr(model, verb)(samples=samples, **options)

    def sketch_at(self, resolved: Loop, drawn: Mapping[str, NDArray[np.float64]]) -> Sketch:
        """Return the links between their joint axes."""
        return loop_sketch(resolved, drawn)

    def caption(self, drawn: Drawing) -> str:
        """Return the caption of the drawing."""
        return (
            "The loop at the beginning of its range; dashed lines are joint axes and translations along them"
        )

    def run(self, model: Any) -> Result:
        """Return the range of a driven loop, or the motion of a free one."""
        return model.inverse_dynamics() if model.is_driven else model.simulate()

    def cost(self, model: Any, result: Result) -> tuple[TableView, str] | None:
        """Return the time per pose of a driven loop and the largest closure defect."""
        known = result.statistics
        if not model.is_driven:
            return None
        row = (
            result.provenance["backend"],
            str(result.count),
            seconds(known["wall_s"] / max(1, result.count)),
            f"{known['closure']:.1e}",
        )
        caption = (
            "A driven loop is not integrated: each pose is closed by Newton's method starting from the "
            "previous one, with all rates, accelerations and forces. The defect is the maximum over all "
            "poses, of angles in radians, of translations relative to the size of the loop."
        )
        return TableView(("backend", "poses", "time per pose", "largest defect"), (row,)), caption

    def example(self, model: Any) -> list[str]:
        """Return lines that evaluate a driven loop at a value, or run a free one."""
        d = model.description
        if not model.is_driven:
            return [f"run = model.simulate({d.t_end:g})", "run.drift"]
        value = 0.5 * (d.span[0] + d.span[1])
        return [
            f"turn = model.inverse_dynamics(at=[{value:.6g}])  # at a value of the input, in SI units",
            "turn.summary()",
        ]
