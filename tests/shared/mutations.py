"""Scene files with faults put into them, and the required outcome of each: a scene or a named error."""

from __future__ import annotations

import builtins
import json
import os
import re
import signal
import sys
import time
import tomllib
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from pathlib import Path

from hypothesis import strategies as st

import symgen
from symgen.errors import SlowBackendWarning, SlowRunWarning, SymgenError
from symgen.pipeline.build import is_kinematic
from symgen.pipeline.systems import system_of
from symgen.runtime.elastic.model import ElasticModel
from symgen.runtime.loop.model import LoopModel
from symgen.scene.loading import SHIPPED, check_scene, read_scene
from symgen.scene.resolve import resolve

#: Seconds after which a call counts as hanging.
PATIENCE = 5.0
#: Wall time [s] that runs are limited to, and an allowance on a busy machine for
#: deriving the equations of elastic links and computing results.
LIMIT, OVER = 0.5, 4.0
#: Of valid scenes, one in this number is derived, and one in this number is built, assembled and run.
DERIVED, BUILT = 4, 16
#: A function that expressions try to call: whatever calls it has run code of a scene.
CANARY = "symgen_canary"

ORIGINALS = tuple(path.read_text(encoding="utf-8") for path in sorted(SHIPPED.glob("*.toml")))

HOSTILE = (
    f"{CANARY}()", f"__import__('os').system('{CANARY}')", f"__import__('builtins').{CANARY}()",
    f"(lambda: {CANARY}())()", f"[{CANARY}() for x in (1,)]", f"exec('{CANARY}()')", f"eval('{CANARY}()')",
    f"open('{CANARY}', 'w')", "().__class__.__base__.__subclasses__()", f"t.__class__.{CANARY}()",
    f"{{{{{CANARY}()}}}}", f"{{% include '{CANARY}' %}}", f"sin({CANARY}())", f"{CANARY} if 1 else 2",
    f"*/ {CANARY}(); /*", f'"""\n{CANARY}()\n"""', f"1 m; {CANARY}()", f"f'{{{CANARY}()}}'", f"../../{CANARY}",
    f"/tmp/{CANARY}", f"$({CANARY})", f"x := {CANARY}()", f"\\N{{DIGIT ONE}} {CANARY}()", "print", "t.free_symbols",
    "9**9**9**9", "2**10**9", "(" * 200 + "t" + ")" * 200, "-" * 500 + "1", "1" * 5000, "t" * 3000, "t+" * 900 + "t",
    "sin(" * 50 + "t" + ")" * 50, "((t+1)**16+1)**16", "exp(exp(exp(9)))", "sqrt(-1)", "0/0", "1/t", "log(0)", "1e999",
    "1 m^1000", "1 m^(1/0)", "1 kg^9**9**9", "m**m", "1 m m m", "nan m", "inf m", "-0.0 m", "1e-320 m", "1_0 m",
    "0x10 m", "1,5 m", "１ m", "1 μm", "1 °", "1 Ω", "5 furlong", "-459.67 degF", "1 dB", "300 rpm*s", "1 m/", "\x00",
    "\ud7ff", "\U0001f527 m", "é", "ﬁ", "a\u0301 m", "\u202e1 m", "\r\n", "A.position", "A.x", "rho.rho", "?", "",
    " ", "t", "pi", "nan", "inf", "True", "None", "...", "@", "1 if t else 2", "a[0]", "'text'", "1j m", "~1", "a and b",
)  # fmt: skip
NUMBERS = (
    0, 1, -1, 2, 3, 7, 1000, 10**6, 2**63 - 1, -(2**63), 0.0, -0.0, 0.5, 1e-320, 1e308, -1e308, float("nan"),
    float("inf"), float("-inf"), 10**400,
)  # fmt: skip
QUANTITIES = (
    "0 m", "-1 m", "1 m", "1e300 m", "1e-300 m", "2 cm", "1 kg", "0 kg", "-1 kg", "1e200 kg", "1 rad", "0 deg", "90 deg",
    "1e20 deg", "1 s", "-1 s", "0 s", "1 N", "1 N*m", "1 m/s", "1 m/s^2", "60 rpm", "0 rpm", "1 kg*m^2", "1 kg/m", "1 Pa",
    "1e-200 Pa", "1 N/m", "1 N*s/m", "t", "t*t", "omega*t", "1/(1 - t)", "sin(1 rad)", "1 in", "1 lbf", "1 ft*lbf", "1 /s",
)  # fmt: skip


