"""``symgen bench``: work-precision comparison of the integrators over tolerances and steps."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from symgen.cli import options as o
from symgen.cli.common import changes, command, progress_bar, show


@command("symgen bench triple_pendulum --t-end 1 --plot bench.svg")
def bench(
    scene: o.Scene,
    methods: Annotated[
        str | None, typer.Option(metavar="NAME[,NAME...]", help="Integrators; default: all.")
    ] = None,
    precisions: Annotated[
        str, typer.Option(metavar="NAME[,NAME...]", help="float32, float64, longdouble, float128.")
    ] = "float64",
    t_end: Annotated[
        float | None,
        typer.Option(help="End time \\[s]; default: the scene's. Shorten it for chaotic motion."),
    ] = None,
    samples: Annotated[int, typer.Option(help="Number of times at which errors are evaluated.")] = 21,
    repeats: Annotated[int, typer.Option(help="Number of timed runs per setting.")] = 5,
    longest: Annotated[
        float, typer.Option(help="End a series of settings after the first run longer than this \\[s].")
    ] = 0.5,
    set_: o.Set = None,
    out: o.JsonFile = None,
    plot: o.Plot = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
) -> None:
    """Measure error, time and order of every integrator.

    Errors are measured against a reference solution with tight tolerances. All methods and settings take half
    a minute or longer; --methods, --longest and --repeats shorten this.
    """
    from symgen.study.speed.report import draw, print_work_precision
    from symgen.study.speed.work_precision import work_precision

    with progress_bar(f"bench of {Path(scene).stem}", as_json) as progress:
        measurement = work_precision(
            scene,
            set=changes(set_),
            methods=methods.split(",") if methods else None,
            precisions=precisions.split(","),
            t_end=t_end,
            samples=samples,
            repeats=repeats,
            longest=longest,
            backend=backend,
            progress=progress,
        )
    if plot:
        draw(measurement, plot)
    show(measurement.summary(), as_json, out, lambda of: print_work_precision(measurement, of), plot)
