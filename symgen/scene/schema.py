"""The scene as the user writes it: tables and keys, checked by pydantic. Values are read in ``linkage``."""

from __future__ import annotations

from collections.abc import Iterable
from inspect import Parameter, Signature
from typing import Any, Literal

from pydantic import ConfigDict, Field, PrivateAttr, ValidationError
from pydantic.fields import FieldInfo

from symgen.calls import checked
from symgen.errors import ModelError, SceneError
from symgen.loads import LOADS
from symgen.methods import METHODS, claiming
from symgen.scene.elastic.schema import (
    CrankTable,
    ElasticTable,
    JointTable,
    ModalDampingTable,
    SectionTable,
    StationTable,
    Weld,
)
from symgen.scene.faults import scene_error
from symgen.scene.loop.schema import SpatialLoop
from symgen.scene.ranges import written_out
from symgen.scene.rods.rotations import DriverTable, GearTable, MotionTable
from symgen.scene.study_schema import Optimise, SweepTable
from symgen.scene.table import (
    Bare,
    Moments,
    Name,
    Table,
    Text,
    Value,
    Vector,
    absent,
    checked_name,
)
from symgen.scene.tables.files import with_points
from symgen.scene.tables.points import PointsTable

FORMAT_VERSION = 1

#: Tables that every scene may have; all others are of points and links, or of a loop.
_SHARED = {
    "symgen", "title", "about", "units", "parameters", "inputs", "states", "tables", "gravity", "analysis",
    "sweep", "optimise",
}  # fmt: skip


def _for_editors(schema: dict[str, Any]) -> None:
    """Declare for editors that a file must state its version, and has points and links or a loop."""
    schema["required"] = ["symgen"]
    others = [key for key in schema["properties"] if key not in _SHARED]
    schema["anyOf"] = [
        {"required": ["points", "links"], "properties": {"loop": False}},
        {"required": ["loop"], "properties": {key: False for key in others if key != "loop"}},
        *({"required": [row.claims[0]]} for row in METHODS.values() if row.schema),
    ]


class Named(Bare):
    """A named value with its meaning; the bare value may stand for the table."""

    BARE = "value"
    value: Value
    about: Text = Field("", description="Meaning, for reports.")


class ParameterTable(Named):
    """A named value, or a law of the time t, for use in expressions."""

    value: Value = Field(
        description='A quantity ("2 cm"), an expression over parameters ("2*a"), a plain number, or a law of '
        'the time ("a*sin(w*t)"), which is not tunable.'
    )
    tunable: bool = Field(False, description="Keep it as an argument of the kernels instead of folding it.")


class Units(Table):
    """Units in which tables and plots show results; those of SI if absent."""

    length: str | None = absent("Such as mm or in; also of velocities and accelerations.")
    force: str | None = absent("Such as kN or lbf; torques follow.")
    torque: str | None = absent("Such as N*m or lbf*ft, where it is not that of length and force.")
    energy: str | None = absent("Such as kJ or N*mm; J if absent, whatever the other units.")
    power: str | None = absent("Such as kW or lbf*ft/s; W if absent, whatever the other units.")
    angle: str | None = absent("rad, deg or rev; also of their rates.")
    stress: str | None = absent("Such as MPa or psi.")


class Input(Named):
    """An external signal in forces and torques, such as that of a controller: a named quantity."""

    value: Value = Field(description="Where no other value is passed; its unit is that of the input.")


class StateTable(Table):
    """A first-order state, such as an integral of a controller, a filter or the current of a motor."""

    start: Value = Field(description="At the start; its unit is that of the state.")
    rate: Value = Field(
        description="Its time derivative: an expression of t, states, inputs, and the state of the mechanism."
    )
    about: Text = Field("", description="Meaning, for reports.")


class PointTable(Table):
    """A joint, a tip or a fixed point of the mechanism, where it is drawn."""

    at: Vector | None = absent("Coordinates: two in the plane, three in space.")
    on: Name | None = absent("Instead of coordinates: the link whose line it is fixed to.")
    fraction: Value | None = absent(
        "Where on that line: 0 at the first point of the link, 1 at its second; any number."
    )
    offset: Value | None = absent(
        "Distance from that line, to the left when looking along it; in the plane only."
    )
    ground: bool = Field(False, description="Fixed to the ground, or moved by it where motion is given.")
    motion: Vector | None = absent("Displacement of a ground point from its drawn position, by the time t.")


class Link(Table):
    """A rod between two points, rigid or elastic, or a rigid body with more points on it."""

    points: list[Name] = Field(min_length=2)
    mass: Value | None = None
    mass_per_length: Value | None = None
    density: Value | None = absent("Mass per volume, instead of the mass: mass, centre and inertia follow.")
    section: SectionTable | None = None
    elastic: ElasticTable | None = absent("That it bends and stretches; rigid if absent.")
    centre: Value | Vector | None = absent(
        "Centre of mass: its coordinates as drawn, or the fraction of the length of a link of two points; "
        "the middle of such a link if absent."
    )
    inertia: Value | Moments | None = absent(
        "Moment of inertia about the centre of mass; mass*length^2/12 for a rod if absent. Of a "
        "body in space: xx, yy, zz and, if they are not zero, xy, xz, yz of the inertia matrix as drawn."
    )
    length: Value | None = absent(
        "Length; the drawn distance if absent. If given, the drawing is only a first guess. A "
        "massless rod may have a length that depends on the time t."
    )


