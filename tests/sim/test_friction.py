"""Test that hinges creep below their transition velocity, and slide above it with Coulomb's friction."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from moments import moment

from serpent_twin.arm import mjcf
from serpent_twin.arm.parameters import NOMINAL
from serpent_twin.effects import KNOWN
from serpent_twin.effects.cable_friction import rub
from serpent_twin.emulator.simulated_bus import SimulatedBus
from serpent_twin.engine.friction_softness import STICKS, soften, softness
from serpent_twin.sim.twin import Twin
from serpent_twin.sim.twin_model import NOMINAL_TWIN, TwinModel

FRICTION, TRANSITION = 0.02, 0.03
CREEPING = TwinModel(replace(NOMINAL, transition_velocity=TRANSITION))


def pushed(torque, inertia, transition, seconds=2.0):
    """Velocity of one hinge after a constant torque has pushed it from rest."""
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = 0.002, np.zeros(3)
    body = spec.worldbody.add_body()
    body.explicitinertial, body.mass, body.inertia = True, 1.0, np.full(3, inertia)
    hinge = body.add_joint(name="hinge", type=mujoco.mjtJoint.mjJNT_HINGE, frictionloss=FRICTION)
    hinge.solimp_friction[:2] = STICKS
    soften(spec, {"hinge": transition})
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qfrc_applied[0] = torque
    mujoco.mj_step(model, data, int(seconds / model.opt.timestep))
    return float(data.qvel[0])


@pytest.mark.parametrize("inertia", [1e-4, 1e-2, 0.3])
@pytest.mark.parametrize("share", [0.2, 0.7])
def test_a_loaded_hinge_creeps_in_proportion_to_its_load(inertia, share):
    relaxed = share * TRANSITION * -np.expm1(-2.0 * FRICTION / (TRANSITION * inertia))
    assert pushed(share * FRICTION, inertia, TRANSITION) == pytest.approx(relaxed, rel=0.03)


def test_above_it_friction_is_coulombs():
    inertia = 0.3
    ended = pushed(3 * FRICTION, inertia, TRANSITION)
    assert ended == pytest.approx(2 * FRICTION / inertia * 2.0, rel=0.1)


def test_without_it_hinges_stick():
    assert pushed(0.9 * FRICTION, 1e-2, 0.0) < 1e-3
    assert NOMINAL_TWIN.spec().to_xml() == mjcf.build().to_xml()
    assert softness(np.array(0.02), np.array(1e4), 0.0) == pytest.approx((0.02, STICKS))


def test_twin_xml_has_it_and_the_arm_is_another():
    model = mujoco.MjModel.from_xml_string(CREEPING.xml())
    dof = model.joint("joint9").dofadr[0]
    assert model.dof_solimp[dof, 0] < STICKS
    assert CREEPING.fingerprint() != NOMINAL_TWIN.fingerprint()


def test_friction_that_grows_with_tension_creeps_alike():
    """Friction that is declared once and friction that is written in every step make the same motion."""
    idle = KNOWN["cable_friction"](1e-12, TRANSITION)
    angles = []
    for design in (CREEPING, CREEPING.with_effect(idle)):
        twin = Twin(design)
        with SimulatedBus(twin) as bus:
            bus.enable_torque()
            bus.write_velocity(np.full(10, 0.2))
            bus.wait(2.0)
            angles.append(twin.joint_angle[0].copy())
    assert angles[1] == pytest.approx(angles[0], abs=1e-9)


def test_frictions_side_by_side_creep_as_dashpots_do():
    rubbing = moment(transition_velocity=np.full((1, 9), 0.01))
    rub(rubbing, np.full((1, 9), 0.015), 0.06)
    assert rubbing.joint_friction == pytest.approx(0.02)
    slope = 0.005 / 0.01 + 0.015 / 0.06
    assert rubbing.transition_velocity == pytest.approx(0.02 / slope)
    stuck = moment()
    rub(stuck, np.full((1, 9), 0.015), 0.06)
    assert (stuck.transition_velocity < 1e-6).all()
