"""Test the soft trunk against statics and its servos' laws: hanging, bending, lag and sag."""

import json

import numpy as np
import pytest
from measured_logs import DATA, WHERE, write_log
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from trunk_runs import answer, log, made, moving, shape

from serpent_twin.errors import SerpentError
from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit
from serpent_twin.machines.machine import ParameterVector
from serpent_twin.machines.trunk import MACHINE, Trunk
from serpent_twin.machines.trunk.shape import ANGLES, CHANNEL, ENDS_AT, GOALS, KINDS, SEEN, TURNED
from serpent_twin.tables.segments import Stretch, cut

MEASURED = DATA / "trunk"
measured = pytest.mark.skipif(not MEASURED.is_dir(), reason=WHERE)
GRAVITY, PIECES, CABLE = 9.81, 4, 6e3


def statics(of, goal):
    """Disks at rest (3, 3), and what cables ask of servos (6,): the least energy, found by scipy."""
    length = np.repeat(of["length"] / PIECES, PIECES)
    share = of["end"][0]
    mass = length / length.sum() / (1 + share)
    hangs = Rotation.from_matrix([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    base = Rotation.from_rotvec([of["tilt"][0], 0, of["tilt"][1]]) * hangs
    both = np.repeat(of["direction"], 2) + np.tile([0, np.pi], 6)
    holes = CHANNEL * np.stack([0 * both, np.cos(both), np.sin(both)], axis=1)

    def places(q):
        """Holes of base and disks (4, 12, 3), markers (3, 3), heights of the pieces' middles and the end."""
        at, turn, gap = of["base"], base, 0.0
        passes, markers, heights = [at + turn.apply(holes)], [], []
        for n, (about_y, about_z) in enumerate(q.reshape(-1, 2)):
            at = at + turn.apply([gap + length[n] / 2, 0, 0])
            turn = turn * Rotation.from_euler("YZ", [about_y, about_z])
            gap = length[n] / 2
            heights.append(at[1])
            if n % PIECES == PIECES - 1:
                disk = n // PIECES
                passes.append(at + turn.apply(holes + [gap, 0, 0]))
                markers.append(at + turn.apply(of["disk"].reshape(3, 3)[disk] + [gap, 0, 0]))
        return np.array(passes), np.array(markers), [*heights, (at + turn.apply([gap, 0, 0]))[1]]

    def stretch(passes):
        runs = np.linalg.norm(np.diff(passes, axis=0), axis=2).T
        long = np.array([runs[k, : ENDS_AT[k // 2]].sum() for k in range(12)])
        straight = np.array([of["length"][: ENDS_AT[k // 2]].sum() for k in range(12)])
        wound = of["wound"][np.array(ENDS_AT) - 1] * (goal + of["zero"])
        rest = straight - np.repeat(of["pulled"], 2) - np.repeat(wound, 2) * np.tile([1, -1], 6)
        return np.maximum(long - rest, 0)

    def energy(q):
        passes, _, heights = places(q)
        bent = of["hose"][0] / np.repeat(length, 2) * q**2
        weight = (
            GRAVITY * of["weight"][0] * (mass @ heights[:-1] + share / (1 + share) * heights[-1])
        )
        return weight + (bent.sum() + CABLE * (stretch(passes) ** 2).sum()) / 2

    found = minimize(energy, np.zeros(24), method="BFGS", options={"gtol": 1e-4, "maxiter": 400})
    passes, markers, _ = places(found.x)
    tension = CABLE * stretch(passes)
    wound = of["wound"][np.array(ENDS_AT) - 1]
    return markers, wound * (tension[0::2] - tension[1::2])


@pytest.mark.parametrize(
    "goal", [[0, 0, 0, 0, 0, 0], [0.5, 0, 0.3, 0, 0, 0], [0, 0.9, 0, -0.4, -0.3, 0.2]]
)
def test_at_rest_its_energy_is_least(goal):
    disks, _, _ = answer(Trunk(shape()), log(goal))
    expected, _ = statics(shape(), np.array(goal))
    np.testing.assert_allclose(disks[-1], expected, atol=2e-5)


def test_a_servo_that_gives_way_settles_short_by_compliance_times_torque():
    goal, compliance = np.array([0.4, 0.7, 0.3, 0, 0, 0]), 0.03
    _, servos, _ = answer(Trunk(shape()), log(goal), servo_sag=[compliance, 0.05])
    _, torque = statics(shape(), servos[-1])
    np.testing.assert_allclose(goal - servos[-1], compliance * torque, atol=2e-3)


def test_without_load_it_follows_a_step_like_a_first_order_lag():
    goal = np.repeat([[0.0] * 6, [0.3] * 6], [100, 200], axis=0)
    free = Trunk(shape(pulled=[-0.1] * 6), every=1)
    _, servos, time = answer(free, log(goal), servo_sag=[0.03, 0.2])
    since = time - 1.0
    expected = np.where(since > 0, 0.3 * (1 - np.exp(-since / 0.2)), 0.0)
    np.testing.assert_allclose(servos[:, 0], expected, atol=0.012)  # 8 ms: less than a time step


def test_a_delay_moves_servos_and_disks_alike():
    time = 0.01 * np.arange(500)
    goal = 0.3 * np.sin(2 * np.pi * 0.5 * time)[:, None] * np.ones(6)
    now = answer(Trunk(shape()), log(goal))
    late = answer(Trunk(shape()), log(goal), command_delay=[0.14])
    for before, after in zip(now[:2], late[:2], strict=True):
        np.testing.assert_allclose(after[107:], before[100:-7], atol=2e-4)


def test_links_shorten_by_hooke():
    """Hanging straight on no cables, each link carries what is below its middle, and the end."""
    hanging = shape(pulled=[-0.1] * 6, tilt=[0.0, 0.0], disk=[0.0] * 9)
    compliance, share = 1e-4, 0.4
    down = [answer(Trunk(hanging), log([0.0] * 6), **there)[0][-1, 2, 1] for there in
            ({}, {"link_compression": [compliance]})]  # fmt: skip
    length = np.repeat(hanging["length"] / PIECES, PIECES)
    mass = length / length.sum() / (1 + share)
    carried = 1.2 * np.cumsum(mass[::-1])[::-1] + 1.2 * share / (1 + share)
    assert down[0] - down[1] == pytest.approx(compliance * GRAVITY * carried.sum(), rel=0.01)


@pytest.mark.parametrize("name", sorted(set(Trunk(shape()).candidates) - {"mocap_latency"}))
def test_a_vanishing_strength_leaves_the_nominal_trunk(name):
    goal = 0.4 * np.sin(0.02 * np.arange(300))[:, None] * np.array([1, 0.5, -0.5, 1, 0, 1])
    machine = Trunk(shape())
    ranges = list(machine.candidates[name].ranges.values())
    values = [ranges[0].least, *(r.low if r.low else r.typical for r in ranges[1:])]
    nominal, there = (answer(machine, log(goal), **e)[0] for e in ({}, {name: values}))
    late = 2e-3 if name == "servo_sag" else 3e-4  # its lag is not its strength
    np.testing.assert_allclose(there[50:], nominal[50:], atol=late)


def test_a_trunk_that_cannot_be_built_has_no_prediction_and_leaves_the_others():
    """A step of a fit may leave a cable less than no length, which MuJoCo refuses."""
    machine, run = Trunk(shape()), log([0.1] * 6)
    runs = cut(
        [Stretch.whole(run)],
        machine.columns,
        [each.name for each in machine.outputs],
        machine.every,
    )
    at = np.zeros((2, len(machine.declared)))
    names = [each.name for each in machine.declared]
    at[1, names.index("stretch of motor 3's cables at rest")] = 1e4
    nominal, impossible = machine.respond([ParameterVector(x) for x in at], runs)
    assert np.isnan(impossible).all()
    np.testing.assert_allclose(nominal, machine.respond([ParameterVector(at[0])], runs)[0])


def test_what_was_hung_on_is_found_in_the_trunks_own_weights(tmp_path):
    """From twin.json of the bare trunk, as the loop writes it."""
    bare = MACHINE.open([made(Trunk(shape()), moving(14))])
    bare.write(ParameterVector.nominal(bare.declared), tmp_path / "twin.json", {})
    twin = json.loads((tmp_path / "twin.json").read_text())
    loaded = made(bare.machine, moving(34, 1), payload=[0.25, 0.05])
    case = MACHINE.changed(tmp_path / "twin.json").open([loaded])
    assert {name: list(v) for name, v in twin["first"].items()}.keys() == KINDS.keys()
    runs = case.pieces([loaded])
    start = ParameterVector.nominal(case.declared, {"payload": np.array([0.1, 0.05])})
    case = case.reweighted(start, runs)
    found = fit(case, runs, start, free_parameters(case, ["payload"]), 4, 3)
    value, low, high = found.interval("payload", 0)
    assert value == pytest.approx(0.25, rel=0.05)
    assert low < 0.25 < high


def test_angles_are_linear_between_the_rows_in_which_they_are_new(tmp_path):
    angle = np.repeat(np.arange(20.0), 5)
    columns = {"time": 0.01 * np.arange(100)} | dict.fromkeys((*GOALS, *ANGLES, *SEEN), angle)
    (run,) = MACHINE.read(write_log(tmp_path / "some.parquet", {}, **columns))
    np.testing.assert_allclose(run.columns[TURNED[0]][:96], np.arange(96) / 5)


def test_refusals_say_what_to_do(tmp_path):
    case = MACHINE.open([made(Trunk(shape()), moving(4))])
    with pytest.raises(SerpentError, match=r"shorter than 12 s.* Give longer runs"):
        case.pieces([log(moving(11))])
    other = tmp_path / "twin.json"
    other.write_text(json.dumps({"kind": "jaw"}))
    with pytest.raises(SerpentError, match=r'kind is the text "jaw"; it must be "trunk"'):
        MACHINE.changed(other).open([])


def test_a_log_of_another_machine_is_refused(tmp_path):
    path = write_log(tmp_path / "some.parquet", {}, time=0.01 * np.arange(100))
    with pytest.raises(SerpentError, match=r"lacks motor1_command.* another machine"):
        MACHINE.read(path)


def test_files_that_cannot_be_read_say_what_to_do(tmp_path):
    for folder, said in ((tmp_path / "none", "no folder"), (tmp_path, r"no \*\.parquet in")):
        with pytest.raises(SerpentError, match=rf"{said} .*\. Name the folder"):
            MACHINE.read(folder)
    path, rows = tmp_path / "a.parquet", np.arange(100.0)
    columns = {"time": 0.01 * rows} | dict.fromkeys((*GOALS, *ANGLES, *SEEN), rows)
    write_log(path, {}, **columns | {GOALS[0]: np.nan * rows})
    with pytest.raises(SerpentError, match=r"command are not finite .* Repair or leave out"):
        MACHINE.read(path)
    write_log(path, {}, **columns | {"time": columns["time"][::-1]})
    with pytest.raises(SerpentError, match=r"time does not increase .* Repair or leave out"):
        MACHINE.read(path)
    path.write_bytes(b"no parquet")
    with pytest.raises(SerpentError, match=r"not a whole Parquet file.* Copy it again"):
        MACHINE.read(path)


@measured
def test_first_guesses_find_where_the_measured_trunk_hangs():
    (run,) = MACHINE.read(MEASURED / "controlled_1.parquet")
    start = MACHINE.open([run]).machine.start
    assert start["length"][0] == pytest.approx(0.1, abs=0.01)
    assert abs(start["base"][1]) < 0.02  # the origin of its frame
    directions = np.degrees(start["direction"])
    between = (directions[[0, 1]] - directions[[5, 3]]) % 180  # of one disk, a quarter turn apart
    np.testing.assert_allclose(between, 90, atol=10)
