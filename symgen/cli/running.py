"""``symgen run``: simulation in time, or evaluation of a driven loop over its input."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from symgen.cli.common import (
    BackendOption,
    ContractionOption,
    DigitsOption,
    MaxWallOption,
    OutOption,
    PlotOption,
    PrecisionOption,
    SceneArgument,
    SetOption,
    VectorOption,
    app,
    changes,
    console,
    kept_of_a_failure,
    print_json,
    progress_bar,
    show_motion,
    write_files,
)
from symgen.errors import ModelError

if TYPE_CHECKING:
    from symgen.runtime.result.result import Result


@app.command()
def run(
    scene: SceneArgument,
    t_end: Annotated[float | None, typer.Option(help="End of the run [s]; default: the scene's.")] = None,
    method: Annotated[
        str | None,
        typer.Option(
            help="Adaptive: dop853, dopri5, radau5 (stiff). Fixed step: rk4, rattle, rattle4, rattle6, "
            "rattle8, generalized-alpha, newmark. Elastic links: dop853, rk4, gauss, gauss4, newmark, "
            "generalized-alpha, wilson-theta, quasi-static, periodic, exact (large rotation)."
        ),
    ] = None,
    rtol: Annotated[
        float | None,
        typer.Option(
            help="Relative tolerance of the local error; with elastic links, relative to the peak stress."
        ),
    ] = None,
    atol: Annotated[float | None, typer.Option(help="Absolute tolerance [m, m/s].")] = None,
    step: Annotated[float | None, typer.Option(help="Fixed step [s].")] = None,
    samples: Annotated[
        int | None, typer.Option(help="Number of recorded times (201), or of values of the input (361).")
    ] = None,
    stabilisation: Annotated[
        str | None,
        typer.Option(
            help="Constraint stabilisation: projection; for comparison baumgarte (not for loops), raw."
        ),
    ] = None,
    stabilisation_rate: Annotated[
        float | None, typer.Option(help="Rate of Baumgarte stabilisation [1/s] (10).")
    ] = None,
    max_drift: Annotated[
        float | None,
        typer.Option(help="Limit [m] of the constraint or closure error, which ends the run; default: none."),
    ] = None,
    max_step: Annotated[
        float | None,
        typer.Option(
            help="Largest step [s] of an adaptive method, so that short loads are not stepped over."
        ),
    ] = None,
    max_wall: MaxWallOption = None,
    checkpoint: Annotated[Path | None, typer.Option(help="File for periodic checkpoints of the run.")] = None,
    every: Annotated[float | None, typer.Option(help="Wall time [s] between checkpoints (10).")] = None,
    resume: Annotated[
        Path | None, typer.Option(help="Resume from a checkpoint of the same run, bit-identically.")
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
        typer.Option("--through", help="Follow a driven loop past the turning points of its input."),
    ] = False,
    revolutions: Annotated[
        float | None, typer.Option(help="Crank revolutions of a scene with elastic links (1).")
    ] = None,
    steps: Annotated[
        int | None,
        typer.Option(help="Steps per revolution with elastic links; default: doubled until accurate."),
    ] = None,
    segments: Annotated[
        int | None, typer.Option(help="Rods per elastic link in the method exact (12).")
    ] = None,
    form: Annotated[
        str | None, typer.Option(help="Equations of elastic links: exact, or thesis (for comparison only).")
    ] = None,
    geometric_stiffness: Annotated[
        bool | None,
        typer.Option(help="Stiffening of elastic links by axial forces; default: as in the scene."),
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
    """Simulate a scene and print the results.

    A driven loop is evaluated over the range of its input.
    """
    asked: _Options = {"t_end": t_end, "method": method, "rtol": rtol, "atol": atol, "step": step}
    types: _Options = {"precision": precision, "digits": digits}
    types |= {"contraction": contraction, "vector": vector}
    if study:
        others: _Options = {"samples": samples, "at": at, "out": out, "plot": plot}
        _studies(scene, study, asked | others | _unusual(types), set_, as_json, backend)
        return
    from symgen.pipeline.build import build_asked

    model: Any = build_asked(scene, set=changes(set_), backend=backend, **types)
    of_elastic: _Options = {"revolutions": revolutions, "steps": steps, "segments": segments, "form": form}
    of_elastic["geometric_stiffness"] = geometric_stiffness
    in_time: _Options = {"stabilisation": stabilisation, "stabilisation_rate": stabilisation_rate}
    in_time |= {"max_drift": max_drift, "max_step": max_step, "max_wall": max_wall}
    in_time |= {"checkpoint": checkpoint, "every": every, "resume": resume}
    with kept_of_a_failure(out):
        result = _result(model, _Asked(asked, at, samples, through, of_elastic, in_time, types), as_json)
    write_files(result, out, plot)
    _show(result, model, as_json)


_Options = dict[str, Any]
#: Default number types and backend.
_USUAL = {"precision": "float64", "contraction": "off", "vector": "none"}


def _unusual(types: _Options) -> _Options:
    """Return the type options that differ from the defaults."""
    return {name: None if _USUAL.get(name) == value else value for name, value in types.items()}


@dataclass(frozen=True, slots=True)
class _Asked:
    """Options given for a run: general, for elastic links, and for integration in time."""

    steps: _Options
    at: list[str] | None
    samples: int | None
    through: bool
    of_elastic: _Options
    in_time: _Options
    types: _Options


def _result(model: Any, asked: _Asked, as_json: bool) -> Result:
    """Run a model with the options that its kind accepts."""
    from symgen.inspection.runs import driven_run, elastic_run, kinematic_run
    from symgen.pipeline.build import is_kinematic
    from symgen.runtime.elastic.model import ElasticModel

    elastic, on_values = isinstance(model, ElasticModel), bool(asked.at or asked.through)
    if not elastic:
        _refuse(asked.of_elastic, f": for elastic links only, and {model.name} has none")
    kept = _in_time(model, on_values, asked.in_time)
    if is_kinematic(model):
        t_end = asked.steps["t_end"]
        _refuse(_unusual(asked.types), ": kinematics is computed in double precision")
        options = {"at": asked.at or None, **asked.steps, "t_end": None}
        return kinematic_run(model, t_end, asked.samples, asked.through, options)
    if not elastic and (model.is_driven or on_values):
        return driven_run(model, asked.at, asked.samples, asked.through, asked.steps)
    with progress_bar(model.description.title, as_json) as progress:
        if elastic:
            options = {**asked.steps, "through": asked.through or None, **asked.of_elastic, **kept}
            return elastic_run(model, asked.at, asked.samples, options, progress)
        samples = 201 if asked.samples is None else asked.samples
        result: Result = model.simulate(**asked.steps, **kept, samples=samples, progress=progress)
        return result


def _refuse(options: _Options, why: str) -> None:
    """Raise ModelError with the names of the given options and the reason, if any is given."""
    given = [f"--{name.replace('_', '-')}" for name, value in options.items() if value is not None]
    if given:
        raise ModelError(f"{', '.join(given)}{why}")


def _in_time(model: Any, driven: bool, given: _Options) -> _Options:
    """Return those of the given options that apply to integration in time only."""
    from symgen.pipeline.build import is_kinematic
    from symgen.runtime.elastic.model import ElasticModel
    from symgen.runtime.loop.model import LoopModel

    elastic = isinstance(model, ElasticModel)
    if is_kinematic(model) or model.is_driven or (driven and not elastic):
        _refuse(given, ": applies to integration in time only")
    if elastic:
        of_constraints = ("stabilisation", "stabilisation_rate", "max_drift")
        _refuse({name: given[name] for name in of_constraints}, " does not go with elastic links")
    if isinstance(model, LoopModel):
        _refuse(
            {"stabilisation_rate": given["stabilisation_rate"]}, ": for linkages of points and links only"
        )
    kept = {name: value for name, value in given.items() if value is not None}
    if "every" in kept:
        if "checkpoint" not in kept:
            raise ModelError("--every sets the interval of checkpoints: give their file with --checkpoint")
        kept["checkpoint_every"] = kept.pop("every")
    return kept


def _show(result: Result, model: Any, as_json: bool) -> None:
    """Print a result as one JSON object or as tables."""
    from symgen.runtime.loop.model import LoopModel
    from symgen.runtime.result.elastic import ElasticResult
    from symgen.runtime.result.motion import Motion
    from symgen.runtime.result.turn import Turn

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
    elif isinstance(model, LoopModel):
        from symgen.report.loops import print_motion_of_loop

        print_motion_of_loop(result, console())
    else:
        from symgen.report.motion import print_result

        print_result(result, console(), _at_rest(result, model))


def _at_rest(result: Result, model: Any) -> list[str]:
    """Return the names of ground points that have not moved."""
    start = model.initial_state().positions
    return [
        p
        for p in model.description.ground
        if not any(result.final[p]["velocity"]) and list(result.final[p]["position"]) == list(start[p])
    ]


def _studies(
    scene: str,
    folder: Path,
    others: _Options,
    set_: list[str] | None,
    as_json: bool,
    backend: str,
) -> None:
    """Run the studies of a scene and print their results; other options are refused."""
    from symgen.study import run_studies

    _refuse(others, " does not go with --study: the scene defines the studies")
    with progress_bar(f"studies of {Path(scene).stem}", as_json) as progress:
        report = run_studies(scene, folder, set=changes(set_), backend=backend, progress=progress)
    if as_json:
        print_json(report.summary())
    else:
        from symgen.study.terminal import print_report

        print_report(report, console())
