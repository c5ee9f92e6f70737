"""A loop whose first joint a motor moves under a controller, stated by ``[states]``."""

from __future__ import annotations

import tomllib

import symgen
from symgen.scene.loading import shipped_scene

#: Constants of a motor (current i) under a controller with an integral (z), which a voltage limits; angle at rest.
KP, KI, LIMIT, R, L, KE, KM, TARGET = 14.0, 6.0, 24.0, 1.6, 0.08, 0.7, 0.9, 2.2
START = 0.3


def servo(voltage="min(limit, max(-limit, kp*(target - theta1) + ki*z))"):
    written = tomllib.loads(shipped_scene("cssp"))
    written["parameters"] |= {
        "kp": str(KP),
        "ki": f"{KI} Hz",
        "limit": str(LIMIT),
        "R": {"value": str(R), "tunable": True},
        "L": f"{L} s",
        "Ke": f"{KE} s",
        "Km": f"{KM} N*m",
        "target": {"value": str(TARGET), "tunable": True},
    }
    written["states"] = {
        "i": {"start": START, "rate": f"({voltage} - R*i - Ke*theta1.rate)/L", "about": "current"},
        "z": {"start": "0 s", "rate": "target - theta1"},
    }
    drives = written["loop"]["drives"]
    drives["theta1"] = f"{drives['theta1']} + Km*i"
    written["analysis"]["outputs"] = [
        "theta1",
        "S1",
        "S4",
        "i",
        "i.rate",
        "i.integral",
        "z",
        "theta1.power",
        "power",
    ]
    return symgen.Scene(**written).called("servo")
