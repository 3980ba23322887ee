"""Say what to look for on a machine that a composed law describes."""

from collections.abc import Mapping
from enum import Enum, auto

from serpent_twin.effects.law import CLOCKS, READINGS, Law


class Form(Enum):
    """What sort of law it is, to somebody who looks for its cause."""

    ALWAYS = auto()
    ONCE = auto()
    """From an instant on"""
    SLOWLY = auto()
    """With time"""
    SWINGING = auto()
    """To and fro with time"""
    WAVES = auto()
    """To and fro with an angle"""
    PLAY = auto()
    """After each reversal"""
    MOVING = auto()
    """With a speed"""
    THERE = auto()
    """Within, above or below something"""
    GROWING = auto()
    """With an angle, a place or a force"""


_RAMPS = ("linear", "beyond", "below")


def form_of(law: Law) -> Form:
    """The form of a law."""
    if not law.reading:
        return Form.ALWAYS
    if READINGS[law.reading][0] in CLOCKS:
        by_clock = {"periodic": Form.SWINGING} | dict.fromkeys(_RAMPS, Form.SLOWLY)
        return by_clock.get(law.shape, Form.ONCE)
    if law.shape in ("periodic", "play"):
        return Form.WAVES if law.shape == "periodic" else Form.PLAY
    if law.reading.endswith("velocity"):
        return Form.MOVING
    return Form.GROWING if law.shape in _RAMPS else Form.THERE


_PULLS = {
    Form.ALWAYS: "a weight, a hose or a wire that pulls",
    Form.ONCE: "something that was hung on, taken off or leaned against it then",
    Form.SLOWLY: "a hose that fills or stiffens",
    Form.SWINGING: "a fan, a pump or a machine beside it that shakes it",
    Form.MOVING: "something that is dragged along",
    Form.THERE: "a hose, a wire or an obstacle that touches it there",
    Form.GROWING: "a hose, a cord or an obstacle that gives",
}
_SEEN = {
    Form.ALWAYS: "a frame that was calibrated elsewhere",
    Form.ONCE: "a camera that was knocked",
    Form.SLOWLY: "a stand that sinks, or cameras that warm up",
    Form.SWINGING: "a stand that shakes",
    Form.GROWING: "lenses that were calibrated for another part of the room",
}
_CAUSES: Mapping[str, tuple[str, Mapping[Form, str]]] = {
    "joint_torque": (
        "something that pulls across the joint",
        {
            Form.ALWAYS: "a spring, a hose or a harness that is tensioned across the joint",
            Form.ONCE: "a spring, a hose or a harness that tore or was tied across the joint then",
            Form.SWINGING: "a fan, a pump or a machine beside it that shakes it",
            Form.PLAY: "rubber, nylon or a seal that springs back before it slides",
            Form.MOVING: "grease or a seal that resists",
            Form.THERE: "a catch, a stop or a harness that touches there",
            Form.GROWING: "a bumper, a hose or a spring",
        },
    ),
    "joint_friction": (
        "a bearing that is tight or dry",
        {
            Form.ONCE: "a screw that was tightened, or dirt that came in then",
            Form.SLOWLY: "a bearing that runs dry",
            Form.THERE: "a burr, dirt or a cover that rubs there",
            Form.GROWING: "a bearing that jams under load",
        },
    ),
    "gear_friction": (
        "a gear or a cable that rubs",
        {
            Form.ONCE: "a cable that left its groove, or a gear that was damaged then",
            Form.SLOWLY: "a gear that runs dry",
            Form.THERE: "a damaged tooth, or a cable that rubs there",
            Form.GROWING: "a gear that jams under load",
        },
    ),
    "motor_torque": (
        "a spring on the horn, or a current sensor that errs",
        {
            Form.WAVES: "a bent shaft, a winch off its centre or a damaged tooth",
            Form.PLAY: "a gear or a cable that springs back before it slides",
            Form.MOVING: "grease that resists",
        },
    ),
    "winch_angle": (
        "a winch that does not turn with its encoder",
        {
            Form.ALWAYS: "a horn that was mounted turned",
            Form.ONCE: "a set screw that came loose, or a horn that slipped then",
            Form.SLOWLY: "a set screw that works loose",
            Form.WAVES: "an encoder's magnet or a winch off its centre",
            Form.PLAY: "play in the gear, or between horn and winch",
            Form.MOVING: "an encoder that reads late, or play in the gear",
            Form.GROWING: "a winch of another radius, or a shaft that twists",
        },
    ),
    "command": (
        "a drive of another scale or zero",
        {
            Form.ONCE: "a drive that was set otherwise then",
            Form.GROWING: "a gear or a drum of another radius",
        },
    ),
    "slack": (
        "a strand that gives way",
        {
            Form.ALWAYS: "a strand that was tied otherwise",
            Form.ONCE: "a clamp that slipped, or a knot that came loose then",
            Form.SLOWLY: "a strand that creeps, or a clamp that slips",
            Form.PLAY: "a guide or a pulley that is loose",
            Form.THERE: "a strand that leaves its groove there",
            Form.GROWING: "a guide that gives, or a pulley of another radius",
        },
    ),
    "force": ("something that pulls or pushes", _PULLS),
    "force_in_body": ("something that pulls along with the link", _PULLS),
    "spring": ("an elastic cord, a hose or a tether to a fixed point", {}),
    "link_turn": (
        "a link that gives",
        {
            Form.ALWAYS: "a link that was built bent or turned",
            Form.ONCE: "a screw that worked loose, or a link that was bent then",
            Form.SLOWLY: "a screw that works loose, or a link that creeps",
            Form.THERE: "a link that is loose and tips over there",
        },
    ),
    "marker_shift": (
        "a marker that is loose or partly hidden",
        {
            Form.ALWAYS: "a marker that sits elsewhere",
            Form.ONCE: "a marker that was knocked",
            Form.SLOWLY: "a marker whose glue creeps",
        },
    ),
    "load_shift": (
        "a current sensor that errs",
        {
            Form.ALWAYS: "a current sensor whose zero is off",
            Form.ONCE: "a current sensor whose zero jumped",
            Form.SLOWLY: "a current sensor that drifts as it warms up",
            Form.WAVES: "a bent shaft, a winch off its centre or a damaged tooth",
            Form.GROWING: "a current sensor of another scale",
        },
    ),
    "load_scale": (
        "a current sensor or a motor of another scale",
        {
            Form.ONCE: "a current sensor that failed in part then",
            Form.SLOWLY: "a current sensor that fades, or a supply that weakens",
        },
    ),
    "reading_shift": (
        "a sensor that errs",
        {
            Form.ALWAYS: "a sensor whose zero is off",
            Form.ONCE: "a sensor that slipped then",
            Form.SLOWLY: "a sensor that drifts",
            Form.WAVES: "an encoder's magnet off its centre",
            Form.MOVING: "a sensor that reads late",
            Form.GROWING: "a sensor of another scale",
        },
    ),
    "camera_shift": ("cameras that do not stand still", _SEEN),
    "camera_turn": ("cameras that do not stand still", _SEEN),
    "acceleration": (
        "a base that moves",
        {
            Form.ALWAYS: "a base that leans",
            Form.ONCE: "a base that was tilted then",
            Form.SLOWLY: "a base that sinks",
            Form.SWINGING: "a base that shakes",
        },
    ),
}
"""What each quantity's change may come from: in general, and in some forms"""


def look_for(law: Law) -> str:
    """What to look for on the machine, as the end of a sentence."""
    general, of_form = _CAUSES[law.handle]
    return of_form.get(form_of(law), general)
