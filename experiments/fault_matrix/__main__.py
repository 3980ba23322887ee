"""Test whether a collection over the wire loses, repeats or falsifies rows when the bus fails.

Each fault runs through the whole loop: a device on a pseudo-terminal that fails by name and rate, and
`python -m serpent_twin.collect --backend real` against it, in real time. The device's transcript says
what the motors really did; every logged row is compared with it word for word. A second run of each
fault is killed with kill -9, to see when the motors rest and which rows survive.
"""

import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from tqdm import tqdm

from experiments.result_page import publish, store
from serpent_twin.arm.control import joint_p_control, random_targets
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.command_line import cli
from serpent_twin.command_line.options import Checked, RateHz, Seed
from serpent_twin.emulator.child import Running, running
from serpent_twin.emulator.simulated_bus import SimulatedBus
from serpent_twin.emulator.verify import Event, check_rows, read_transcript
from serpent_twin.errors import SerpentError
from serpent_twin.hardware.dynamixel import DynamixelBus
from serpent_twin.hardware.dynamixel.setup import ArmSetup, write_setup
from serpent_twin.sessions import read_journal, read_session, recover
from serpent_twin.stored import within

FAULTS = {
    "none": (),
    "crc": ("crc=0.005",),
    "drop": ("drop=0.005",),
    "truncate": ("truncate=0.005",),
    "garbage": ("garbage=0.005",),
    "late": ("late=0.005/0.06",),
    "very_late": ("late=0.005/0.15",),
    "deaf": ("deaf=0.01",),
    "all_of_the_wire": tuple(f"{n}=0.002" for n in ("crc", "drop", "truncate", "garbage", "late")),
    "missing_for_a_moment": ("missing=0.01/0.3",),
    "watchdog": ("watchdog=0.02",),
    "reboot": ("reboot=0.004",),
    "unplug": ("unplug=0.004/0.5",),
    "missing": (),
    "overload": (),
    "voltage": (),
}
ENDS = {"missing": 4, "overload": 3, "voltage": 7}
"""Faults that nobody can overcome, and the motor that they strike once, late in the run: it must end
with a sentence that names motor and cause."""
STRIKE = 0.8  # of the cycles
AIM_STOP_S = 0.5
BYTES_MS = (24 + 10 * 38 + 64) * 10 / 1e3
"""Read request, ten answers and a command on the wire: 10 bits a byte at 1 MBd."""
REST = 1  # [words] a driven motor that turns no faster is at rest


@dataclass(frozen=True)
class FaultMatrix(Checked):
    """Run each fault through the whole collect loop over the wire, and check every row."""

    out: Path = Path("fault_matrix")
    """Folder for results.json and the runs; must not hold an earlier matrix."""
    cycles: Annotated[int, within(10, 10_000_000)] = 500
    """Control cycles of each fault."""
    rate_hz: RateHz = 50.0
    """Control cycles per second, in real time."""
    faults: tuple[str, ...] = tuple(FAULTS)
    """Which faults."""
    seed: Seed = 0
    """Seed of targets and faults."""
    page: Path | None = None
    """Also write the results as a Markdown page, such as docs/results/fault-matrix.md."""


def main(config: FaultMatrix) -> None:  # noqa: D103 tyro would print it above the config's own
    unknown = sorted(set(config.faults) - FAULTS.keys())
    if unknown:
        raise SerpentError(f"no such faults: {', '.join(unknown)}. There are {', '.join(FAULTS)}.")
    if config.out.exists() and any(config.out.iterdir()):
        raise SerpentError(f"{config.out} is not empty. Nothing was changed: choose another --out.")
    config.out.mkdir(parents=True, exist_ok=True)
    table = {}
    for name in tqdm(config.faults, unit="fault", leave=False):
        table[name] = run_fault(config, name)
        tqdm.write(_line(name, table[name]))
    cycle = cycle_times(config.seed)
    for name, figures in cycle.items():
        print(f"cycle {name:24} median {figures['median']:6.2f} ms   p99 {figures['p99']:6.2f} ms")
    settings = {key: getattr(config, key) for key in ("cycles", "rate_hz", "seed")}
    figures = {"faults": table, "cycle_ms": cycle, "settings": settings}
    results = store(config.out / "results.json", "experiments.fault_matrix", figures)
    publish(results, config.page)
    ratio = cycle["over_the_wire_at_1_mbd"]["times_its_bytes"]
    print(f"a cycle at 1 MBd takes {ratio:.2f} × the time of its bytes, {BYTES_MS:.2f} ms")
    print(f"\n{verdict(table)}")


