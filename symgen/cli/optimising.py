"""``symgen optimise``: the parameters that minimise an output, and the Pareto front of two."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from symgen.cli import options as o
from symgen.cli.common import changes, command, show_study
from symgen.errors import ModelError


@command("symgen optimise barrier.toml --method differential-evolution")
def optimise(
    scene: o.Scene,
    method: Annotated[
        str | None,
        o.option("--method", metavar="NAME", help="SLSQP (default), trust-constr, differential-evolution."),
    ] = None,
    seed: Annotated[
        int | None, o.option("--seed", metavar="N", help="Seed of differential evolution (0).")
    ] = None,
    set_: o.Set = None,
    write: Annotated[
        Path | None,
        o.option("--write", metavar="FILE", group="Output", help="Write the scene with the optimum: .toml."),
    ] = None,
    page: o.Page = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
) -> None:
    r"""Find the parameters that minimise an output.

    The table \[optimise] of the scene has the variables with their bounds, the objective and the constraints.
    Two objectives give the designs of their Pareto front.
    """
    from symgen.atomic import writable, write_text
    from symgen.report.sweeps import optimum_study
    from symgen.scene.loading import check_scene, override, read_scene
    from symgen.study.optima import (
        bounds_of,
        check_tables,
        check_units,
        check_units_at_start,
        with_values,
        written,
    )
    from symgen.study.sweeps import varied

    changed = override(read_scene(scene), changes(set_))
    plan: Any = check_scene(changed).optimise
    if plan is None:
        raise ModelError(
            "there is no optimisation in this scene\n  Write [optimise] with variables and objective."
        )
    arguments = plan.model_dump(exclude_unset=True)
    arguments["constraints"], quantities = bounds_of(plan.constraints)
    arguments |= {name: value for name, value in (("method", method), ("seed", seed)) if value is not None}
    model, arguments["variables"], units = varied(
        scene, arguments["variables"], set=changes(set_), backend=backend, table="optimise.variables"
    )
    check_units_at_start(quantities, model, arguments)
    if isinstance(arguments["objective"], list):
        if write:
            raise ModelError("a Pareto front has many optima: omit --write, or give one objective")
        _front(model, arguments, quantities, units, page, as_json)
        return
    if arguments.pop("points", None) is not None:
        raise ModelError("points are those of a Pareto front: give [optimise] two objectives")
    if write:
        writable(write, (".toml",), "scene")
        check_tables(scene, changed, write)
    optimum = model.optimise(**arguments)
    check_units(quantities, optimum.units)
    best = with_values(changed, optimum.parameters, units, model.description)
    check_scene(best)
    if write:
        write_text(write, written(scene, best))
    study = optimum_study(optimum, arguments["objective"], units)
    if page:
        study = replace(study, **_pictures(model, optimum, arguments, changed, best, units))
    data = {"scene": model.name, "kind": "optimum", **optimum.summary()}
    show_study(study, model.name, data, as_json, page, write)


def _pictures(
    model: Any, optimum: Any, arguments: Mapping[str, Any], text: Any, best: Any, units: Any
) -> dict[str, Any]:
    """Return the figures and drawings of a page: start and optimum, outputs of both, the course."""
    from symgen.inspection.view import view_of
    from symgen.report.page.sheet import Sheet
    from symgen.report.sweeps import optimum_figures
    from symgen.scene.loading import check_scene
    from symgen.scene.resolve import resolve
    from symgen.study.optima import with_values

    begin = {name: optimum.start[name] for name in optimum.parameters if name in optimum.start}
    first = with_values(text, begin, units, model.description) if begin else text

    def drawings() -> Any:
        for title, scene, built in (
            ("start", first, model.with_parameters(**begin)),
            ("optimum", best, optimum.model),
        ):
            resolved = resolve(check_scene(scene))
            view = view_of(resolved)
            yield Sheet(title, [view.sketch(resolved, built, None)], {}, view.unit(resolved))

    return {"figures": optimum_figures(model, optimum, arguments, units), "drawings": drawings}


def _front(
    model: Any,
    arguments: dict[str, Any],
    quantities: Mapping[str, str],
    units: Mapping[str, tuple[str, float]],
    page: Path | None,
    as_json: bool,
) -> None:
    """Find, print and write the Pareto front of two objectives."""
    from symgen.report.sweeps import front_study, show_in
    from symgen.study.optima import check_units

    if arguments.pop("method", "SLSQP") != "SLSQP":
        raise ModelError("a Pareto front is found by SLSQP: omit the method")
    arguments.pop("seed", None)
    front = model.pareto(objectives=arguments.pop("objective"), **arguments)
    check_units(quantities, json.loads(front.attrs["units"]))
    points = {str(n): front[n].values.tolist() for n in (*front.coords, *front.data_vars)}
    data = {"scene": model.name, "kind": "pareto", "points": points, "runs": front.attrs["runs"]}
    show_in(front, units)
    show_study(front_study(front), model.name, data, as_json, page)
