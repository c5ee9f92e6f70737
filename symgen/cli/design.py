"""``symgen sweep``: variation of parameters; ``synthesise``: four-bars by their properties."""

from __future__ import annotations

from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from symgen.cli import options as o
from symgen.cli.common import (
    changes,
    command,
    console,
    print_json,
    progress_bar,
    show_study,
    told_on_interrupt,
)
from symgen.cli.request import analysis, recording
from symgen.errors import ModelError, SimulationError

_DESIGN = "Design"


@command("symgen synthesise swing.toml --out four_bars")
def synthesise(
    task: Annotated[
        Path, typer.Argument(help="TOML file whose table \\[synthesis] has the prescribed properties.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder for the linkages as scenes: four_bar_1.toml and so on.")
    ] = None,
    vary: Annotated[
        str | None,
        typer.Option(help="Design chart of limit positions over a quantity: swing=20deg:90deg:15."),
    ] = None,
    plot: o.Plot = None,
    page: o.Page = None,
    as_json: o.Json = False,
) -> None:
    r"""Find all four-bars, slider-cranks or spherical four-bars with prescribed properties.

    The task has a linkage (four-bar, slider-crank or spherical) and a
    kind: limits (limit positions and transmission angles), function (of the crank's angle),
    path (points of the coupler) or motion (poses of the coupler), such as \[synthesis] kind = "motion",
    points = \[\["0 m", "0 m"], \["4 cm", "3 cm"], ...], angles = \["0 deg", "20 deg", ...].
    Each linkage is run, and faults of its motion are listed.
    """
    from symgen.atomic import writable_folder, write_folder
    from symgen.report.synthesis import synthesis_study
    from symgen.synthesis.synthesise import synthesise as found

    if out:
        writable_folder(out, "scenes")
    if vary:
        if out:
            raise ModelError("a design chart has no scenes: omit --out, or --vary")
        _chart(task, vary, plot, page, as_json)
        return
    if plot:
        raise ModelError("expected --vary NAME=START:STOP:COUNT with --plot, which draws a design chart")
    result = found(task)
    if out:
        stem = {"spherical": "spherical_four_bar"}.get(result.linkage, result.linkage.replace("-", "_"))
        scenes = [d.linkage.toml(result.title, result.units).encode() for d in result.designs]
        write_folder(out, {f"{stem}_{i}.toml": scene for i, scene in enumerate(scenes, 1)}, "scenes")
    show_study(synthesis_study(result), task.stem, result.summary(), as_json, page, out)


def _chart(task: Path, vary: str, plot: Path | None, page: Path | None, as_json: bool) -> None:
    """Print, plot and write a design chart."""
    from symgen.report.synthesis import chart_study, plot_chart
    from symgen.synthesis.charts import design_chart, values_of

    name, values = values_of(task, vary)
    chart = design_chart(task, name, values)
    if plot:
        plot_chart(chart, plot)
    show_study(chart_study(chart), task.stem, chart.summary(), as_json, page, plot)


