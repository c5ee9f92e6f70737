"""Standard streams of the command line, closed, full or in other encodings, and its ends by signals."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress
from typing import Any, NoReturn, TextIO

#: Standard streams by number; those that are closed are opened on the null device with these flags. A closed
#: standard output cannot be written, so that the command fails as on a full device.
_STREAMS = (("stdin", os.O_RDONLY), ("stdout", os.O_RDONLY), ("stderr", os.O_WRONLY))
#: Signals that end a command, by name: systems differ in them.
_ENDING = ("SIGTERM", "SIGHUP")


class Ends:
    """Ends of the command by signals: they unwind it as Ctrl-C does, so that nothing is left behind."""

    number = signal.SIGINT

    @classmethod
    def catch(cls) -> None:
        """Unwind the command at signals that would end the process at once."""
        for name in _ENDING:
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, cls._end)

    @classmethod
    def _end(cls, number: int, _: Any) -> NoReturn:
        cls.number = signal.Signals(number)
        raise KeyboardInterrupt

    @classmethod
    def message(cls) -> str:
        """Return the message of the end."""
        return "interrupted" if cls.number == signal.SIGINT else f"ended by {cls.number.name}"


def open_streams() -> None:
    """Open closed standard streams; print characters that the encoding of a stream lacks as escapes."""
    for number, (name, flags) in enumerate(_STREAMS):
        if getattr(sys, name) is None:
            os.dup2(os.open(os.devnull, flags), number)
            setattr(sys, name, open(number, "w" if number else "r", encoding="utf-8", closefd=False))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def discard(stream: TextIO) -> None:
    """Discard what is left in the buffer of a stream that failed, and what follows."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
