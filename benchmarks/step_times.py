"""Measure the processor time of a residual and of a derivative of one machine, by the package on the path.

It is run as a script, so that it measures the code of any checkout: step_times.py LOGS [MACHINE.toml].
"""

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from serpent_twin import machines
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.machines.machine import ParameterVector

SESSIONS, VECTORS = 1, 4


def processor_time(of: Callable[[], object]) -> float:
    """Processor time of a call [s], all threads together; a first call is not measured."""
    of()
    began = time.process_time()
    of()
    return time.process_time() - began


def main(logs: Path, machine: Path | None) -> None:
    """Print the times as JSON."""
    rig = machines.find(machines.named("arm", machine))
    sessions = rig.read(logs)[:SESSIONS]
    case = rig.open(sessions)
    pieces, start = case.pieces(sessions), ParameterVector.nominal(case.declared)
    rng = np.random.default_rng(0)
    near = [ParameterVector(0.01 * rng.standard_normal(len(case.declared))) for _ in range(VECTORS)]
    free, most = free_parameters(case, ()), case.segments[1]
    times = {
        "residual": processor_time(lambda: case.residual(near, pieces)),
        "derivative": processor_time(lambda: fit(case, pieces, start, free, 1, most, steps=0)),
    }
    print(json.dumps(times))


if __name__ == "__main__":
    with threadpool_limits(1, "blas"):
        main(Path(sys.argv[1]), Path(sys.argv[2]) if sys.argv[2:] else None)
