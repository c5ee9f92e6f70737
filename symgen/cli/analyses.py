"""``symgen kinematics``, ``equilibrium``, ``modes``, ``forces``: what is asked of linkages besides motion."""

from __future__ import annotations

from typing import Annotated

import typer

from symgen.cli.common import (
    BackendOption,
    JsonOption,
    OutOption,
    PlotOption,
    SceneArgument,
    SetOption,
    app,
    changes,
    check_files,
    console,
    linkage,
    print_json,
    show_motion,
    write_files,
)


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
    out: OutOption = None,
    plot: PlotOption = None,
    as_json: JsonOption = False,
    backend: BackendOption = "auto",
) -> None:
    """Follow a driven linkage, and find its dead centres.

    Positions, velocities and accelerations are shown.
    """
    from symgen.errors import ModelError
    from symgen.pipeline import build_kinematics

    model = build_kinematics(scene, set=changes(set_), backend=backend)
    state = None
    if branch != 1:
        states = model.assemblies()
        if not 1 <= branch <= len(states):
            raise ModelError(f"there is no branch {branch}: {len(states)} assemblies were found at t = 0")
        state = states[branch - 1]
    motion = model.kinematics(start, stop, samples=samples, of=of, state=state, through=through)
    write_files(motion, out, plot)
    show_motion(motion, as_json)


@app.command()
def equilibrium(
    scene: SceneArgument, set_: SetOption = None, as_json: JsonOption = False, backend: BackendOption = "auto"
) -> None:
    """Find the static equilibrium downhill from the start."""
    model = linkage(scene, set_, backend, "equilibrium")
    found = model.equilibrium()
    if as_json:
        print_json({"scene": model.name, **found.summary()})
    else:
        from symgen.report.analyses import print_equilibrium

        print_equilibrium(found, model.description.title, console())


@app.command()
def modes(
    scene: SceneArgument,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            metavar="ANGLE[,ANGLE...]",
            help='Crank angles of a scene with elastic links: "0,60" (degrees), "0.5 rad"; else its start.',
        ),
    ] = None,
    moving: Annotated[
        bool, typer.Option("--moving", help="Of elastic links as they turn, not at rest in their pose.")
    ] = False,
    set_: SetOption = None,
    as_json: JsonOption = False,
    backend: BackendOption = "auto",
) -> None:
    """Find frequencies and shapes of small oscillations.

    They are those about equilibrium, or of elastic links in a pose.
    """
    from symgen.errors import ModelError
    from symgen.pipeline import build_scene as build_model
    from symgen.runtime.elastic_model import ElasticModel

    elastic = build_model(scene, set=changes(set_), backend=backend)
    if isinstance(elastic, ElasticModel):
        from symgen.report.elastic import print_elastic_modes
        from symgen.runs import angles

        poses = angles(at) if at else [None]
        found = [elastic.modes(angle, moving=moving) for angle in poses]
        if not as_json:
            print_elastic_modes(found, elastic.description.title, console())
        elif len(found) == 1:
            print_json(found[0].summary())
        else:
            print_json({"scene": elastic.name, "poses": [m.summary() for m in found]})
        return
    if at or moving:
        given = "--at" if at else "--moving"
        raise ModelError(f"{elastic.name} has no elastic links: {given} is for those")
    model = linkage(scene, set_, backend, "modes")
    about = model.modes()
    if as_json:
        print_json({"scene": model.name, **about.summary()})
    else:
        from symgen.report.analyses import print_modes

        print_modes(about, model.description.title, console())


@app.command()
def forces(
    scene: SceneArgument,
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            metavar="ANGLE[,ANGLE...]",
            help='Directions of the driven link, in degrees or as "0.5 rad"; else the range of time.',
        ),
    ] = None,
    elements: Annotated[int, typer.Option(help="Into how many elements each link is cut.")] = 1,
    section: Annotated[
        list[float] | None,
        typer.Option(
            "--section", metavar="PART", help="Part of the links' lengths to cut; the middle if absent."
        ),
    ] = None,
    start: Annotated[float, typer.Option("--from", help="Start of the range [s].")] = 0.0,
    stop: Annotated[
        float | None, typer.Option("--to", help="End of the range [s]; the scene's own when absent.")
    ] = None,
    samples: Annotated[int | None, typer.Option(help="Number of times (361).")] = None,
    set_: SetOption = None,
    out: OutOption = None,
    plot: PlotOption = None,
    as_json: JsonOption = False,
    backend: BackendOption = "auto",
) -> None:
    """Find joint, section and driving forces of a driven linkage.

    All its links are taken as rigid.
    """
    from symgen.errors import ModelError
    from symgen.runs import angles

    check_files(out, plot)
    if at and samples is not None:
        raise ModelError("give --at or --samples, not both")
    asked = angles(at) if at else None
    model = linkage(scene, set_, backend, "forces")
    found = model.forces(
        start,
        stop,
        at=asked,
        elements=elements,
        sections=section or (0.5,),
        samples=361 if samples is None else samples,
    )
    write_files(found, out, plot)
    if as_json:
        print_json(found.summary())
    else:
        from symgen.report.forces import print_forces

        print_forces(found, console())
