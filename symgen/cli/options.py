"""Arguments and options of the commands, each declared once, in the groups of their help."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

#: Groups of options in the help of a command, besides its own.
_SCENE, _OUTPUT, _COMPILATION = "Scene", "Output", "Compilation"
_LIMITS, _CONSTRAINTS, _ELASTIC = "Limits and checkpoints", "Constraints", "Elastic links"


def option(*names: str, help: str, group: str | None = "Run", **more: Any) -> Any:
    """Return an option of a command; brackets in its help are text and no markup."""
    return typer.Option(*names, help=help.replace("[", r"\["), rich_help_panel=group, **more)


def _scenes(incomplete: str) -> list[str]:
    """Return the shipped scenes whose names begin with a text, for the shell's completion."""
    from symgen.scene.loading import shipped_scenes

    return [name for name in shipped_scenes() if name.startswith(incomplete)]


def _result_file(file: Path | None) -> Path | None:
    """Check that a result can be written to the file before a command runs; raise ResultError if not."""
    if file:
        from symgen.atomic import writable
        from symgen.runtime.result.result import SAVED_AS

        writable(file, SAVED_AS, "result")
    return file


def _plot_file(file: Path | None) -> Path | None:
    """Check that a plot can be written to the file before a command runs."""
    if file:
        from symgen.atomic import writable
        from symgen.report.page.plots import DRAWN_AS

        writable(file, DRAWN_AS, "plot")
    return file


Scene = Annotated[
    str, typer.Argument(help="Name of a shipped scene, or path of a TOML file.", autocompletion=_scenes)
]
Source = Annotated[
    str,
    typer.Argument(help="A scene, or a Python file with a function system().", autocompletion=_scenes),
]
Set = Annotated[
    list[str] | None,
    option(
        "--set",
        metavar="KEY=VALUE",
        group=_SCENE,
        help='Set a parameter, or a key by its path: rho="2 kg/m", links.OA.mass="1 kg". May be repeated.',
    ),
]
Out = Annotated[
    Path | None,
    option(
        "--out",
        metavar="FILE",
        group=_OUTPUT,
        callback=_result_file,
        help="Save the result: .nc, .npz or .csv.",
    ),
]
Plot = Annotated[
    Path | None,
    option(
        "--plot", metavar="FILE", group=_OUTPUT, callback=_plot_file, help="Save a plot: .png, .svg or .pdf."
    ),
]
PlotOf = Annotated[
    list[str] | None,
    option(
        "--of",
        metavar="NAME",
        group=_OUTPUT,
        help="An output, point or link in the plot; default: all outputs. May be repeated.",
    ),
]
XY = Annotated[
    str | None,
    option(
        "--xy",
        metavar="NAME",
        group=_OUTPUT,
        help="A point whose path is plotted, y over x with equal axes, such as a coupler curve.",
    ),
]
Json = Annotated[bool, option("--json", group=_OUTPUT, help="Print one JSON object and nothing else.")]
Difference = Annotated[
    str, option("--format", metavar="FORMAT", group=_OUTPUT, help="Matrix entries as text, or latex.")
]
Backend = Annotated[
    str, option("--backend", metavar="NAME", group=_COMPILATION, help="auto, c, numpy or mpmath.")
]
Precision = Annotated[
    str,
    option(
        "--precision", metavar="TYPE", group=_COMPILATION, help="float32, float64, longdouble or float128."
    ),
]
Digits = Annotated[
    int | None,
    option("--digits", metavar="N", group=_COMPILATION, help="Digits of the mpmath backend (40)."),
]
Contraction = Annotated[
    str,
    option("--contraction", metavar="MODE", group=_COMPILATION, help="off, or fast: fused multiply-add."),
]
Vector = Annotated[
    str,
    option(
        "--vector",
        metavar="SET",
        group=_COMPILATION,
        help="none (portable), or native: instructions of this processor.",
    ),
]

