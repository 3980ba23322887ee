"""Make a machine's log: its model with a fault that the effects of the twin have no part in.

MuJoCo moves rigid bodies as the model says, by the classical Runge-Kutta method in steps of 0.25 ms. The
fault is a force, a command or a reading that is computed here.
"""

from collections import deque
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
import pyarrow as pa
import pyarrow.csv as csv

from experiments.any_model.models import PublicModel
from serpent_twin.arrays import Array
from serpent_twin.effects import law_of, place_of

RATE, SECONDS, STEP, NOISE = 50.0, 12.0, 0.25e-3, 3e-4  # [Hz], [s], [s], [rad]
_SLIDES = 0.002  # [rad/s] above which dry friction is whole
VECTORS = ("gravity", "constant_force", "swinging_force")
"""Laws whose strength is a vector"""
WINDOW, BEYOND, SWING, WAVES = (0.0, 0.3), 0.15, 0.7, 6.0
"""Parameters of faults that no catalogue lists: angles from the joint's middle between which it sticks and
beyond which it is stopped [rad], frequency of a swing [Hz], waves of an encoder in a turn
"""


class FaultyRun:
    """A machine with one fault of a strength; nothing for a machine like its model."""

    def __init__(self, model: PublicModel, fault: str, strength: float, seed: int) -> None:
        spec = model.spec()
        spec.option.integrator, spec.option.timestep = mujoco.mjtIntegrator.mjINT_RK4, STEP
        self.law, self.at = law_of(fault), place_of(fault)
        self.strength = strength
        self.towards = np.random.default_rng(seed).standard_normal(3)
        self.towards[1] *= not model.planar
        self.towards *= strength / np.linalg.norm(self.towards)
        self._middle = model.middle
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        if self.law == "payload":
            self._carry()
        if self.law == "gravity":
            self.model.opt.gravity += self.towards
        if self.law == "rotor_inertia":
            self.model.dof_armature[self.model.joint(self.at).dofadr[0]] += strength
        late = round(strength / STEP) if self.law == "command_delay" else 0
        self._past = deque[Array](maxlen=late + 1)
        self._reached = np.zeros(self.model.nu)
        self._begun = False

    @property
    def parameters(self) -> Array:
        """Strengths of the effect that the trace should find, (1,) or (3,)."""
        return self.towards if self.law in VECTORS else np.array([self.strength])

    def read(self) -> Array:
        """What the joints' encoders show without noise, (nq,)."""
        found = self.data.qpos.copy()
        if self.law == "encoder_wave":
            joint = self._named(mujoco.mjtObj.mjOBJ_JOINT)
            found[joint] += self.strength * np.sin(WAVES * found[joint])
        return found

    def step(self, told: Array) -> None:
        """One step, in which the actuators are told something, (nu,)."""
        self.data.ctrl[:] = self._command(told)
        self.data.qfrc_applied[:] = self._force()
        mujoco.mj_step(self.model, self.data)

    def push(self, torque: Array) -> None:
        """One step, in which drives give torques to the joints, (nv,), of which gears take some."""
        self.data.qfrc_applied[:] = torque + self._force()
        if self.law == "gear_friction":
            dof = self.model.joint(self.at).dofadr[0]
            along = np.tanh(self.data.qvel[dof] / _SLIDES)
            # of the mean of what enters and leaves a gear, which differ by the friction
            carried = abs(torque[dof]) / (1 + np.sign(torque[dof] * along) * self.strength / 2)
            self.data.qfrc_applied[dof] -= self.strength * carried * along
        mujoco.mj_step(self.model, self.data)

    def _command(self, told: Array) -> Array:
        """What reaches the actuators."""
        self._past.append(told)
        told = self._past[0].copy()
        if not self._begun:
            self._reached[:], self._begun = told, True
        n = self._named(mujoco.mjtObj.mjOBJ_ACTUATOR)
        if self.law == "servo_lag":
            self._reached[n] += STEP / self.strength * (told[n] - self._reached[n])
            told[n] = self._reached[n]
        elif self.law == "gear_backlash":
            half = self.strength / 2
            self._reached[n] = np.clip(self._reached[n], told[n] - half, told[n] + half)
            told[n] = self._reached[n]
        elif self.law == "torque_saturation":
            per = self.model.actuator_gear[n, 0]
            told[n] = told[n] / (1 + self.strength * abs(per * told[n]))
        return told

    def _force(self) -> Array:
        """What acts on the joints, (nv,)."""
        out, data = np.zeros(self.model.nv), self.data
        if self.law in ("hinge_friction", "joint_elasticity", "joint_stiffening"):
            joint = self._named(mujoco.mjtObj.mjOBJ_JOINT)
            angle, dof = data.qpos[self.model.jnt_qposadr[joint]], self.model.jnt_dofadr[joint]
            rubs = np.tanh(data.qvel[dof] / _SLIDES)
            of = {"hinge_friction": rubs, "joint_elasticity": angle, "joint_stiffening": angle**3}
            out[dof] = -self.strength * of[self.law]
        elif self.law in ("sticking_joint", "soft_stop"):
            joint = self._named(mujoco.mjtObj.mjOBJ_JOINT)
            angle, dof = data.qpos[joint] - self._middle[joint], self.model.jnt_dofadr[joint]
            inside = WINDOW[0] < angle < WINDOW[1]
            rubs = inside * np.tanh(data.qvel[dof] / _SLIDES)
            of = {"sticking_joint": rubs, "soft_stop": max(angle - BEYOND, 0.0)}
            out[dof] = -self.strength * of[self.law]
        elif self.law in ("constant_force", "swinging_force"):
            body = self._named(mujoco.mjtObj.mjOBJ_BODY)
            swings = np.sin(2 * np.pi * SWING * data.time)
            push, at = self.towards, data.xpos[body]
            if self.law == "swinging_force":
                push, at = swings * push, data.xipos[body]
            mujoco.mj_applyFT(self.model, data, push, np.zeros(3), at, body, out)
        return out

    def _named(self, kind: mujoco.mjtObj) -> int:
        return mujoco.mj_name2id(self.model, kind, self.at)

    def _carry(self) -> None:
        """Add a point mass at the origin of a body's frame: the parallel axes of Huygens and Steiner."""
        m, n = self.model, self._named(mujoco.mjtObj.mjOBJ_BODY)
        turn, own, at = np.zeros(9), m.body_mass[n], m.body_ipos[n].copy()
        mujoco.mju_quat2Mat(turn, m.body_iquat[n])
        frame, whole = turn.reshape(3, 3), own + self.strength
        about = frame @ np.diag(m.body_inertia[n]) @ frame.T + own * _moved(at)
        centre = own / whole * at
        about -= whole * _moved(centre)
        inertia, axes = np.linalg.eigh(about)
        axes *= np.sign(np.linalg.det(axes))
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, axes.ravel())
        m.body_mass[n], m.body_ipos[n], m.body_inertia[n] = whole, centre, inertia
        m.body_iquat[n] = quaternion
        mujoco.mj_setConst(m, self.data)


