"""The command line: arguments in, calls out."""

from __future__ import annotations

import atexit
import gc
import sys
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from symgen.errors import SceneError, SymgenError

if TYPE_CHECKING:
    from rich.console import Console

app = typer.Typer(
    help="Derive the equations of a mechanism, print them as C, and run them compiled.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    add_completion=False,
)
cache_app = typer.Typer(help="The folder of compiled scenes.", no_args_is_help=True)
app.add_typer(cache_app, name="cache")

SceneArgument = Annotated[
    str, typer.Argument(help="A name that 'symgen scenes' lists, or the path of a TOML file.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help='A parameter or dotted key: rho="2 kg/m", links.OA.mass="1 kg".'
    ),
]
BackendOption = Annotated[str, typer.Option(help="auto, c or numpy.")]


def main() -> None:
    """Run the command line: every error that symgen raises on purpose becomes one message and exit code 2."""
    gc.disable()  # a short process: collecting garbage would only lengthen its start and, thawed, its end
    atexit.register(gc.freeze)
    warnings.showwarning = lambda message, *_, **__: print(f"symgen: {message}", file=sys.stderr)
    try:
        app()
    except SymgenError as error:
        print(f"symgen: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        print("symgen: interrupted", file=sys.stderr)
        raise SystemExit(130) from None
    except BrokenPipeError:
        sys.stderr.close()
        raise SystemExit(1) from None


def _console() -> Console:
    from rich.console import Console

    return Console(width=None if sys.stdout.isatty() else 110, highlight=False)


def _changes(changes: list[str] | None) -> dict[str, str]:
    result = {}
    for change in changes or []:
        name, equals, value = change.partition("=")
        if not equals or not name.strip():
            raise SceneError(f"expected --set KEY=VALUE, got {change!r}")
        bare = value.strip()
        quoted = len(bare) > 1 and bare[0] == bare[-1] and bare[0] in "\"'"
        result[name.strip()] = bare[1:-1] if quoted else bare
    return result


@app.callback(invoke_without_command=True)
def _version(
    ctx: typer.Context, version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False
) -> None:
    if version:
        from symgen import __version__

        print(__version__)
        raise typer.Exit


@app.command()
def scenes() -> None:
    """List the shipped scenes."""
    from symgen.report.tables import table
    from symgen.scene.loading import read_scene, shipped_scenes

    rows = [(name, read_scene(name).data.get("title", "")) for name in shipped_scenes()]
    shown = table("Shipped scenes", ("name", "mechanism"), rows)
    shown.columns[1].justify = "left"
    _console().print(shown)


@app.command()
def run(
    scene: SceneArgument,
    t_end: Annotated[
        float | None, typer.Option(help="End of the run [s]; the scene's own when absent.")
    ] = None,
    method: Annotated[str | None, typer.Option(help="dop853 (adaptive) or rk4 (fixed step).")] = None,
    rtol: Annotated[float | None, typer.Option(help="Relative tolerance of the local error.")] = None,
    atol: Annotated[float | None, typer.Option(help="Absolute tolerance [m, m/s].")] = None,
    step: Annotated[float | None, typer.Option(help="Fixed step [s].")] = None,
    samples: Annotated[int, typer.Option(help="Number of recorded times.")] = 201,
    set_: SetOption = None,
    out: Annotated[Path | None, typer.Option(help="Save the result: .nc or .npz.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Save a plot: .png, .svg or .pdf.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
    backend: BackendOption = "auto",
) -> None:
    """Run a scene and print where it ended."""
    from symgen.atomic import writable
    from symgen.errors import SimulationError
    from symgen.pipeline import build as build_model
    from symgen.report.plots import DRAWN_AS
    from symgen.runtime.result import SAVED_AS

    for file, endings, what in ((out, SAVED_AS, "result"), (plot, DRAWN_AS, "plot")):
        if file:
            writable(file, endings, what)
    model = build_model(scene, set=_changes(set_), backend=backend)
    options: dict[str, Any] = {"method": method, "rtol": rtol, "atol": atol, "step": step, "samples": samples}
    try:
        if as_json or not sys.stderr.isatty():
            result = model.simulate(t_end, **options)
        else:
            from symgen.report.progress import bar

            with bar(model.description.title) as progress:
                result = model.simulate(t_end, **options, progress=progress)
    except SimulationError as error:
        if out and error.partial is not None:
            error.partial.save(out)
            print(f"symgen: what was recorded until then is in {out}", file=sys.stderr)
        raise
    if out:
        result.save(out)
    if plot:
        result.plot(file=plot)
    if as_json:
        import json

        print(json.dumps(result.summary(), allow_nan=False))
    else:
        from symgen.report.tables import print_result

        print_result(result, _console())


JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]


@app.command()
def kinematics(
    scene: SceneArgument,
    start: Annotated[float, typer.Option("--from", help="Start of the range [s].")] = 0.0,
    stop: Annotated[
        float | None, typer.Option("--to", help="End of the range [s]; the scene's own when absent.")
    ] = None,
    of: Annotated[
        list[str] | None,
        typer.Option("--of", metavar="NAME", help="A point or link to record; all if absent."),
    ] = None,
    samples: Annotated[int, typer.Option(help="Number of recorded times.")] = 181,
    branch: Annotated[int, typer.Option(help="Which assembly at t = 0 to follow; 1 is the drawn one.")] = 1,
    through: Annotated[
        bool, typer.Option("--through", help="Go on through dead centres, back in time.")
    ] = False,
    set_: SetOption = None,
    out: Annotated[Path | None, typer.Option(help="Save the result: .nc or .npz.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Save a plot: .png, .svg or .pdf.")] = None,
    as_json: JsonOption = False,
    backend: BackendOption = "auto",
) -> None:
    """Follow a driven linkage: positions, velocities, accelerations, dead centres."""
    from symgen.errors import ModelError
    from symgen.pipeline import build as build_model

    model = build_model(scene, set=_changes(set_), backend=backend)
    state = None
    if branch != 1:
        states = model.assemblies()
        if not 1 <= branch <= len(states):
            raise ModelError(f"there is no branch {branch}: {len(states)} assemblies were found at t = 0")
        state = states[branch - 1]
    motion = model.kinematics(start, stop, samples=samples, of=of, state=state, through=through)
    if out:
        motion.save(out)
    if plot:
        motion.plot(file=plot)
    if as_json:
        _print_json(motion.summary())
    else:
        from symgen.report.analyses import print_motion

        print_motion(motion, _console())


@app.command()
def equilibrium(
    scene: SceneArgument, set_: SetOption = None, as_json: JsonOption = False, backend: BackendOption = "auto"
) -> None:
    """Find the static equilibrium downhill from the start of a scene."""
    from symgen.pipeline import build as build_model

    model = build_model(scene, set=_changes(set_), backend=backend)
    found = model.equilibrium()
    if as_json:
        _print_json({"scene": model.name, **found.summary()})
    else:
        from symgen.report.analyses import print_equilibrium

        print_equilibrium(found, model.description.title, _console())


@app.command()
def modes(
    scene: SceneArgument, set_: SetOption = None, as_json: JsonOption = False, backend: BackendOption = "auto"
) -> None:
    """Find frequencies and shapes of small oscillations about the equilibrium of a scene."""
    from symgen.pipeline import build as build_model

    model = build_model(scene, set=_changes(set_), backend=backend)
    found = model.modes()
    if as_json:
        _print_json({"scene": model.name, **found.summary()})
    else:
        from symgen.report.analyses import print_modes

        print_modes(found, model.description.title, _console())


def _print_json(data: dict[str, Any]) -> None:
    import json

    print(json.dumps(data, allow_nan=False))


@app.command()
def show(
    model: Annotated[str, typer.Argument(help="A scene, or a building block: rod, rod_spatial.")],
    matrix: Annotated[
        str | None,
        typer.Argument(
            help="A matrix; all are listed without it. momentum_rows for those, momentum_rows.NAME for one."
        ),
    ] = None,
    form: Annotated[
        str, typer.Option("--format", help="unicode, latex, c, or numeric (at the start).")
    ] = "unicode",
    set_: SetOption = None,
) -> None:
    """Show the derived equations."""
    from symgen.models import BLOCKS
    from symgen.pipeline import build as build_model
    from symgen.pipeline import derive
    from symgen.report import equations

    changes = _changes(set_)
    form_of, _, row = (matrix or "").partition(".")
    if model in BLOCKS:
        system = BLOCKS[model]()
    else:
        from symgen.scene.loading import override, read_scene

        text = override(read_scene(model), changes)
        if form_of == "momentum_rows":
            from symgen.models.momentum import momentum_system
            from symgen.scene.loading import check_scene
            from symgen.scene.resolve import resolve_linkage

            system = momentum_system(resolve_linkage(check_scene(text)))
        else:
            system = derive(text)
    if matrix is None:
        from symgen.report.tables import table

        shown = table(system.title, ("matrix", "shape", "unit", "meaning"), equations.overview(system))
        shown.columns[3].justify = "left"
        _console().print(shown)
        return
    built = build_model(model, set=changes) if form == "numeric" and model not in BLOCKS else None
    if matrix == "momentum_rows" and model not in BLOCKS:
        print(equations.show_rows(system, form, built))
    else:
        print(equations.show(system, row or matrix, form, built))


@app.command()
def explain(scene: SceneArgument, set_: SetOption = None) -> None:
    """Tell how a scene hangs together: its tree, loops, degrees of freedom and redundant rows."""
    from symgen.models.structure import structure
    from symgen.pipeline import build as build_model
    from symgen.report.summary import freedom_lines
    from symgen.scene.loading import load_scene
    from symgen.scene.resolve import resolve_linkage

    changes = _changes(set_)
    print(*structure(resolve_linkage(load_scene(scene, set=changes))), sep="\n", flush=True)
    print(*freedom_lines(build_model(scene, set=changes)), sep="\n")


@app.command()
def generate(
    check: Annotated[
        bool, typer.Option("--check", help="Change nothing; fail where a file is not current.")
    ] = False,
) -> None:
    """Write the shipped kernels under generated/ anew."""
    from symgen.errors import GenerationError
    from symgen.shipped import generate as write
    from symgen.shipped import not_current

    if check:
        found = not_current()
        if found:
            print("".join(found), end="")
            raise GenerationError(f"{len(found)} generated files are not current: run 'symgen generate'")
        print("generated/ is current")
        return
    for name in write():
        print(f"generated/{name}")


@app.command()
def build(scene: SceneArgument, set_: SetOption = None, backend: BackendOption = "auto") -> None:
    """Derive, emit and compile a scene into the cache."""
    from symgen.pipeline import build as build_model
    from symgen.report.summary import model_lines

    print(*model_lines(build_model(scene, set=_changes(set_), backend=backend)), sep="\n")


@app.command()
def schema() -> None:
    """Print the JSON Schema of scene files, for editors."""
    import json

    from symgen.scene.schema import Scene

    print(json.dumps(Scene.model_json_schema(), indent=2))


@cache_app.command("info")
def cache_info() -> None:
    """Show where the cache is and what it holds."""
    from symgen.cache import Cache
    from symgen.report.tables import table

    store = Cache()
    entries = store.entries()
    total = sum(size for _, size in entries)
    rows = [(name, f"{size / 1024:.0f} KiB") for name, size in entries]
    print(f"{store.root}: {len(entries)} entries, {total / 1024:.0f} KiB")
    if rows:
        _console().print(table("", ("entry", "size"), rows))


@cache_app.command("clear")
def cache_clear() -> None:
    """Remove every compiled scene from the cache."""
    from symgen.cache import Cache

    store = Cache()
    print(f"removed {store.clear()} entries from {store.root}")
