"""Step the arms from one reading to the next."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from serpent_twin.arm.geometry import N_JOINTS
from serpent_twin.arrays import Array

from . import accidents
from .cables import RADIUS, Strands
from .chain import GRAVITY, Payloads, Pose, chain
from .effects import Effects
from .parameters import BenchArm
from .servo import ServoBatch

NEWTON = 8  # most iterations of a step; two are common
MIDDLE = 0.51  # of a step is where forces are taken: 0.5 keeps energy, more calms stiff modes
BRISTLE_DAMPING = 1e-3  # s: damping of a sticking hinge over its stiffness
FLEX_DAMPING = 2e-3  # s: damping of a link that flexes over its stiffness
_OUTER = np.maximum.outer(np.arange(N_JOINTS), np.arange(N_JOINTS))


class ArmBatch:
    """R arms side by side, each with its own parameters and effects.

    Motors step first, then the hinges with the cables at the motors' new angles; stiff terms
    (strands, their going slack, dry friction) are solved together by Newton's method. Dry friction
    is a bristle that gives way elastically and slides at its limit. The jaw follows motor 10 on
    its taut loop and is left out: that loop carries no tension, so motor 10 feels its gear alone.
    """

    def __init__(
        self, arms: Sequence[BenchArm], effects: Sequence[Effects], h: float, clock: Array
    ) -> None:
        self.h, self.clock, self.effects = h, clock.copy(), effects
        self.elapsed = 0.0
        """Time in the session [s]"""
        self.accidents = [e.accidents for e in effects]
        payload = Payloads(
            np.array([e.payload for e in effects]),
            np.array([e.payload_link - 1 for e in effects]),
            np.array([e.payload_at for e in effects]),
        )
        self.chain = chain(arms, payload, effects[0].flexes)
        self.camera_shift = np.array([[a.camera_shift] for a in arms])
        self.camera_turn = Rotation.from_rotvec([a.camera_turn for a in arms]).as_matrix()
        self.joint = self.chain.joint
        self.strands, self.servos = Strands(arms, effects), ServoBatch(arms, effects)
        self.ratio = np.array([a.radius_ratio for a in arms])
        self.friction = np.array([a.joint_friction for a in arms])
        self.bristle = np.array([[a.bristle_stiffness] for a in arms])
        self.gravity = np.array([_gravity(e) for e in effects])
        self.spring, self.damping = self._hinge_springs(arms, effects)
        self.pulley_friction = np.array([[e.cable_friction] for e in effects])
        self.wrap_friction = np.array([[e.cable_friction_wrap] for e in effects])
        shape = (len(arms), self.chain.n_hinges)
        self.q, self.dq = np.zeros(shape), np.zeros(shape)
        self.bent = np.zeros((len(arms), N_JOINTS))
        """Elastic deflection of each hinge's bristle [rad]."""
        self.relaxed = np.zeros((len(arms), N_JOINTS))
        """Joint angles at which springs that relax have no torque [rad]"""
        self.tension = np.zeros((len(arms), 2, N_JOINTS))
        self.push = np.zeros((len(arms), N_JOINTS, 3))
        """What pushes each link's centre of mass, in the base frame [N]"""

    def _hinge_springs(
        self, arms: Sequence[BenchArm], effects: Sequence[Effects]
    ) -> tuple[Array, Array]:
        """Stiffness [N m/rad] and damping [N m s/rad] of all hinges, (R, H)."""
        of = {"z": "link_flex", "y": "link_flex", "x": "link_twist"}
        each = ("joint", *(of[axis] for axis in effects[0].flexes))
        per_link = [[1 / getattr(e, name, np.inf) for name in each] for e in effects]
        spring = np.tile(per_link, N_JOINTS)
        damping = FLEX_DAMPING * spring
        spring[:, self.joint] = [[e.joint_elasticity] for e in effects]
        damping[:, self.joint] = [[a.joint_damping] for a in arms]
        return spring, damping

    def step(self, command: Array) -> None:
        """Advance h at velocity commands [rad/s], (R, 10)."""
        if any(self.accidents):
            self.servos.slip = accidents.winch_slip(self.accidents, self.clock)
            self.servos.rubbing = accidents.gear_friction(self.accidents, self.servos.angle)
        self.servos.warm(self.elapsed)
        self.servos.step(command, self.motor_torque(), self.h)
        limit = self._friction_limit()
        middle = MIDDLE * self.h
        speed = self._solve(limit, middle)
        grip = np.clip(self._grip(speed[:, self.joint], middle), -limit, limit)
        loose = self.bristle * (1 + BRISTLE_DAMPING / middle)
        bent = grip / loose + self.bent * (1 - self.bristle / loose)
        bent = self.bent + (bent - self.bent) / MIDDLE
        self.bent = np.clip(bent, -limit / self.bristle, limit / self.bristle)
        self.q += self.h * speed
        self.dq = self.dq + (speed - self.dq) / MIDDLE
        self.clock += self.h
        self.elapsed += self.h
        self.strands.age(self.tension, self.h, self.clock)
        if any(self.accidents):
            shape = self.tension.shape
            self.strands.rest += accidents.strand_slack(self.accidents, self.clock, shape)
            accidents.relax(self.accidents, self.q[:, self.joint], self.relaxed, self.h)

    def motor_torque(self) -> Array:
        """Torque of the cables against each motor [N m], (R, 10)."""
        torque = np.zeros((len(self.q), N_JOINTS + 1))
        torque[:, :N_JOINTS] = self.ratio * RADIUS * (self.tension[:, 0] - self.tension[:, 1])
        return torque

    def seen(self, place: Array) -> Array:
        """Places in the base frame (R, …, 3) as the cameras' frame has them [m]."""
        return place @ self.camera_turn.swapaxes(1, 2) + self.camera_shift

    def markers(self, q: Array) -> Array:
        """Marker places [m], (R, 9, 3), at hinge angles q (R, H)."""
        return self.chain.markers(self.chain.pose(q))

    def _solve(self, limit: Array, h: float) -> Array:
        """Hinge velocities [rad/s], (R, H), h [s] from now, under friction limits [N m], (R, 9)."""
        joint = self.joint
        pose = self.chain.pose(self.q + h * self.dq)
        jacobian = self.chain.jacobian(pose)
        inertia = jacobian @ jacobian.swapaxes(1, 2)
        torque = self._outside(pose) - self.spring * self.q
        torque -= self.chain.bias(pose, jacobian, self.dq, self.gravity)
        fixed = (inertia @ self.dq[..., None])[..., 0] + h * torque
        diagonal = np.arange(self.chain.n_hinges)
        inertia[:, diagonal, diagonal] += h * (self.damping + h * self.spring)
        speed, moving = self.dq.copy(), np.arange(len(self.q))
        before: np.ndarray | None = None
        for _ in range(NEWTON):
            pull, slope, state = self._implicit(speed[:, joint], limit, h)
            if before is not None:
                moving = moving[(state != before)[moving].any(axis=1)]
            if not len(moving):
                break
            matrix, right = inertia[moving], fixed[moving]
            matrix[:, joint[:, None], joint] += h * slope[moving]
            known = (slope[moving] @ speed[moving][:, joint, None])[..., 0]
            right[:, joint] += h * (pull[moving] + known)
            speed[moving], before = np.linalg.solve(matrix, right[..., None])[..., 0], state
        return speed

    def _implicit(self, speed: Array, limit: Array, h: float) -> tuple[Array, Array, np.ndarray]:
        """Cables and dry friction after h [s] of the joints' motion at `speed` [rad/s], (R, 9).

        Returns joint torques [N m], (R, 9), minus their slopes by speed, (R, 9, 9), and which
        strands pull and hinges stick: Newton has converged when these stay.
        """
        servos, turn = self.servos, np.cumsum(speed, axis=1)
        rate = RADIUS * (self.ratio * servos.winch_speed - turn)
        angle = np.cumsum(self.q[:, self.joint], axis=1)
        before = self.ratio * (servos.winch - self.h * servos.winch_speed)
        loop = RADIUS * (before - angle) + h * rate
        self.tension, stiff, damp, taut = self.strands.pull(loop, rate)
        moment = RADIUS * (self.tension[:, 0] - self.tension[:, 1])
        slope = RADIUS**2 * (h * stiff + damp).sum(1)
        torque = np.cumsum(moment[:, ::-1], axis=1)[:, ::-1]
        matrix = np.take(np.cumsum(slope[:, ::-1], axis=1)[:, ::-1], _OUTER, axis=1)
        tried = self._grip(speed, h)
        friction = np.clip(tried, -limit, limit)
        sticks = friction == tried
        diagonal = np.arange(N_JOINTS)
        matrix[:, diagonal, diagonal] += self.bristle * (h + BRISTLE_DAMPING) * sticks
        state = np.concatenate([taut.reshape(len(speed), -1), sticks, friction > 0], axis=1)
        return torque - friction, matrix, state

    def _grip(self, speed: Array, h: float) -> Array:
        """Friction after h [s] at `speed` [rad/s] of hinges that stick [N m], (R, 9)."""
        return self.bristle * (self.bent + (h + BRISTLE_DAMPING) * speed)

    def _friction_limit(self) -> Array:
        """Dry friction that each joint can give now [N m], (R, 9)."""
        limit = self.friction
        if self.pulley_friction.any() or self.wrap_friction.any():
            q = self.q[:, self.joint]
            moment = RADIUS * (self.strands.affected * self.tension).sum(1)
            passing = np.cumsum(moment[:, ::-1], axis=1)[:, ::-1]
            share = self.pulley_friction + np.expm1(self.wrap_friction * np.abs(q))
            limit = limit + share * passing
        for row, e in enumerate(self.effects):
            if e.sticking_joint:
                at, (low, high) = e.stick_joint - 1, e.stick_window
                if low <= self.q[row, self.joint[at]] <= high:
                    limit = limit.copy()
                    limit[row, at] *= 1 + e.sticking_joint
        return limit

    def _outside(self, pose: Pose) -> Array:
        """Hinge torques of an outside force [N m], (R, H)."""
        torque = np.zeros_like(self.q)
        for row, e in enumerate(self.effects):
            if e.outside_force and self.q[row, self.joint[e.force_joint - 1]] > e.force_threshold:
                force = e.outside_force * np.array(e.force_direction)
                torque[row] += self._of_force(pose, row, e.force_link, force)
        for row, link in zip(*np.nonzero(self.push.any(axis=2)), strict=True):
            torque[row] += self._of_force(pose, row, link + 1, self.push[row, link])
        if any(self.accidents):
            angle = self.q[:, self.joint]
            torque[:, self.joint] += accidents.stop_torque(self.accidents, angle)
            torque[:, self.joint] += accidents.relaxing_torque(self.accidents, angle, self.relaxed)
            for row, each in accidents.of_kind(self.accidents, "swinging_push"):
                force = accidents.swinging(each, self.clock[row])
                torque[row] += self._of_force(pose, row, each.part, force)
            for row, each in accidents.of_kind(self.accidents, "elastic_cord"):
                force = accidents.cord(each, pose.com[row, self._body(each.part)])
                torque[row] += self._of_force(pose, row, each.part, force)
        return torque

    def _body(self, link: int) -> int:
        """The chain's first body of a link."""
        return int(np.flatnonzero(self.chain.carrier >= self.joint[link - 1])[0])

    def _of_force(self, pose: Pose, row: int, link: int, force: Array) -> Array:
        """Hinge torques of a force on one link's centre of mass [N m], (H,)."""
        body = self._body(link)
        moved = np.cross(pose.axis[row], pose.com[row, body] - pose.origin[row]) @ force
        return moved * (np.arange(len(moved)) <= self.chain.carrier[body])

    def frames(self, q: Array) -> tuple[Array, Array]:
        """Origins, (R, 9, 3), and rotations, (R, 9, 3, 3), of the links in the base frame, at hinge angles q
        (R, H).
        """
        pose = self.chain.pose(q)
        return pose.origin[:, self.joint], pose.rotation[:, self.joint]


def _gravity(e: Effects) -> Array:
    """Gravity in the base frame [m/s²], (3,): x turned about y, then z, by small parts of the tilt."""
    about_y = e.base_tilt * np.cos(e.tilt_direction)
    about_z = e.base_tilt * np.sin(e.tilt_direction)
    return GRAVITY * np.array(
        [
            np.cos(about_y) * np.cos(about_z),
            np.cos(about_y) * np.sin(about_z),
            -np.sin(about_y),
        ]
    )
