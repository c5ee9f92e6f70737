"""The command line: parses arguments and calls the Python API."""

from __future__ import annotations

import atexit
import errno
import gc
import os
import sys
import warnings
from copy import copy
from typing import Annotated

import typer

from symgen.cli import (
    accuracy,
    analyses,
    benching,
    comparing,
    exporting,
    inspection,
    making,
    reporting,
    running,
    stability,
    sweeping,
)
from symgen.cli.common import app
from symgen.errors import ArgumentError, SymgenError

__all__ = [
    "accuracy",
    "analyses",
    "app",
    "benching",
    "comparing",
    "exporting",
    "inspection",
    "main",
    "making",
    "reporting",
    "running",
    "stability",
    "sweeping",
]

#: The commands in the order of --help: a mechanism, its equations, analyses, measurements.
_ORDER = ["run", "scenes", "schema", "build", "show", "explain", "report", "export", "generate", "diff"]
_ORDER += ["kinematics", "equilibrium", "modes", "forces", "sweep", "bench", "accuracy", "stability"]
app.registered_commands.sort(key=lambda command: _ORDER.index(getattr(command.callback, "__name__", "")))


#: Errors of a full device or an exhausted quota.
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


def main() -> None:
    """Run the command line: every SymgenError becomes one message and an exit code."""
    gc.disable()  # a short process: garbage collection would only delay its start and its end
    atexit.register(gc.freeze)
    warnings.showwarning = lambda message, *_, **__: print(f"symgen: {message}", file=sys.stderr)
    try:
        try:
            _only(sys.argv[1:2])()
        finally:
            sys.stdout.flush()  # report a full device here rather than after the exit
    except ArgumentError as error:
        print(f"symgen: {error.named(_option(error.argument))}", file=sys.stderr)
        raise SystemExit(2) from None
    except SymgenError as error:
        print(f"symgen: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        print("symgen: interrupted", file=sys.stderr)
        raise SystemExit(130) from None
    except BrokenPipeError:
        sys.stderr.close()
        raise SystemExit(1) from None
    except OSError as error:
        if error.errno not in _FULL:
            raise
        print(f"symgen: cannot write the output: {error.strerror}", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # discard the rest of the buffer
        raise SystemExit(1) from None


def _option(argument: str) -> str:
    """Return the command-line option of an argument, or the argument's name if no option was given."""
    option = "--every" if argument == "checkpoint_every" else f"--{argument.replace('_', '-')}"
    given = any(word.partition("=")[0] == option for word in sys.argv)
    return option if given else argument


def _only(word: list[str]) -> typer.Typer:
    """Return only the command that is named, if any: Typer is slow for many options."""
    named = [c for c in app.registered_commands if c.callback and [c.callback.__name__] == word]
    if not named:
        return app
    alone = copy(app)
    alone.registered_commands, alone.registered_groups = named, []
    return alone


@app.callback(invoke_without_command=True)
def _version(
    ctx: typer.Context, version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False
) -> None:
    if version:
        from symgen.version import __version__

        print(__version__)
        raise typer.Exit
