"""State which composed laws are right for a fault that the catalogue lacks."""

from collections.abc import Mapping, Sequence
from typing import Any

from bench_arm.accidents import Accident
from serpent_twin.arm import mjcf
from serpent_twin.arm.geometry import ARM, N_JOINTS

Answer = dict[str, Any]
"""Part of an entry of diagnosis.json: changes, place, laws and depends_on, each as lists of what is right;
and the size of the law, None where a fault has none
"""

_THRESHOLDS = ("above", "under", "within")
_CLOCK = ("time", "runtime")
_RAMPS = ("beyond", "below", "within", "above")


def _answer(
    changes: Sequence[str],
    places: Sequence[str],
    laws: Sequence[str],
    on: Sequence[str],
    size: float | None = None,
) -> Answer:
    sorts = (changes, places, laws, on)
    names = ("changes", "places", "laws", "on")
    return {**dict(zip(names, map(list, sorts), strict=True)), "size": size}


def _force(link: int, laws: Sequence[str], on: Sequence[str], size: float) -> list[Answer]:
    return _near(("force", "force_in_body"), link, laws, on, size)


def _near(
    changes: Sequence[str],
    link: int,
    laws: Sequence[str],
    on: Sequence[str],
    size: float | None = None,
) -> list[Answer]:
    """A force on a link; on the one beside it, logs of this length hardly differ."""
    near = [f"link{n}" for n in (link, link - 1, link + 1) if 1 <= n <= N_JOINTS]
    return [_answer(changes, near, laws, on, size)]


def _knocked(marker: int, size: float | None = None) -> list[Answer]:
    return [_answer(("marker_shift",), (f"marker{marker}",), _THRESHOLDS, _CLOCK, size)]


def _turned(link: int, size: float | None = None) -> list[Answer]:
    return [_answer(("link_turn",), (f"link{link}",), _THRESHOLDS, _CLOCK, size)]


def of_accident(happened: Accident) -> list[Answer]:
    """The laws that are right for an accident of a bench arm."""
    part, clock, size = happened.part, _CLOCK, happened.strength
    motor, joint, load = f"motor{part}", f"joint{part}", f"motor{part}_load"
    strand = mjcf.STRANDS[2 * (part % N_JOINTS) + part // N_JOINTS]
    own, steps = (f"motor angle of {motor}",), _THRESHOLDS
    last = int(part == N_JOINTS)  # a turn of it moves its one marker, and nothing else
    several: Mapping[str, list[Answer]] = {
        "swinging_push": _force(part, ("periodic",), clock, size),
        "soft_stop": [
            _answer(("joint_torque",), (joint,), _RAMPS, (f"joint angle of {joint}",), size)
        ],
        "loose_strand": [_answer(("slack",), (strand,), steps, clock, size)],
        "slipped_winch": [_answer(("winch_angle",), (motor,), steps, clock, size)],
        "loose_gear": [_answer(("winch_angle",), (motor,), ("play",), own)],
        "encoder_wave": [_answer(("winch_angle",), (motor,), ("periodic",), own, size)],
        "rubbing_cable": [_answer(("gear_friction",), (motor,), steps, own, size)],
        "knocked_marker": _knocked(part, size) + last * _turned(part),
        "moved_cameras": [_answer(("camera_shift",), ("base",), steps, clock, size)],
        "fading_load": [
            _answer(
                ("load_shift",),
                (load,),
                ("linear",),
                (f"horn torque of {motor}",),
                size / ARM.servo.stall_torque,
            ),
            _answer(("load_scale",), (load,), ("constant",), (), size),
        ],
        "dying_load": [
            _answer(("load_scale",), (load,), ("linear",), clock, size / happened.instant)
        ],
        "elastic_cord": _near(("spring",), part, ("constant",), ()),
        "turned_link": _turned(part, size) + last * _knocked(part),
        "turned_cameras": [_answer(("camera_turn",), ("base",), steps, clock, size)],
        "drifting_clock": [_answer(("camera_delay",), ("base",), ("linear",), clock, size)],
        "relaxing_joint": [
            _answer(("joint_torque",), (joint,), ("lag",), (f"joint angle of {joint}",), size)
        ],
        "late_load": [_answer(("load_shift",), (load,), ("lag",), (f"horn torque of {motor}",))],
    }
    return several[happened.kind]


def of_bench(name: str, effects: Any) -> list[Answer]:
    """The laws that are right for a fault of a bench arm that the catalogue lacks."""
    for each in effects.accidents:
        if each.kind == name:
            return of_accident(each)
    if name == "outside_force":
        return _force(
            effects.force_link,
            ("above",),
            (f"joint angle of joint{effects.force_joint}",),
            effects.outside_force,
        )
    if name == "sticking_joint":
        joint = f"joint{effects.stick_joint}"
        return [_answer(("joint_friction",), (joint,), ("within",), (f"joint angle of {joint}",))]
    if name == "load_ripple":
        motor, wave = f"motor{effects.ripple_motor}", effects.load_ripple
        on = (f"motor angle of {motor}",)
        torque = wave * ARM.servo.stall_torque
        return [
            _answer(("load_shift",), (f"{motor}_load",), ("periodic",), on, wave),
            _answer(("motor_torque",), (motor,), ("periodic",), on, torque),
        ]
    return []


def matches(entry: Mapping[str, Any], answers: Sequence[Answer]) -> bool:
    """Whether a discovered effect, or one of those that it is said to be equivalent to, is right."""
    several = [entry, *entry.get("equivalent", [])]
    return any(_matches(each, answer) for each in several for answer in answers)


def size_of(entry: Mapping[str, Any], answers: Sequence[Answer]) -> float | None:
    """The size that a discovered law should have; None where it is not right, or the fault has no size."""
    return next((each["size"] for each in answers if _matches(entry, each)), None)


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