class Gravity(Table):
    """Uniform gravity."""

    acceleration: Vector


class PointMass(Table):
    """A mass at a point, with the moment of inertia of a body that is fixed to a link there."""

    point: Name
    mass: Value
    inertia: Value | None = absent("In the plane the moment of inertia about the point.")
    link: Name | None = absent("The link with which the inertia rotates, if several that rotate apart meet.")


class GuideTable(Table):
    """Points that stay on the line of a link: a block on a rod, or on a rail between two ground points."""

    points: list[Name] = Field(min_length=1)
    along: Name = Field(description="The link whose line they stay on.")


class EventTable(Table):
    """A moment of a run that is looked for: where a quantity passes a value."""

    name: Name = Field(description="Name in the results.")
    of: str = Field(description="A quantity of the state such as A.position.y, or an expression of them.")
    value: Value = Field(0, description="Threshold of the quantity.")
    direction: Literal["rising", "falling", "both"] = Field("both", description="Which way it passes.")
    ends_run: bool = Field(False, description="Whether the run ends there.")


class StartTable(Table):
    """How the motion starts; at rest where drawn when absent."""

    angles: dict[Name, Value] = Field(
        default_factory=dict, description="Direction of a link from its first point to its second (plane)."
    )
    rates: dict[Name, Value | Vector] = Field(
        default_factory=dict, description="Angular velocity of a link; in space three components."
    )
    velocities: dict[Name, Vector] = Field(default_factory=dict, description="Velocity of a point.")
    equilibrium: bool = Field(
        default=False, description="Start at rest in the equilibrium reached from the drawing and the angles."
    )


class Analysis(Table):
    """Analysis of the mechanism."""

    kind: Literal["dynamics", "kinematics"] = Field(
        default="dynamics",
        description="kinematics: positions, velocities and accelerations of a driven linkage, and no forces.",
    )
    t_end: Value = Field(
        default="1 s", description="By default one revolution of the crank if links are elastic."
    )
    assembly_tolerance: Value | None = absent(
        "By how much redundant constraints, or closure of a loop, may be missed."
    )
    motion: Literal["space"] | None = absent(
        "space: derive a linkage with three coordinates in space though it stays in a plane."
    )
    outputs: list[str] | None = absent(
        "Recorded outputs, such as C.position, OA.tension, O.reaction, energy."
    )


class _Interface(type(Table)):  # type: ignore[misc]
    """Type of a class that lists its interface alone, also in ``help``."""

    def __dir__(cls) -> list[str]:
        return [name for name in vars(cls) if not name.startswith(("_", "model_"))]