def run_fault(config: FaultMatrix, name: str) -> dict[str, object]:
    """One fault: a run to its end, checked row by row, and a run that is killed."""
    folder = config.out / name
    with _Bench(folder / "run", config, name) as bench:
        process = bench.collect(config.cycles)
        if name in ENDS:
            bench.strike(name, ENDS[name], rows=round(STRIKE * config.cycles), process=process)
        said = process.communicate()[1]
        session = read_session(bench.log)
        counts = bench.device.stop()
    events = bench.transcript()
    checked = check_rows(session, events)
    expected = config.cycles if name not in ENDS else _commands(events)
    with _Bench(folder / "killed", config, name) as bench:
        killed = bench.kill(rows=50)
    stop = killed["stop_s"] if name not in ENDS else _time_to_rest(events, name)
    return {
        "rows": len(session),
        "rows_lost": expected - len(session) + killed["rows_lost"],
        "rows_wrong": checked.wrong + checked.stale,
        "rows_stale": checked.stale,
        "rows_interrupted": checked.interrupted,
        "recoveries": sum(session.metadata["bus"]["recoveries"].values()),
        "recovered": session.metadata["bus"]["recoveries"],
        "stop_s": stop,
        "struck": {fault: counts["faults"].get(fault, 0) for fault in _names(name)},
        "missed_deadlines": session.metadata["loop"]["missed_deadlines"],
        "complete": session.metadata["complete"],
        "ended": session.metadata.get("ended", ""),
        "said": said.splitlines()[-1] if process.returncode else "",
    }


def _names(name: str) -> list[str]:
    return [fault.partition("=")[0] for fault in FAULTS[name]] or [n for n in ENDS if n == name]


class _Bench:
    """A device that fails and a folder for the arm on it."""

    def __init__(self, folder: Path, config: FaultMatrix, name: str) -> None:
        folder.mkdir(parents=True)
        self.folder, self.config = folder, config
        self.log = folder / "logs" / "session_01.parquet"
        faults = [word for fault in FAULTS[name] for word in ("--fault", fault)]
        self._arguments = ["--realtime", "--seed", str(config.seed), *faults]
        self._arguments += ["--transcript", str(folder / "transcript.jsonl")]
        self.device: Running

    def __enter__(self) -> "_Bench":
        self._running = running(*self._arguments, "--start-counts", "0")
        self.device = self._running.__enter__()
        setup = ArmSetup(self.device.port, zero=(0,) * 10, path=self.folder / "arm.toml")
        write_setup(setup)
        return self

    def __exit__(self, *error: object) -> None:
        self._running.__exit__(*error)

    def collect(self, steps: int) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "serpent_twin.collect", "--backend", "real"]
        command += ["--sessions", "1"]
        command += ["--steps", str(steps), "--rate-hz", str(self.config.rate_hz)]
        command += ["--seed", str(self.config.seed), "--out", str(self.log.parent)]
        command += ["--setup", str(self.folder / "arm.toml")]
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def strike(self, name: str, motor: int, rows: int, process: subprocess.Popen[str]) -> None:
        self._await_rows(rows, process)
        self.device.trigger(name, motor)

    def kill(self, rows: int) -> dict[str, object]:
        """Kill a collection with kill -9 once rows are logged; which of them survive, when is rest?"""
        process = self.collect(100_000)
        known = self._await_rows(rows, process)
        os.kill(process.pid, signal.SIGKILL)
        at = time.monotonic()
        process.communicate()
        time.sleep(1.5)
        (recovered,) = recover(self.log.parent)
        events = self.transcript()
        lost = max(0, known - len(read_session(recovered)))
        return {"rows_lost": lost, "stop_s": _rest_after(events, at)}

    def _await_rows(self, rows: int, process: subprocess.Popen[str]) -> int:
        journal = self.log.with_suffix(".journal")
        while (logged := _rows_in(journal)) < rows and process.poll() is None:
            time.sleep(0.05)
        return logged

    def transcript(self) -> list[Event]:
        return read_transcript(self.folder / "transcript.jsonl")


