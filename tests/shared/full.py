"""Repetitions of a check that only ``.ci/run --full`` runs: parameters under the marker ``full``."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import pytest


def full(*values: Any) -> Any:
    """Return a set of parameters under the marker ``full``."""
    return pytest.param(*values, marks=pytest.mark.full)


def full_unless(by_default: Callable[..., bool], sets: Iterable[Any]) -> list[Any]:
    """Return sets of parameters, those under the marker ``full`` for which ``by_default`` is false."""
    made = []
    for each in sets:
        values = each if isinstance(each, tuple) else (each,)
        made.append(each if by_default(*values) else full(*values))
    return made
