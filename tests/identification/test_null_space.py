"""Test which numbers logs cannot separate, on a planar arm whose base parameters are known in closed form."""

import mujoco
import numpy as np
import pytest
from example import Example, table

from serpent_twin.identification.detection import opening_fit
from serpent_twin.identification.fitting.information import Information
from serpent_twin.identification.fitting.null_space import null_combinations
from serpent_twin.machines.machine import Declared
from serpent_twin.machines.model import open_machine
from serpent_twin.machines.model.masses import state_all
from serpent_twin.machines.model.numbers import NUMBERS, change_number

LENGTH, G, PERIOD = 0.4, 9.81, 0.005  # [m], [m/s²], [s]
MJCF = f"""<mujoco>
  <option gravity="0 0 -{G}"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 -1 0"/>
      <inertial pos="0.02 0 -0.25" mass="3" diaginertia="0.05 0.06 0.02"/>
      <body name="lower" pos="0 0 -{LENGTH}">
        <joint name="elbow" axis="0 -1 0"/>
        <inertial pos="-0.02 0 -0.2" mass="2" diaginertia="0.03 0.04 0.02"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
TOML = """schema_version = 1
model = "arm.xml"
rows = "torque"
time = { column = "t", unit = "s" }
measured = [
    { joint = "shoulder", columns = ["q1"], unit = "rad" },
    { joint = "elbow", columns = ["q2"], unit = "rad" },
    { joint = "shoulder", columns = ["tau1"], unit = "N m" },
    { joint = "elbow", columns = ["tau2"], unit = "N m" },
]
"""


def spec():
    """The arm's model, whose inertia is written down."""
    out = mujoco.MjSpec.from_string(MJCF)
    state_all(out, out.compile())
    return out


def base(model):
    """The base parameters of the planar arm, (6,): first moments of both links, the upper with the lower's
    mass at its end, and second moments about their joints, likewise.
    """
    (m1, m2), (c1, c2) = model.body_mass[1:], model.body_ipos[1:]
    spread = [out_of_plane(model, n) for n in (1, 2)]
    first = [m1 * c1[0], m1 * c1[2] - m2 * LENGTH, m2 * c2[0], m2 * c2[2]]
    squares = [c[0] ** 2 + c[2] ** 2 for c in (c1, c2)]
    return np.array(
        [*first, spread[0] + m1 * squares[0] + m2 * LENGTH**2, spread[1] + m2 * squares[1]]
    )


def out_of_plane(model, body):
    """Inertia of a body about its own centre of mass, along y."""
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, model.body_iquat[body])
    return axes.reshape(3, 3)[1] ** 2 @ model.body_inertia[body]


def torques(q, v, a):
    """Torques of the joints [N m], (T, 2), by d'Alembert's principle on complex numbers: real is down."""
    parameters, (turn, speed, faster) = spec().compile(), (np.cumsum(x, axis=1) for x in (q, v, a))
    place, lean = np.exp(1j * turn), 1j * faster - speed**2
    c = -parameters.body_ipos[1:, 2] + 1j * parameters.body_ipos[1:, 0]
    end = LENGTH * place[:, 0]
    accelerates = [
        c[0] * place[:, 0] * lean[:, 0],
        end * lean[:, 0] + c[1] * place[:, 1] * lean[:, 1],
    ]
    by_first = [1j * c[0] * place[:, 0], 1j * (end + c[1] * place[:, 1])]
    by_second = [0 * end, 1j * c[1] * place[:, 1]]
    out = np.zeros_like(q)
    for n in (0, 1):
        force = parameters.body_mass[1 + n] * (accelerates[n] - G)
        own = out_of_plane(parameters, 1 + n) * faster[:, n]
        out[:, 0] += np.real(np.conj(by_first[n]) * force) + own
        out[:, 1] += np.real(np.conj(by_second[n]) * force) + (own if n else 0)
    return out


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """What a derivative by all that is declared shows nothing of, and what is declared."""
    folder, rng = tmp_path_factory.mktemp("planar"), np.random.default_rng(1)
    time = PERIOD * np.arange(4000)[:, None, None]
    turns, phase = 2 * np.pi * rng.uniform(0.1, 1.5, (5, 2)), 2 * np.pi * rng.random((5, 2))
    size, angle = rng.uniform(0.1, 0.4, (5, 2)), turns * time + phase
    parts = np.sin(angle), turns * np.cos(angle), -(turns**2) * np.sin(angle)
    motion = [(size * part).sum(axis=1) for part in parts]
    tau = torques(*motion) + 0.01 * rng.standard_normal(motion[0].shape)
    q = 1e-4 * np.round(motion[0] / 1e-4)
    log = table(folder / "log.csv", "t,q1,q2,tau1,tau2", np.c_[time[:, 0], q, tau])
    rig = open_machine(Example(MJCF, TOML).write(folder / "machine"))
    case = rig.open(runs := rig.read(log))
    known = Information.of(case, opening_fit(case, case.pieces(runs)))
    return case.declared, null_combinations(case.declared, known.slopes, known.weight)


