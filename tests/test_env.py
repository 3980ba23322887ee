"""Test dm_env's contract of the environment over a bus."""

import numpy as np
from absl.testing import absltest
from dm_env import test_utils

from serpent_twin import env
from serpent_twin.arm.control import joint_p_control
from serpent_twin.arm.geometry import motor_from_joint
from serpent_twin.emulator.simulated_bus import SimulatedBus


class EnvironmentContract(test_utils.EnvironmentTestMixin, absltest.TestCase):
    """dm_env's own checks, over more than one episode."""

    def make_object_under_test(self):
        return env.make(steps=8)

    def make_action_sequence(self):
        spec = self.environment.action_spec()
        rng = np.random.default_rng(0)
        for _ in range(20):
            yield rng.uniform(spec.minimum, spec.maximum, spec.shape) / 20


def test_episode_ends_with_its_targets():
    environment = env.make(steps=5)
    steps = [environment.reset(), *(environment.step(np.zeros(10)) for _ in range(5))]
    assert [s.last() for s in steps] == [False] * 5 + [True]
    assert steps[-1].discount == 1.0


def test_p_control_earns_more_than_resting():
    def final_reward(policy):
        environment = env.make(steps=5, seed=3)
        step = environment.reset()
        while not step.last():
            step = environment.step(policy(step.observation))
        return step.reward

    gain = 3.0
    moving = final_reward(lambda o: joint_p_control(o["target"], o["position"], gain))
    resting = final_reward(lambda o: np.zeros(10))
    assert moving > resting / 2


def test_action_is_what_the_motors_do():
    environment = env.make(steps=100)
    environment.reset()
    velocity = 0.3 * motor_from_joint(np.full(9, 0.1))
    velocity = np.append(velocity, velocity[-1])
    for _ in range(4):
        step = environment.step(velocity)
    assert np.allclose(step.observation["velocity"], velocity, atol=0.03)
    assert np.allclose(step.observation["position"], velocity * 1.0, atol=0.03)


def test_a_tripped_motor_ends_the_episode_as_a_failure():
    buses = []

    def open_bus():
        buses.append(SimulatedBus())
        return buses[-1]

    environment = env.make(open_bus)
    environment.reset()
    buses[-1].motors.hardware_error[3] = 1 << 5
    step = environment.step(np.zeros(10))
    assert step.last() and step.discount == 0.0


def test_reset_starts_straight_and_releases_the_old_bus():
    environment = env.make(steps=5)
    first = environment.reset()
    old = environment.physics.bus
    environment.step(np.ones(10))
    again = environment.reset()
    assert np.array_equal(first.observation["position"], again.observation["position"])
    assert environment.physics.bus is not old
    assert not old._connected
