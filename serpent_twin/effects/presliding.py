"""Let hinges give way elastically before their dry friction slides.

A hinge that sticks hangs on bristles of compliance c, which slide at the friction F: Jenkins' element, whose
torque changes by q̇ / c within ±F. Where the friction creeps near rest, q̇ = v τ / F, bristle and dashpot are
in series. Source: Jenkin, 1922, as in Iwan, J. Applied Mechanics 33 (1966) 893; Al-Bender and Swevers, IEEE
Control Systems 28 (2008) 64, on presliding.
"""

from typing import Any

import numpy as np

from serpent_twin.arrays import Array

_LEAST = 1e-9
_SLIDES = 0.01
"""A hinge at its limit slides if a step at its speed would load the bristles by more than this share of the
friction. A slower one hangs on them, and they carry it back when it is let go
"""
_HARD = 1e-4
"""Transition velocity of a hinge that slides [rad/s]"""


def give_way(moment: Any, held: Array, compliance: Array | float) -> None:
    """Let the hinges' friction give way elastically [rad/(N m)]; `held` is what the bristles hold [N m],
    (n, 9), changed in place.

    The implicit Euler rule: of the torque after a step, what was held before acts from outside, and the rest
    is the constraint's, in proportion to the speed. The constraint is as strong either way, so a hinge that
    slides has all of its friction in it, and none outside.
    """
    friction, creeps, dt = moment.joint_friction, moment.transition_velocity, moment.dt
    limit, went = np.maximum(friction, _LEAST), dt * moment.joint_velocity
    dt = np.maximum(dt, _LEAST)
    give = np.maximum(compliance + dt * creeps / limit, _LEAST)
    room, loaded = limit * give, compliance * held + went
    slides = (np.abs(loaded) >= room) & (np.abs(went) > _SLIDES * room)
    np.minimum(np.maximum(loaded / give, -limit), limit, out=held)
    outside = np.where(slides, 0.0, held * compliance / give)
    moment.joint_torque = moment.joint_torque - outside
    elastic = np.greater(compliance, 0.0)
    held_in = np.where(elastic, limit + np.abs(outside), friction)
    near = np.where(slides, _HARD, held_in * give / dt)
    moment.transition_velocity = np.where(elastic, near, creeps)
    moment.joint_friction = held_in
