"""Signals that arrive while a compiler is started."""

from __future__ import annotations

import os
import signal
import subprocess
from contextlib import ExitStack

import pytest

from symgen.toolchain import compiler


class Ended(BaseException):
    pass


def test_a_signal_at_the_start_of_a_compiler_ends_it(monkeypatch):
    """The handler raises before the compiler is known to what ends it, unless signals wait."""
    started = []
    popen = subprocess.Popen

    def interrupted(*arguments, **options):
        started.append(popen(*arguments, **options))
        os.kill(os.getpid(), signal.SIGTERM)
        return started[0]

    def end(*_):
        raise Ended

    before = signal.signal(signal.SIGTERM, end)
    monkeypatch.setattr(compiler.subprocess, "Popen", interrupted)
    try:
        with pytest.raises(Ended), ExitStack() as opened:
            compiler.started(["sleep", "60"], opened)
        assert started[0].wait(10) == -signal.SIGKILL
    finally:
        signal.signal(signal.SIGTERM, before)
        started[0].kill()
