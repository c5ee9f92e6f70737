"""``symgen kinematics``, ``equilibrium``, ``modes``, ``forces``: analyses of linkages."""

from __future__ import annotations

from typing import Annotated, Any

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
        float | None, typer.Option("--to", help="End of the range [s]; default: the scene's.")
    ] = None,
    of: Annotated[
        list[str] | None,
        typer.Option("--of", metavar="NAME", help="A point or link to record; default: all."),
    ] = None,
    samples: Annotated[int, typer.Option(help="Number of recorded times.")] = 181,
    branch: Annotated[int, typer.Option(help="Assembly mode at t = 0; 1 is the drawn one.")] = 1,
    through: Annotated[
        bool, typer.Option("--through", help="Continue past dead centres, back in time.")
    ] = False,
    set_: SetOption = None,
    out: OutOption = None,
    plot: PlotOption = None,
    as_json: JsonOption = False,
    backend: BackendOption = "auto",
) -> None:
    """Compute the kinematics of a driven linkage.

    Positions, velocities and accelerations are printed. Dead centres in the range are located and listed.
    """
    from symgen.errors import ModelError
    from symgen.pipeline.build import build_kinematics

    model = build_kinematics(scene, set=changes(set_), backend=backend)
    state: Any = None
    if branch != 1:
        states = model.assemblies()
        if not 1 <= branch <= len(states):
            raise ModelError(f"there is no branch {branch}: {len(states)} assemblies were found at t = 0")
        state = states[branch - 1]
    motion: Any = model.kinematics(start, stop, samples=samples, of=of, state=state, through=through)
    write_files(motion, out, plot)
    show_motion(motion, as_json)


@app.command()
def equilibrium(
    scene: SceneArgument, set_: SetOption = None, as_json: JsonOption = False, backend: BackendOption = "auto"
) -> None:
    """Find the static equilibrium downhill from the start.

    Elastic links bend; each is divided into 12 rods.
    """
    from symgen.pipeline.build import build_scene as build_model
    from symgen.runtime.elastic.model import ElasticModel

    elastic = build_model(scene, set=changes(set_), backend=backend)
    model = elastic if isinstance(elastic, ElasticModel) else linkage(scene, set_, backend, "equilibrium")
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
            help='Crank angles of a scene with elastic links: "0,60" (degrees), "0.5 rad"; default: start.',
        ),
    ] = None,
    moving: Annotated[
        bool, typer.Option("--moving", help="Elastic links at the crank's speed instead of at rest.")
    ] = False,
    set_: SetOption = None,
    as_json: JsonOption = False,
    backend: BackendOption = "auto",
) -> None:
    """Find frequencies and shapes of small oscillations.

    They refer to the static equilibrium, or to a pose of elastic links.
    """
    from symgen.errors import ModelError
    from symgen.pipeline.build import build_scene as build_model
    from symgen.runtime.elastic.model import ElasticModel

    elastic = build_model(scene, set=changes(set_), backend=backend)
    if isinstance(elastic, ElasticModel):
        from symgen.inspection.runs import angles
        from symgen.report.elastic import print_elastic_modes

        poses = angles(at) if at else [None]
        found: Any = [elastic.modes(angle, moving=moving) for angle in poses]
        if not as_json:
            print_elastic_modes(found, elastic.description.title, console())
        elif len(found) == 1:
            print_json(found[0].summary())
        else:
            print_json({"scene": elastic.name, "poses": [m.summary() for m in found]})
        return
    if at or moving:
        given = "--at" if at else "--moving"
        raise ModelError(f"{elastic.name} has no elastic links: {given} applies to elastic links only")
    model = linkage(scene, set_, backend, "modes")
    about: Any = model.modes()
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
            help='Directions of the driven link, in degrees or as "0.5 rad"; default: the time range.',
        ),
    ] = None,
    elements: Annotated[int, typer.Option(help="Number of finite elements per link.")] = 1,
    section: Annotated[
        list[float] | None,
        typer.Option(
            "--section", metavar="PART", help="Position of the section along the link, 0 to 1; default: 0.5."
        ),
    ] = None,
    start: Annotated[float, typer.Option("--from", help="Start of the range [s].")] = 0.0,
    stop: Annotated[
        float | None, typer.Option("--to", help="End of the range [s]; default: the scene's.")
    ] = None,
    samples: Annotated[int | None, typer.Option(help="Number of times (361).")] = None,
    set_: SetOption = None,
    out: OutOption = None,
    plot: PlotOption = None,
    as_json: JsonOption = False,
    backend: BackendOption = "auto",
) -> None:
    """Compute the forces in a driven linkage.

    Joint, section and driving forces are printed; all links are treated as rigid.
    """
    from symgen.errors import ModelError
    from symgen.inspection.runs import angles

    if at and samples is not None:
        raise ModelError("give --at or --samples, not both")
    asked = angles(at) if at else None
    model = linkage(scene, set_, backend, "forces")
    found: Any = model.inverse_dynamics(
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