def test_six_of_twenty_inertia_numbers_are_base_parameters(found):
    declared, null = found
    inertia = [each for each in declared if not each.name.startswith("zero of")]
    assert len(inertia) == 20 and len(null) == 14


def test_a_change_that_no_row_shows_leaves_the_base_parameters(found):
    """Slopes of the base parameters are below 2 % of them per prior deviation: small changes go unnamed."""
    usual = base(spec().compile())
    for each in found[1]:
        by = 1e-4
        ahead, behind = (base(changed(each, sign * by)) for sign in (1, -1))
        slope = np.abs(ahead - behind) / (2 * by)
        assert (slope < 0.02 * np.abs(usual)).all(), each


def changed(combination, share):
    """The arm with a share of a combination's changes."""
    out = spec()
    for name, change in combination.changes.items():
        number, body = name.split(" of ")[0], name.split(" of ")[-1]
        if name.startswith("centre of mass"):
            number = " of ".join(name.split(" of ")[:2])
        by = share * change / (100 if combination.units[name] == "%" else 1)
        by = by if NUMBERS[number].added else np.exp(by)
        change_number(out, number, 1 + ["upper", "lower"].index(body), by)
    return out.compile()


def test_out_of_the_plane_nothing_shows(found):
    alone = {next(iter(each.changes)) for each in found[1] if each.told == "nothing"}
    flat = [f"shear {axes}" for axes in ("xy", "xz", "yz")] + ["centre of mass y", "spread y"]
    assert alone == {f"{number} of {body}" for number in flat for body in ("upper", "lower")}


def test_a_combination_moves_few_numbers(found):
    """Along x and z, mass of one link may spread; the lower's passes to the upper, at whose end it hangs."""
    several = [each for each in found[1] if len(each.changes) > 1]
    assert sorted(len(each.changes) for each in several)[:3] == [2, 2, 4]
    assert all(each.told == "the sum of what they do" for each in several)
    for body in ("upper", "lower"):
        names = {f"spread x of {body}", f"spread z of {body}"}
        assert any({*each.changes} == names for each in several)


def test_words_say_a_common_factor_and_a_product():
    declared = [Declared(name, "log 1", 0.1, 0.01) for name in "abc"]
    time = np.linspace(0, 1, 50)
    rows = 1e4 * np.array([np.sin(9 * time), -np.sin(9 * time), time])
    (ratio,) = null_combinations(declared, rows, 1.0)
    assert str(ratio) == "a +10 % and b +10 %" and ratio.told == "their ratios"
    (product,) = null_combinations(declared, np.abs(rows), 1.0)
    assert str(product) == "a +10 % and b −10 %" and product.told == "their product"
    assert null_combinations(declared, np.array([time, time**2, time**3]) * 1e4, 1.0) == ()