class Scene(Table, metaclass=_Interface):
    """One mechanism with its analysis: points and links, or a loop.

    It has a list of tables for each kind of load in ``symgen.loads.LOADS``, after the point masses, and the
    tables that rows of ``symgen.methods.METHODS`` add.

    Build it from a file with :func:`symgen.load_scene`, or in Python with the same words:
    ``symgen.Scene(name="press", points={...}, links={...})``. ``docs/scene.md`` describes all tables.
    The name is that of the model, and the prefix of its functions in C; a file has its own.
    """

    model_config = ConfigDict(json_schema_extra=_for_editors)

    symgen: Literal[1] = Field(1, description="Version of the scene format.")
    title: Text = ""
    about: Text = ""
    units: Units = Field(default_factory=lambda: Units.model_validate({}))
    parameters: dict[Name, ParameterTable] = Field(default_factory=dict)
    inputs: dict[Name, Input] = Field(default_factory=dict)
    states: dict[Name, StateTable] = Field(default_factory=dict)
    tables: dict[Name, PointsTable] = Field(default_factory=dict)
    points: dict[Name, PointTable] = Field(default_factory=dict, min_length=1)
    links: dict[Name, Link] = Field(default_factory=dict, min_length=1)
    loop: SpatialLoop | None = None
    gravity: Gravity | None = None
    masses: list[PointMass] = Field(default_factory=list)
    guides: list[GuideTable] = Field(default_factory=list)
    drivers: list[DriverTable] = Field(default_factory=list)
    motions: list[MotionTable] = Field(default_factory=list)
    gears: list[GearTable] = Field(default_factory=list)
    crank: CrankTable | None = None
    modal_damping: ModalDampingTable | None = None
    welds: list[Weld] = Field(default_factory=list)
    joints: list[JointTable] = Field(default_factory=list)
    stations: list[StationTable] = Field(default_factory=list)
    start: StartTable = Field(default_factory=StartTable)
    events: list[EventTable] = Field(default_factory=list)
    analysis: Analysis = Field(default=Analysis())
    sweep: SweepTable | None = None
    optimise: Optimise | None = None

    _name: str = PrivateAttr("scene")
    _file: str = PrivateAttr("")

    @classmethod
    def model_json_schema(cls, *arguments: Any, **options: Any) -> dict[str, Any]:
        """Return the JSON schema of scenes, with the tables of registered loads and methods."""
        _add_tables()
        return super().model_json_schema(*arguments, **options)

    @checked
    def __init__(self, /, *, name: str = "scene", **tables: Any) -> None:
        _add_tables()
        tables = written_out(tables)
        if "tables" in tables:
            tables["tables"] = with_points(tables["tables"])
        try:
            super().__init__(**tables)
        except ValidationError as error:
            raise scene_error(Scene, error) from None
        self._name = checked_name(name)
        self._check_kind()

    def _check_kind(self) -> None:
        """Raise SceneError unless the scene has points and links, or a loop."""
        analysis = self.analysis
        for key, is_present in (("motion", analysis.motion), ("kind", analysis.kind != "dynamics")):
            if self.loop is not None and is_present:
                raise SceneError("the analysis of a loop follows from its outputs", where=f"analysis.{key}")
        if self.loop is None:
            if claiming(self.model_fields_set).schema:
                return
            for key in ("points", "links"):
                if key not in self.model_fields_set:
                    raise SceneError(
                        "this key is missing",
                        where=key,
                        hint="A scene has points and links, or a loop.",
                    )
            return
        for key in sorted(self.model_fields_set - _SHARED - {"loop"}):
            raise SceneError(
                f"a scene with a loop has no {key}",
                where=key,
                hint="A scene has points and links, or a loop with links and loads of its own.",
            )

    def __repr__(self) -> str:
        kind = f"{len(self.points)} points, {len(self.links)} links" if self.loop is None else "loop"
        return f"<Scene {self.name!r}: {self.title or 'without a title'}, {kind}>"

    __str__ = __repr__

    @property
    def driven(self) -> tuple[str, ...]:
        """The links whose direction is prescribed, by drivers and as the crank."""
        crank = () if self.crank is None else (self.crank.link,)
        return (*(driver.link for driver in self.drivers), *crank)

    @property
    def name(self) -> str:
        """Short name: the file's stem, or ``name=`` in Python."""
        return self._name

    @property
    def file(self) -> str:
        """Name of the file it was read from; empty for a scene made in Python."""
        return self._file

    def called(self, name: str, file: str = "") -> Scene:
        """Return the same scene under a name, which prefixes its generated functions."""
        copy = self.model_copy()
        copy._name, copy._file = checked_name(name), file
        return copy


#: The tables of loads and methods that the scene has.
_ADDED: dict[str, type[Table]] = {}


def _of_methods() -> dict[str, type[Table]]:
    """Return the tables that methods add to scenes, by name."""
    tables: dict[str, type[Table]] = {}
    for row in METHODS.values():
        if row.schema:
            if not row.claims:
                raise ModelError(
                    f"the method {row.name!r} has a schema and claims no table\n"
                    '  Name its table in the scene: claims=("TABLE",).'
                )
            _check_new(row.claims[0], f"the method {row.name!r}", (*LOADS, *tables))
            tables[row.claims[0]] = row.load("schema")
    return tables


def _check_new(table: str, owner: str, added: Iterable[str]) -> None:
    """Check that a table to be added has a name of its own; raise ModelError with its owner otherwise."""
    if table in added or (table in Scene.model_fields and table not in _ADDED):
        raise ModelError(
            f"{owner} adds the table {table!r} to scenes, which have a table of that name\n"
            "  Register it under another name."
        )


def _add_tables() -> None:
    """Give the scene lists of tables of loads, and tables of methods, including those registered since."""
    loads = {name: kind.schema for name, kind in LOADS.items()}
    kinds = loads | _of_methods()
    if kinds == _ADDED:
        return
    for name in loads:
        _check_new(name, f"the load kind {LOADS[name].noun!r}", ())
    fields, others = Scene.model_fields, {n: f for n, f in Scene.model_fields.items() if n not in _ADDED}
    fields.clear()
    for name, info in others.items():
        fields[name] = info
        if name == "masses":
            for key, table in kinds.items():
                annotation: Any = list[table] if key in loads else table | None  # type: ignore[valid-type]
                default: Any = Field(default_factory=list) if key in loads else Field(default=None)
                fields[key] = FieldInfo.from_annotated_attribute(annotation, default)
    _ADDED.clear()
    _ADDED.update(kinds)
    Scene.model_rebuild(force=True)
    named = Parameter("name", Parameter.KEYWORD_ONLY, default="scene")
    Scene.__signature__ = Signature([named, Parameter("tables", Parameter.VAR_KEYWORD)])


_add_tables()