def _rest_after(events: list[Event], at: float) -> float:
    """Time from `at` until no motor is driven any more [s]; a limp one may still sink with the arm."""
    after = (e for e in events if e["event"] == "state" and e["host_s"] > at)
    moving = [
        e["host_s"]
        for e in after
        if any(abs(v) > REST and on for v, on in zip(e["velocity"], e["torque"], strict=True))
    ]
    return round(max(moving) - at, 3) if moving else 0.0


def _commands(events: list[Event]) -> int:
    """Number of control cycles that sent a command; standing still is none of the controller's."""
    return sum(event["event"] == "goal" and any(event["goal"]) for event in events)


def _time_to_rest(events: list[Event], name: str) -> float:
    struck = [e["host_s"] for e in events if e["event"] == "fault" and e["name"] == name]
    if not struck:
        raise SerpentError(f"the fault {name} never struck. Run it again.")
    return _rest_after(events, struck[0])


def _rows_in(journal: Path) -> int:
    try:
        return len(read_journal(journal).rows) if journal.exists() else 0
    except SerpentError:
        return 0


def cycle_times(seed: int, cycles: int = 200) -> dict[str, dict[str, float]]:
    """Times of read, compute, command in process and over the wire [ms]; physics is left out."""
    targets = random_targets(cycles, np.random.default_rng(seed))
    with SimulatedBus() as bus:
        figures = {"in_process": _time_cycles(bus, targets)}
    for name, pace in (("over_the_wire", "--no-paced"), ("over_the_wire_at_1_mbd", "--paced")):
        with running("--realtime", pace) as device, DynamixelBus(ArmSetup(device.port)) as bus:
            figures[name] = _time_cycles(bus, targets)
    figures["over_the_wire_at_1_mbd"]["times_its_bytes"] = (
        figures["over_the_wire_at_1_mbd"]["median"] / BYTES_MS
    )
    return figures


def _time_cycles(bus, targets: np.ndarray) -> dict[str, float]:
    times = []
    bus.enable_torque()
    for target in targets:
        began = time.perf_counter()
        state = bus.read_state()
        bus.write_velocity(joint_p_control(target, state.position, NOMINAL.controller_gain))
        times.append(1e3 * (time.perf_counter() - began))
        bus.wait(0.02)
    return {"median": float(np.median(times)), "p99": float(np.quantile(times, 0.99))}


def verdict(table: dict[str, dict]) -> str:
    """One sentence that the numbers support."""
    lost, wrong, stale = (
        sum(row[k] for row in table.values()) for k in ("rows_lost", "rows_wrong", "rows_stale")
    )
    slowest = max(row["stop_s"] for row in table.values())
    unnamed = [
        name
        for name, row in table.items()
        if name in ENDS and not (re.search(r"motor \d", str(row["said"])) and not row["complete"])
    ]
    sentence = (
        f"Over {sum(row['rows'] for row in table.values())} rows, {lost} were lost and {wrong} wrong, "
        f"{stale} of these stale; the motors were at rest at most {slowest:.2f} s after a kill or a "
        f"fatal fault (aim {AIM_STOP_S} s)."
    )
    if unnamed:
        sentence += f" No sentence that names a motor ended: {', '.join(unnamed)}."
    return sentence


def _line(name: str, row: dict) -> str:
    """What is printed of a fault once it was run."""
    said = f"\n    {row['said']}" if row["said"] else ""
    return (
        f"{name:22} {row['rows']} rows, {row['rows_lost']} lost, {row['rows_wrong']} wrong, "
        f"{row['rows_stale']} stale, {row['rows_interrupted']} interrupted, {row['recoveries']} recoveries, "
        f"rest after {row['stop_s']:.2f} s, struck {sum(row['struck'].values())} times{said}"
    )


if __name__ == "__main__":
    cli.run(main)