@analysis(
    "symgen sweep slider_crank --vary a4=0in:30in:7 --of theta1.drive --out offsets.zarr",
    "vary list_ sobol latin_hypercube random seed analysis outputs reduce samples t_end chunk part "
    "threads processes dask dry_run set_ out plot page as_json backend",
    page=o.Page,
    vary=o.maybe(
        list[str],
        "--vary",
        "KEY=VALUES",
        "A parameter or key, and START:STOP:COUNT, V1,V2,..., LOW:HIGH or normal(MEAN, DEVIATION), "
        "with units. May be repeated.",
        _DESIGN,
    ),
    list_=o.maybe(Path, "--list", "FILE", "CSV file: a column per key, a row per run.", _DESIGN),
    sobol=o.maybe(int, "--sobol", "N", "Sample ranges by a scrambled Sobol sequence.", _DESIGN),
    latin_hypercube=o.maybe(int, "--latin-hypercube", "N", "Sample ranges by a Latin hypercube.", _DESIGN),
    random=o.maybe(int, "--random", "N", "Sample ranges by random numbers.", _DESIGN),
    seed=o.maybe(int, "--seed", "N", "Seed of the samples (0).", _DESIGN),
    analysis=o.maybe(str, "--analysis", "NAME", "Analysis of each run, such as simulate or periodic."),
    outputs=o.outputs_of("Outputs to keep, of kinematics also points, links or corners A.B.C; default: all."),
    reduce=o.names(
        "--reduce",
        "Reductions: peak (default), greatest, least, range, mean, rms, final or history. Results are named "
        "after them, B.position.peak; those of history, and of equilibrium and modes, as the output.",
    ),
    chunk=o.maybe(int, "--chunk", "N", "Runs that are written at a time."),
    part=o.maybe(str, "--part", "I/N", "Only every N-th chunk from the I-th, for job arrays."),
    threads=o.maybe(int, "--threads", "N", "Number of threads; default: all processors."),
    processes=o.maybe(int, "--processes", "N", "Carry out chunks in N processes, of one thread by default."),
    dask=o.maybe(str, "--dask", "ADDRESS", "Carry out chunks on the Dask cluster of this scheduler."),
    dry_run=Annotated[
        bool,
        o.option("--dry-run", group="Run", help="Check options; print the number of runs and their time."),
    ],
    out=o.maybe(
        Path, "--out", "FILE", "Zarr store of the results; continued if there. Or a table: .csv.", "Output"
    ),
)
def sweep(ctx: typer.Context) -> None:
    r"""Carry out an analysis over many values of parameters.

    Options replace those of the table \[sweep] of the scene. Extremes of all outputs are printed.
    """
    from symgen.report import sweeps
    from symgen.runtime.sweeps.executors import dask_client
    from symgen.scene.loading import load_scene
    from symgen.study.sweeps import of_file, of_options, varied

    params = ctx.params
    scene, vary, list_ = (params[name] for name in ("scene", "vary", "list_"))
    plan: Any = load_scene(scene, set=changes(params["set_"])).sweep
    arguments = {} if plan is None else plan.model_dump(exclude_unset=True)
    kinds = [(k, params[k.replace("-", "_")]) for k in ("sobol", "latin-hypercube", "random")]
    kinds = [(kind, count) for kind, count in kinds if count is not None]
    if len(kinds) + (list_ is not None) > 1 or (vary and list_ is not None):
        raise ModelError(
            "give --vary, with --sobol, --latin-hypercube or --random for ranges, or --list alone"
        )
    if vary or list_ is not None:
        arguments = {
            key: value for key, value in arguments.items() if key not in ("vary", "sampling", "count")
        }
    if list_ is not None:
        arguments |= {"vary": of_file(list_), "sampling": "list"}
    elif vary:
        arguments["vary"] = of_options(vary)
    if kinds:
        arguments["sampling"], arguments["count"] = kinds[0]
    names = ("seed", "analysis", "outputs", "reduce", "samples", "t_end", "chunk")
    arguments |= {name: params[name] for name in names if params[name] is not None}
    if "vary" not in arguments:
        raise ModelError("expected parameters to vary: --vary KEY=START:STOP:COUNT, or [sweep] in the scene")
    out, plot = params["out"], params["plot"]
    if params["outputs"]:
        arguments.pop("of", None)  # of the scene's table
    (model, arguments["vary"], units), _ = recording(
        partial(varied, scene, arguments["vary"], backend=params["backend"]),
        scene,
        changes(params["set_"]),
        params["outputs"],
        arguments.get("t_end"),
    )
    arguments |= {"file": out, "part": _part(params["part"]), "threads": params["threads"]}
    if params["dry_run"]:
        _estimated(model, arguments, params["as_json"])
        return
    dask, processes = params["dask"], params["processes"]
    if dask and processes is not None:
        raise ModelError("give --processes or --dask, not both")
    with (
        told_on_interrupt(),
        dask_client(dask) if dask else nullcontext(processes) as executor,
        progress_bar(f"sweep of {model.name}", params["as_json"]) as progress,
    ):
        runs = model.sweep(**arguments, executor=executor, progress=progress)
    sweeps.show_in(runs, units)
    about = sweeps.summary(runs)
    if about["failed"] == about["runs"] - about["missing"] > 0:
        raise SimulationError(f"all {about['failed']} runs failed, the first: {about['first_error']}")
    if plot:
        sweeps.plot(runs, file=plot)
    data = {"scene": model.name, "kind": "sweep", **about}
    show_study(
        sweeps.sweep_study(runs, about), model.name, data, params["as_json"], params["page"], out, plot
    )


def _estimated(model: Any, arguments: dict[str, Any], as_json: bool) -> None:
    """Print the number of runs of a sweep, and the time of all by that of the first."""
    from symgen.runtime.sweeps.designs import design_of
    from symgen.runtime.sweeps.sweep import check, estimate, sweep_of

    reduced = dict(arguments)
    named = ("sampling", "count", "seed", "analysis", "outputs", "reduce", "threads", "chunk", "file", "part")
    sampling, count, seed, analysis, outputs, reduce, threads, chunk, file, part = (
        reduced.pop(k, None) for k in named
    )
    design = design_of(reduced.pop("vary"), sampling, count, seed or 0)
    sweep = sweep_of(model, analysis, design, outputs, reduce or "peak", reduced, threads)
    check(sweep, file, chunk, part)
    runs, chunks, time = estimate(sweep, chunk, part)
    if as_json:
        about = {"runs": runs, "chunks": chunks, "seconds": time}
        print_json({"scene": model.name, "kind": "sweep_estimate", "analysis": sweep.analysis, **about})
        return
    console().print(
        f"{runs} runs of {sweep.analysis.replace('_', ' ')} in {chunks} chunks: about {time:.2g} s"
    )


def _part(text: str | None) -> tuple[int, int]:
    """Return the two numbers of --part."""
    first, slash, last = (text or "1/1").partition("/")
    if not slash or not first.isdecimal() or not last.isdecimal():
        raise ModelError(f"expected --part I/N such as 2/8, got {text!r}")
    return int(first), int(last)
