"""Describe the error in sentences, and state where to look for its cause."""

import numpy as np

from serpent_twin.effects.law_causes import look_for_error
from serpent_twin.numerals import capital, counted, listed
from serpent_twin.residual.dependence import Dependence
from serpent_twin.residual.findings import ErrorChange, Findings, SessionChange
from serpent_twin.residual.measure import MARKERS, Measure
from serpent_twin.residual.noise import in_words
from serpent_twin.residual.settling import OWN

AT_THE_NOISE = 1.08  # times the noise floor: no error is left
SHAKES = 2.0  # times the noise floor: what changes from row to row like noise is the machine's own motion
MOSTLY = 0.7  # times the error: that motion is most of it
NOT_SMALL = 0.1  # share of the variance above the noise that deserves a sentence of its own

_WARMS = "gears or grease that warm up, so that friction falls"
_CREEPS = "something that warms up, creeps or settles, and recovers between sessions"


def describe(findings: Findings) -> str:
    """Describe what is left, on what it depends and where to look, in a few plain sentences."""
    parts = [_size(findings), *_shaken(findings)]
    told: list[str] = []
    for what, change, of_loads in (
        (findings.noise.of_marker.error, findings.marker_change, False),
        (findings.noise.of_load.error, findings.load_change, True),
    ):
        pairs = [p for p in _pairs(findings) if (p[0].kind == "load") == of_loads]
        if change is not None and change.steady:  # says when and how much, which is more
            pairs = [p for p in pairs if p[0].feature.kind != "time"]
        swing = change.line.share if change and change.swings and change.line else 0.0
        marker = findings.noise.of_marker
        both = [_dependences(pairs, marker), _changes(change, what, marker)]
        settles = change is not None and change.steady == "settling"
        if settles or (pairs and swing > pairs[0][0].share_above_noise):  # the greater first
            both.reverse()
        told += [*both[0], *both[1]]
    if not told and _is_above_noise(findings):
        told = [_unknown(findings)]
    return " ".join([*parts, *told])


def _pairs(findings: Findings) -> list[tuple[Dependence, str]]:
    return list(zip(findings.depends_on, findings.where, strict=True))


def _is_above_noise(findings: Findings) -> bool:
    """Whether the error is more than noise; yes where the noise is unknown."""
    return not findings.marker.mean <= AT_THE_NOISE * findings.noise.mean_floor


def _size(findings: Findings) -> str:
    mean, floor = findings.marker.mean, findings.noise.mean_floor
    percent, quiet = findings.load.rms, findings.noise.load_floor
    parts = []
    if np.isfinite(mean):
        marker = findings.noise.of_marker
        word = "" if _is_above_noise(findings) else ", which is no more than noise"
        alone = in_words(floor, marker.unit)
        parts.append(f"{marker.are} off by {mean:.2f} {marker.unit} (noise alone: {alone}){word}")
    if np.isfinite(percent):
        load = findings.noise.of_load
        unit = load.unit.removesuffix(" of stall")
        parts.append(
            f"{load.what} by {percent:.2f} {load.unit} (noise alone: {in_words(quiet, unit)})"
        )
    text = "; ".join(parts) or "Neither markers nor loads were measured"
    return f"{capital(text)}."


def _shaken(findings: Findings) -> list[str]:
    """What is said where the machine itself moves from row to row as noise would."""
    noise, mean = findings.noise, findings.marker.mean
    shakes = noise.mean_jitter
    if not (shakes > SHAKES * noise.mean_floor and shakes > MOSTLY * mean):
        return []
    return [
        f"From row to row {noise.of_marker.what} move like noise of {shakes:.2f} {noise.of_marker.unit}, but "
        "as the machine can move: between rows it vibrates, chatters, or sticks and slips, which a log at a "
        "higher rate would show."
    ]


