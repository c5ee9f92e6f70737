"""Analyses on the command line: options become arguments, results become files, tables or JSON."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from copy import copy
from functools import partial, wraps
from inspect import Parameter, Signature
from typing import Any

import typer

from symgen.cli.common import (
    changes,
    command,
    console,
    print_json,
    progress_bar,
    saved_on_failure,
    until,
    wrote,
)
from symgen.cli.options import DEFAULTS, OF_ANALYSES
from symgen.errors import ArgumentError, ModelError, OptionsError, SceneError
from symgen.methods import load, method_of, table_of

#: Options that decide how kernels are compiled, and all others that are not arguments of an analysis.
_TYPES = ("precision", "digits", "contraction", "vector")
#: Options that select the content of a plot; without --plot they are refused.
_OF_PLOTS = ("plot_of", "xy", "plot_over", "compare")
_COMMON = ("scene", "set_", "means", "out", "plot", "film", *_OF_PLOTS, "as_json", "backend", *_TYPES)
#: Analyses that record more outputs than the scene selects.
_FURTHER = ("kinematics", "inverse_dynamics")
#: Options that select a range, which ``--at`` replaces.
_RANGE = ("samples", "start", "stop", "through")


def analysis(
    example: str, options: str, required: str = "scene", **options_of: Any
) -> Callable[[Callable[[typer.Context], None]], Callable[..., None]]:
    """Register a command, with an example in its help and options by the arguments that they set.

    ``options`` are names of ``OF_ANALYSES`` or of ``options_of``, which the command declares itself.
    """
    known = {**OF_ANALYSES, **options_of}

    def declared(carry_out: Callable[[typer.Context], None]) -> Callable[..., None]:
        @wraps(carry_out)
        def call(ctx: typer.Context, **values: Any) -> None:
            ctx.params.update(values)  # lists and paths
            carry_out(ctx)

        annotations = {"ctx": typer.Context, **{name: known[name] for name in ("scene", *options.split())}}
        call.__annotations__ = annotations
        vars(call)["__signature__"] = Signature(
            [
                Parameter(
                    name,
                    Parameter.KEYWORD_ONLY,
                    default=Parameter.empty if name in ("ctx", *required.split()) else DEFAULTS.get(name),
                    annotation=annotation,
                )
                for name, annotation in annotations.items()
            ]
        )
        return command(example)(call)

    return declared


def recording(
    build: Callable[..., Any],
    scene: str,
    settings: dict[str, Any],
    of: Sequence[str] | None,
    t_end: float | None = None,
) -> tuple[Any, SceneError | None]:
    """Return what ``build`` makes of a scene, with the outputs ``of``, if any, in place of its own.

    ``t_end`` is the end of its runs that the command gives [s].

    Without those that the scene does not have, such as section forces; the error of the first is returned.
    """
    from symgen.pipeline.user_system import is_user_file

    unknown, names = None, [] if is_user_file(scene) else list(of or ())
    while names:
        try:
            return until(t_end, build, {**settings, "analysis.outputs": names}), unknown
        except SceneError as error:
            unknown, index = unknown or error, re.fullmatch(r"analysis\.outputs\.(\d+)", error.where)
            if not index:
                break
            del names[int(index[1])]
    return until(t_end, build, settings), unknown


class CommandRequest:
    """A command with the options given to it, and the model of its scene.

    Parameters
    ----------
    ctx
        The context of the command.
    build
        Builds the model: ``symgen.pipeline.build.build_selected`` when absent.
    """

    def __init__(self, ctx: typer.Context, build: Callable[..., Any] | None = None) -> None:
        from symgen.pipeline.build import build_selected

        source = ctx.get_parameter_source
        values = {name: value for name, value in ctx.params.items() if source(name).name != "DEFAULT"}  # type: ignore[union-attr]
        self.names = {p.name: p.opts[0] for p in ctx.command.params}
        self.options = {name: value for name, value in values.items() if name not in _COMMON}
        self.types = {name: values[name] for name in _TYPES if name in values}
        self.common = ctx.params
        self.as_json = bool(ctx.params.get("as_json"))
        compiled = {name: values[name] for name in ("backend", *_TYPES) if name in values}
        scene, settings = ctx.params["scene"], changes(ctx.params["set_"])
        of = self.options.get("of") if build is None else None
        made = partial(build or build_selected, scene, **compiled)
        model, self.unknown = recording(made, scene, settings, of, self.options.get("t_end"))
        self.model: Any = model

    def shown(self, names: Iterable[str]) -> str:
        """Return arguments as options of the command line."""
        return ", ".join(str(self.names[name]) for name in names)

    def carry_out(self, verb: str, **more: Any) -> None:
        """Carry out an analysis with its options and ``more``; save, plot and print its result."""
        out, plot, film = (self.common.get(name) for name in ("out", "plot", "film"))
        names, path, over, files = (self.common.get(name) for name in _OF_PLOTS)
        selected = self.shown(name for name in _OF_PLOTS if self.common.get(name))
        if selected and not plot:
            raise ModelError(f"{selected} selects the content of a plot: give --plot FILE")
        if path and (names or over):
            raise ModelError("give --xy, or --plot-of and --over, not both")
        stems = [file.stem for file in files or ()]
        from symgen.runtime.beams.selection import every_output
        from symgen.runtime.model.verbs import accepted

        others = {}
        for file in files or ():
            from symgen.runtime.result.files import load_result

            others[str(file) if stems.count(file.stem) > 1 else file.stem] = load_result(file)
        of, further = self.options.get("of"), verb in _FURTHER
        if self.unknown and not further:
            raise self.unknown
        if of and "of" in accepted(self.model, verb):
            further = False
        else:
            self.options.pop("of", None)
        with saved_on_failure(out), every_output() if of else nullcontext():
            result = self.result(verb, **self.arguments(verb), **more)
        if of and further:
            result = result.selected(of)
        if out:
            result.save(out)
        if plot:
            result.plot(*(names or ()), file=plot, xy=path or "", over=over or "", compare=others)
        # A copy is of no model, and has no means.
        self.show(verb, copy(result) if self.common.get("means") is False else result)
        if film:
            result.animate(film)
        if not self.as_json:
            wrote(out, plot, film)

    def result(self, verb: str, **arguments: Any) -> Any:
        """Return the result of an analysis, with a progress bar if it reports progress.

        Raises
        ------
        CapabilityError
            If the model does not support the analysis.
        ModelError
            If it does not accept an argument; the message names the option.
        """
        from symgen.runtime.model.verbs import accepted

        analysis, title = getattr(self.model, verb), self.model.description.title
        silent = "progress" not in accepted(self.model, verb)
        with nullcontext() if silent else progress_bar(title, self.as_json) as progress:
            arguments |= {} if silent else {"progress": progress}
            try:
                return analysis(**arguments)
            except ArgumentError as error:
                name = error.argument if error.argument in self.options else ""
                raise ModelError(error.named(self.names.get(name, error.argument))) from None
            except OptionsError as error:
                raise ModelError(error.named(lambda name: str(self.names.get(name, name)))) from None

    def arguments(self, verb: str) -> dict[str, Any]:
        """Return the arguments of an analysis from the options given.

        Raises
        ------
        ModelError
            For an option that does not apply to the scene, or values that cannot be read.
        """
        from symgen.runtime.model.verbs import accepted

        getattr(self.model, verb)  # raises the reason if the model does not support it
        row = method_of(self.model).commands[verb]
        known = accepted(self.model, verb) - ({"at"} if not row.values else set())
        refused = [name for name in self.options if name not in known]
        if refused:
            others = [name for name in self.names if name in known]
            raise ModelError(
                f"{self.shown(refused)} does not apply to {verb.replace('_', '-')} of {self.model.name}\n"
                f"  Its options are {self.shown(others) or 'none'}."
            )
        ranged = [name for name in _RANGE if name in self.options and "at" in self.options]
        if ranged:
            raise ModelError(f"give --at or {self.shown(ranged)}, not both")
        arguments = dict(self.options)
        if "checkpoint_every" in arguments and "checkpoint" not in arguments:
            raise ModelError("--checkpoint-every sets an interval: give the file with --checkpoint")
        variables = set()
        for name in ("at", "start", "stop"):
            if name in arguments:
                one, option = isinstance(arguments[name], str), self.names[name]
                values, over = load(row.values)(
                    self.model, [arguments[name]] if one else arguments[name], option
                )
                if one and len(values) > 1:
                    raise ModelError(f"expected one value after {option}, got {arguments[name]!r}")
                arguments[name] = values[0] if one else values
                variables.add(over)
        if len(variables) > 1:
            raise ModelError("give both ends of the range as times, or both as values of the input")
        if variables and "over" in known:
            arguments["over"] = variables.pop()
        if "state" in arguments:
            arguments["state"] = self._assembly(arguments["state"])
        return arguments

    def _assembly(self, number: int) -> Any:
        """Return the state of an assembly mode of a linkage, counted from 1."""
        states = self.model.assemblies()
        if not 1 <= number <= len(states):
            raise ModelError(
                f"expected --state from 1 to {len(states)}, the assembly modes at the start, got {number}"
            )
        return states[number - 1]

    def show(self, verb: str, result: Any) -> None:
        """Print a result as one JSON object, or as tables."""
        if self.as_json:
            from symgen.report.extremes import with_averages

            print_json({"scene": self.model.name, **with_averages(result)})
        else:
            table_of(self.model, verb)(result, self.model, console())
