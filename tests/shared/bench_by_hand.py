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


def com_places(q, link=9, behind=0.090):
    """Centres of mass by hand: half of each link's length behind its joint, (9, 3), from q (9,); the joints,
    their axes, and a place on a link.
    """
    at, turn, places, joints, axes = np.zeros(3), np.eye(3), [], [], []
    for i, length in enumerate(ARM.link_length):
        c, s = np.cos(q[i]), np.sin(q[i])
        z = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        y = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        axes.append(turn @ ([0, 0, 1.0] if i % 2 == 0 else [0, 1.0, 0]))
        turn = turn @ (z if i % 2 == 0 else y)
        joints.append(at)
        places.append(at + turn @ [length / 2, 0, 0])
        if i == link - 1:
            held = at + turn @ [behind, 0, 0]
        at = at + turn @ [length, 0, 0]
    return np.array(places), np.array(joints), np.array(axes), held


def weight_moments(q, effects=NONE, gravity=G):
    """Gravity's moment about each joint [N m], (9,), by hand."""
    com, joints, axes, held = com_places(q, effects.payload_link, effects.payload_at)
    beyond = [np.cross(com[i:] - joints[i], np.outer(ARM.link_mass[i:], gravity)) for i in range(9)]
    of_payload = np.cross(held - joints, effects.payload * gravity)
    of_payload[effects.payload_link :] = 0
    return np.array([axes[i] @ (beyond[i].sum(0) + of_payload[i]) for i in range(9)])
