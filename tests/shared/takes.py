"""A session without markers, and the take of it that cameras film."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from serpent_twin.arm.control import joint_p_control, random_targets
from serpent_twin.emulator.simulated_bus import SimulatedBus
from serpent_twin.hardware.base_frame import Rigid
from serpent_twin.sessions import FIELDS, Session, read_session, write_session
from serpent_twin.sessions.merge import Merge, merge
from serpent_twin.sim.twin import Twin

NOISE = 5e-4
DRIFT = 30e-6
CAMERAS = Rigid(Rotation.from_rotvec([0.7, -1.1, 2.0]).as_matrix(), np.array([0.4, 1.3, -2.0]))


def simulated(rows, seed, rate=4.0):
    """A session without markers, and the twin's true markers in between: times, (T,), (T, 9, 3)."""
    rng = np.random.default_rng(seed)
    bus, period, fine = SimulatedBus(Twin(), rng, 0.015), 1 / rate, 0.01
    targets = random_targets(rows, rng, hold=round(1.25 * rate))
    log, times, truth = [], [], []
    with bus:
        bus.enable_torque()
        for target in targets:
            state = bus.read_state()
            sent = bus.write_velocity(joint_p_control(target, state.position, 2.29))
            log.append((bus.time, state.position, state.velocity, state.load, sent, target))
            for _ in range(round(period / fine)):
                times.append(bus.time)
                truth.append(bus.twin.markers[0])
                bus.wait(fine)
    metadata = {"backend": "real", "arm": "twin", "session": 1, "rate_hz": rate, "markers": "none"}
    columns = [np.array(column) for column in zip(*log, strict=True)]
    columns = dict(zip(FIELDS, [*columns, np.full((rows, 9, 3), np.nan)], strict=True))
    session = Session(None, {"schema_version": 1} | metadata, columns)
    return session, np.array(times), np.array(truth)


def filmed(times, truth, start, seed, pad=15.0, loss=0.03):
    """Frame numbers and what cameras see of the truth, log time 0 being at camera time `start`."""
    rng = np.random.default_rng(seed)
    frame = np.arange(int((start - pad) * 120), int((start + times[-1] * (1 + DRIFT) + pad) * 120))
    at = np.clip((frame / 120 - start) / (1 + DRIFT), 0.0, times[-1])
    seen = CAMERAS.apply(CubicSpline(times, truth)(at))
    seen += NOISE * rng.standard_normal(seen.shape)
    seen[rng.random(seen.shape[:2]) < loss] = np.nan
    return frame, seen


def merged(tmp_path, session, take, **options):
    path = tmp_path / "logs" / "session_01.parquet"
    path.parent.mkdir(exist_ok=True)
    if not path.exists():
        write_session(path, session)
    config = Merge(path, take, tmp_path / f"out{len(list(tmp_path.glob('out*')))}", **options)
    (_result,) = [s for s, _ in merge(config)]
    return read_session(config.out / "session_01.parquet")