def _dependences(pairs: list[tuple[Dependence, str]], marker: Measure) -> list[str]:
    if not pairs:
        return []
    first, at = pairs[0]
    share, text = 100 * first.share_above_noise, first.text
    size = "of it" if first.kind == "size" else "of what is above the noise"
    seen = "" if first.kind == "load" else f" ({at})"
    sentence = f"{capital(text)}, which explains {share:.0f} % {size}{seen}."
    if first.alternatives:
        sentence += f" {capital(' or '.join(first.alternatives))} would explain it nearly as well."
    others = [d for d, _ in pairs[1:] if d.share_above_noise >= NOT_SMALL]
    if others:
        also = [f"{d.text} ({100 * d.share_above_noise:.0f} %)" for d in others]
        sentence += f" Besides, {listed(also)}."
    return [f"{sentence} Look for {hint(first, marker)}."]


def hint(dependence: Dependence, marker: Measure = MARKERS) -> str:
    """What to look for on the machine."""
    said = look_for_error(dependence.feature.kind, dependence.shape.kind)
    return said.replace("{view}", marker.view)


def _changes(change: ErrorChange | None, what: str, marker: Measure) -> list[str]:
    """Sentences on a jump or drift, and on an oscillation."""
    if change is None:
        return []
    sentences = []
    if change.steady == "jump" and change.jump is not None:
        most = int(np.argmax(np.abs(change.jump.size)))
        size = change.jump.size[most] * change.in_unit[most]
        sentences.append(
            f"{capital(what)} jumps at {change.jump.time_s:.0f} s of {change.jump.session}, "
            f"most in {change.channels[most]} ({_signed(size, change.unit)}): look for "
            "something that slipped, came loose or was knocked."
        )
    if change.steady == "drift":
        most = change.drift.strongest
        scale = change.in_unit[most]
        slope, half = scale * change.drift.per_minute[most], scale * change.drift.interval[most]
        sentences.append(
            f"{capital(what)} drifts, most in {change.channels[most]} "
            f"({_signed(slope, change.unit)} ± {half:.2g} per minute): look for something that warms up, "
            "creeps or slips slowly."
        )
    if settles := change.settles(what):
        sentences.append(settling_text(settles))
    if change.swings and change.line is not None:
        sentences.append(
            f"{capital(what)} swings at {change.line.frequency_hz:.2f} Hz whatever the "
            f"motors do ({100 * change.line.share:.0f} % of its variance): look for something that "
            f"shakes the machine{marker.shaken}."
        )
    return sentences


def settling_text(of: SessionChange) -> str:
    """A change that fades after each session's beginning, in a sentence."""
    motion = f"the motion of {of.against}" if of.against != OWN else "its own motion"
    against = f" against {motion}" if of.against else ""
    more = f", and in {counted(of.others, 'other')} likewise" if of.others else ""
    return (
        f"{capital(of.what)} changes with the time since a session began, in every session anew: most "
        f"in {of.channel}{against} ({_signed(of.begins, of.unit)} at the beginning, fading with "
        f"{of.time_constant_s:.0f} s){more}: look for {_WARMS if of.against else _CREEPS}."
    )


def _signed(value: float, unit: str) -> str:
    gap = "" if unit == "°" else " "
    return f"{value:+.2g}{gap}{unit}".replace("-", "−")


def _unknown(findings: Findings) -> str:
    """Describe an error above the noise that depends on nothing: at least where it is."""
    marker = findings.noise.of_marker
    unit, several = marker.unit, len(findings.marker.by_marker) > 1
    constant = np.linalg.norm(findings.marker.mean_residual, axis=-1)
    if np.mean(constant) > 0.7 * np.fmin(findings.above_noise, findings.marker.mean):
        most = int(np.argmax(constant))
        where = f", greatest at {marker.one} {most + 1}" if several else ""
        return f"Most of it is a constant offset{where} ({constant[most]:.2f} {unit}): look at {marker.zero}."
    above = findings.above_noise
    what = f"The {above:.2f} {unit} above the noise follow" if np.isfinite(above) else "It follows"
    nothing = f"{what} nothing that was looked at: no angle, motion, force, time or place."
    if (burst := findings.burst) is None:
        return nothing
    return (
        f"{nothing} {100 * burst.share:.0f} % lie in {100 * burst.of_time:.0f} % of the time, most between "
        f"{burst.begin:.0f} s and {burst.end:.0f} s of {burst.session}: look at what happens there, and "
        "whether other logs have it, too."
    )
