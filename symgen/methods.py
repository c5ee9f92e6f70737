"""The methods of symgen: one row binds everything that depends on how a mechanism is described and solved.

Scenes, descriptions and models carry the name of their method; what differs between methods is looked up here
and nowhere else tested. Entries are ``module:name`` and are imported when they are first used, so that
importing this module costs nothing. A new method is a new row.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from symgen.errors import ModelError, check_known
from symgen.registry import Registry, load


class Command(NamedTuple):
    """How an analysis of models of one method appears on the command line.

    ``table`` prints its result: (result, model, console). ``values`` reads the values of ``--at``, ``--from``
    and ``--to``: (model, texts, option) -> numbers and their variable; empty where they do not apply.
    """

    table: str
    values: str = ""


@dataclass(frozen=True, slots=True)
class Method:
    """One method.

    Attributes
    ----------
    name
        The name that resolved scenes, descriptions and models carry.
    claims
        Tables of a scene that only this method has; the first row of ``METHODS`` with one claims a scene.
    schema
        Class of its first table, if this is not a table of all scenes.
    resolve
        Scene -> resolved scene, which may carry the name of another method that shares this one's tables.
    system
        Resolved scene -> System.
    letters
        Resolved scene -> the same with letters for its constants, and the letters; none where empty.
    further
        Resolved scene -> Systems of analyses besides, by name; none where empty.
    describe
        Resolved scene, Program, hash of the equations -> Description without its start.
    description
        Class of that description.
    start
        System, Description, Library -> Description with its start.
    model
        ModelParts (``symgen.pipeline.build``) -> Model.
    export
        Model, Program, sources (and names of further programs, if any) -> Exported.
    record
        Resolved scene, System -> steps of the derivation.
    subject
        Scene, model and options -> subject of studies of speed.
    view
        Class of what pages and explanations show, a subclass of ``symgen.inspection.view.View``.
    state
        Model, time or value as text -> arguments of the matrices there.
    momentum
        Resolved scene -> System of its momentum rows.
    accuracy
        Model, Request (``symgen.study.accuracy.kernels``) -> kernels to compare with exact arithmetic.
    commands
        The analyses that the command line offers, by name.
    """

    name: str
    claims: tuple[str, ...] = ()
    schema: str = ""
    resolve: str = ""
    system: str = ""
    letters: str = ""
    further: str = ""
    describe: str = ""
    description: str = ""
    start: str = ""
    model: str = ""
    export: str = ""
    record: str = ""
    subject: str = ""
    accuracy: str = ""
    view: str = ""
    state: str = ""
    momentum: str = ""
    commands: Mapping[str, Command] = field(default_factory=dict)

    def load(self, entry: str) -> Any:
        """Return the object that an entry names, imported at the first use.

        Raises
        ------
        ModelError
            When the method has no such entry.
        """
        name = str(getattr(self, entry))
        if not name:
            raise ModelError(f"models of the method {self.name!r} have no {entry}")
        return load(name)

    @property
    def deciding(self) -> tuple[Any, ...]:
        """What its entries name outside of symgen, as far as kernels and descriptions depend on them."""
        names = (getattr(self, entry) for entry in _DECIDING)
        return tuple(load(name) for name in names if name and not name.startswith("symgen."))


#: The entries of a row on which kernels and descriptions depend.
_DECIDING = (
    "schema",
    "resolve",
    "system",
    "letters",
    "further",
    "describe",
    "description",
    "start",
    "momentum",
)
_LINKAGE = {
    "resolve": "symgen.scene.resolve:resolved_linkage",
    "system": "symgen.pipeline.systems:linkage_system_of",
    "letters": "symgen.scene.rods.letters:of_linkage",
    "further": "symgen.models.analyses:elastic_systems",
    "describe": "symgen.pipeline.describe:of_linkage",
    "description": "symgen.runtime.kernels.description:Description",
    "start": "symgen.pipeline.describe:with_state",
    "momentum": "symgen.models.momentum.rows:momentum_system",
}
_VALUES = "symgen.inspection.values"
_DRIVE, _CRANK, _INPUT = (f"{_VALUES}:{name}" for name in ("of_drive", "of_crank", "of_input"))
_OF_RODS = {
    "simulate": Command("symgen.report.motion:print_result"),
    "kinematics": Command("symgen.report.analyses:print_motion", _DRIVE),
    "inverse_dynamics": Command("symgen.report.forces:print_forces", _DRIVE),
    "equilibrium": Command("symgen.report.analyses:print_equilibrium"),
    "modes": Command("symgen.report.analyses:print_modes"),
    "linearise": Command("symgen.report.linear:print_linearisation"),
    "sensitivity": Command("symgen.report.linear:print_sensitivity"),
    "assemblies": Command("symgen.report.analyses:print_assemblies", _DRIVE),
}
_RUN_OF_ELASTIC = Command("symgen.report.elastic:print_elastic_result", _CRANK)
_OF_ELASTIC = _OF_RODS | {
    "simulate": _RUN_OF_ELASTIC,
    "modes": Command("symgen.report.elastic:print_elastic_modes", _CRANK),
    "periodic": _RUN_OF_ELASTIC,
    "quasi_static": _RUN_OF_ELASTIC,
    "large_rotation": _RUN_OF_ELASTIC,
    "speed_response": Command("symgen.report.elastic:print_speed_response"),
}
_POSES_OF_LOOP = Command("symgen.report.loops:print_turn", _INPUT)
_OF_LOOP = {
    "simulate": Command("symgen.report.loops:print_motion_of_loop"),
    "kinematics": _POSES_OF_LOOP,
    "inverse_dynamics": _POSES_OF_LOOP,
    "assemblies": Command("symgen.report.loops:print_assemblies", _INPUT),
    "linearise": _OF_RODS["linearise"],
    "sensitivity": _OF_RODS["sensitivity"],
}

#: All methods, in the order in which they claim a scene.
METHODS = Registry[Method](
    {
        row.name: row
        for row in (
            Method(
                "loop",
                claims=("loop",),
                resolve="symgen.scene.resolve:resolved_loop",
                system="symgen.models.loop.system:loop_system",
                letters="symgen.scene.loop.letters:of_loop",
                describe="symgen.pipeline.describe:of_loop",
                description="symgen.runtime.kernels.loop_description:LoopDescription",
                start="symgen.pipeline.describe:with_pose",
                model="symgen.pipeline.build:loop_model",
                export="symgen.export.loop:loop",
                record="symgen.models.record:of_loop",
                subject="symgen.study.speed.subjects:loop",
                accuracy="symgen.study.accuracy.kernels:of_loop_model",
                view="symgen.inspection.loops:LoopView",
                state="symgen.inspection.state:of_loop",
                commands=_OF_LOOP,
            ),
            Method(
                "elastic",
                claims=("crank",),
                **_LINKAGE,
                model="symgen.pipeline.build:elastic_model",
                export="symgen.export.elastic:elastic",
                record="symgen.models.record:of_elastic",
                subject="symgen.study.speed.elastic_links:elastic",
                accuracy="symgen.study.accuracy.kernels:of_elastic",
                view="symgen.inspection.linkages:ElasticView",
                state="symgen.inspection.state:of_elastic",
                commands=_OF_ELASTIC,
            ),
            Method(
                "spatial",
                (),
                **_LINKAGE,
                model="symgen.pipeline.spatial:spatial_model",
                record="symgen.models.record:of_linkage",
                accuracy="symgen.study.accuracy.kernels:of_spatial",
                view="symgen.inspection.linkages:SpatialView",
                state="symgen.inspection.state:of_spatial",
                commands={
                    "simulate": Command("symgen.report.elastic:print_elastic_result"),
                    "equilibrium": _OF_RODS["equilibrium"],
                    "modes": Command("symgen.report.elastic:print_elastic_modes", f"{_VALUES}:of_pose"),
                    "sensitivity": _OF_RODS["sensitivity"],
                },
            ),
            Method(
                "rods",
                claims=("points",),
                **_LINKAGE,
                model="symgen.pipeline.build:linkage_model",
                export="symgen.export.rods:rods",
                record="symgen.models.record:of_linkage",
                subject="symgen.study.speed.subjects:rods",
                accuracy="symgen.study.accuracy.kernels:of_rods",
                view="symgen.inspection.linkages:RodsView",
                state="symgen.inspection.state:of_linkage",
                commands=_OF_RODS,
            ),
            Method(
                "general",
                system="symgen.models.general.system:general_system",
                describe="symgen.pipeline.describe:of_general",
                description="symgen.runtime.kernels.description:Description",
                start="symgen.pipeline.describe:with_state",
                export="symgen.export.rods:rods",
                view="symgen.inspection.systems:GeneralView",
                accuracy="symgen.study.accuracy.kernels:of_rods",
                commands={
                    name: _OF_RODS[name]
                    for name in ("simulate", "kinematics", "equilibrium", "modes", "linearise", "sensitivity")
                },
            ),
            Method(
                "system",
                export="symgen.export.system:system",
                view="symgen.inspection.systems:SystemView",
                description="symgen.runtime.kernels.system_description:SystemDescription",
                accuracy="symgen.study.accuracy.kernels:of_user_system",
            ),
        )
    },
    lambda row: row.deciding,
)


def method_of(subject: Any) -> Method:
    """Return the method of a resolved scene, a description or a model, by the name that it carries."""
    name = subject.method
    check_known(name, METHODS, "there is no method")
    return METHODS[name]


def table_of(model: Any, verb: str) -> Callable[[Any, Any, Any], None]:
    """Return the function that prints the result of an analysis of a model: result, model and console."""
    printer: Callable[[Any, Any, Any], None] = load(method_of(model).commands[verb].table)
    return printer


def further_of(resolved: Any) -> dict[str, Any]:
    """Return the Systems of a resolved scene besides its own, by name."""
    method = method_of(resolved)
    return method.load("further")(resolved) if method.further else {}


def claiming(tables: Collection[str]) -> Method:
    """Return the method that claims a scene by its tables; rods where none does."""
    rows = METHODS.values()
    return next((row for row in rows if any(claim in tables for claim in row.claims)), METHODS["rods"])
