"""Choose which candidates are sought in a model of many joints, and say what is not."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace

import mujoco
import numpy as np

from serpent_twin import stored
from serpent_twin.effects import law_of
from serpent_twin.machines.candidate import Candidate
from serpent_twin.machines.model.described import Described
from serpent_twin.machines.model.places import MOST, only_single
from serpent_twin.machines.model.things import acts_on, joints_moving
from serpent_twin.numerals import counted, listed

MOST_PLACES = 12
"""Places at which a law is sought: each costs fits"""
_EVERYWHERE = "hinge_friction"
"""A law that is sought at all joints: every joint has friction, and it shows at its own alone"""
_KINDS = ("free joint", "ball joint", "slide", "hinge")
"""What joints are, in MuJoCo's order"""
_CARRIED = ("payload", "constant_force")
"""Laws that are sought where something is carried, if there are more places than that"""


def sought(
    machine: Described, found: Mapping[str, Candidate]
) -> tuple[dict[str, Candidate], tuple[str, ...]]:
    """The candidates that are sought, by name, and sentences that say what is not and why. What machine.toml
    names is sought, however much it is.
    """
    placed = Counter(law_of(name) for name, each in found.items() if each.at)
    left = {law: n for law, n in placed.items() if n > MOST_PLACES and law != _EVERYWHERE}
    if machine.about.candidates:
        left = {}
    ends = _ends(machine.model)
    kept: dict[str, Candidate] = {}
    at_ends = Counter[str]()
    for name, each in found.items():
        law = law_of(name)
        carried = law in _CARRIED and (each.place_kind == "site" or each.at in ends)
        if not each.at or law not in left or (carried and at_ends[law] < MOST_PLACES):
            kept[name] = each
            at_ends[law] += bool(each.at)
    kept = {
        name: replace(each, confused_with=tuple(n for n in each.confused_with if n in kept))
        for name, each in kept.items()
    }
    return kept, tuple(_said(machine, left, at_ends))


def _ends(model: mujoco.MjModel) -> set[str]:
    """Names of the bodies that carry no other: the ends of chains."""
    parents = {int(model.body_parentid[n]) for n in range(1, model.nbody)}
    return {model.body(n).name for n in range(1, model.nbody) if n not in parents}


def _said(machine: Described, left: Mapping[str, int], kept: Mapping[str, int]) -> Iterator[str]:
    """What is not sought, or not known."""
    if left:
        several = [_left_out(law, n, kept[law]) for law, n in left.items()]
        example = next(iter(left))
        yield (
            f"Not sought, because a law is sought at {MOST_PLACES} places at most: {listed(several)}. "
            f'Name what you suspect in machine.toml, such as candidates = ["{example}@*"]: only that is '
            "sought then, at all of its places."
        )
    if machine.about.moves and not only_single(machine.model):
        many = machine.model.njnt > MOST
        has = f"more than {MOST} joints" if many else "joints that are no hinges or slides"
        yield f"No law is composed of what no effect explains: the model has {has}."
    if machine.about.moves and (unknown := _unmeasured(machine)):
        yield (
            f"Nothing measures {unknown}: what begins and moves there is the model's, and an effect there "
            "shows only by what it does to what is measured."
        )


def _left_out(law: str, count: int, kept: int) -> str:
    """A law, and at how many places it is not sought."""
    some = f" at {count - kept} of {count} places" if kept else f" at any of {count} places"
    return law.replace("_", " ") + some


def _unmeasured(machine: Described) -> str:
    """Joints that neither a column is of nor move anything that one is of, in words; nothing without any."""
    model = machine.model
    left = sorted(set(range(model.njnt)) - _known_joints(machine))
    kinds: dict[str, list[str]] = {}
    for n in left:
        kinds.setdefault(_KINDS[int(model.jnt_type[n])], []).append(
            model.joint(n).name or f"of {model.body(model.jnt_bodyid[n]).name or f'joint {n}'}"
        )
    return listed(
        f"the {kind if len(several) == 1 else counted(len(several), kind)} {stored.names(several)}"
        for kind, several in kinds.items()
    )


def _known_joints(machine: Described) -> set[int]:
    """Joints that a log measures or prescribes, or that move what it measures."""
    model = machine.model
    found = set[int]()
    things = [each.of for each in (*machine.about.measured, *machine.prescribed)]
    for kind, name in things:
        if kind == "actuator":
            kind, name = acts_on(model, name)
        if kind == "joint":
            found.add(model.joint(name).id)
        elif kind == "site":
            found |= joints_moving(model, int(model.site_bodyid[model.site(name).id]))
        elif kind == "tendon":
            found |= _along(model, model.tendon(name).id)
        elif kind == "sensor":
            found |= _sensed(model, model.sensor(name).id)
    return found | _tied(model, found)


def _tied(model: mujoco.MjModel, known: set[int]) -> set[int]:
    """Joints that follow a known one by an equality of the model."""
    of_joints = (model.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (model.eq_obj2id >= 0)
    of_joints &= np.asarray(model.eq_active0, bool)
    pairs = np.stack([model.eq_obj1id, model.eq_obj2id], axis=1)[of_joints].tolist()
    found = set(known)
    for _ in pairs:
        for pair in pairs:
            found |= set(pair) if found & set(pair) else set()
    return found


def _along(model: mujoco.MjModel, tendon: int) -> set[int]:
    """Joints that change a tendon's length."""
    found = set[int]()
    first = model.tendon_adr[tendon]
    for n in range(first, first + model.tendon_num[tendon]):
        of = int(model.wrap_objid[n])
        if model.wrap_type[n] == mujoco.mjtWrap.mjWRAP_JOINT:
            found.add(of)
        elif model.wrap_type[n] == mujoco.mjtWrap.mjWRAP_SITE:
            found |= joints_moving(model, int(model.site_bodyid[of]))
    return found


def _sensed(model: mujoco.MjModel, sensor: int) -> set[int]:
    """Joints that a sensor reads, or that move what it sits on."""
    of, at = int(model.sensor_objid[sensor]), mujoco.mjtObj(int(model.sensor_objtype[sensor]))
    if at == mujoco.mjtObj.mjOBJ_JOINT:
        return {of}
    if at == mujoco.mjtObj.mjOBJ_TENDON:
        return _along(model, of)
    if at == mujoco.mjtObj.mjOBJ_SITE:
        return joints_moving(model, int(model.site_bodyid[of]))
    if at in (mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_XBODY):
        return joints_moving(model, of)
    return set()