def _moved(along: Array) -> Array:
    """Inertia of a mass of one at a place, (3, 3)."""
    return along @ along * np.eye(3) - np.outer(along, along)


def record(path: Path, model: PublicModel, fault: str, strength: float, seed: int) -> None:
    """Write a session as CSV: time, what the actuators are told, what the joints' encoders read."""
    rng = np.random.default_rng(seed)
    machine = FaultyRun(model, fault, strength, 1)
    joints = [machine.model.joint(n).name for n in range(machine.model.njnt)]
    size, phase = rng.uniform(0.3, 1, (3, len(joints))), rng.uniform(0, 2 * np.pi, (3, len(joints)))
    turning = 2 * np.pi * rng.uniform(0.1, 0.8, (3, len(joints)))
    size *= model.swing / size.sum(axis=0)

    def goal(time: float) -> Array:
        return np.array(model.middle) + (size * np.sin(turning * time + phase)).sum(axis=0)

    driven = [joints.index(joint) for joint in model.drives.values()]
    low, high = machine.model.actuator_ctrlrange.T
    limited = machine.model.actuator_ctrllimited.astype(bool)
    late = machine.law == "sensor_delay"
    behind = [joints.index(machine.at), round(strength / STEP)] if late else [0, 0]
    data, rows, every = machine.data, [], round(1 / RATE / STEP)
    past: list[float] = []
    data.qpos[:] = goal(0.0) if model.gain == 0 else model.middle
    for n in range(round(SECONDS * RATE)):
        told = goal(n / RATE)[driven]
        if model.gain:
            told = model.gain * (told - data.qpos[driven] - 0.1 * data.qvel[driven])
        told = np.where(limited, np.clip(told, low, high), told)
        read = machine.read()
        past = past or [read[behind[0]]] * (behind[1] + 1)
        read[behind[0]] = past[-1 - behind[1]]
        rows.append([n / RATE, *told, *read])
        for _ in range(every):
            machine.step(told)
            past.append(data.qpos[behind[0]])
    table = np.array(rows)
    seen = table[:, 1 + len(driven) :]
    seen += NOISE * rng.standard_normal(seen.shape)
    names = ["t", *(f"u_{each}" for each in model.drives), *(f"q_{each}" for each in joints)]
    write_table(path, names, table)


def write_table(path: Path, names: Sequence[str], rows: Array) -> None:
    """Write the columns of rows (T, C) as CSV, in a new folder if need be."""
    path.parent.mkdir(parents=True, exist_ok=True)
    csv.write_csv(pa.table(dict(zip(names, rows.T, strict=True))), path)


def describe(folder: Path, model: PublicModel) -> Path:
    """Write the model and its machine.toml as a user would; returns the latter's path."""
    spec = model.spec()
    compiled = spec.compile()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.xml").write_text(spec.to_xml())
    lines = ['schema_version = 1\nmodel = "model.xml"\nrows = "motion"']
    lines.append('time = { column = "t", unit = "s" }\n')
    unit = "1" if model.gain else "rad"
    for actuator in model.drives:
        lines.append(
            f'[[drive]]\nactuator = "{actuator}"\ncolumn = "u_{actuator}"\nunit = "{unit}"\n'
        )
    for n in range(compiled.njnt):
        name = compiled.joint(n).name
        lines.append(f'[[measured]]\njoint = "{name}"\ncolumns = ["q_{name}"]\nunit = "rad"\n')
    (folder / "machine.toml").write_text("\n".join(lines))
    return folder / "machine.toml"