TEnd = Annotated[
    float | None, option("--t-end", metavar="SECONDS", help="End of the run [s]; default: the scene's.")
]
Samples = Annotated[
    int | None, option("--samples", metavar="N", help="Number of equally spaced samples recorded.")
]
At = Annotated[
    list[str] | None,
    option(
        "--at",
        metavar="VALUE,...",
        help='Values to evaluate instead of a range: of the input, "45,100" (bare: degrees, or a loop\'s '
        'unit of length), "0.5 rad", or of the time, "0.3 s".',
    ),
]
AtAngles = Annotated[
    list[str] | None,
    option(
        "--at",
        metavar="ANGLE,...",
        help='Crank angles to record: "0,60" (bare numbers are degrees), "0.5 rad".',
    ),
]
From = Annotated[
    str | None,
    option(
        "--from",
        metavar="VALUE",
        help="Start of the range; bare numbers are seconds, or the input of a loop in its unit.",
    ),
]
To = Annotated[str | None, option("--to", metavar="VALUE", help="End of the range; default: the scene's.")]
Branch = Annotated[
    int | None,
    option("--branch", metavar="N", help="Assembly mode of a linkage at the start; 1 is the drawn one."),
]
Through = Annotated[bool, option("--through", help="Continue past turning points of the input.")]
Rtol = Annotated[
    float | None,
    option(
        "--rtol",
        metavar="X",
        help="Relative tolerance of the local error; elastic links: error over the peak stress.",
    ),
]
Steps = Annotated[
    int | None,
    option(
        "--steps",
        metavar="N",
        group=_ELASTIC,
        help="Steps per revolution; default: doubled until --rtol is met.",
    ),
]
Revolutions = Annotated[
    float | None,
    option("--revolutions", metavar="N", group=_ELASTIC, help="Number of revolutions of the crank (1)."),
]
Segments = Annotated[
    int | None,
    option("--segments", metavar="N", group=_ELASTIC, help="Number of rods per elastic link (12)."),
]
Form = Annotated[
    str | None,
    option(
        "--form",
        metavar="FORM",
        group=_ELASTIC,
        help="exact, or thesis: constant transformations, for comparison only.",
    ),
]
GeometricStiffness = Annotated[
    bool | None,
    option(
        "--no-geometric-stiffness",
        callback=lambda omitted: False if omitted else None,
        group=_ELASTIC,
        help="Omit the stiffness of axial forces.",
    ),
]
Method = Annotated[
    str | None,
    option(
        "--method",
        metavar="NAME",
        help="Integrator. Adaptive: dop853, dopri5, radau5 (stiff). Fixed step: rk4, rattle, rattle4, "
        "rattle6, rattle8, generalized-alpha, newmark. Elastic links: gauss, gauss4, newmark, "
        "generalized-alpha, wilson-theta, dop853, rk4.",
    ),
]
Atol = Annotated[
    float | None, option("--atol", metavar="X", help="Absolute tolerance of the local error [m, m/s].")
]
Step = Annotated[float | None, option("--step", metavar="SECONDS", help="Fixed step [s].")]
Stabilisation = Annotated[
    str | None,
    option(
        "--stabilisation",
        metavar="NAME",
        group=_CONSTRAINTS,
        help="projection; for comparison only: baumgarte (linkages), raw.",
    ),
]
StabilisationRate = Annotated[
    float | None,
    option(
        "--stabilisation-rate",
        metavar="X",
        group=_CONSTRAINTS,
        help="Rate of Baumgarte stabilisation [1/s] (10).",
    ),
]
MaxDrift = Annotated[
    float | None,
    option(
        "--max-drift",
        metavar="METRES",
        group=_CONSTRAINTS,
        help="End the run at this constraint or closure error [m]; default: never.",
    ),
]
MaxStep = Annotated[
    float | None,
    option(
        "--max-step",
        metavar="SECONDS",
        group=_LIMITS,
        help="Largest step [s] of an adaptive method, so that short loads are not stepped over.",
    ),
]
MaxWall = Annotated[
    float | None,
    option(
        "--max-wall",
        metavar="SECONDS",
        group=_LIMITS,
        help="End the run, with the samples recorded so far, after this wall time [s]; default: never.",
    ),
]
Checkpoint = Annotated[
    Path | None,
    option("--checkpoint", metavar="FILE", group=_LIMITS, help="File for periodic checkpoints of the run."),
]
CheckpointEvery = Annotated[
    float | None,
    option(
        "--checkpoint-every",
        metavar="SECONDS",
        group=_LIMITS,
        help="Wall time [s] between checkpoints (10).",
    ),
]
Resume = Annotated[
    Path | None,
    option(
        "--resume",
        metavar="FILE",
        group=_LIMITS,
        help="Continue from a checkpoint of the same run, with the same bits.",
    ),
]

#: Options of analyses by the argument that each sets, and the defaults of those that have one.
OF_ANALYSES: dict[str, Any] = {
    "scene": Scene, "t_end": TEnd, "method": Method, "rtol": Rtol, "atol": Atol, "step": Step, "steps": Steps,
    "revolutions": Revolutions, "start": From, "stop": To, "at": At, "samples": Samples, "state": Branch,
    "through": Through, "segments": Segments, "form": Form, "geometric_stiffness": GeometricStiffness,
    "stabilisation": Stabilisation, "stabilisation_rate": StabilisationRate, "max_drift": MaxDrift,
    "max_step": MaxStep, "max_wall": MaxWall, "checkpoint": Checkpoint, "checkpoint_every": CheckpointEvery,
    "resume": Resume, "set_": Set, "out": Out, "plot": Plot, "plot_of": PlotOf, "xy": XY, "as_json": Json,
    "backend": Backend, "precision": Precision, "digits": Digits, "contraction": Contraction,
    "vector": Vector,
}  # fmt: skip
DEFAULTS = {
    "through": False, "stable": True, "moving": False, "as_json": False, "backend": "auto",
    "precision": "float64", "contraction": "off", "vector": "none",
}  # fmt: skip
