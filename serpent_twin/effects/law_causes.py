"""Say what to look for on a machine that a composed law describes, or whose error follows something."""

from collections.abc import Mapping
from enum import Enum, auto

from serpent_twin.effects.law import CLOCKS, READINGS, Law


class LawForm(Enum):
    """What sort of law it is, to somebody who looks for its cause."""

    ALWAYS = auto()
    ONCE = auto()
    """Change from an instant on"""
    SLOWLY = auto()
    """Change with time"""
    SWINGING = auto()
    """Oscillation with time"""
    WAVES = auto()
    """Oscillation with an angle"""
    PLAY = auto()
    """Change after each reversal"""
    LATE = auto()
    """Change by what follows a reading late"""
    MOVING = auto()
    """Change with a speed"""
    THERE = auto()
    """Change within, above or below something"""
    GROWING = auto()
    """Change with an angle, a place or a force"""


_RAMPS = ("linear", "beyond", "below")
_BY_SHAPE = {"periodic": LawForm.WAVES, "play": LawForm.PLAY, "lag": LawForm.LATE}


def form_of(law: Law) -> LawForm:
    """The form of a law."""
    if not law.reading:
        return LawForm.ALWAYS
    if READINGS[law.reading].kind in CLOCKS:
        by_clock = {"periodic": LawForm.SWINGING} | dict.fromkeys(_RAMPS, LawForm.SLOWLY)
        return by_clock.get(law.shape, LawForm.ONCE)
    if law.shape in _BY_SHAPE:
        return _BY_SHAPE[law.shape]
    if law.reading.endswith("velocity"):
        return LawForm.MOVING
    return LawForm.GROWING if law.shape in _RAMPS else LawForm.THERE


_PULLS = {
    LawForm.ALWAYS: "a weight, a hose or a wire that pulls",
    LawForm.ONCE: "something that was hung on, taken off or leaned against it then",
    LawForm.SLOWLY: "a hose that fills or stiffens",
    LawForm.SWINGING: "a fan, a pump or a machine beside it that shakes it",
    LawForm.MOVING: "something that is dragged along",
    LawForm.THERE: "a hose, a wire or an obstacle that touches it there",
    LawForm.GROWING: "a hose, a cord or an obstacle that gives",
}
_SEEN = {
    LawForm.ALWAYS: "a frame that was calibrated elsewhere",
    LawForm.ONCE: "a camera that was knocked",
    LawForm.SLOWLY: "a stand that sinks, or cameras that warm up",
    LawForm.SWINGING: "a stand that shakes",
    LawForm.GROWING: "lenses that were calibrated for another part of the room",
}
_CAUSES: Mapping[str, tuple[str, Mapping[LawForm, str]]] = {
    "joint_torque": (
        "something that pulls across the joint",
        {
            LawForm.ALWAYS: "a spring, a hose or a harness that is tensioned across the joint",
            LawForm.ONCE: "a spring, a hose or a harness that tore or was tied across the joint then",
            LawForm.SWINGING: "a fan, a pump or a machine beside it that shakes it",
            LawForm.PLAY: "rubber, nylon or a seal that springs back before it slides",
            LawForm.LATE: "nylon, rubber or grease that relaxes: it resists at first, then gives way",
            LawForm.MOVING: "grease or a seal that resists",
            LawForm.THERE: "a catch, a stop or a harness that touches there",
            LawForm.GROWING: "a bumper, a hose or a spring",
        },
    ),
    "joint_friction": (
        "a bearing that is tight or dry",
        {
            LawForm.ONCE: "a screw that was tightened, or dirt that came in then",
            LawForm.SLOWLY: "a bearing that runs dry",
            LawForm.THERE: "a burr, dirt or a cover that rubs there",
            LawForm.GROWING: "a bearing that jams under load",
        },
    ),
    "gear_friction": (
        "a gear or a cable that rubs",
        {
            LawForm.ONCE: "a cable that left its groove, or a gear that was damaged then",
            LawForm.SLOWLY: "a gear that runs dry",
            LawForm.THERE: "a damaged tooth, or a cable that rubs there",
            LawForm.GROWING: "a gear that jams under load",
        },
    ),
    "motor_torque": (
        "a spring on the horn, or a current sensor that errs",
        {
            LawForm.WAVES: "a bent shaft, a winch off its centre or a damaged tooth",
            LawForm.PLAY: "a gear or a cable that springs back before it slides",
            LawForm.LATE: "rubber or grease in the drive that relaxes",
            LawForm.MOVING: "grease that resists",
        },
    ),
    "winch_angle": (
        "a winch that does not turn with its encoder",
        {
            LawForm.ALWAYS: "a horn that was mounted turned",
            LawForm.ONCE: "a set screw that came loose, or a horn that slipped then",
            LawForm.SLOWLY: "a set screw that works loose",
            LawForm.WAVES: "an encoder's magnet or a winch off its centre",
            LawForm.PLAY: "play in the gear, or between horn and winch",
            LawForm.LATE: "a coupling of rubber, or an encoder that is ahead of its winch",
            LawForm.MOVING: "an encoder that reads late, or play in the gear",
            LawForm.GROWING: "a winch of another radius, or a shaft that twists",
        },
    ),
    "command": (
        "a drive of another scale or zero",
        {
            LawForm.ONCE: "a drive that was set otherwise then",
            LawForm.GROWING: "a gear or a drum of another radius",
        },
    ),
    "slack": (
        "a strand that gives way",
        {
            LawForm.ALWAYS: "a strand that was tied otherwise",
            LawForm.ONCE: "a clamp that slipped, or a knot that came loose then",
            LawForm.SLOWLY: "a strand that creeps, or a clamp that slips",
            LawForm.PLAY: "a guide or a pulley that is loose",
            LawForm.LATE: "a strand or its sheath that gives way late",
            LawForm.THERE: "a strand that leaves its groove there",
            LawForm.GROWING: "a guide that gives, or a pulley of another radius",
        },
    ),
    "force": ("something that pulls or pushes", _PULLS),
    "force_in_body": ("something that pulls along with the link", _PULLS),
    "spring": ("an elastic cord, a hose or a tether to a fixed point", {}),
    "link_turn": (
        "a link that gives",
        {
            LawForm.ALWAYS: "a link that was built bent or turned",
            LawForm.ONCE: "a screw that worked loose, or a link that was bent then",
            LawForm.SLOWLY: "a screw that works loose, or a link that creeps",
            LawForm.THERE: "a link that is loose and tips over there",
        },
    ),
    "marker_shift": (
        "a marker that is loose or partly hidden",
        {
            LawForm.ALWAYS: "a marker that sits elsewhere",
            LawForm.ONCE: "a marker that was knocked",
            LawForm.SLOWLY: "a marker whose glue creeps",
        },
    ),
    "load_shift": (
        "a current sensor that errs",
        {
            LawForm.ALWAYS: "a current sensor whose zero is off",
            LawForm.ONCE: "a current sensor whose zero jumped",
            LawForm.SLOWLY: "a current sensor that drifts as it warms up",
            LawForm.WAVES: "a bent shaft, a winch off its centre or a damaged tooth",
            LawForm.LATE: "a current sensor that reads late",
            LawForm.GROWING: "a current sensor of another scale",
        },
    ),
    "load_scale": (
        "a current sensor or a motor of another scale",
        {
            LawForm.ONCE: "a current sensor that failed in part then",
            LawForm.SLOWLY: "a current sensor that fades, or a supply that weakens",
        },
    ),
    "reading_shift": (
        "a sensor that errs",
        {
            LawForm.ALWAYS: "a sensor whose zero is off",
            LawForm.ONCE: "a sensor that slipped then",
            LawForm.SLOWLY: "a sensor that drifts",
            LawForm.WAVES: "an encoder's magnet off its centre",
            LawForm.MOVING: "a sensor that reads late",
            LawForm.GROWING: "a sensor of another scale",
        },
    ),
    "camera_shift": ("cameras that do not stand still", _SEEN),
    "camera_turn": ("cameras that do not stand still", _SEEN),
    "camera_delay": (
        "cameras that are late",
        {
            LawForm.ONCE: "a clock that was set anew, or frames that were lost then",
            LawForm.SLOWLY: "cameras whose clock runs faster or slower than the motors'",
        },
    ),
    "acceleration": (
        "a base that moves",
        {
            LawForm.ALWAYS: "a base that leans",
            LawForm.ONCE: "a base that was tilted then",
            LawForm.SLOWLY: "a base that sinks",
            LawForm.SWINGING: "a base that shakes",
        },
    ),
}
"""What each quantity's change may come from: in general, and in some forms"""


