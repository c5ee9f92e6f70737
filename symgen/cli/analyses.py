"""``symgen run`` and the analyses that models of several methods support, named as in Python."""

from __future__ import annotations

from typing import Annotated

import typer

from symgen.cli import options as o
from symgen.cli.carrying import Request
from symgen.cli.common import command, print_json
from symgen.errors import ModelError


@command("symgen run four_bar --t-end 2 --plot run.png")
def run(
    ctx: typer.Context,
    scene: o.Scene,
    t_end: o.TEnd = None,
    at: o.At = None,
    samples: o.Samples = None,
    set_: o.Set = None,
    out: o.Out = None,
    plot: o.Plot = None,
    plot_of: o.PlotOf = None,
    xy: o.XY = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
    precision: o.Precision = "float64",
    digits: o.Digits = None,
    contraction: o.Contraction = "off",
    vector: o.Vector = "none",
) -> None:
    """Run the analysis that suits the scene.

    A mechanism under forces is simulated, elastic links over one revolution. A driven loop is evaluated
    over its input, with all forces. The other commands select the analysis and have all of its options.
    """
    request = Request(ctx)
    supported = request.model.capabilities
    verb = next((v for v in ("simulate", "inverse_dynamics", "kinematics") if v in supported), "simulate")
    if verb == "kinematics" and request.types:
        raise ModelError(f"{request.shown(request.types)}: kinematics is computed in double precision")
    if verb == "simulate" or "t_end" not in request.options:
        request.carry_out(verb)
        return
    if at:
        raise ModelError("give --at or --t-end, not both")
    request.carry_out(verb, stop=request.options.pop("t_end"), over="time")


@command("symgen simulate peaucellier --t-end 1 --rtol 1e-12")
def simulate(
    ctx: typer.Context,
    scene: o.Scene,
    t_end: o.TEnd = None,
    method: o.Method = None,
    rtol: o.Rtol = None,
    atol: o.Atol = None,
    step: o.Step = None,
    samples: o.Samples = None,
    stabilisation: o.Stabilisation = None,
    stabilisation_rate: o.StabilisationRate = None,
    max_drift: o.MaxDrift = None,
    revolutions: o.Revolutions = None,
    steps: o.Steps = None,
    at: o.AtAngles = None,
    form: o.Form = None,
    geometric_stiffness: o.GeometricStiffness = None,
    max_step: o.MaxStep = None,
    max_wall: o.MaxWall = None,
    checkpoint: o.Checkpoint = None,
    checkpoint_every: o.CheckpointEvery = None,
    resume: o.Resume = None,
    set_: o.Set = None,
    out: o.Out = None,
    plot: o.Plot = None,
    plot_of: o.PlotOf = None,
    xy: o.XY = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
    precision: o.Precision = "float64",
    digits: o.Digits = None,
    contraction: o.Contraction = "off",
    vector: o.Vector = "none",
) -> None:
    """Simulate the motion in time."""
    Request(ctx).carry_out("simulate")


@command("symgen kinematics crank_rocker --of rocker --plot rocker.svg")
def kinematics(
    ctx: typer.Context,
    scene: o.Scene,
    start: o.From = None,
    stop: o.To = None,
    at: o.At = None,
    samples: o.Samples = None,
    of: Annotated[
        list[str] | None,
        o.option(
            "--of",
            metavar="NAME",
            help="A point, link or corner A.B.C to record; default: all that move.",
        ),
    ] = None,
    state: o.Branch = None,
    through: o.Through = False,
    set_: o.Set = None,
    out: o.Out = None,
    plot: o.Plot = None,
    xy: o.XY = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
) -> None:
    """Compute the kinematics of a driven mechanism.

    Positions, velocities and accelerations are printed, and dead centres in the range. Links need no masses.
    """
    from symgen.pipeline.build import build_kinematics

    Request(ctx, build_kinematics).carry_out("kinematics")


@command("symgen inverse-dynamics crank_rocker --at 0,60")
def inverse_dynamics(
    ctx: typer.Context,
    scene: o.Scene,
    start: o.From = None,
    stop: o.To = None,
    at: o.At = None,
    samples: o.Samples = None,
    elements: Annotated[
        int | None,
        o.option("--elements", metavar="N", help="Finite elements per link of a linkage (1)."),
    ] = None,
    sections: Annotated[
        list[float] | None,
        o.option(
            "--section",
            metavar="PART",
            help="Position of a section along the links of a linkage, 0 to 1 (0.5).",
        ),
    ] = None,
    state: o.Branch = None,
    through: o.Through = False,
    set_: o.Set = None,
    out: o.Out = None,
    plot: o.Plot = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
) -> None:
    """Compute joint forces and drive efforts of a driven motion.

    Elastic links are treated as rigid.
    """
    Request(ctx).carry_out("inverse_dynamics")


@command('symgen equilibrium four_bar --set links.crank.mass="2 kg"')
def equilibrium(
    ctx: typer.Context,
    scene: o.Scene,
    t: Annotated[
        float | None,
        o.option("--t", metavar="SECONDS", help="Time at which loads and drives are held [s] (0)."),
    ] = None,
    stable: Annotated[
        bool,
        o.option("--stable/--any", help="Descend to a stable equilibrium, or take one of any kind nearby."),
    ] = True,
    segments: o.Segments = None,
    set_: o.Set = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
) -> None:
    """Find a static equilibrium, its reactions and stability."""
    Request(ctx).carry_out("equilibrium")


