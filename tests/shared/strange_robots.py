"""Make small robots with logs of many forms, and the machine.toml that is right for each."""

import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from serpent_twin.matching import Matched
from serpent_twin.units import TO_SI

SERVO, SPEED, MOTOR = "servo", "speed", "motor"
STYLES = {
    "by name": ("cmd_{act}", "pos_{joint}", "vel_{joint}", "effort_{act}"),
    "brackets": ("u[{n0}]", "q[{n0}]", "dq[{n0}]", ""),
    "ros": (
        "/joint_commands/data_{n0}",
        "/joint_states/position_{n0}",
        "/joint_states/velocity_{n0}",
        "/joint_states/effort_{n0}",
    ),
    "theta": ("ref_{n1}", "theta{n1}", "dtheta{n1}", ""),
    "act": ("act{n1}.cmd", "joint_{n1}", "joint_{n1}_vel", ""),
    "dynamixel": (
        "goal_position_{n1}",
        "present_position_{n1}",
        "present_velocity_{n1}",
        "present_load_{n1}",
    ),
    "lerobot": ("action.{joint}.pos", "observation.state.{joint}.pos", "", ""),
    "desired": ("{joint}_desired", "{joint}_actual", "{joint}_speed", "{joint}_torque"),
    "camel": ("Motor{n1}Cmd", "Joint{n1}Angle", "Joint{n1}Rate", "Motor{n1}Current"),
    "setpoint": ("setpoint {joint}", "encoder {joint}", "", ""),
    "german": ("soll_{n1}", "ist_{n1}", "", ""),
    "nothing": ("c", "c", "c", ""),
}
"""Names of commands, positions, velocities and efforts"""
NAMES = ("base", "shoulder", "elbow", "wrist", "roll", "tool")


@dataclass(frozen=True)
class Form:
    """A robot and how its logs are written."""

    kinds: str
    """h or s for each joint: hinge or slide"""
    actuators: str = SERVO
    style: str = "by name"
    angle: str = "rad"
    length: str = "m"
    clock: str = "s"
    """s, ms, ns, us, epoch ms or iso"""
    named: bool = True
    """Whether joints have names and not numbers"""
    flipped: tuple[int, ...] = ()
    """Joints whose encoder runs backwards"""
    degrees: bool = False
    """Whether the MJCF is in degrees"""
    limited: bool = True
    extra: bool = True
    """Whether there are columns of other things"""
    shuffled: bool = False
    unit_in_name: bool = False
    rate: float = 100.0
    friction: float = 0.0
    late: int = 0
    """Rows that commands come late"""
    seed: int = 0
    asymmetric: bool = False


@dataclass
class Truth:
    """What a machine.toml must say: column and SI units of 1, by thing."""

    drive: dict[str, tuple[str, float]] = field(default_factory=dict)
    measured: dict[str, tuple[str, float]] = field(default_factory=dict)
    time: tuple[str, float] = ("", 1.0)


def joint_names(form: Form) -> list[str]:
    if form.named:
        return [NAMES[n] for n in range(len(form.kinds))]
    return [f"joint_{n + 1}" for n in range(len(form.kinds))]


def actuator_names(form: Form) -> list[str]:
    ending = {SERVO: "servo", SPEED: "speed", MOTOR: "motor"}[form.actuators]
    if form.named:
        return [f"{name}_{ending}" for name in joint_names(form)]
    return [f"a{n + 1}" for n in range(len(form.kinds))]


