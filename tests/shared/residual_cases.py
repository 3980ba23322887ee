"""Made-up comparisons of an arm with its twin, by what the twin lacks."""

from functools import cache

import numpy as np

from serpent_twin.arm.geometry import joint_axis, link_frames, markers, motor_from_joint
from serpent_twin.residual import Comparison, analyse

PERIOD = 0.25
NOISE, LOAD_NOISE = 0.4e-3, 0.007


def motion(rng, S, T):
    """Joint angles and velocities under P control to random targets, new every five rows."""
    low = np.where(np.arange(9) % 2 == 0, -np.pi / 8, 0.0)
    target = np.repeat(rng.uniform(low, np.pi / 8, (T // 5 + 5, S, 9)), 5, axis=0)
    q, rows = np.zeros((S, 9)), []
    for goal in target[: T + 20]:
        dq = 1.6 * (goal - q)
        rows.append((q, dq))
        q = q + PERIOD * dq
    return (np.stack(column[20:], axis=1) for column in zip(*rows, strict=True))


def predicted_loads(q, dm):
    gravity = 0.03 * np.cumsum(np.sin(q[..., ::-1]), axis=-1)[..., ::-1]
    return np.concatenate([gravity, 0.1 * gravity[..., :1]], axis=-1) + 0.03 * np.tanh(dm / 0.05)


def made(seed, S=10, T=160, sessions=1, noise=NOISE, turn=None, load=None, shift=None):
    """A comparison whose twin lacks rotations [rad], loads or shifts [m] given as functions.

    Each is a function of joint angles, joint velocities, motor angles, predicted loads and time.
    """
    rng = np.random.default_rng(seed)
    q, dq = motion(rng, S, T)
    m, dm = (np.concatenate([v, v[..., -1:]], -1) for v in map(motor_from_joint, (q, dq)))
    time = ((np.arange(S) % (S // sessions)) * T)[:, None] * PERIOD + PERIOD * np.arange(T)
    loads = predicted_loads(q, dm)
    state = (q, dq, m, loads, time)
    origin, rotation = link_frames(q)
    measured = markers(q + (turn(*state) if turn else 0)) + (shift(*state) if shift else 0)
    measured = measured + rng.normal(0, noise, measured.shape)
    measured[rng.random(measured.shape[:3]) < 0.002] = np.nan
    felt = loads + (load(*state) if load else 0) + rng.normal(0, LOAD_NOISE, loads.shape)
    return Comparison(
        session=tuple(f"session_{s * sessions // S + 1:02d}" for s in range(S)),
        time=time,
        marker_measured=measured,
        marker_predicted=markers(q),
        load_measured=felt,
        load_predicted=loads,
        motor_angle=m,
        motor_velocity=dm,
        motor_command=dm,
        joint_angle=q,
        tension=50 * np.concatenate([np.maximum(loads, 0), np.maximum(-loads, 0)], axis=-1),
        joint_anchor=origin,
        joint_axis=np.stack([rotation[..., i, :, :] @ joint_axis(i) for i in range(9)], axis=-2),
    )


def only(index, values, count=9):
    """The values for one joint or motor, nought for the others."""
    return values[..., None] * (np.arange(count) == index)


def fading(values, seconds):
    """Exponentially fading mean over rows, by its definition."""
    keep, out = np.exp(-PERIOD / seconds), [values[:, 0]]
    for row in values.T[1:]:
        out.append(keep * out[-1] + (1 - keep) * row)
    return np.stack(out, axis=1)


def held_back(q, dq, *_):
    inside = (q[..., 3] > 0.14) & (q[..., 3] < 0.26)
    return only(3, -0.03 * np.sign(dq[..., 3]) * inside)


SWAY = np.linspace(0, 1, 9)[:, None] * np.array([0, 1e-3, 0])
CASES = {
    "nothing": {},
    "force": {"turn": lambda q, *_: only(3, 0.02 * (q[..., 3] > 0.21))},
    "sticks": {"turn": held_back},
    "ripple": {"load": lambda q, dq, m, *_: only(2, 0.012 * np.sin(6 * m[..., 2]), 10)},
    "shaken": {"turn": lambda q, *_: 0.02 * np.random.default_rng(9).standard_normal(q.shape)},
    "sway": {"shift": lambda *s: np.sin(2 * np.pi * 0.7 * s[-1])[..., None, None] * SWAY},
    "drift": {"turn": lambda *s: only(5, 0.02 * s[-1] / 400)},
    "jump": {"turn": lambda *s: only(6, 0.015 * (s[-1] > 213))},
    "play": {"turn": lambda q, dq, *_: only(4, -0.01 * np.tanh(dq[..., 4] / 0.02))},
    "creep": {"turn": lambda *s: only(2, 0.5 * fading(s[3][..., 2], 10.0))},
    "delay": {"turn": lambda q, dq, *_: -0.02 * dq},
}


@cache
def case(name):
    return made(1, **CASES[name])


@cache
def found(name):
    return analyse(case(name), np.random.default_rng(0), permutations=99)
