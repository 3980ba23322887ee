"""Compute cases and closed forms of the bench arm by hand, for its tests."""

import numpy as np

from bench_arm import NONE, ArmBatch, BenchArm
from serpent_twin.arm.geometry import ARM

G = np.array([9.81, 0.0, 0.0])
LOOSE = BenchArm(strand_slack=(1.0,) * 18, joint_friction=(1e-12,) * 9, joint_damping=0.0)
SMOOTH = BenchArm(joint_friction=(1e-12,) * 9, joint_damping=0.02, strand_damping=10.0)
STILL = np.zeros((1, 10))


def machine(arm, effects=NONE, h=4e-3):
    return ArmBatch([arm], [effects], h, np.zeros(1))


def run(m, seconds, command=STILL):
    for _ in range(round(seconds / m.h)):
        m.step(command)
    return m


def calm(m):
    """Damp every hinge near its critical damping, which moves no equilibrium."""
    m.damping[:, m.joint] = np.geomspace(0.3, 0.02, 9)
    return m


def hold_at(m, motor, seconds=14.0):
    """Put the motors at angles (9,), with the joints where stiff cables would have them, and wait."""
    m.servos.angle[0, :9] = m.servos.winch[0] = motor
    m.servos.friction = m.servos.friction + 100  # so that no motor turns
    m.q[0, m.joint] = np.diff(motor, prepend=0.0)
    return run(calm(m), seconds)


def com_places(q):
    """Centres of mass by hand: half of each link's length behind its joint, (9, 3), from q (9,)."""
    at, turn, places, joints, axes = np.zeros(3), np.eye(3), [], [], []
    for i, length in enumerate(ARM.link_length):
        c, s = np.cos(q[i]), np.sin(q[i])
        z = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        y = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        axes.append(turn @ ([0, 0, 1.0] if i % 2 == 0 else [0, 1.0, 0]))
        turn = turn @ (z if i % 2 == 0 else y)
        joints.append(at)
        places.append(at + turn @ [length / 2, 0, 0])
        at = at + turn @ [length, 0, 0]
    tip = joints[-1] + turn @ [0.090, 0, 0]
    return np.array(places), np.array(joints), np.array(axes), tip


def weight_moments(q, payload=0.0, gravity=G):
    """Gravity's moment about each joint [N m], (9,), by hand."""
    com, joints, axes, tip = com_places(q)
    mass, com = np.append(ARM.link_mass, payload), np.vstack([com, tip])
    return np.array(
        [axes[i] @ np.cross(com[i:] - joints[i], mass[i:, None] * gravity).sum(0) for i in range(9)]
    )