def mjcf(form: Form, real: bool = False) -> str:
    """The robot's model; the real one has friction and other masses."""
    rng = np.random.default_rng(form.seed)
    turn = 180 / np.pi if form.degrees else 1.0
    body, ends, told = "", "", ""
    names, drives = joint_names(form), actuator_names(form)
    for n, kind in enumerate(form.kinds):
        mass = (1.0 - 0.12 * n) * rng.uniform(0.7, 1.3) * (1.04 if real else 1)
        axis = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "0 0 1")[n]
        if kind == "s":
            axis = ("1 0 0", "0 1 0", "0 0 1")[n % 3]
        high = rng.uniform(1.2, 2.8) if kind == "h" else rng.uniform(0.2, 0.4)
        low = -high * (0.35 if form.asymmetric else 1.0)
        scale = turn if kind == "h" else 1.0
        limits = (
            f'range="{low * scale:.4f} {high * scale:.4f}" limited="true"' if form.limited else ""
        )
        rub = form.friction * (1.0 if kind == "h" else 10.0) if real else 0.0
        joint = "hinge" if kind == "h" else "slide"
        damping = 0.05 if kind == "h" else 6.0
        damping *= np.pi / 180 if form.degrees and kind == "h" else 1.0
        body += (
            f'<body name="b{n}" pos="{0.2 if n else 0} 0 {0 if n else 0.5}">'
            f'<joint name="{names[n]}" type="{joint}" axis="{axis}" {limits} damping="{damping}" '
            f'armature="{0.02 if kind == "h" else 0.3}" frictionloss="{rub}"/>'
            f'<geom type="box" size="0.1 0.02 0.02" pos="0.1 0.01 0" mass="{mass:.4f}" '
            'contype="0" conaffinity="0"/>'
        )
        ends += "</body>"
        gain = (60.0 if kind == "h" else 3000.0) * rng.uniform(0.6, 1.5)
        speed = (6.0 if kind == "h" else 200.0) * rng.uniform(0.7, 1.4)
        if form.actuators == SERVO:
            told += f'<position name="{drives[n]}" joint="{names[n]}" kp="{gain:.2f}" kv="{gain / 18:.3f}"/>'
        elif form.actuators == SPEED:
            told += f'<velocity name="{drives[n]}" joint="{names[n]}" kv="{speed * 6:.3f}"/>'
        else:
            told += f'<motor name="{drives[n]}" joint="{names[n]}"/>'
    angle = "degree" if form.degrees else "radian"
    return (
        f'<mujoco><compiler angle="{angle}"/><option timestep="0.002" integrator="implicitfast"/>'
        f"<worldbody>{body}{ends}</worldbody><actuator>{told}</actuator></mujoco>"
    )


def simulated(
    form: Form, seconds: float, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Times, commands, positions and velocities of a log, SI."""
    rng = np.random.default_rng(1000 * form.seed + seed)
    model = mujoco.MjModel.from_xml_string(mjcf(form, real=True))
    data, n = mujoco.MjData(model), len(form.kinds)
    steps = round(1 / form.rate / model.opt.timestep)
    rows = round(seconds * form.rate)
    span = np.array([0.35 if k == "h" else 0.06 for k in form.kinds])
    middle = np.zeros(n)
    if form.asymmetric:
        middle = np.array([0.3 if k == "h" else 0.04 for k in form.kinds]) * 1.6
    waves = [(rng.uniform(0.15, 0.9, 3), rng.uniform(0, 6.28, 3)) for _ in range(n)]

    def goal(t: float) -> np.ndarray:
        return middle + span * np.array([np.sin(6.28 * f * t + p).sum() for f, p in waves]) / 1.2

    data.qpos[:] = goal(0.0)
    kept: list[np.ndarray] = []
    told, angle, rate = (np.empty((rows, n)) for _ in range(3))
    command = goal(0.0)
    hold = max(1, round(form.rate / rng.choice([form.rate, 50.0, 20.0])))
    for row in range(rows):
        angle[row], rate[row] = data.qpos[:n], data.qvel[:n]
        if row % hold == 0:
            want = goal(row / form.rate)
            if form.actuators == SERVO:
                command = want
            elif form.actuators == SPEED:
                near = (goal(row / form.rate + 0.01) - want) / 0.01
                command = near + 4.0 * (want - data.qpos[:n])
            else:
                inertia = np.zeros((n, n))
                mujoco.mj_fullM(model, data, inertia)
                need = 40 * (want - data.qpos[:n]) - 9 * data.qvel[:n]
                command = inertia @ need + data.qfrc_bias[:n]
        kept.append(command.copy())
        told[row] = command
        data.ctrl[:] = kept[max(0, row - form.late)]
        mujoco.mj_step(model, data, steps)
    assert np.abs(angle).max() < 4, "the robot is unstable"
    return np.arange(rows) / form.rate, told, angle, rate


def written(form: Form, folder: Path, seconds: float = 16.0, logs: int = 2) -> Truth:
    """Write robot.xml and CSV logs, and say what is right."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.xml").write_text(mjcf(form))
    (folder / "logs").mkdir()
    truth = Truth()
    for number in range(logs):
        time, told, angle, rate = simulated(form, seconds, number)
        table, truth = _columns(form, time + 20.0 * number, told, angle, rate, number)
        names = list(table)
        lines = [",".join(f'"{n}"' if " " in n else n for n in names)]
        lines += [",".join(row) for row in zip(*table.values(), strict=True)]
        (folder / "logs" / f"run_{number + 1}.csv").write_text("\n".join(lines) + "\n")
    return truth


