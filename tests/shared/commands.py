"""Commands called in this process."""

from __future__ import annotations

from typer.testing import CliRunner

from symgen.cli import app

runner = CliRunner()


def call(*arguments):
    done = runner.invoke(app, [*map(str, arguments)], catch_exceptions=True)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return done.stdout
