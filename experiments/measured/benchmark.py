"""List the measured machines, and how the twin of each is judged."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from experiments.measured.metric import (
    CENTRED_TIP_RMS,
    JOINTS_MAE,
    MAE,
    RMSE,
    TIP_RMS,
    TORQUE_RMS,
    Metric,
)
from serpent_twin.machines.model import open_machine


@dataclass(frozen=True)
class Benchmark:
    """A machine's data, and how its twin is judged."""

    metric: Metric
    """Measure of its error"""
    splits: tuple[tuple[str, ...], ...]
    """Names of the files held out in each; the first is the one reported"""
    reference: float | None
    """What the authors published, in the metric, or what `reference_by` reached; None if unknown"""
    sketch: float | None
    """What a small simulator or regression with the effects expected here reached; None without any"""
    origin: str
    """Where the original recordings are"""
    reference_by: str = ""
    """What reached the reference, where nothing is published"""
    model: str = ""
    """Name of its MJCF, if that lies with the logs"""
    form: str = "*.parquet"
    """Names of files of its logs"""
    unchanged: str = "*"
    """Names of the files of the machine as it was; any other is of it after something was changed"""


_DOUBLE_PENDULUM = Benchmark(
    JOINTS_MAE,
    (),
    reference=4.7,
    sketch=None,
    origin="github.com/dfki-ric-underactuated-lab/double_pendulum, commit 1e8544e",
    reference_by="a simulation with the authors' friction, of build C.1",
    form="*.csv",
)
BENCHMARKS: Mapping[str, Benchmark] = {
    "xl330": Benchmark(
        MAE,
        (("kp200_*",), ("kp100_*",), ("kp800_*",)),
        reference=1.77,
        sketch=2.45,
        origin="github.com/Rhoban/bam, branch xl330, commit af22604",
    ),
    "jaw": Benchmark(
        RMSE,
        (("tool_*_12.*", "tool_*_30.*", "tool_*_23.*"), ("tool_*_4?.*",)),
        reference=0.37,
        sketch=0.44,
        origin="github.com/MRDLab/mis-tool-characterization, commit 03658b2",
    ),
    "trunk": Benchmark(
        TIP_RMS,
        (("controlled_2.*",), ("controlled_1.*",)),
        reference=9.9,
        sketch=19.2,
        origin="github.com/StanfordASL/trunk-stack, commit 8b4b923",
        reference_by="a cubic map from measured motor angles",
        unchanged="controlled_*",
    ),
    "opencr": Benchmark(
        CENTRED_TIP_RMS,
        (("rep1_pair23_*",), ("rep1_pair12_*",), ("rep1_pair13_*",)),
        reference=7.7,
        sketch=7.0,
        origin="github.com/ContinuumRoboticsLab/opencr-mujoco, commit 17fff8b",
        reference_by="the authors' own fit of three segments' pretension, on the poses that it was fitted to",
        model="v4.xml",
        form="*.csv",
    ),
    "staubli_tx40": Benchmark(
        TORQUE_RMS,
        (),
        reference=2.92,
        sketch=9.9,
        origin="github.com/thanhndv212/figaroh-examples, commit c0b5c7f",
        reference_by="the authors' friction and rotor inertias on their model",
        form="*.csv",
    ),
    "kuka_kr300": Benchmark(
        TORQUE_RMS,
        (("test.parquet",),),
        reference=None,
        sketch=None,
        origin="nonlinearbenchmark.org, Industrial robot, DOI 10.26204/DATA/5",
    ),
    "dfki_double_pendulum_a": replace(_DOUBLE_PENDULUM, splits=(("A0_01.csv",),)),
    "dfki_double_pendulum_c": replace(_DOUBLE_PENDULUM, splits=(("C0_01.csv", "C0_03.csv"),)),
    "dfki_simple_pendulum": Benchmark(
        MAE,
        (("energy_shaping_1kg*",), ("energy_shaping_0.5kg*",)),
        reference=None,
        sketch=None,
        origin="github.com/dfki-ric-underactuated-lab/torque_limited_simple_pendulum, commit ed17ea2",
        form="*.csv",
    ),
    "go2": Benchmark(
        JOINTS_MAE,
        (),
        reference=None,
        sketch=None,
        origin="github.com/iit-DLSLab/sim2real-robot-identification, commit 06739ea",
        form="*.csv",
    ),
}


def rig_of(name: str, data: Path) -> Any:
    """A machine that a folder of its name here describes; a folder of its name in the data has its logs."""
    described, model = Path(__file__).parent / name / "machine.toml", BENCHMARKS[name].model
    return open_machine(described, data / name / model if model else None)
