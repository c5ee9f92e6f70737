"""Arguments and options of the commands, each declared once, in the groups of their help."""

from __future__ import annotations

from collections.abc import Callable
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
    from symgen.scene.loading import machines, shipped_scenes

    return [name for name in shipped_scenes() + machines() if name.startswith(incomplete)]


def _writable(noun: str, endings: str | tuple[str, ...]) -> Callable[[Path | None], Path | None]:
    """Return a check that a file can be written, made before a command runs; it raises ResultError if not.

    ``endings`` are those of its name, or ``module:NAME`` of symgen, which is imported if the option is given.
    """

    def check(file: Path | None) -> Path | None:
        if file:
            from symgen.atomic import writable
            from symgen.registry import load

            writable(file, load(f"symgen.{endings}") if isinstance(endings, str) else endings, noun)
        return file

    return check


def _film_file(file: Path | None) -> Path | None:
    """Check that an animation can be written to the file before a command runs."""
    if file:
        from symgen.report.page.movie import film_file

        film_file(file)
    return file


Scene = Annotated[
    str, typer.Argument(help="Name of a shipped scene, or path of a TOML file.", autocompletion=_scenes)
]
Source = Annotated[
    str,
    typer.Argument(help="A scene, or a Python file with a function system().", autocompletion=_scenes),
]
Inspected = Annotated[
    str,
    typer.Argument(
        help="A scene, a Python file with a function system(), or a building block.", autocompletion=_scenes
    ),
]
Set = Annotated[
    list[str] | None,
    option(
        "--set",
        metavar="KEY=VALUE",
        group=_SCENE,
        help='Set a parameter, or a key by its path: rho="2 kg/m", links.OA.mass="1 kg"; KEY=none '
        "removes a key or a table. May be repeated.",
    ),
]
Plot = Annotated[
    Path | None,
    option(
        "--plot",
        metavar="FILE",
        group=_OUTPUT,
        callback=_writable("plot", "report.page.plots:DRAWN_AS"),
        help="Save a plot: .png, .svg or .pdf.",
    ),
]
Page = Annotated[
    Path | None,
    option(
        "--page",
        metavar="FILE",
        group=_OUTPUT,
        callback=_writable("page", (".html",)),
        help="Write an HTML page with the results.",
    ),
]
JsonFile = Annotated[
    Path | None,
    option(
        "--out",
        metavar="FILE",
        group=_OUTPUT,
        callback=_writable("report", (".json",)),
        help="Save the results: .json.",
    ),
]
Json = Annotated[bool, option("--json", group=_OUTPUT, help="Print one JSON object and nothing else.")]
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


def separated(texts: list[str] | None) -> list[str] | None:
    """Return the names of a list that is repeated, or separated by commas."""
    return [name.strip() for text in texts for name in text.split(",")] if texts else None


def names(option_name: str, help: str, kind: Any = list[str] | None, group: str = "Run") -> Any:
    """Return the annotation of an option that lists names."""
    return Annotated[
        kind, option(option_name, metavar="NAME,...", group=group, callback=separated, help=help)
    ]


def outputs_of(help: str, kind: Any = list[str] | None) -> Any:
    """Return the annotation of ``--of``, which selects outputs; ``--outputs`` has the same meaning."""
    return Annotated[kind, option("--of", "--outputs", metavar="NAME,...", callback=separated, help=help)]


def maybe(kind: Any, name: str, metavar: str, help: str, group: str = "Run", **more: Any) -> Any:
    """Return the annotation of an option that may be absent."""
    return Annotated[kind | None, option(name, metavar=metavar, help=help, group=group, **more)]


