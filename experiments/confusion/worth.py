"""Compute what the true law of a fault would be worth where a trace looked for it.

A law of the true shape, place and thresholds, whatever its size, beside the twin that was calibrated without
it, and to first order: by how many squared standard errors it would explain the training logs better. What
the calibrated parameters have absorbed is lost to it.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from bench_arm.accidents import Accident
from bench_arm.effects import Effects
from experiments.confusion.expected import strand_of
from serpent_twin.effects.law import Law
from serpent_twin.identification import Trace
from serpent_twin.identification.checkpoints import Checkpoints
from serpent_twin.identification.composing import ComposingTracer
from serpent_twin.identification.discovery.followed import Way, swinging
from serpent_twin.identification.discovery.screen import Search
from serpent_twin.identification.run import planned
from serpent_twin.machines.places import response_at

_CLOCK = "runtime", "machine"

TrueLaw = tuple[Law, Sequence[Way]]
"""A law, and the ways in which its change follows its reading"""


def _law(handle: str, place: str, *several: Way) -> TrueLaw:
    way = several[0]
    return Law(handle, place, way.shape, way.reading, way.where), several


def _constant(handle: str, place: str) -> TrueLaw:
    return _law(handle, place, Way("constant", "", "", 0.0, 0.0))


def _since(handle: str, place: str, happened: Accident) -> TrueLaw:
    return _law(handle, place, Way("above", *_CLOCK, happened.instant, 0.0))


def _of_accident(happened: Accident) -> TrueLaw:
    part, begin, width = happened.part, happened.begin, happened.width
    motor, joint, load = f"motor{part}", f"joint{part}", f"motor{part}_load"
    of_motor, of_joint = ("motor_angle", motor), ("joint_angle", joint)
    swings = 2 * np.pi * happened.rate
    several: Mapping[str, Callable[[], TrueLaw]] = {
        "swinging_push": lambda: _law("force", f"link{part}", *swinging(_CLOCK, swings)),
        "soft_stop": lambda: _law("joint_torque", joint, Way("beyond", *of_joint, begin, 0.0)),
        "loose_strand": lambda: _since("slack", strand_of(happened), happened),
        "slipped_winch": lambda: _since("winch_angle", motor, happened),
        "loose_gear": lambda: _law(
            "winch_angle", motor, Way("play", *of_motor, happened.strength, 0.0)
        ),
        "encoder_wave": lambda: _law("winch_angle", motor, *swinging(of_motor, happened.rate)),
        "rubbing_cable": lambda: _law(
            "gear_friction", motor, Way("within", *of_motor, begin, width)
        ),
        "knocked_marker": lambda: _since("marker_shift", f"marker{part}", happened),
        "moved_cameras": lambda: _since("camera_shift", "base", happened),
        "fading_load": lambda: _constant("load_scale", load),
        "dying_load": lambda: _law("load_scale", load, Way("linear", *_CLOCK, 0.0, 0.0)),
        "elastic_cord": lambda: _constant("spring", f"link{part}"),
        "turned_link": lambda: _since("link_turn", f"link{part}", happened),
        "turned_cameras": lambda: _since("camera_turn", "base", happened),
        "drifting_clock": lambda: _law("camera_delay", "base", Way("linear", *_CLOCK, 0.0, 0.0)),
        "relaxing_joint": lambda: _law(
            "joint_torque", joint, Way("lag", *of_joint, happened.time_constant, 0.0)
        ),
        "late_load": lambda: _law(
            "load_shift", load, Way("lag", "horn_torque", motor, happened.strength, 0.0)
        ),
    }
    return several[happened.kind]()


def true_law(name: str, effects: Effects) -> TrueLaw:
    """The law of a fault that the catalogue lacks, of a bench arm."""
    for each in effects.accidents:
        if each.kind == name:
            return _of_accident(each)
    if name == "outside_force":
        on = "joint_angle", f"joint{effects.force_joint}"
        way = Way("above", *on, effects.force_threshold, 0.0)
        return _law("force", f"link{effects.force_link}", way)
    if name == "sticking_joint":
        joint, (low, high) = f"joint{effects.stick_joint}", effects.stick_window
        return _law("joint_friction", joint, Way("within", "joint_angle", joint, low, high - low))
    motor = f"motor{effects.ripple_motor}"
    swings = swinging(("motor_angle", motor), effects.ripple_periods)
    return _law("load_shift", f"{motor}_load", *swings)


def worth(traced: Trace, law: TrueLaw) -> float:
    """What a law would be worth beside the twin with which a trace, whose stages are kept, began to seek laws
    [squared standard errors].
    """
    rig, training, judging = planned(traced)
    case = rig.open(training)
    notes = Checkpoints(traced.out / "stages", case.clock)
    pieces = case.pieces(training), case.pieces(judging)
    tracer = ComposingTracer(case, *pieces, notes, lambda _: None, traced.seed)
    _, base, _ = tracer.named()
    case = tracer.case
    some = case.take(tracer.training, base.used)
    places = case.places(base.point, some)
    assert places is not None
    wanted, several = law
    search = Search.of(case, some, base, places)
    return search.worth(response_at(places, wanted), several)
