"""The command line: parses arguments and calls the Python API."""

from __future__ import annotations

import atexit
import errno
import gc
import inspect
import logging
import re
import sys
import warnings
from copy import copy
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.models import CommandInfo

from symgen.cli import common
from symgen.cli.common import FAULT, INTERRUPTED, RUN, SCENE, USAGE, tell
from symgen.cli.streams import Ends, discard, open_streams
from symgen.errors import (
    COMPILE_AGAIN,
    ArgumentError,
    BuildError,
    CacheError,
    DerivationError,
    GenerationError,
    InitialStateError,
    OptionsError,
    OutputError,
    SceneError,
    SimulationError,
    StaleBinaryError,
    SymgenError,
)

#: The commands in the order of --help: their group, the module that declares them, and their names.
_COMMANDS = (
    ("Analyses", "analyses", "run simulate kinematics inverse_dynamics equilibrium modes linearise"),
    ("Analyses", "analyses", "sensitivity assemblies"),
    ("Elastic links", "analyses", "periodic quasi_static large_rotation speed_response"),
    ("Scenes", "inspection", "new scenes units schema"),
    ("Scenes", "design", "sweep"),
    ("Scenes", "optimising", "optimise"),
    ("Scenes", "design", "synthesise"),
    ("Pages and drawings", "reporting", "report animate live draw"),
    ("Equations", "inspection", "show explain diff"),
    ("Kernels", "build", "build generate"),
    ("Kernels", "exporting", "export"),
    ("Checks", "accuracy", "accuracy"),
    ("Checks", "bench", "bench"),
)
_GROUP_OF = {name: group for group, _, names in _COMMANDS for name in names.split()}
_MODULE_OF = {name: module for _, module, names in _COMMANDS for name in names.split()}


def _name(command: CommandInfo) -> str:
    """Return the name of a command's function."""
    return getattr(command.callback, "__name__", "")


def _loaded(*modules: str) -> typer.Typer:
    """Return the application with the commands that these modules declare, in their order and groups."""
    for module in modules:
        import_module(f"symgen.cli.{module}")
    commands = common.app.registered_commands
    commands.sort(key=lambda command: [*_GROUP_OF].index(_name(command)))
    for command in commands:
        command.rich_help_panel = _GROUP_OF[_name(command)]
        # Typer keeps line breaks within the paragraphs of help.
        command.help = re.sub(r"(?<!\n)\n(?!\n)", " ", inspect.cleandoc(command.callback.__doc__ or ""))
    return common.app


def __getattr__(name: str) -> Any:
    """Return the whole application, ``app``; a command alone is loaded without the others."""
    if name != "app":
        raise AttributeError(f"module 'symgen.cli' has no attribute {name!r}")
    return globals().setdefault(name, _loaded(*_MODULE_OF.values()))


#: Exit codes of errors, which their subclasses share; that of all others is 2, wrong usage.
_EXIT_CODES: dict[type[SymgenError], int] = {
    SceneError: SCENE,
    InitialStateError: SCENE,
    DerivationError: SCENE,
    SimulationError: RUN,
    OutputError: FAULT,
    GenerationError: FAULT,
    BuildError: FAULT,
    CacheError: FAULT,
    StaleBinaryError: FAULT,
}

#: Modules that the installation compiles: after an update, they may be missing, or lack a name.
_COMPILED = "symgen._cython", "symgen.runtime._"
#: Errors of standard output: a full device, an exhausted quota, a closed stream.
_UNWRITABLE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)


def main() -> None:
    """Run the command line: every error becomes one message and an exit code."""
    gc.disable()  # a short process: garbage collection would only delay its start and its end
    atexit.register(gc.freeze)
    open_streams()
    Ends.catch()
    warnings.showwarning = lambda message, *_, **__: tell(str(message))
    if sys.stderr.isatty():
        logger = logging.getLogger("symgen")
        logger.addHandler(_Progress())
        logger.setLevel(logging.INFO)
    raise SystemExit(_ended())


class _Progress(logging.Handler):
    """Prints what takes time, such as a first build, where somebody waits for it."""

    def emit(self, record: logging.LogRecord) -> None:
        tell(record.getMessage())