def look_for(law: Law) -> str:
    """What to look for on the machine, as the end of a sentence."""
    general, of_form = _CAUSES[law.handle]
    return of_form.get(form_of(law), general)


_CAUSES_OF_ERRORS = {
    "angle step": "something that touches, pulls or lets go there: a hose, a stop, a cable off its groove",
    "angle ramp": "something that begins to pull or press there: a hose, a stop, a cable that stiffens",
    "angle window": "something in that range alone: a catch, a tight spot, a rubbing cover",
    "angle ripple": "something that comes round with it: a horn, winch or wheel off centre, a damaged tooth",
    "angle": "an elasticity, a geometric error or a weight that the twin lacks",
    "directed window": "something that holds it back in that range: a tight or sticking axle",
    "directed": "friction or play there",
    "ripple": "something that comes round with it: a horn, winch or wheel off centre, a damaged tooth",
    "velocity": "damping, friction or a delay",
    "direction": "friction or play there",
    "reversal": "play or friction that is taken up after each reversal",
    "load": "an elasticity or friction that grows with force",
    "tension": "an elasticity or friction that grows with tension",
    "past": "creep: something that gives way slowly under force",
    "time": "something that warms up, creeps or wears",
    "place": "something in that place: an obstacle, a hose{view}",
    "group": "a cause common to them all, such as a delay (velocities), elasticity (loads) or weight",
}
"""What an error that follows a feature may come from, in general or in one shape, with {view} of markers"""


def look_for_error(feature: str, shape: str) -> str:
    """What to look for where an error follows a kind of feature in a kind of shape."""
    return _CAUSES_OF_ERRORS.get(f"{feature} {shape}", _CAUSES_OF_ERRORS[feature])
