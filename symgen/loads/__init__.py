"""The loads of a linkage, one file each; a new one is a file and a line in ``LOADS``."""

from __future__ import annotations

from symgen.loads.actuator import LineForce
from symgen.loads.bearing import BearingFriction
from symgen.loads.bushing import ElasticBushing
from symgen.loads.distributed_force import DistributedLoad
from symgen.loads.force import AppliedForce
from symgen.loads.load import Load
from symgen.loads.output import SceneOutput
from symgen.loads.spring import LinearSpring
from symgen.loads.torque import AppliedTorque
from symgen.loads.torsion_spring import AngularSpring
from symgen.registry import Registry

#: Load kinds by the table of the scene that holds them, in the order in which their terms are derived.
LOADS = Registry[type[Load]](
    {
        "springs": LinearSpring,
        "actuators": LineForce,
        "forces": AppliedForce,
        "distributed_forces": DistributedLoad,
        "torques": AppliedTorque,
        "torsion_springs": AngularSpring,
        "bushings": ElasticBushing,
        "bearings": BearingFriction,
        "outputs": SceneOutput,
    }
)
