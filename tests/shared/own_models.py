"""Make logs of small models with the very model, by MuJoCo itself in ten times as fine steps."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from example import table

RATE, SECONDS, NOISE, FINER = 50.0, 4.1, 2e-4, 10  # [Hz], [s], [rad, m], times as fine steps
_UNTOUCHED = 'contype="0" conaffinity="0"'
Change = Callable[[np.ndarray], np.ndarray]


def _capsule(to: str, more: str = "") -> str:
    return f'<geom type="capsule" fromto="0 0 0 {to}" size="0.01" mass="0.1" {more}/>'


def _model(world: str, actuators: str = "", more: str = "") -> str:
    return f"""<mujoco><compiler angle="radian"/><option timestep="0.002" integrator="implicitfast"/>
    <worldbody>{world}</worldbody><actuator>{actuators or _servo()}</actuator>{more}</mujoco>"""


def _servo(name: str = "s1", joint: str = "j1", more: str = "", kp: float = 20.0) -> str:
    return f'<position name="{name}" joint="{joint}" kp="{kp}" kv="{0.03 * kp}" {more}/>'


def _arm(beyond: str = "", at: str = "0 0 0.5", more: str = "", body: str = "") -> str:
    return f"""<body name="l1" pos="{at}" {body}>
    <joint name="j1" axis="0 1 0" damping="0.05" armature="0.005" {more}/>
    {_capsule("0.2 0 0")}{beyond}</body>"""


def _forearm(more: str = 'damping="0.05"') -> str:
    return f"""<body name="l2" pos="0.2 0 0"><joint name="j2" axis="0 1 0" {more}/>
    {_capsule("0.15 0 0")}<site name="tip" pos="0.15 0 0"/></body>"""


def _finger(name: str, side: str) -> str:
    return f"""<body name="{name}" pos="0.2 {side}0.02 0">
    <joint name="{name}" type="slide" axis="0 {side}1 0" damping="1" range="0 0.04"/>
    <geom type="box" size="0.02 0.004 0.01" mass="0.02"/></body>"""


def _integrator(more: str = "") -> str:
    return f'<intvelocity name="s1" joint="j1" kp="20" kv="0.6" actrange="-2 2"/>{more}'


_GRIPPER = _finger("g1", "") + _finger("g2", "-")
_MIMIC = '<equality><joint joint1="g1" joint2="g2"/></equality>'
_PENDULUM = f"""<body name="l2" pos="0.2 0 0"><joint name="p" axis="0 1 0" damping="0.005"/>
    {_capsule("0 0 -0.2")}</body>"""
_BALL = f"""<body name="l2" pos="0.2 0 0"><joint name="b" type="ball" damping="0.003"/>
    {_capsule("0.05 0 -0.2", _UNTOUCHED)}</body>"""
_FLOOR = '<geom type="plane" size="2 2 0.1"/>'
_BAR = f"""<body name="rod" pos="0 0 0.1"><joint name="k" axis="0 1 0"/>
    {_capsule("0.3 0 0", _UNTOUCHED)}</body>"""
_ROCKER = f"""<body name="rocker" pos="0.3 0 0"><joint name="r" axis="0 1 0"/>
    {_capsule("0 0 0.1", _UNTOUCHED)}</body>"""
_CRANK = f"""<body name="crank"><joint name="j1" axis="0 1 0" damping="0.05" armature="0.005"/>
    {_capsule("0 0 0.1")}{_BAR}</body>"""
_PUSHER = """<body name="l1" pos="0 0 0.03"><joint name="j1" type="slide" axis="1 0 0" damping="1"/>
    <geom type="box" size="0.02 0.05 0.02" mass="0.3"/></body>"""
_COUPLED = """<tendon><fixed name="t1"><joint joint="j1" coef="1"/></fixed>
    <fixed name="t2"><joint joint="j2" coef="1"/></fixed></tendon>
    <equality><tendon tendon1="t2" tendon2="t1" polycoef="0 0.8 0 0 0"/></equality>"""
_TENDON = """<tendon><fixed name="t1"><joint joint="j1" coef="1"/><joint joint="j2" coef="0.5"/>
    </fixed></tendon>"""
_MUSCLE = """<general name="s1" joint="j1" dyntype="muscle" dynprm="0.1 0.4" gainprm="2"
    ctrlrange="0 1" ctrllimited="true"/>"""
_DC_MOTOR = """<dcmotor name="s1" joint="j1" motorconst="0.46" resistance="4.5" input="pos"
    controller="20 20 0.5"/>"""
_MOCAP = f"""<body name="target" mocap="true" pos="0.3 0.3 0.3"><geom size="0.02" {_UNTOUCHED}/></body>"""
_KEYFRAME = '<keyframe><key name="home" qpos="1 -1" ctrl="1"/></keyframe>'
_TWO = _servo() + _servo("s2", "j2", kp=10)


def _cube(at: str = "0.5 0.5 0.05") -> str:
    return f"""<body name="cube" pos="{at}"><freejoint/>
    <geom type="box" size="0.03 0.03 0.03" mass="0.05"/></body>"""


def _floating(at: str, shape: str, more: str = "") -> str:
    arm = _arm(at="0 0 0.06", body=more).replace("0.2 0 0", "0 0 0.2")
    return f'<body name="base" pos="{at}" {more}><freejoint/><geom {shape} mass="2"/>{arm}</body>'


@dataclass(frozen=True)
class OwnModel:
    """A model, and how a log of it is made."""

    mjcf: str
    told: tuple[tuple[str, float, float], ...] = (("s1", 0.0, 0.4),)
    """Actuators, the middle of their commands and how far these go"""
    measured: tuple[str, ...] = ("joint j1",)
    """Kind and name of each"""
    units: tuple[str, ...] = ("rad",)
    settled: float = 3.0
    """Seconds under the first commands before the log begins"""
    begin: Callable[[mujoco.MjData], None] | None = None
    """Where the simulation begins"""
    keyframe: str = ""
    change: Change | None = None
    """What the log makes of readings, (T, C)"""


def _at(**angles: float) -> Callable[[mujoco.MjData], None]:
    def begin(data: mujoco.MjData) -> None:
        for name, angle in angles.items():
            data.joint(name).qpos[0] = angle

    return begin


def _activated(data: mujoco.MjData) -> None:
    data.qpos[0] = data.act[0] = 0.5


def _wrapped(readings: np.ndarray) -> np.ndarray:
    return (readings + np.pi) % (2 * np.pi) - np.pi


def _slow(readings: np.ndarray) -> np.ndarray:
    """The second column comes in each third row."""
    out = readings.copy()
    out[:, 1] = readings[np.arange(len(out)) // 3 * 3, 1]
    return out


_S1, _S2 = ("s1", 0.0, 0.4), ("s2", 0.3, 0.4)
_JOINTS, _RADIANS = ("joint j1", "joint j2"), ("rad", "rad")
_FINGERS = ("s1", 0.0, 0.4), ("s2", 0.02, 0.01)
_GRIPPED, _GRIPS = ("joint j1", "joint g1"), ("rad", "m")


def _two(
    world: str, actuators: str = _TWO, more: str = "", change: Change | None = None
) -> OwnModel:
    told = _S1, _S2
    return OwnModel(_model(world, actuators, more), told, _JOINTS, _RADIANS, change=change)


OWN_MODELS: dict[str, OwnModel] = {
    "two joints": _two(_arm(_forearm())),
    "free cube beside": OwnModel(_model(_FLOOR + _arm() + _cube())),
    "free cube, log begins elsewhere": OwnModel(
        _model(_FLOOR + _arm() + _cube()), told=(("s1", -0.7, 0.3),)
    ),
    "cube and a torque": OwnModel(
        _model(
            _FLOOR + _arm(more='stiffness="0.3"') + _cube(), '<motor name="s1" joint="j1"/>'
        ),
        told=(("s1", -0.2, 0.15),),
    ),
    "cube that the arm pushes": OwnModel(
        _model(_FLOOR + _PUSHER + _cube("0.07 0 0.03"), _servo(kp=200)),
        told=(("s1", 0.0, 0.05),),
        units=("m",),
    ),
    "mimic finger": OwnModel(
        _model(_arm(_GRIPPER), _servo() + _servo("s2", "g1", kp=100), _MIMIC),
        _FINGERS, _GRIPPED, _GRIPS,
    ),
    "four-bar linkage": OwnModel(
        _model(
            _CRANK + _ROCKER,
            more='<equality><connect body1="rod" body2="rocker" anchor="0.3 0 0"/></equality>',
        ),
        told=(("s1", 0.5, 0.3),),
    ),
    "passive joint": OwnModel(_model(_arm(_PENDULUM))),
    "passive joint that swings": OwnModel(_model(_arm(_PENDULUM)), begin=_at(p=0.9), settled=0.3),
    "ball joint": OwnModel(_model(_arm(_BALL))),
    "unmeasured servo": OwnModel(
        _model(_arm(_forearm()), _TWO), told=(_S1, ("s2", 0.6, 0.3))
    ),
    "elastic joint": OwnModel(_model(_arm(_forearm('damping="0.01" stiffness="3"')))),
    "only the tip is measured": OwnModel(
        _model(_arm(_forearm()), _TWO), (_S1, _S2), ("site tip",), ("m",)
    ),
    "floating base in space": OwnModel(
        _model(_floating("0 0 1", f'size="0.1" {_UNTOUCHED}', 'gravcomp="1"'))
    ),
    "floating base on the floor": OwnModel(
        _model(_FLOOR + _floating("0 0 0.2", 'type="box" size="0.1 0.1 0.05"'))
    ),
    "slow filter": OwnModel(_model(_arm(), _servo(more='timeconst="0.5"'))),
    "slow filter, log begins in motion": OwnModel(
        _model(_arm(), _servo(more='timeconst="0.5"')), settled=0.0
    ),
    "integrator": OwnModel(_model(_arm(), _integrator()), begin=_activated, settled=0.0),
    "integrator, filter and mimic": OwnModel(
        _model(
            _arm(_GRIPPER),
            _integrator(_servo("s2", "g1", 'timeconst="0.3"', 100)),
            _MIMIC,
        ),
        _FINGERS, _GRIPPED, _GRIPS,
        begin=_activated,
        settled=0.0,
    ),
    "muscle": OwnModel(_model(_arm(more='stiffness="2"'), _MUSCLE), told=(("s1", 0.5, 0.4),)),
    "DC motor with an integral": OwnModel(_model(_arm(), _DC_MOTOR)),
    "delayed actuator": OwnModel(
        _model(_arm(), _servo(more='delay="0.06" nsample="400" interp="linear"'))
    ),
    "tendon": _two(
        _arm(_forearm()),
        '<position name="s1" tendon="t1" kp="50" kv="1"/>' + _servo("s2", "j2", kp=10),
        _TENDON,
    ),
    "coupled by tendons": OwnModel(
        _model(_arm(_forearm()), more=_COUPLED), told=(("s1", 0.5, 0.3),)
    ),
    "mocap body": _two(_arm(_forearm()) + _MOCAP),
    "limit active at the start": OwnModel(
        _model(_arm(more='range="-0.2 1"')), told=(("s1", -0.2, 0.5),)
    ),
    "contact at the start": OwnModel(
        _model(_FLOOR + _arm(at="0 0 0.1")), told=(("s1", 0.45, 0.5),)
    ),
    "gravity-compensated": _two(_arm(_forearm(), body='gravcomp="1"')),
    "keyframe elsewhere": OwnModel(_model(_arm(_PENDULUM), more=_KEYFRAME), keyframe="home"),
    "encoder that wraps": OwnModel(
        _model(_arm()), told=(("s1", 3.0, 0.5),), change=_wrapped, begin=_at(j1=3.0)
    ),
    "readings slower than rows": _two(_arm(_forearm()), change=_slow),
}  # fmt: skip
"""Models by what is unusual of each"""


def write(folder: Path, name: str, sessions: int = 2) -> Path:
    """Write a model, its machine.toml and its logs; returns the path of the machine.toml."""
    own = OWN_MODELS[name]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.xml").write_text(own.mjcf)
    told = [f'{{ actuator = "{each}", column = "u_{each}", unit = "1" }}' for each, *_ in own.told]
    seen = []
    for thing, unit in zip(own.measured, own.units, strict=True):
        kind, of = thing.split()
        columns = [f"{of}_{axis}" for axis in "xyz"] if kind == "site" else [of]
        more = ", cameras = false" if kind == "site" else ""
        named = ", ".join(f'"{each}"' for each in columns)
        seen.append(
            f'{{ {kind} = "{of}", columns = [{named}], unit = "{unit}", noise = {NOISE}{more} }}'
        )
    home = f'keyframe = "{own.keyframe}"\n' if own.keyframe else ""
    (folder / "machine.toml").write_text(
        f'schema_version = 1\nmodel = "model.xml"\nrows = "motion"\n{home}'
        f'time = {{ column = "t", unit = "s" }}\n'
        f"drive = [{', '.join(told)}]\nmeasured = [{', '.join(seen)}]\n"
    )
    for n in range(sessions):
        _log(folder / "logs" / f"run_{n}.csv", own, n)
    return folder / "machine.toml"


def _log(path: Path, own: OwnModel, seed: int) -> None:
    """Write a motion, read just before a row's commands take effect."""
    rng, model = np.random.default_rng(seed), mujoco.MjModel.from_xml_string(own.mjcf)
    model.opt.timestep /= FINER
    data, rows = mujoco.MjData(model), round(SECONDS * RATE)
    time = np.arange(rows) / RATE
    told = np.empty((rows, len(own.told)))
    for k, (_, middle, size) in enumerate(own.told):
        speed, phase = rng.uniform(1, 6, 3), rng.uniform(0, 6, 3)
        told[:, k] = middle + size / 2.2 * np.sin(speed * time[:, None] + phase).sum(axis=1)
    actuators = [model.actuator(each).id for each, *_ in own.told]
    if own.keyframe:
        mujoco.mj_resetDataKeyframe(model, data, model.key(own.keyframe).id)
    if own.begin:
        own.begin(data)
    steps, seen = round(1 / RATE / model.opt.timestep), []
    before = round(own.settled * RATE)
    for row in range(-before, rows):
        if row >= 0:
            mujoco.mj_forward(model, data)
            seen.append(_read(model, data, own))
        data.ctrl[actuators] = told[max(row, 0)]
        mujoco.mj_step(model, data, steps)
    readings = np.array(seen) + NOISE * rng.standard_normal((rows, len(seen[0])))
    readings = own.change(readings) if own.change else readings
    columns = [f"u_{each}" for each, *_ in own.told]
    for thing in own.measured:
        kind, of = thing.split()
        columns += [f"{of}_{axis}" for axis in "xyz"] if kind == "site" else [of]
    table(path, f"t,{','.join(columns)}", np.c_[time, told, readings], 7)


def _read(model: mujoco.MjModel, data: mujoco.MjData, own: OwnModel) -> np.ndarray:
    found = []
    for thing in own.measured:
        kind, of = thing.split()
        found.append(data.joint(of).qpos.copy() if kind == "joint" else data.site(of).xpos.copy())
    return np.concatenate(found)