@command("symgen modes elastic_four_bar --at 0,60")
def modes(
    ctx: typer.Context,
    scene: o.Scene,
    at: Annotated[
        list[str] | None,
        o.option(
            "--at",
            metavar="ANGLE,...",
            group="Elastic links",
            help='Crank angles: "0,60" (bare: degrees), "0.5 rad"; default: start.',
        ),
    ] = None,
    moving: Annotated[
        bool,
        o.option("--moving", group="Elastic links", help="At the speed of the crank instead of at rest."),
    ] = False,
    set_: o.Set = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
) -> None:
    """Find frequencies and shapes of small vibrations.

    They refer to the static equilibrium, or to poses of elastic links.
    """
    request = Request(ctx)
    arguments = request.arguments("modes")
    poses = [{"at": angle} for angle in arguments.pop("at", [])] or [{}]
    found = [request.result("modes", **arguments, **pose) for pose in poses]
    if as_json and len(found) > 1:
        print_json({"scene": request.model.name, "poses": [analysis.summary() for analysis in found]})
    elif as_json:
        request.show("modes", found[0], as_json)
    else:
        request.show("modes", found, as_json)


@command("symgen linearise four_bar --coordinate crank.angle --at equilibrium")
def linearise(
    ctx: typer.Context,
    scene: o.Scene,
    at: Annotated[
        str | None,
        o.option("--at", metavar="STATE", help="start (default) or equilibrium."),
    ] = None,
    inputs: Annotated[
        list[str] | None,
        o.option("--input", metavar="NAME", help="An input of the scene; default: all."),
    ] = None,
    outputs: Annotated[
        list[str] | None,
        o.option("--output", metavar="NAME", help="An output, such as A.position.x; default: coordinates."),
    ] = None,
    coordinates: Annotated[
        list[str] | None,
        o.option(
            "--coordinate",
            metavar="NAME",
            help="An independent coordinate, such as crank.angle; default: positions of all moving points.",
        ),
    ] = None,
    set_: o.Set = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
) -> None:
    """Compute the state-space matrices A, B, C, D.

    They are exact derivatives of the equations of motion at a state.
    """
    request = Request(ctx)
    about = request.options.pop("at", "start")
    if about not in ("start", "equilibrium"):
        raise ModelError(f"expected start or equilibrium after --at, got {about!r}")
    arguments = request.arguments("linearise")
    if about == "equilibrium":
        arguments["at"] = request.result("equilibrium")
    request.show("linearise", request.result("linearise", **arguments), as_json)


@command("symgen sensitivity peaucellier --at equilibrium --output O.reaction")
def sensitivity(
    ctx: typer.Context,
    scene: o.Scene,
    outputs: Annotated[
        list[str],
        o.option(
            "--output", metavar="NAME", help="Output, such as A.position.x, or frequencies. May be repeated."
        ),
    ],
    parameters: Annotated[
        list[str] | None,
        o.option("--parameter", metavar="NAME", help="Tunable parameter; default: all. May be repeated."),
    ] = None,
    at: Annotated[
        str | None,
        o.option(
            "--at",
            metavar="STATE",
            help='start (default), equilibrium, or a time of a driven linkage, "0.3 s".',
        ),
    ] = None,
    coordinates: Annotated[
        list[str] | None,
        o.option("--coordinate", metavar="NAME", help="Independent coordinate to hold, such as crank.angle."),
    ] = None,
    set_: o.Set = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
) -> None:
    """Compute exact derivatives of outputs with respect to tunable parameters.

    An equilibrium stays one as a parameter varies. At another state, drives and coordinates are held.
    """
    from symgen.inspection.values import of_time

    request = Request(ctx)
    about = request.options.pop("at", "start")
    arguments = request.arguments("sensitivity")
    if about == "equilibrium":
        arguments["at"] = request.result("equilibrium")
    elif about != "start":
        arguments["at"] = of_time(about, "--at", "start, equilibrium")
    request.show("sensitivity", request.result("sensitivity", **arguments), as_json)


@command("symgen assemblies crank_rocker --at 60")
def assemblies(
    ctx: typer.Context,
    scene: o.Scene,
    at: Annotated[
        str | None,
        o.option(
            "--at",
            metavar="VALUE",
            help='Value of the input, "60" (degrees, or a loop\'s unit of length), or a time, "0.3 s"; '
            "default: the start.",
        ),
    ] = None,
    set_: o.Set = None,
    as_json: o.Json = False,
    backend: o.Backend = "auto",
) -> None:
    """List the assembly modes of a mechanism, the drawn one first."""
    from symgen.pipeline.build import build_kinematics

    request = Request(ctx, build_kinematics)
    found = request.result("assemblies", **request.arguments("assemblies"))
    if as_json:
        poses = [getattr(pose, "positions", pose) for pose in found]
        plain = [{k: v if isinstance(v, float) else v.tolist() for k, v in pose.items()} for pose in poses]
        print_json({"scene": request.model.name, "analysis": "assemblies", "assemblies": plain})
    else:
        request.show("assemblies", found, as_json)
