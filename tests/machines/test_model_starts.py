"""Test that what a twin may leave holds the error of a start that is known by noisy readings."""

import numpy as np
from example import Example, opened

MASS, GEAR, NOISE, RATE = 2.0, 3.0, 2e-4, 50.0  # [kg], [N], [m], [Hz]
CART = f"""<mujoco>
  <option timestep="0.004"/>
  <worldbody><body name="cart">
    <joint name="rail" type="slide" axis="1 0 0"/>
    <geom size="0.1" mass="{MASS}" contype="0" conaffinity="0"/>
  </body></worldbody>
  <actuator><motor name="belt" joint="rail" gear="{GEAR}"/></actuator>
</mujoco>
"""
TOML = """schema_version = 1
model = "cart.xml"
rows = "motion"
time = { column = "t", unit = "s" }
steps = 16
drive = [{ actuator = "belt", column = "current" }]
measured = [{ joint = "rail", columns = ["x"], unit = "m" }]
"""


def _log(path, seed, rows=1500):
    """A cart without friction, whose force is constant in each row: the exact motion, read with noise."""
    rng, dt = np.random.default_rng(seed), 1 / RATE
    time = np.arange(rows) * dt
    current = np.sin(2 * np.pi * 0.5 * time) + 0.3 * np.sin(2 * np.pi * 1.1 * time + seed)
    force = GEAR * current / MASS
    speed = np.r_[0.0, np.cumsum(force * dt)[:-1]] - 0.47
    place = np.r_[0.0, np.cumsum(speed * dt + force * dt**2 / 2)[:-1]]
    seen = place + NOISE * rng.standard_normal(rows)
    table = "\n".join(
        f"{t:.4f},{u:.9f},{x:.9f}" for t, u, x in zip(time, current, seen, strict=True)
    )
    path.write_text(f"t,current,x\n{table}\n")


def test_an_error_of_the_start_that_noise_makes_is_expected(tmp_path):
    """A cart that nothing brakes drifts by the noise of its start; of a spring, none would be left."""
    Example(CART, TOML).write(tmp_path)
    _log(tmp_path / "log.csv", 1)
    case, pieces, true = opened(tmp_path / "machine.toml", tmp_path / "log.csv")
    off = pieces.measured - case.machine.respond([true], pieces)[0]
    left = 1e3 * np.nanmean(np.abs(off))
    wanted = case.expected(true, [true] * 4, pieces, np.random.default_rng(0))
    assert left > 2 * 1e3 * NOISE * np.sqrt(2 / np.pi)
    np.testing.assert_allclose(wanted, left, rtol=0.25)
