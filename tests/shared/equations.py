"""Matrices that a name or the number of an equation stands for."""

from __future__ import annotations

from symgen.pipeline.subject import Subject
from symgen.symbolic.system import NamedMatrix


def found(subject: Subject, name: str) -> list[NamedMatrix]:
    return [m for chosen in subject.found(name) for m in chosen.matrices]