def _ended() -> int:
    """Return the exit code of the command line."""
    try:
        try:
            code: int | None = _only(sys.argv[1:2])(standalone_mode=False)
        finally:
            sys.stdout.flush()  # report a full device here rather than after the exit
        if code == INTERRUPTED:  # newer versions of Typer catch Ctrl-C
            raise KeyboardInterrupt
        return code or 0
    except _WrongUsage as error:
        return _failed(_usage(error), USAGE)
    except ArgumentError as error:
        return _failed(error.named(_option(error.argument)), USAGE)
    except OptionsError as error:
        return _failed(error.named(_option), USAGE)
    except SymgenError as error:
        return _failed(
            str(error), next((_EXIT_CODES[c] for c in type(error).__mro__ if c in _EXIT_CODES), USAGE)
        )
    except typer.Abort as error:
        if isinstance(error.__cause__, EOFError):  # Typer takes it for the end of an input
            raise error.__cause__ from None
        return _failed(Ends.message(), 128 + Ends.number)
    except KeyboardInterrupt:
        return _failed(Ends.message(), 128 + Ends.number)
    except ImportError as error:
        if not (error.name or "").startswith(_COMPILED):
            raise
        return _failed(f"{error}\n{COMPILE_AGAIN}", FAULT)
    except BrokenPipeError:
        discard(sys.stdout)
        return FAULT
    except OSError as error:
        if error.errno not in _UNWRITABLE:
            raise
        discard(sys.stdout)
        return _failed(str(OutputError.of("the output", error)), FAULT)


#: The class of usage errors; Typer has it under different names in its versions.
_WrongUsage: type[Exception] = typer.BadParameter.__mro__[1]


def _failed(message: str, code: int) -> int:
    """Print an error and return its exit code."""
    if message:
        tell(message)
    return code


def _usage(error: Any) -> str:
    """Return the message of a usage error, with the command that has options that ``run`` lacks."""
    message = _of_value(error) or error.format_message()
    ctx = error.ctx
    of_run = ctx is not None and ctx.info_name == "run"
    if of_run and message.startswith("No such"):
        return f"{message}\n  Analyses have commands of their own: 'symgen simulate SCENE'."
    if message.startswith("No such option: --t-end") and any("--to" in p.opts for p in ctx.command.params):
        return (
            'No such option: --t-end\n  The end of the range is --to, such as --to "0.5 s" or --to "90 deg".'
        )
    command = ctx.command_path if ctx else "symgen"
    return f"{message}\n  See '{command} --help'." if message else ""


#: Expected values by the beginning of the name that Pydantic gives an error.
_EXPECTED = {"int": "a whole number", "float": "a number", "bool": "true or false"}


def _of_value(error: Any) -> str:
    """Return the message of an option whose value Typer could not convert; empty for other errors."""
    errors = getattr(error.__cause__, "errors", None)
    if errors is None:
        return ""
    wrong = errors()[0]
    expected = _EXPECTED.get(wrong["type"].partition("_")[0])
    return f"expected {expected} after {error.param.opts[0]}, got {wrong['input']!r}" if expected else ""


def _option(argument: str) -> str:
    """Return the command-line option of an argument, or the argument's name if no option was given."""
    option = f"--{argument.replace('_', '-')}"
    is_present = any(word.partition("=")[0] == option for word in sys.argv)
    return option if is_present else argument


def _only(word: list[str]) -> typer.Typer:
    """Return only the command that is named, if any: Typer is slow for many options."""
    named = [name for name in _MODULE_OF if [name.replace("_", "-")] == word]
    if not named:
        return _loaded(*_MODULE_OF.values())
    alone = copy(_loaded(_MODULE_OF[named[0]]))
    alone.registered_commands = [c for c in alone.registered_commands if _name(c) in named]
    alone.registered_groups = []
    return alone


@common.app.callback(invoke_without_command=True)
def _version(
    ctx: typer.Context, version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False
) -> None:
    if version:
        from symgen.version import __version__

        print(__version__)
        raise typer.Exit
