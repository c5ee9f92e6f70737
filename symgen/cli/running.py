"""``symgen run``: a motion in time, or a driven loop over its input."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from symgen.cli.common import (
    BackendOption,
    ContractionOption,
    DigitsOption,
    OutOption,
    PlotOption,
    PrecisionOption,
    SceneArgument,
    SetOption,
    VectorOption,
    app,
    changes,
    check_files,
    console,
    print_json,
    progress_bar,
    show_motion,
    write_files,
)

if TYPE_CHECKING:
    from symgen.runtime.result import Result


@app.command()
def run(
    scene: SceneArgument,
    t_end: Annotated[
        float | None, typer.Option(help="End of the run [s]; the scene's own when absent.")
    ] = None,
    method: Annotated[
        str | None,
        typer.Option(
            help="Adaptive: dop853, dopri5, radau5 (stiff). Fixed step: rk4, rattle, rattle4, rattle6, "
            "rattle8, generalized-alpha, newmark. Of elastic links dop853, rk4, gauss, gauss4, newmark, "
            "generalized-alpha, wilson-theta, quasi-static, periodic, exact (large rotation)."
        ),
    ] = None,
    rtol: Annotated[
        float | None,
        typer.Option(
            help="Relative tolerance of the local error; with elastic links, error over the peak stress."
        ),
    ] = None,
    atol: Annotated[float | None, typer.Option(help="Absolute tolerance [m, m/s].")] = None,
    step: Annotated[float | None, typer.Option(help="Fixed step [s].")] = None,
    samples: Annotated[
        int | None, typer.Option(help="Number of recorded times (201), or of values of the input (361).")
    ] = None,
    stabilisation: Annotated[
        str | None,
        typer.Option(help="How constraints are kept: projection; for comparison only baumgarte, raw."),
    ] = None,
    stabilisation_rate: Annotated[
        float | None, typer.Option(help="Rate of Baumgarte's terms [1/s] (10).")
    ] = None,
    max_drift: Annotated[
        float | None, typer.Option(help="Error of a constraint [m] that ends the run; none when absent.")
    ] = None,
    checkpoint: Annotated[
        Path | None, typer.Option(help="A file that is given the run's state now and then.")
    ] = None,
    every: Annotated[
        float | None, typer.Option(help="Seconds of wall time from one checkpoint to the next (10).")
    ] = None,
    resume: Annotated[
        Path | None, typer.Option(help="Go on from a checkpoint of the same run, to the same bits.")
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            metavar="VALUE[,VALUE...]",
            help='Values of the first input of a driven loop: "45,100" (degrees, or the scene\'s unit of '
            'length), "0.5 rad", "3 in"; with elastic links, crank angles.',
        ),
    ] = None,
    through: Annotated[
        bool,
        typer.Option(
            "--through", help="Follow a driven loop on through the values at which its input turns back."
        ),
    ] = False,
    revolutions: Annotated[
        float | None, typer.Option(help="Turns of the crank of a scene with elastic links (1).")
    ] = None,
    steps: Annotated[
        int | None,
        typer.Option(help="Steps a turn with elastic links; doubled until they suffice when absent."),
    ] = None,
    segments: Annotated[
        int | None, typer.Option(help="Rods of each elastic link, of the method exact (12).")
    ] = None,
    form: Annotated[
        str | None, typer.Option(help="Equations of elastic links: exact, or thesis (for comparison only).")
    ] = None,
    geometric_stiffness: Annotated[
        bool | None,
        typer.Option(help="Whether axial forces stiffen elastic links; as the scene says when absent."),
    ] = None,
    set_: SetOption = None,
    out: OutOption = None,
    plot: PlotOption = None,
    study: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Run the [[studies]] of the scene instead; plots and tables."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
    backend: BackendOption = "auto",
    precision: PrecisionOption = "float64",
    digits: DigitsOption = None,
    contraction: ContractionOption = "off",
    vector: VectorOption = "none",
) -> None:
    """Run a scene and print where it ended; a driven loop is evaluated over the range of its input."""
    if study:
        given: dict[str, Any] = {"--t-end": t_end, "--method": method, "--rtol": rtol, "--atol": atol}
        given |= {"--step": step, "--samples": samples, "--at": at, "--out": out, "--plot": plot}
        given |= {"--precision": None if precision == "float64" else precision, "--digits": digits}
        given |= {"--contraction": None if contraction == "off" else contraction}
        given |= {"--vector": None if vector == "none" else vector}
        others = [name for name, value in given.items() if value is not None]
        _studies(scene, study, others, set_, as_json, backend)
        return
    from symgen.errors import ModelError, SimulationError
    from symgen.pipeline import build_asked as build_model
    from symgen.pipeline import is_kinematic
    from symgen.runtime.elastic_model import ElasticModel
    from symgen.runtime.loop_model import LoopModel

    check_files(out, plot)
    types: dict[str, Any] = {"precision": precision, "digits": digits}
    types |= {"contraction": contraction, "vector": vector}
    model: Any = build_model(scene, set=changes(set_), backend=backend, **types)
    options: dict[str, Any] = {"method": method, "rtol": rtol, "atol": atol, "step": step}
    of_elastic = {"revolutions": revolutions, "steps": steps, "segments": segments, "form": form}
    of_elastic["geometric_stiffness"] = geometric_stiffness
    if not isinstance(model, ElasticModel):
        refused = [f"--{name.replace('_', '-')}" for name, value in of_elastic.items() if value is not None]
        if refused:
            raise ModelError(f"{', '.join(refused)}: for elastic links only, and {model.name} has none")
    kept = _of_linkages(
        model,
        bool(at or through),
        stabilisation=stabilisation,
        stabilisation_rate=stabilisation_rate,
        max_drift=max_drift,
        checkpoint=checkpoint,
        every=every,
        resume=resume,
    )
    result: Result
    try:
        if isinstance(model, ElasticModel):
            from symgen.runs import elastic_run

            asked = {"t_end": t_end, **options, "through": through or None, **of_elastic}
            with progress_bar(model.description.title, as_json) as progress:
                result = elastic_run(model, at, samples, asked, progress)
        elif is_kinematic(model):
            from symgen.runs import kinematic_run

            asked = {"at": at or None, **options}
            result = kinematic_run(model, t_end, samples, through, asked)
        elif model.is_driven or at or through:
            from symgen.runs import driven_run

            result = driven_run(model, at, samples, through, {"t_end": t_end, **options})
        else:
            with progress_bar(model.description.title, as_json) as progress:
                result = model.simulate(
                    t_end, **options, **kept, samples=201 if samples is None else samples, progress=progress
                )
    except SimulationError as error:
        if out and error.partial is not None:
            error.partial.save(out)
            print(f"symgen: what was recorded until then is in {out}", file=sys.stderr)
        raise
    write_files(result, out, plot)
    _show(result, isinstance(model, LoopModel), as_json)


def _of_linkages(model: Any, driven: bool, **given: Any) -> dict[str, Any]:
    """Return the options, of those given, that only the motion of linkages of points and links has."""
    from symgen.errors import ModelError
    from symgen.runtime.model import Model

    kept = {name: value for name, value in given.items() if value is not None}
    if kept and (not isinstance(model, Model) or driven):
        refused = ", ".join(f"--{name.replace('_', '-')}" for name in kept)
        raise ModelError(f"{refused}: for the motion of linkages of points and links only")
    if "every" in kept:
        if "checkpoint" not in kept:
            raise ModelError("--every says how often a checkpoint is written: say where, with --checkpoint")
        kept["checkpoint_every"] = kept.pop("every")
    return kept


def _show(result: Result, of_loop: bool, as_json: bool) -> None:
    """Print a result: as one JSON object, or as tables."""
    from symgen.runtime.elastic_result import ElasticResult
    from symgen.runtime.motion import Motion
    from symgen.runtime.turn import Turn

    if isinstance(result, Motion):
        show_motion(result, as_json)
    elif as_json:
        print_json(result.summary())
    elif isinstance(result, ElasticResult):
        from symgen.report.elastic import print_elastic_result

        print_elastic_result(result, console())
    elif isinstance(result, Turn):
        from symgen.report.loops import print_turn

        print_turn(result, console())
    elif of_loop:
        from symgen.report.loops import print_motion_of_loop

        print_motion_of_loop(result, console())
    else:
        from symgen.report.tables import print_result

        print_result(result, console())


def _studies(
    scene: str, folder: Path, others: list[str], set_: list[str] | None, as_json: bool, backend: str
) -> None:
    """Run the studies of a scene, and print what they gave."""
    from symgen.errors import ModelError
    from symgen.study import run_studies

    if others:
        raise ModelError(f"{', '.join(others)} does not go with --study: the scene says what is studied")
    with progress_bar(f"studies of {Path(scene).stem}", as_json) as progress:
        report = run_studies(scene, folder, set=changes(set_), backend=backend, progress=progress)
    if as_json:
        print_json(report.summary())
    else:
        from symgen.study.terminal import print_report

        print_report(report, console())
