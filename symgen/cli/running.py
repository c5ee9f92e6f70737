"""``symgen run``: a motion in time, or a driven loop over its input."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
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
from symgen.errors import ModelError, SimulationError

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
        typer.Option(
            help="How constraints are kept: projection; for comparison only baumgarte (not of loops), raw."
        ),
    ] = None,
    stabilisation_rate: Annotated[
        float | None, typer.Option(help="Rate of Baumgarte's terms [1/s] (10).")
    ] = None,
    max_drift: Annotated[
        float | None,
        typer.Option(help="Error of a constraint or of closure [m] that ends the run; none when absent."),
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
    """Run a scene, and print where it ended.

    A driven loop is evaluated over the range of its input.
    """
    asked: _Options = {"t_end": t_end, "method": method, "rtol": rtol, "atol": atol, "step": step}
    types: _Options = {"precision": precision, "digits": digits}
    types |= {"contraction": contraction, "vector": vector}
    if study:
        others: _Options = {"samples": samples, "at": at, "out": out, "plot": plot}
        _studies(scene, study, asked | others | _unusual(types), set_, as_json, backend)
        return
    from symgen.pipeline import build_asked

    check_files(out, plot)
    model: Any = build_asked(scene, set=changes(set_), backend=backend, **types)
    of_elastic: _Options = {"revolutions": revolutions, "steps": steps, "segments": segments, "form": form}
    of_elastic["geometric_stiffness"] = geometric_stiffness
    in_time: _Options = {"stabilisation": stabilisation, "stabilisation_rate": stabilisation_rate}
    in_time |= {"max_drift": max_drift, "checkpoint": checkpoint, "every": every, "resume": resume}
    with _kept_of_a_failure(out):
        result = _result(model, _Asked(asked, at, samples, through, of_elastic, in_time, types), as_json)
    write_files(result, out, plot)
    _show(result, model, as_json)


_Options = dict[str, Any]
#: What types are where nothing is asked for.
_USUAL = {"precision": "float64", "contraction": "off", "vector": "none"}


def _unusual(types: _Options) -> _Options:
    """Return what is asked for of types, and is not what they are anyway."""
    return {name: None if _USUAL.get(name) == value else value for name, value in types.items()}


@dataclass(frozen=True, slots=True)
class _Asked:
    """What is asked for of a run, by option: of any, of elastic links, and of motions found in time."""

    steps: _Options
    at: list[str] | None
    samples: int | None
    through: bool
    of_elastic: _Options
    in_time: _Options
    types: _Options


def _result(model: Any, asked: _Asked, as_json: bool) -> Result:
    """Run a model as its kind is run."""
    from symgen.pipeline import is_kinematic
    from symgen.runs import driven_run, elastic_run, kinematic_run
    from symgen.runtime.elastic_model import ElasticModel

    elastic, on_values = isinstance(model, ElasticModel), bool(asked.at or asked.through)
    if not elastic:
        _refuse(asked.of_elastic, f": for elastic links only, and {model.name} has none")
    kept = _in_time(model, on_values, asked.in_time)
    if is_kinematic(model):
        t_end = asked.steps["t_end"]
        _refuse(_unusual(asked.types), ": kinematics is computed in doubles")
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
    """Raise ModelError, which names them and then says why, where any of these options is given."""
    given = [f"--{name.replace('_', '-')}" for name, value in options.items() if value is not None]
    if given:
        raise ModelError(f"{', '.join(given)}{why}")


def _in_time(model: Any, driven: bool, given: _Options) -> _Options:
    """Return the options, of those given, that only motions found in time have."""
    from symgen.pipeline import is_kinematic
    from symgen.runtime.elastic_model import ElasticModel
    from symgen.runtime.loop_model import LoopModel

    elastic = isinstance(model, ElasticModel)
    if is_kinematic(model) or model.is_driven or (driven and not elastic):
        _refuse(given, ": for motions that are found step by step in time")
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
            raise ModelError("--every says how often a checkpoint is written: say where, with --checkpoint")
        kept["checkpoint_every"] = kept.pop("every")
    return kept


@contextmanager
def _kept_of_a_failure(out: Path | None) -> Iterator[None]:
    """Save what was recorded until a run failed, where its result was to be saved."""
    try:
        yield
    except SimulationError as error:
        if out and error.partial is not None:
            error.partial.save(out)
            print(f"symgen: what was recorded until then is in {out}", file=sys.stderr)
        raise


def _show(result: Result, model: Any, as_json: bool) -> None:
    """Print a result: as one JSON object, or as tables."""
    from symgen.runtime.elastic_result import ElasticResult
    from symgen.runtime.loop_model import LoopModel
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
    elif isinstance(model, LoopModel):
        from symgen.report.loops import print_motion_of_loop

        print_motion_of_loop(result, console())
    else:
        from symgen.report.tables import print_result

        print_result(result, console())


def _studies(
    scene: str,
    folder: Path,
    others: _Options,
    set_: list[str] | None,
    as_json: bool,
    backend: str,
) -> None:
    """Run the studies of a scene, and print what they gave; no other option goes with that."""
    from symgen.study import run_studies

    _refuse(others, " does not go with --study: the scene says what is studied")
    with progress_bar(f"studies of {Path(scene).stem}", as_json) as progress:
        report = run_studies(scene, folder, set=changes(set_), backend=backend, progress=progress)
    if as_json:
        print_json(report.summary())
    else:
        from symgen.study.terminal import print_report

        print_report(report, console())