AtAngles = maybe(
    list[str],
    "--at",
    "ANGLE,...",
    'Crank angles to record: "0,60" (bare: degrees), "0:90:4" (from, to, count), "0.5 rad".',
)
#: Options of analyses by the argument that each sets, and the defaults of those that have one.
OF_ANALYSES: dict[str, Any] = {
    "scene": Scene,
    "t_end": TEnd,
    "method": maybe(
        str,
        "--method",
        "NAME",
        "Integrator. Adaptive: dop853, taylor (for --rtol of at most 1e-9), dopri5, radau5 (stiff). "
        "Fixed step: rk4, rattle, rattle4, rattle6, rattle8, generalized-alpha, newmark. Elastic links: "
        "gauss, gauss4, newmark, generalized-alpha, wilson-theta, bdf2 to bdf5, dop853, rk4.",
    ),
    "rtol": maybe(
        float,
        "--rtol",
        "X",
        "Relative tolerance of the local error; elastic links: error over the peak stress.",
    ),
    "atol": maybe(float, "--atol", "X", "Absolute tolerance of the local error [m, m/s]."),
    "step": maybe(float, "--step", "SECONDS", "Fixed step [s] without error control, by default of dop853."),
    "steps": maybe(
        int, "--steps", "N", "Steps per revolution; default: doubled until --rtol is met.", _ELASTIC
    ),
    "revolutions": maybe(float, "--revolutions", "N", "Number of revolutions of the crank (1).", _ELASTIC),
    "start": maybe(
        str,
        "--from",
        "VALUE",
        "Start of the range; numbers without a unit are seconds, or the input of a loop in its unit.",
    ),
    "stop": maybe(str, "--to", "VALUE", "End of the range; default: the scene's."),
    "at": maybe(
        list[str],
        "--at",
        "VALUE,...",
        'Values to evaluate instead of a range: of the input, "45,100" (bare: degrees, or a loop\'s '
        'unit of length), "0:90:4" (from, to, count), "0.5 rad", or of the time, "0.3 s". An angle that a '
        "linkage passes more than once is that of its first passage.",
    ),
    "samples": Samples,
    "of": outputs_of("Outputs to record and print, such as B.position; default: those of the scene."),
    "means": Annotated[
        bool,
        option(
            "--means/--no-means",
            help="Print mean and RMS over time, and work, for which the analysis is repeated.",
        ),
    ],
    "state": maybe(int, "--state", "N", "Assembly mode of a linkage at the start; 1 is the drawn one."),
    "through": Annotated[bool, option("--through", help="Continue past turning points of the input.")],
    "elements": maybe(int, "--elements", "N", "Number of elements per elastic link.", _ELASTIC),
    "form": maybe(
        str, "--form", "FORM", "exact, or thesis: constant transformations, for comparison only.", _ELASTIC
    ),
    "initial": maybe(
        str, "--initial", "STATE", "undeformed, or quasi-static: bent by the loads at the start.", _ELASTIC
    ),
    "geometric_stiffness": Annotated[
        bool | None,
        option(
            "--no-geometric-stiffness",
            callback=lambda omitted: False if omitted else None,
            group=_ELASTIC,
            help="Omit the stiffness of axial forces.",
        ),
    ],
    "stabilisation": maybe(
        str,
        "--stabilisation",
        "NAME",
        "projection; for comparison only: baumgarte (linkages), raw.",
        _CONSTRAINTS,
    ),
    "stabilisation_rate": maybe(
        float, "--stabilisation-rate", "X", "Rate of Baumgarte stabilisation [1/s] (10).", _CONSTRAINTS
    ),
    "max_drift": maybe(
        float,
        "--max-drift",
        "METRES",
        "End the run at this constraint or closure error [m]; default: never.",
        _CONSTRAINTS,
    ),
    "max_step": maybe(
        float,
        "--max-step",
        "SECONDS",
        "Largest step [s] of an adaptive method, shorter than the shortest load.",
        _LIMITS,
    ),
    "max_wall": maybe(
        float,
        "--max-wall",
        "SECONDS",
        "End the run, with the samples recorded so far, after this wall time [s]; default: never.",
        _LIMITS,
    ),
    "checkpoint": maybe(Path, "--checkpoint", "FILE", "File for periodic checkpoints of the run.", _LIMITS),
    "checkpoint_every": maybe(
        float, "--checkpoint-every", "SECONDS", "Wall time [s] between checkpoints (10).", _LIMITS
    ),
    "resume": maybe(
        Path, "--resume", "FILE", "Continue from a checkpoint of the same run, with the same bits.", _LIMITS
    ),
    "stable": Annotated[
        bool,
        option("--stable/--any", help="Find a stable equilibrium, or a nearby one of any kind."),
    ],
    "set_": Set,
    "out": maybe(
        Path,
        "--out",
        "FILE",
        "Save the result: .nc, .npz or .csv.",
        _OUTPUT,
        callback=_writable("result", "runtime.result.result:SAVED_AS"),
    ),
    "plot": Plot,
    "plot_of": names(
        "--plot-of", "Outputs, points or links in the plot; default: six quantities.", group=_OUTPUT
    ),
    "xy": maybe(
        str,
        "--xy",
        "NAME",
        "A point whose path is plotted, y over x with equal axes, such as a coupler curve.",
        _OUTPUT,
    ),
    "plot_over": maybe(
        str,
        "--over",
        "NAME",
        "Output on the horizontal axis of the plot; default: the time, or the input.",
        _OUTPUT,
    ),
    "compare": maybe(
        list[Path],
        "--compare",
        "FILE",
        "A saved result to overlay in the plot, labelled by the name of its file. May be repeated.",
        _OUTPUT,
    ),
    "film": maybe(
        Path, "--animate", "FILE", "Save an animation: .html, .gif or .mp4.", _OUTPUT, callback=_film_file
    ),
    "as_json": Json,
    "backend": Backend,
    "precision": Precision,
    "digits": Digits,
    "contraction": Contraction,
    "vector": Vector,
}
#: Options of compilation, by their arguments.
COMPILED = "backend precision digits contraction vector"
DEFAULTS = {
    "through": False, "means": True, "stable": True, "moving": False, "as_json": False, "backend": "auto",
    "precision": "float64", "contraction": "off", "vector": "none",
}  # fmt: skip
