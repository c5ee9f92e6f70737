"""Types of a loop that moves; see ``_loop_motion.pyx`` for what things do."""

from symgen.runtime._loop import LoopEquations

class MovingLoop(LoopEquations): ...
