"""The loop over the shots of a batch, the same for every engine."""

from __future__ import annotations

from typing import Any

from billiards_env.engine.log import Log
from billiards_env.engine.measures import END, START
from billiards_env.engine.shots import Shots, load_shot, store
from billiards_env.jit import inlined
from billiards_env.jit.interrupt import interrupted
from billiards_env.physics.state import scene_of

INTERRUPTED = -1
"""Returned when Ctrl-C stopped a shot (see `jit.interrupt`); its results are undefined."""

LOOK_AFTER = 20_000
"""Amount of work after which a loop calls `interrupted`: about ten milliseconds. The unit is one event of PIC."""


def for_all_shots(run: Any) -> Any:
    """Returns the kernel that runs shots one after the other.

    Args:
        run: A kernel that runs one shot and returns its amount of work, in the unit of `LOOK_AFTER`, or INTERRUPTED.
    """

    @inlined
    def run_all(ks, kernels, scene, work, limit, max_events, shots, log):  # out: work, shots, log
        """Runs the shots of the range `ks`. Returns whether it was interrupted.

        `kernels` are those of the engine. `scene`, `shots` and `log` are the fields of `SceneArrays`, `Shots` and
        `Log`, as plain tuples.
        """
        shots, log = Shots(*shots), Log(*log)
        pending = 0
        for k in ks:
            arrays = scene_of(kernels.scene, scene, k)
            load_shot(k, shots, arrays, work.state)
            work.record(START, -1, -1, k, arrays, work.state, shots)
            spent = run(k, kernels, arrays, work, limit, max_events, shots, log)
            if spent == INTERRUPTED:
                return True
            work.record(END, -1, -1, k, arrays, work.state, shots)
            store(k, shots, arrays, work.state)
            pending += spent + len(arrays.radius)
            if pending > LOOK_AFTER:
                if interrupted():
                    return True
                pending = 0
        return False

    return run_all
