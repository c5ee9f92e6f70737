"""``symgen run`` and the analyses of models, named as in Python."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from symgen.cli import options as o
from symgen.cli.common import print_json
from symgen.cli.request import CommandRequest, analysis
from symgen.errors import ModelError

_SHOWN = "set_ out plot plot_of xy plot_over compare film as_json"


@analysis(
    "symgen run four_bar --t-end 2 --plot run.png",
    f"t_end at samples of means {_SHOWN} {o.COMPILED}",
)
def run(ctx: typer.Context) -> None:
    """Run the default analysis of a scene.

    A mechanism under forces is simulated, elastic links over one revolution. A driven loop is evaluated
    over its input, with all forces. The other commands select the analysis and have all of its options.
    """
    request = CommandRequest(ctx)
    verbs = "simulate", "inverse_dynamics", "kinematics"
    verb = next((v for v in verbs if hasattr(request.model, v)), "simulate")
    if verb == "kinematics" and request.types:
        raise ModelError(f"{request.shown(request.types)}: kinematics is computed in double precision")
    if verb == "simulate" or "t_end" not in request.options:
        request.carry_out(verb)
        return
    if "at" in request.options:
        raise ModelError("give --at or --t-end, not both")
    request.carry_out(verb, stop=request.options.pop("t_end"), over="time")


@analysis(
    "symgen simulate peaucellier --t-end 1 --rtol 1e-12",
    "t_end method rtol atol step samples of means stabilisation stabilisation_rate max_drift revolutions "
    "steps at form geometric_stiffness initial max_step max_wall checkpoint checkpoint_every resume "
    f"{_SHOWN} {o.COMPILED}",
    at=o.AtAngles,
)
def simulate(ctx: typer.Context) -> None:
    """Simulate the motion in time."""
    CommandRequest(ctx).carry_out("simulate")


@analysis(
    "symgen kinematics crank_rocker --of rocker --plot rocker.svg",
    "start stop at samples of means state through "
    "set_ out plot plot_of xy plot_over compare film as_json backend",
    of=o.outputs_of("Points, links or corners A.B.C, or outputs of them, to record; default: all that move."),
)
def kinematics(ctx: typer.Context) -> None:
    """Compute the kinematics of a driven mechanism.

    Positions, velocities and accelerations are printed, and dead centres in the range. Links need no masses.
    """
    from symgen.pipeline.build import build_kinematics

    CommandRequest(ctx, build_kinematics).carry_out("kinematics")


@analysis(
    "symgen inverse-dynamics crank_rocker --at 0,60",
    "start stop at samples of means elements sections state through "
    "set_ out plot plot_of plot_over compare film as_json backend",
    elements=o.maybe(int, "--elements", "N", "Finite elements per link of a linkage (1)."),
    sections=o.maybe(
        list[float], "--sections", "PART", "Position of a section along the links of a linkage, 0 to 1 (0.5)."
    ),
)
def inverse_dynamics(ctx: typer.Context) -> None:
    """Compute joint forces and drive efforts of a driven motion.

    Elastic links are treated as rigid.
    """
    CommandRequest(ctx).carry_out("inverse_dynamics")


@analysis(
    'symgen equilibrium four_bar --set links.crank.mass="2 kg"',
    "at of stable elements set_ as_json backend",
    at=o.maybe(str, "--at", "TIME", 'Time at which loads and drives are held, "0.3 s"; default: 0.'),
)
def equilibrium(ctx: typer.Context) -> None:
    """Find a static equilibrium, its reactions and stability."""
    request = CommandRequest(ctx)
    at = request.options.pop("at", None)
    request.carry_out("equilibrium", **({} if at is None else {"at": _time(at, "a time")}))


@analysis(
    "symgen modes elastic_four_bar --at 0,60",
    "stable at moving set_ as_json backend",
    at=o.maybe(
        list[str],
        "--at",
        "ANGLE,...",
        'Crank angles: "0,60" (bare: degrees), "0:90:4" (from, to, count), "0.5 rad"; '
        'in space times, "0.1 s"; default: start.',
        "Elastic links",
    ),
    moving=Annotated[
        bool,
        o.option("--moving", group="Elastic links", help="At the speed of the crank instead of at rest."),
    ],
)
def modes(ctx: typer.Context) -> None:
    """Find frequencies and shapes of small vibrations.

    Linkages vibrate about the static equilibrium, elastic links about poses of the crank.
    """
    request = CommandRequest(ctx)
    anywhere = not request.options.pop("stable", True)
    arguments = request.arguments("modes")
    poses = [{"at": angle} for angle in arguments.pop("at", [])]
    if poses and anywhere:
        raise ModelError("--any is for the equilibrium of a linkage, not for poses of the crank after --at")
    poses = poses or [{"at": request.result("equilibrium", stable=False)} if anywhere else {}]
    results = [request.result("modes", **arguments, **pose) for pose in poses]
    if request.as_json and len(results) > 1:
        print_json({"scene": request.model.name, "poses": [one.summary() for one in results]})
    elif request.as_json:
        request.show("modes", results[0])
    else:
        request.show("modes", results)


@analysis(
    "symgen linearise four_bar --coordinates crank.angle --at equilibrium",
    "at stable inputs outputs coordinates set_ as_json backend",
    at=o.maybe(str, "--at", "STATE", 'start (default), equilibrium, or a time of the run, "0.3 s".'),
    inputs=o.names("--inputs", "Inputs of the scene; default: all."),
    outputs=o.outputs_of("Outputs, such as A.position.x; default: coordinates."),
    coordinates=o.names(
        "--coordinates",
        "Independent coordinates, such as crank.angle; default: positions of all moving points.",
    ),
)
def linearise(ctx: typer.Context) -> None:
    """Compute the state-space matrices A, B, C, D.

    They are exact derivatives of the equations of motion at a state.
    """
    request = CommandRequest(ctx)
    about = _state(request)
    request.show("linearise", request.result("linearise", **request.arguments("linearise"), **about))


@analysis(
    "symgen sensitivity peaucellier --at equilibrium --of O.reaction",
    "outputs parameters at stable coordinates t_end t_eval integrals method rtol atol step max_step "
    "set_ as_json backend",
    required="scene outputs",
    outputs=o.outputs_of("Outputs, such as A.position.x, or frequencies.", list[str]),
    parameters=o.names("--parameters", "Tunable parameters; default: all."),
    at=o.maybe(str, "--at", "STATE", 'start (default), equilibrium, or a time of a driven linkage, "0.3 s".'),
    coordinates=o.names("--coordinates", "Independent coordinates to hold, such as crank.angle."),
    t_end=o.maybe(float, "--t-end", "SECONDS", "Derivatives at this time [s] of the run from that state."),
    t_eval=o.maybe(
        list[str], "--t-eval", "TIME,...", 'Or at these times: "0.1,0.2" [s], "0.1:0.5:5" (from, to, count).'
    ),
    integrals=o.names("--integrals", "Outputs to integrate over the time of the run."),
)
def sensitivity(ctx: typer.Context) -> None:
    """Compute exact derivatives of outputs with respect to tunable parameters.

    An equilibrium moves with the parameters. At any other state, drives and coordinates are held constant,
    along a run at its start.
    """
    request = CommandRequest(ctx)
    about = _state(request)
    arguments = request.arguments("sensitivity")
    if "t_eval" in arguments:
        from symgen.inspection.values import of_times

        arguments["t_eval"] = of_times(arguments["t_eval"], "--t-eval")
    request.show("sensitivity", request.result("sensitivity", **arguments, **about))


def _state(request: CommandRequest) -> dict[str, Any]:
    """Return the argument ``at`` for a state on the command line: start, equilibrium or a time."""
    about, stable = request.options.pop("at", "start"), request.options.pop("stable", True)
    if about == "equilibrium":
        return {"at": request.result("equilibrium", stable=stable)}
    if not stable:
        raise ModelError(f"--any is for --at equilibrium, got --at {about}")
    if about == "start":
        return {}
    return {"at": _time(about, "start, equilibrium or a time")}


def _time(text: str, expected: str) -> float:
    """Return a time [s] after --at."""
    from symgen.inspection.values import of_times

    times = of_times([text], "--at", expected)
    if len(times) > 1:
        raise ModelError(f"expected one time after --at, got {text!r}")
    return times[0]


@analysis(
    "symgen assemblies crank_rocker --at 60",
    "at set_ as_json backend",
    at=o.maybe(
        str,
        "--at",
        "VALUE",
        'Value of the input, "60" (degrees, or a loop\'s unit of length), or a time, "0.3 s"; '
        "default: the start.",
    ),
)
def assemblies(ctx: typer.Context) -> None:
    """List the assembly modes of a mechanism, the drawn one first."""
    from symgen.pipeline.build import build_kinematics

    request = CommandRequest(ctx, build_kinematics)
    modes = request.result("assemblies", **request.arguments("assemblies"))
    if request.as_json:
        poses = [getattr(pose, "positions", pose) for pose in modes]
        plain = [{k: v if isinstance(v, float) else v.tolist() for k, v in pose.items()} for pose in poses]
        status = {"complete": modes.complete, "incomplete": modes.incomplete}
        print_json({"scene": request.model.name, "analysis": "assemblies", "assemblies": plain, **status})
    else:
        request.show("assemblies", modes)


@analysis(
    "symgen periodic elastic_four_bar",
    f"steps rtol samples of at form geometric_stiffness max_step max_wall {_SHOWN} {o.COMPILED}",
    at=o.AtAngles,
)
def periodic(ctx: typer.Context) -> None:
    """Find the steady state of elastic links and its stability."""
    CommandRequest(ctx).carry_out("periodic")


@analysis(
    "symgen quasi-static elastic_four_bar --at 0,60",
    f"revolutions samples of at form geometric_stiffness max_wall {_SHOWN} {o.COMPILED}",
    at=o.AtAngles,
)
def quasi_static(ctx: typer.Context) -> None:
    """Compute the static deformation of elastic links under the rigid motion."""
    CommandRequest(ctx).carry_out("quasi_static")


@analysis(
    "symgen large-rotation elastic_four_bar --elements 8",
    "elements t_end revolutions rtol samples of max_step max_wall checkpoint checkpoint_every resume "
    f"{_SHOWN} backend",
)
def large_rotation(ctx: typer.Context) -> None:
    """Simulate elastic links in large rotation, as beam elements.

    This is the reference solution for linear theory, on which the other analyses are based.
    """
    CommandRequest(ctx).carry_out("large_rotation")


@analysis(
    "symgen speed-response elastic_four_bar --speeds 60:400:18",
    "speeds rtol samples max_wall set_ out plot as_json backend",
    required="scene speeds",
    speeds=Annotated[
        str,
        o.option(
            "--speeds",
            metavar="FROM:TO:COUNT",
            help='Crank speeds in rpm: "20:400:39", or a list such as "60,95,120".',
        ),
    ],
)
def speed_response(ctx: typer.Context) -> None:
    """Find steady states of elastic links over the crank speed.

    Peak values, critical speeds and stability are printed.
    """
    from symgen.inspection.values import crank_speeds

    speeds = crank_speeds(ctx.params["speeds"])
    request = CommandRequest(ctx)
    request.options["speeds"] = speeds
    request.carry_out("speed_response")
