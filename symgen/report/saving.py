"""What the constants of a scene save: its operations beside those of the same model in general."""

from __future__ import annotations

from collections.abc import Iterator

from symgen.lowering.program import lower_system
from symgen.symbolic.system import System


def saving_lines(system: System, general: System, what: str) -> Iterator[str]:
    """Yield the operations of every kernel, with what they would be in general, and their sum."""
    own, other = ({k.name: k.counts.flops for k in lower_system(s).kernels} for s in (system, general))
    total, whole = sum(own.values()), sum(other.values())
    times = f" ({whole / total:.1f} times)" if total else ""
    yield f"{system.name}: {total} operations; with {what} {whole}{times}"
    width = max(map(len, own))
    for name, count in own.items():
        yield f"  {name:{width}}  {count:5}; {other[name]:5}"
