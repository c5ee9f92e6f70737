"""Standard streams that are closed, full or in another encoding, full disks, and ends by signals."""

from __future__ import annotations

import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from shared.signals import ended_by

SYMGEN = shlex.join([sys.executable, "-m", "symgen"])
FULL, CLOSED = (f"symgen: cannot write the output: {os.strerror(number)}\n" for number in (28, 9))
MISSING = "run no_such_scene"


def ended(commands: dict[str, str], **options) -> dict[str, tuple[int, str, str]]:
    """Return exit code, standard output and error of shell commands, which run side by side."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    running = {
        name: subprocess.Popen(command, shell=True, text=True, **pipes, **options)
        for name, command in commands.items()
    }
    said = {name: process.communicate() for name, process in running.items()}
    return {name: (process.returncode, *said[name]) for name, process in running.items()}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
def test_codes_and_messages_with_streams_that_cannot_be_written():
    expected = {
        "--version > /dev/full": (1, FULL),
        "--version >&-": (1, CLOSED),
        "run four_bar --t-end 0.01 >&-": (1, CLOSED),
        "--version > /dev/full 2> /dev/full": (1, ""),
        f"{MISSING} 2> /dev/full": (3, ""),
        f"{MISSING} <&- >&- 2>&-": (3, ""),
    }
    done = ended({words: f"{SYMGEN} {words}" for words in expected})
    assert {words: (code, error) for words, (code, _, error) in done.items()} == expected
    code, out, _ = ended({"": f"{SYMGEN} --version <&- 2>&-"})[""]
    assert (code, out.count("\n")) == (0, 1)


def test_characters_that_the_encoding_lacks_are_escaped():
    given = f"{SYMGEN} run four_bar --t-end 0.01 --set 'title=Welle µ 四'"
    for encoding, title in (("ascii", r"Welle \xb5 \u56db"), ("latin-1", r"Welle µ \u56db")):
        process = subprocess.run(
            given, shell=True, capture_output=True, env={**os.environ, "PYTHONIOENCODING": encoding}
        )
        assert (process.returncode, process.stderr) == (0, b"")
        assert process.stdout.decode(encoding).startswith(title)
    process = subprocess.run(
        f"{SYMGEN} run 'Kurbel µ'",
        shell=True,
        capture_output=True,
        env={**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0"},
    )
    assert process.returncode == 3 and b"there is no scene and no file called 'Kurbel" in process.stderr


#: Calls commands one after the other, all but the first with files of at most so many bytes.
LIMITED = """
import resource, sys
from symgen import cli
for number, words in enumerate(sys.argv[1:]):
    sys.argv = ["symgen", *words.split()]
    try:
        cli.main()
    except SystemExit as end:
        print(f"code={end.code}")
    resource.setrlimit(resource.RLIMIT_FSIZE, (2048, 2048))
"""


def test_a_full_disk_has_one_code_and_one_message(tmp_path):
    """The largest size of files acts as a full disk."""
    written = (
        "run four_bar --out run.nc",
        "simulate four_bar --out run.npz",
        "simulate four_bar --checkpoint-every 0 --checkpoint kept",
        "export four_bar --out folder",
        "new own.toml --from thesis_four_bar",
    )
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, "run four_bar", *written],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )
    codes = [line for line in done.stdout.splitlines() if line.startswith("code=")]
    messages = done.stderr.splitlines()
    assert codes == ["code=0", *["code=1"] * len(written)], messages
    assert len(messages) == len(written)
    for message in messages:
        assert message.startswith("symgen: cannot write ") and message.endswith(": File too large")
    assert [*tmp_path.iterdir()] == []


def test_a_signal_ends_the_compiler_and_leaves_nothing_in_the_cache(tmp_path):
    cache, started, compiler = tmp_path / "cache", tmp_path / "started", tmp_path / "cc"
    compiler.write_text(
        f'#!/bin/sh\nfor word; do\nif [ "$word" = -c ]; then echo $$ > {started}; sleep 60; fi\ndone\nexec cc "$@"\n'
    )
    compiler.chmod(0o755)
    command = [sys.executable, "-m", "symgen", "run", "four_bar", "--set", "title=another"]
    command += ["--set", "points.A.at=['0.6 m', '0.9 m']", "--set", "links.crank.mass=1.25 kg"]
    env = {**os.environ, "SYMGEN_CACHE": str(cache), "CC": str(compiler)}
    assert ended_by(signal.SIGTERM, command, started, env=env) == (143, "symgen: ended by SIGTERM\n")
    with pytest.raises(ProcessLookupError):
        os.kill(int(started.read_text()), 0)
    assert [*cache.iterdir()] == []