def _columns(
    form: Form, time: np.ndarray, told: np.ndarray, angle: np.ndarray, rate: np.ndarray, number: int
) -> tuple[dict[str, list[str]], Truth]:
    rng = np.random.default_rng(7 + 100 * form.seed + number)
    order = np.random.default_rng(form.seed + 5)
    truth, several = Truth(), []
    joints, drives = joint_names(form), actuator_names(form)
    style = STYLES[form.style]
    for n, kind in enumerate(form.kinds):
        unit = form.angle if kind == "h" else form.length
        size = TO_SI[unit][0]
        sign = -1 if n in form.flipped else 1
        words = {"n0": n, "n1": n + 1, "joint": joints[n], "act": drives[n]}
        tail = f"_{unit}" if form.unit_in_name else ""
        force = "" if form.actuators == MOTOR else tail
        if form.actuators == SPEED and force:
            force += "_s"
        scale = 1.0 if form.actuators == MOTOR else size
        noise = 2e-4 if kind == "h" else 2e-5
        read = sign * (angle[:, n] + noise * rng.normal(size=len(time))) / size
        speed = sign * (rate[:, n] + 20 * noise * rng.normal(size=len(time))) / size
        effort = 0.3 * told[:, n] / scale + rng.normal(size=len(time)) * 0.05
        several += [
            (("drive", drives[n], scale), style[0].format(**words) + force, told[:, n] / scale),
            (("measured", joints[n], sign * size), style[1].format(**words) + tail, read),
        ]
        if style[2]:
            several.append((None, style[2].format(**words) + (f"{tail}_s" if tail else ""), speed))
        if style[3]:
            several.append((None, style[3].format(**words), effort))
    if form.extra:
        drift = 24 + 0.02 * np.cumsum(rng.normal(size=len(time))) / 10
        several += [
            (None, "motor temperature", drift),
            (None, "loop_count", np.arange(len(time)) + 5.0),
            (None, "battery_V", 12 - 0.01 * time + 0.02 * rng.normal(size=len(time))),
        ]
    if form.shuffled or form.style == "nothing":
        several = [several[k] for k in order.permutation(len(several))]
    if form.style == "nothing":
        count = iter(range(1, 99))
        several = [
            (of, f"c{next(count)}" if name[0] == "c" else name, v) for of, name, v in several
        ]
    clock, cells, seconds = _clock(form, time, rng)
    table = {clock: cells}
    truth.time = (clock, seconds)
    for of, name, values in several:
        table[name] = [f"{each:.7g}" for each in values]
        if of:
            getattr(truth, of[0])[of[1]] = (name, of[2])
    return table, truth


def _clock(form: Form, time: np.ndarray, rng: np.random.Generator) -> tuple[str, list[str], float]:
    jitter = time + rng.normal(size=len(time)) * 0.02 / form.rate
    match form.clock:
        case "ms":
            return "t_ms" if form.seed % 2 else "stamp", [f"{1e3 * t:.2f}" for t in jitter], 1e-3
        case "us":
            return "timestamp", [f"{1e6 * t:.0f}" for t in jitter], 1e-6
        case "ns":
            return (
                "timestamp",
                [str(1_740_909_640_000_000_000 + round(1e9 * t)) for t in jitter],
                1e-9,
            )
        case "epoch ms":
            return "time", [f"{1_740_909_640_000 + 1e3 * t:.1f}" for t in jitter], 1e-3
        case "iso":
            start = np.datetime64("2025-03-02T10:00:20")
            return "stamp", [str(start + np.timedelta64(round(1e6 * t), "us")) for t in time], 1.0
    return ("t" if form.style != "nothing" else "c0"), [f"{t:.5f}" for t in time], 1.0


def judged(found: Matched, truth: Truth) -> str:
    """right, open or wrong: whether what was decided is true, and whether all was."""
    said = tomllib.loads(found.text)
    wrong = [
        f"{each.get('actuator') or each.get('joint')}: {each.get('column') or each.get('columns')}"
        for kind in ("drive", "measured")
        for each in said.get(kind, [])
        if not _true(kind, each, getattr(truth, kind)) and not _doubted(found, each)
    ]
    clock = said["time"]
    if not found.text.partition("time = ")[0].count("UNDECIDED:") and (
        clock["column"] != truth.time[0]
        or (found.decisions[0].unit and TO_SI[clock["unit"]][0] != truth.time[1])
    ):
        wrong.append(f"time: {clock}")
    if wrong:
        return f"wrong: {wrong}"
    return "open" if found.undecided else "right"


def _true(kind: str, each: dict, truth: dict[str, tuple[str, float]]) -> bool:
    name = each["actuator"] if kind == "drive" else each["joint"]
    column = each["column"] if kind == "drive" else each["columns"][0]
    factor = each.get("scale", 1.0) * TO_SI[each["unit"]][0]
    right = truth.get(name)
    return right is not None and column == right[0] and bool(np.isclose(factor, right[1]))


def _doubted(found: Matched, each: dict) -> bool:
    column = each.get("column") or each["columns"][0]
    return any(d.column == column and d.why.startswith("? ") for d in found.decisions)
