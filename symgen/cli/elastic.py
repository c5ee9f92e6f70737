"""Analyses that linkages with elastic links alone support."""

from __future__ import annotations

from typing import Annotated

import typer

from symgen.cli import options as o
from symgen.cli.carrying import Request
from symgen.cli.common import command


@command("symgen periodic elastic_four_bar")
def periodic(
    ctx: typer.Context,
    scene: o.Scene,
    steps: o.Steps = None,
    rtol: o.Rtol = None,
    samples: o.Samples = None,
    at: o.AtAngles = None,
    form: o.Form = None,
    geometric_stiffness: o.GeometricStiffness = None,
    max_step: o.MaxStep = None,
    max_wall: o.MaxWall = None,
    set_: o.Set = None,
    out: o.Out = None,
    plot: o.Plot = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
    precision: o.Precision = "float64",
    digits: o.Digits = None,
    contraction: o.Contraction = "off",
    vector: o.Vector = "none",
) -> None:
    """Find the steady state of elastic links and its stability."""
    Request(ctx).carry_out("periodic")


@command("symgen quasi-static elastic_four_bar --at 0,60")
def quasi_static(
    ctx: typer.Context,
    scene: o.Scene,
    revolutions: o.Revolutions = None,
    samples: o.Samples = None,
    at: o.AtAngles = None,
    form: o.Form = None,
    geometric_stiffness: o.GeometricStiffness = None,
    max_wall: o.MaxWall = None,
    set_: o.Set = None,
    out: o.Out = None,
    plot: o.Plot = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
    precision: o.Precision = "float64",
    digits: o.Digits = None,
    contraction: o.Contraction = "off",
    vector: o.Vector = "none",
) -> None:
    """Compute the static deformation of elastic links under the rigid motion."""
    Request(ctx).carry_out("quasi_static")


@command("symgen large-rotation elastic_four_bar --segments 8")
def large_rotation(
    ctx: typer.Context,
    scene: o.Scene,
    segments: o.Segments = None,
    elements: Annotated[
        int | None,
        o.option("--elements", metavar="N", help="Number of elements per elastic link, not rods."),
    ] = None,
    revolutions: o.Revolutions = None,
    rtol: o.Rtol = None,
    samples: o.Samples = None,
    max_step: o.MaxStep = None,
    max_wall: o.MaxWall = None,
    checkpoint: o.Checkpoint = None,
    checkpoint_every: o.CheckpointEvery = None,
    resume: o.Resume = None,
    set_: o.Set = None,
    out: o.Out = None,
    plot: o.Plot = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
) -> None:
    """Simulate elastic links in large rotation, as chains of rods or as beam elements.

    This is the reference solution for linear theory, on which the other analyses are based.
    """
    Request(ctx).carry_out("large_rotation")


@command("symgen speed-response elastic_four_bar --speeds 60:400:18")
def speed_response(
    ctx: typer.Context,
    scene: o.Scene,
    speeds: Annotated[
        str,
        o.option(
            "--speeds",
            metavar="FROM:TO:COUNT",
            help='Crank speeds in rpm: "20:400:39", or a list such as "60,95,120".',
        ),
    ],
    rtol: o.Rtol = None,
    samples: o.Samples = None,
    max_wall: o.MaxWall = None,
    set_: o.Set = None,
    out: o.Out = None,
    plot: o.Plot = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
) -> None:
    """Find steady states of elastic links over the crank speed.

    Peak values, critical speeds and stability are printed.
    """
    from symgen.inspection.values import crank_speeds

    wanted = crank_speeds(speeds)
    request = Request(ctx)
    request.options["speeds"] = wanted
    request.carry_out("speed_response")