def places(data: object, path: tuple = ()) -> Iterator[tuple]:
    """Walk to every value of a scene."""
    inner = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in inner:
        yield (*path, key)
        yield from places(value, (*path, key))


def _words(data: dict) -> list:
    """Return all keys and texts of a scene, which are likely faults in other places."""
    keys = {str(part) for path in places(data) for part in path if isinstance(part, str)}
    return sorted(keys)


def _table(data: dict, path: tuple) -> object:
    table: object = data
    for part in path:
        table = table[part]  # type: ignore[index]
    return table


def _toml(value: object) -> str:
    """Write a value as TOML; most values have the same form in JSON."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_toml(str(k))} = {_toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return str(value).lower() if isinstance(value, bool | float) else str(value)


def _deep(levels: int) -> object:
    value: object = "1 m"
    for i in range(levels):
        value = {"at": value} if i % 2 else [value]
    return value


def _values(data: dict) -> st.SearchStrategy:
    found = [_table(data, p) for p in places(data)]
    return st.one_of(
        st.sampled_from(QUANTITIES),
        st.sampled_from(_words(data)),
        st.sampled_from(found),
        st.sampled_from(HOSTILE),
        st.sampled_from(NUMBERS),
        st.sampled_from(
            (True, False, [], {}, [[]], {"at": {}}, ["0 m"], ["0 m"] * 2, ["1 m"] * 3, ["O"] * 5000)
        ),
        st.integers(1, 60).map(_deep),
        st.text(max_size=12),
        st.floats(allow_nan=False).map(lambda x: f"{x!r} m"),
    ).map(deepcopy)


def _mutate(draw: st.DrawFn, data: dict) -> None:
    path = draw(st.sampled_from(list(places(data)) or [("symgen",)]))
    table, key = _table(data, path[:-1]), path[-1]
    kind = draw(
        st.sampled_from(("value", "value", "value", "drop", "rename", "copy", "move", "scale", "add"))
    )
    if key not in table and isinstance(table, dict):
        kind = "value"
    if kind == "drop":
        del table[key]
    elif kind == "rename" and isinstance(table, dict):
        name = draw(st.one_of(st.sampled_from(_words(data)), st.sampled_from(HOSTILE), st.text(max_size=6)))
        table[name] = table.pop(key)
    elif kind == "copy" and isinstance(table, list):
        table.insert(key, deepcopy(table[key]))
    elif kind in ("copy", "add") and isinstance(table, dict):
        table[draw(st.sampled_from(_words(data)))] = (
            deepcopy(table[key]) if kind == "copy" else draw(_values(data))
        )
    elif kind == "move":
        other = draw(st.sampled_from(list(places(data))))
        value = deepcopy(table[key])
        there = _table(data, other[:-1])
        there[other[-1]] = value
    elif kind == "scale" and isinstance(table[key], str):
        factor = draw(st.sampled_from(("-", "0", "1e3", "1e-9", "1e150", "7")))
        table[key] = re.sub(r"^[-+]?[\d.]+", lambda m: f"-{m[0]}" if factor == "-" else factor, table[key])
    else:
        table[key] = draw(_values(data))


@st.composite
def scene_files(draw: st.DrawFn) -> bytes:
    """Give the bytes of a shipped scene with one to four faults, of meaning or of writing."""
    original = draw(st.sampled_from(ORIGINALS))
    if draw(st.integers(0, 9)):
        data = tomllib.loads(original)
        for _ in range(draw(st.sampled_from((1, 1, 1, 1, 2, 3, 4)))):
            _mutate(draw, data)
        return "".join(f"{_toml(str(k))} = {_toml(v)}\n" for k, v in data.items()).encode(
            "utf-8", "surrogatepass"
        )
    text = original.encode()
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(text)))
        length = draw(st.integers(0, 40))
        text = (
            text[:at]
            + draw(st.binary(max_size=8) | st.sampled_from([h.encode() for h in HOSTILE]))
            + text[at + length :]
        )
    return text


class Hang(BaseException):
    """Something took too long."""


class Forbidden(BaseException):
    """A scene ran code, or wrote where it must not."""


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Raise Hang where the block takes longer."""

    def stop(*_: object) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, stop)
    # Repeatedly, since callbacks from C suppress exceptions raised in them.
    signal.setitimer(signal.ITIMER_REAL, seconds, 0.1)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_CHANGES = (
    "os.remove",
    "os.rename",
    "os.rmdir",
    "os.mkdir",
    "os.link",
    "os.symlink",
    "os.truncate",
    "os.chmod",
)
_PROCESSES = (
    "os.system",
    "os.exec",
    "os.fork",
    "os.posix_spawn",
    "os.spawn",
    "subprocess.Popen",
    "socket.connect",
)
_watched: list[Path] = []
_seen: list[str] = []


