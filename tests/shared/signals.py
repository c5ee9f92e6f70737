"""Commands that a signal ends."""

from __future__ import annotations

import signal
import subprocess
import time
from pathlib import Path


def ended_by(number: int, command: list[str], file: Path, **options) -> tuple[int, str]:
    """Return exit code and standard error of a command that a signal meets once a file has content."""
    # Processes in the background of a script ignore SIGINT, and so do those that they start.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        running = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, **options
        )
    finally:
        signal.signal(signal.SIGINT, before)
    try:
        for _ in range(6000):
            if file.exists() and file.stat().st_size:
                break
            time.sleep(0.01)
        running.send_signal(number)
        error = running.communicate(timeout=60)[1]
        return running.returncode, error
    finally:
        running.kill()
        running.wait()
