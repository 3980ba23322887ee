"""State which composed laws are right for a fault that the catalogue lacks."""

from collections.abc import Mapping, Sequence
from typing import Any

from bench_arm.accidents import Accident
from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import N_JOINTS

Answer = dict[str, Any]
"""Part of an entry of diagnosis.json: changes, place, laws and depends_on, each as lists of what is right"""

_THRESHOLDS = ("above", "under", "within")
_RAMPS = ("beyond", "below", "within", "above")


def _answer(
    changes: Sequence[str], places: Sequence[str], laws: Sequence[str], on: Sequence[str]
) -> Answer:
    return {"changes": list(changes), "places": list(places), "laws": list(laws), "on": list(on)}


def _force(link: int, laws: Sequence[str], on: Sequence[str]) -> list[Answer]:
    return _near(("force", "force_in_body"), link, laws, on)


def _near(
    changes: Sequence[str], link: int, laws: Sequence[str], on: Sequence[str]
) -> list[Answer]:
    """A force on a link; on the one beside it, logs of this length hardly differ."""
    near = [f"link{n}" for n in (link, link - 1, link + 1) if 1 <= n <= N_JOINTS]
    return [_answer(changes, near, laws, on)]


def of_accident(happened: Accident) -> list[Answer]:
    """The laws that are right for an accident of a bench arm."""
    part, clock = happened.part, ("time", "runtime")
    motor, joint = f"motor{part}", f"joint{part}"
    strand = mjcf.STRANDS[2 * (part % N_JOINTS) + part // N_JOINTS]
    several: Mapping[str, list[Answer]] = {
        "swinging_push": _force(part, ("periodic",), clock),
        "soft_stop": [_answer(("joint_torque",), (joint,), _RAMPS, (f"joint angle of {joint}",))],
        "loose_strand": [_answer(("slack",), (strand,), _THRESHOLDS, clock)],
        "slipped_winch": [_answer(("winch_angle",), (motor,), _THRESHOLDS, clock)],
        "encoder_wave": [
            _answer(("winch_angle",), (motor,), ("periodic",), (f"motor angle of {motor}",))
        ],
        "rubbing_cable": [
            _answer(("gear_friction",), (motor,), _THRESHOLDS, (f"motor angle of {motor}",))
        ],
        "knocked_marker": [_answer(("marker_shift",), (f"marker{part}",), _THRESHOLDS, clock)],
        "moved_cameras": [_answer(("camera_shift",), ("base",), _THRESHOLDS, clock)],
        "fading_load": [
            _answer(("load_shift",), (f"{motor}_load",), ("linear",), (f"horn torque of {motor}",)),
            _answer(("load_scale",), (f"{motor}_load",), ("constant",), ()),
        ],
        "dying_load": [_answer(("load_scale",), (f"{motor}_load",), ("linear",), clock)],
        "elastic_cord": _near(("spring",), part, ("constant",), ()),
        "turned_link": [_answer(("link_turn",), (f"link{part}",), _THRESHOLDS, clock)],
        "turned_cameras": [_answer(("camera_turn",), ("base",), _THRESHOLDS, clock)],
    }
    return several[happened.kind]


def of_bench(name: str, effects: Any) -> list[Answer]:
    """The laws that are right for a fault of a bench arm that the catalogue lacks."""
    for each in effects.accidents:
        if each.kind == name:
            return of_accident(each)
    if name == "outside_force":
        return _force(
            effects.force_link, ("above",), (f"joint angle of joint{effects.force_joint}",)
        )
    if name == "sticking_joint":
        joint = f"joint{effects.stick_joint}"
        return [_answer(("joint_friction",), (joint,), ("within",), (f"joint angle of {joint}",))]
    if name == "load_ripple":
        motor = f"motor{effects.ripple_motor}"
        on = (f"motor angle of {motor}",)
        return [
            _answer(("load_shift",), (f"{motor}_load",), ("periodic",), on),
            _answer(("motor_torque",), (motor,), ("periodic",), on),
        ]
    return []


def of_twin(name: str, at: Mapping[str, float]) -> list[Answer]:
    """The laws that are right for a fault of a twin that the catalogue lacks."""
    joint, motor = (f"{kind}{at.get(kind, 0):.0f}" for kind in ("joint", "motor"))
    on_joint, on_motor = (f"joint angle of {joint}",), (f"motor angle of {motor}",)
    several: Mapping[str, list[Answer]] = {
        "outside_force": _force(int(at.get("link", 0)), ("above",), on_joint),
        "sticking_joint": [_answer(("joint_friction",), (joint,), ("within",), on_joint)],
        "periodic_push": [_answer(("joint_torque",), (joint,), ("periodic",), ("time", "runtime"))],
        "load_ripple": [
            _answer(("motor_torque",), (motor,), ("periodic",), on_motor),
            _answer(("load_shift",), (f"{motor}_load",), ("periodic",), on_motor),
        ],
    }
    return several.get(name, [])


def matches(entry: Mapping[str, Any], answers: Sequence[Answer]) -> bool:
    """Whether a discovered effect, or one of those that it is said to be equivalent to, is right."""
    several = [entry, *entry.get("equivalent", [])]
    return any(_matches(each, answer) for each in several for answer in answers)


def _matches(entry: Mapping[str, Any], answer: Answer) -> bool:
    return (
        entry.get("changes") in answer["changes"]
        and entry.get("place", {}).get("name") in answer["places"]
        and entry.get("law") in answer["laws"]
        and _follows(entry.get("depends_on", []), answer["on"])
    )


def _follows(found: Sequence[str], right: Sequence[str]) -> bool:
    """Whether a law follows one of what is right; a constant follows nothing."""
    return bool({*found} & {*right}) if right else not found