def _watch(event: str, arguments: tuple) -> None:
    if not _watched:
        return
    writes = event == "open" and isinstance(arguments[2], int) and arguments[2] & _WRITES
    if event in _PROCESSES:
        _seen.append(f"{event}{arguments}")
    elif writes or event in _CHANGES:
        path = arguments[0]
        path = Path(os.fsdecode(path)) if isinstance(path, str | bytes | os.PathLike) else Path("/dev/null")
        if path.resolve() != Path("/dev/null") and not path.resolve().is_relative_to(_watched[0]):
            _seen.append(f"{event}{arguments}")


sys.addaudithook(_watch)


@contextmanager
def watched(cache: Path) -> Iterator[None]:
    """Raise Forbidden where a process is started, code of a scene runs, or a file outside the cache is written."""
    setattr(builtins, CANARY, lambda *_: _seen.append("code of the scene"))
    _seen.clear()
    _watched.append(cache.resolve())
    try:
        yield
    finally:
        _watched.clear()
        delattr(builtins, CANARY)
    if _seen:
        raise Forbidden(_seen[0])


_UNCLEAN = re.compile(r"Traceback|<[\w. ]+ object at 0x|[\x00-\x09\x0b-\x1f\x7f\ud800-\udfff]")
_LONGEST = 3000


def check_message(text: str) -> None:
    """Raise AssertionError if an error's text is empty, too long, or not readable."""
    assert text.strip(), "an error without words"
    assert not (found := _UNCLEAN.search(text)), f"an error with {found[0]!r} in it"
    assert len(text) <= _LONGEST, f"an error of {len(text)} characters"


def depth(content: bytes) -> int:
    """Return the last stage tested of a valid scene: 0 resolved, 1 derived, 2 built; repeatable."""
    lot = zlib.crc32(content)
    return 2 if lot % BUILT == 0 else 1 if lot % DERIVED == 0 else 0


def run_within(model: object, limit: float = LIMIT) -> tuple[str, float]:
    """Run a model with a limit of wall time; return the error's class or "", and the wall time [s].

    Raises
    ------
    AssertionError
        If the run exceeds its limit.
    """
    begun, outcome = time.perf_counter(), ""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SlowRunWarning)
            _run(model, limit)
    except SymgenError as error:
        check_message(str(error))
        outcome = type(error).__name__
    wall = time.perf_counter() - begun
    assert wall <= limit + OVER, f"a run took {wall:.1f} s, limited to {limit:g} s"
    return outcome, wall


def _run(model: object, limit: float) -> None:
    if isinstance(model, ElasticModel):
        model.simulate(samples=11, max_wall=limit)
    elif not (isinstance(model, LoopModel) and model.is_driven) and not is_kinematic(model):
        model.simulate(max_wall=limit)


def judge(content: bytes, folder: Path, patience: float = PATIENCE) -> tuple[str, float]:
    """Process a scene file up to its stage (``depth``); return the outcome and the wall time [s] of its run.

    Parameters
    ----------
    content
        The bytes of the file.
    folder
        Where it is written; ``SYMGEN_CACHE`` is a folder inside.
    patience
        Limit of the time [s].
    """
    path = folder / "scene.toml"
    path.write_bytes(content)
    goes = depth(content)
    try:
        with warnings.catch_warnings(), within(patience), watched(folder / "cache"):
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", SlowBackendWarning)
            warnings.simplefilter("ignore", DeprecationWarning)
            resolved = resolve(check_scene(read_scene(path)))
            if goes == 1:
                system_of(resolved)
            model = symgen.build(path, backend="numpy") if goes == 2 else None
    except SymgenError as error:
        check_message(str(error))
        return type(error).__name__, 0.0
    outcome, wall = ("", 0.0) if model is None else run_within(model)
    return outcome or ("resolved", "derived", "built")[goes], wall


def warm_up() -> None:
    """Load all that scenes and runs need, so that no scene's time or files are those of imports."""
    for name in ("four_bar", "rssr", "tumbling_body"):
        run_within(symgen.build(name, backend="numpy"), 60.0)
    symgen.build("elastic_four_bar", backend="numpy").simulate(samples=2, rtol=0.5)
