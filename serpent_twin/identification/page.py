"""Write the report of a trace."""

from collections.abc import Mapping

import numpy as np

from serpent_twin.identification import figures, tables
from serpent_twin.identification.check_page import combined_section, effects_section
from serpent_twin.identification.diagnosis import Diagnosis, Named
from serpent_twin.identification.first_picture import first_section
from serpent_twin.identification.missing_page import missing_section
from serpent_twin.identification.wording import spaced, with_numbers
from serpent_twin.machines.candidate import Candidate
from serpent_twin.numerals import capital, counted, listed
from serpent_twin.residual import LOADS, describe
from serpent_twin.residual import figures as residual_figures
from serpent_twin.residual.noise import UNKNOWN
from serpent_twin.runs.report import Figure, Report, Section, Table


def page(
    diagnosis: Diagnosis,
    facts: Mapping[str, str],
    known: Mapping[str, Candidate],
    prior: Mapping[str, float] | None = None,
    record: Mapping[str, tuple[int, int]] | None = None,
) -> Report:
    """The report: what was missing, how that was found, and what is left.

    `known` describes the machine's candidates. `prior` holds the prior width of each calibrated
    parameter, in its unit; without it, a parameter's change from its start is given in standard
    errors. `record` says of each name how often it was right, and how often it was given, where faults
    were known.
    """
    drawn = _residual_figures(diagnosis)
    sections = (
        first_section(diagnosis.shown) if diagnosis.shown else None,
        _before_and_after(diagnosis, drawn),
        effects_section(diagnosis.identifiability) if diagnosis.identifiability else None,
        combined_section(diagnosis.identifiability) if diagnosis.identifiability else None,
        _ranking(diagnosis),
        missing_section(diagnosis, known, record or {}),
        _alike(diagnosis),
        _left(diagnosis, drawn),
        _loads(diagnosis, drawn),
        _calibration(diagnosis, prior or {}),
        _last_resort(diagnosis),
    )
    title = f"What the twin of {diagnosis.arm} lacks{_given(diagnosis, facts)}"
    return Report(title, lead(diagnosis), tuple(s for s in sections if s), facts)


def _given(diagnosis: Diagnosis, facts: Mapping[str, str]) -> str:
    """The logs and the held-out sessions, for the title."""
    names = [name.removesuffix(".parquet") for name in diagnosis.held_out]
    told = [facts.get("logs", ""), f"judged by {listed(names)}" if names else ""]
    return f" ({', '.join(filter(None, told))})" if any(told) else ""


def lead(diagnosis: Diagnosis) -> str:
    """What was missing, the gain of adding it, and what is left, in a few sentences."""
    parts = (_found(diagnosis), _course(diagnosis), diagnosis.not_as_built, _rest(diagnosis))
    return " ".join(part for part in parts if part)


def _found(diagnosis: Diagnosis) -> str:
    if diagnosis.effects:
        told = " and ".join(map(_told, diagnosis.effects))
        return f"The twin lacked {told}; ranges are 95 % intervals."
    if diagnosis.unexplained.is_:
        nearest = " and ".join(map(_told, diagnosis.stand_ins))
        but = (
            f" Nearest comes {nearest}, which the corrected twin has, but as a stand-in."
            if nearest
            else ""
        )
        return f"Nothing in the catalogue explains what is left of the error.{but}"
    if diagnosis.blind:
        return "These logs cannot show whether anything is missing: they excite no effect of the catalogue."
    sure = not (diagnosis.doubt or diagnosis.moved)
    return (
        f"Nothing {'is' if sure else 'was found'} missing: no effect of the catalogue improves "
        "the calibrated twin beyond chance and by enough to justify its parameters."
    )


def _told(effect: Named) -> str:
    return with_numbers(effect.name, effect.parameters)


def _course(diagnosis: Diagnosis) -> str:
    """Errors from stage to stage, of the markers or, where there are none, of the loads."""
    for error, measure in (
        (diagnosis.error, diagnosis.marker),
        (diagnosis.load_error, diagnosis.load),
    ):
        unit = f" {measure.unit}"
        names = [n for n in figures.stages(diagnosis) if np.isfinite(error.get(n, np.nan))]
        if names:
            told = [f"{error[name]:.2f}{unit} {name}" for name in names]
            floor = error.get("noise_floor", np.nan)
            noise = f"; noise alone makes {floor:.2f}{unit}" if np.isfinite(floor) else ""
            noise = noise or f"; what noise alone makes is {UNKNOWN}"
            return f"On {_sessions(diagnosis)}, {measure.are} off by {listed(told)}{noise}."
    return ""


def _rest(diagnosis: Diagnosis) -> str:
    rest = diagnosis.unexplained
    if not rest.is_:
        return f"{diagnosis.doubt} {diagnosis.power}".strip()
    return f"{_share(diagnosis)} {rest.depends_on}".strip()


def _share(diagnosis: Diagnosis) -> str:
    """How much of what is left is unexplained."""
    share = diagnosis.unexplained.share
    return f"Of the squared error that is left, {100 * share:.0f} % is unexplained."


def _sessions(diagnosis: Diagnosis) -> str:
    names = [name.removesuffix(".parquet") for name in diagnosis.held_out]
    return f"{listed(names)}, to which nothing was fitted" if names else "the held-out segments"


def _residual_figures(diagnosis: Diagnosis) -> dict[str, Figure]:
    """The residual's figures by name, of the last twin beside those before it."""
    names = [n for n in figures.stages(diagnosis) if n in diagnosis.comparisons]
    if not names or names[-1] not in diagnosis.findings:
        return {}
    chosen = {name: diagnosis.comparisons[name] for name in names}
    drawn = residual_figures.figures(chosen, diagnosis.findings[names[-1]])
    return {figure.name: figure for figure in drawn}


def _before_and_after(diagnosis: Diagnosis, drawn: Mapping[str, Figure]) -> Section:
    text = (
        "The log drives each twin. Nominal is the twin as declared; calibrated has the "
        "declared parameters fitted to the training sessions; corrected has, besides, what was found "
        "missing."
    )
    if diagnosis.stand_ins:
        text += " What was added is a stand-in: it comes nearest, but is not the cause."
    elif not diagnosis.effects:
        text += " Nothing was added to the calibrated twin, so that the corrected one is the same."
    blocks = (
        figures.before_and_after(diagnosis),
        tables.errors(diagnosis),
        drawn.get("error_by_marker"),
        drawn.get("error_over_time"),
    )
    return Section("Before and after", text, tuple(block for block in blocks if block))


def _ranking(diagnosis: Diagnosis) -> Section | None:
    figure = figures.ranking(diagnosis.candidates, diagnosis.marker.unit)
    if figure is None:
        return None
    verdicts = [each.verdict for each in diagnosis.candidates]
    count = {verdict: verdicts.count(verdict) for verdict in tables.VERDICTS}
    told = listed([f"{n} {verdict}" for verdict, n in count.items() if n])
    text = (
        f"{counted(len(diagnosis.candidates), 'candidate was', 'candidates were')} tried: {told}. "
        "A candidate is accepted only if it reduces the error on sessions that it was not "
        "fitted to, beyond chance and by enough to justify its "
        "parameters. Not excited means that these logs could not show it; unstable, that the simulation of a "
        "twin with it became unstable."
    )
    return Section(
        "Which candidate",
        text,
        (figure, tables.candidates(diagnosis.candidates, diagnosis.marker.unit)),
    )


def _alike(diagnosis: Diagnosis) -> Section | None:
    """What the effects could be mistaken for, and pairs of candidates."""
    tabled = [table for table in (tables.rivals(diagnosis), tables.pairs(diagnosis)) if table.rows]
    if not tabled:
        return None
    alike = [each for several in diagnosis.rivals.values() for each in several]
    open_ = [spaced(each.name) for each in alike if not each.told_apart]
    text = "These logs tell every effect that was found from those that look like it."
    if open_:
        text = f"These logs cannot tell what was found from {listed(open_)}: the names are alternatives."
    if not alike:
        text = "Pairs of candidates were fitted where no candidate was accepted alone."
    return Section("What looks alike", text, tuple(tabled))


def _left(diagnosis: Diagnosis, drawn: Mapping[str, Figure]) -> Section | None:
    """The residual, in words and pictures: of the calibrated twin and, if there is one, the corrected."""
    twins = {
        name: (diagnosis.comparisons[name], diagnosis.findings[name])
        for name in figures.stages(diagnosis)
        if name in diagnosis.findings and name in diagnosis.comparisons
    }
    if not twins:
        return None
    told = {name: describe(found) for name, (_, found) in twins.items()}
    parts = [
        *(f"{capital(name)}: {said}" for name, said in told.items()),
        *([diagnosis.whiteness.sentence()] if diagnosis.whiteness else []),
        _verdict(diagnosis, told),
    ]
    blocks: list[Figure | Table | None] = [figures.by_feature(twins, "residual_by_feature")]
    if diagnosis.unexplained.is_ and len(twins) > 1:
        last = dict([list(twins.items())[-1]])
        blocks.append(figures.by_feature(last, "unexplained_by_feature"))
    if any(comparison.has_markers for comparison, _ in twins.values()):
        blocks += [figures.place_and_time(twins), drawn.get("residual_spectrum")]
    if diagnosis.whiteness:
        blocks.append(residual_figures.whiteness(diagnosis.whiteness))
    blocks.append(tables.bars(diagnosis))
    return Section("What is left", "\n\n".join(parts), tuple(b for b in blocks if b))


def _verdict(diagnosis: Diagnosis, told: Mapping[str, str]) -> str:
    """Whether what is left is explained, without repeating the descriptions."""
    rest = diagnosis.unexplained
    if not rest.is_:
        error, clean = (diagnosis.error.get(n, np.nan) for n in ("corrected", "expected"))
        known = np.isfinite(error) and np.isfinite(clean)
        unit = diagnosis.marker.unit
        beside = f": {error:.2f} {unit}, where a twin that lacks nothing leaves {clean:.2f} {unit}"
        plain = f"What is left is too little to call unexplained{beside if known else ''}."
        return diagnosis.doubt or plain
    share = _share(diagnosis)
    repeated = any(rest.depends_on in said for said in told.values())
    return share if repeated else f"{share} {rest.depends_on}"


def _loads(diagnosis: Diagnosis, drawn: Mapping[str, Figure]) -> Section | None:
    figure = drawn.get("load_error_by_motor")
    if figure is None:
        return None
    if diagnosis.load != LOADS:
        what = diagnosis.load.what.removeprefix("the ").capitalize()
        return Section(what, "Predicted from the same drives as the pose.", (figure,))
    text = (
        "Loads are predicted from the same motor angles. At rest, gear friction may hold any load "
        "within its bounds, so that the loads of moving motors determine more."
    )
    return Section("Loads", text, (figure,))


def _calibration(diagnosis: Diagnosis, prior: Mapping[str, float]) -> Section | None:
    if not diagnosis.calibration and not diagnosis.cautions:
        return None
    parts = ["Declared parameters, fitted to the training sessions, each from its start."]
    if not diagnosis.calibration:
        parts = ["No declared parameter was fitted."]
    if diagnosis.cautions:
        parts += ["What the data cannot tell:", *(f"• {each}" for each in diagnosis.cautions)]
    tabled = (tables.moved(diagnosis), tables.calibration(diagnosis.calibration, prior))
    return Section("Calibration", "\n\n".join(parts), tuple(t for t in tabled if t.rows))


def _last_resort(diagnosis: Diagnosis) -> Section:
    learned, unit = diagnosis.learned, diagnosis.marker.unit
    loads = np.isfinite(diagnosis.load_error.get("calibrated", np.nan))
    read = "angles, velocities and loads" if loads else "angles and velocities"
    text = (
        f"A correction of what is predicted of {diagnosis.marker.what}, learned from motor {read}. It is "
        "no physics, names no cause, and is in none of the figures above."
    )
    if not np.isfinite(learned.before):
        said = "It was not learned: these logs lack what it is learned from."
    elif not learned.on:
        said = (
            f"It is off: on {_sessions(diagnosis)}, it removes nothing of the "
            f"{learned.before:.2f} {unit} beyond chance."
        )
    else:
        low, high = (100 * share for share in learned.interval)
        said = (
            f"It removes {100 * learned.share:.0f} % ({low:.0f} … {high:.0f} %, 95 % interval) of the "
            f"{diagnosis.marker.size} on {_sessions(diagnosis)}: {learned.before:.2f} {unit} without it, "
            f"{learned.after:.2f} {unit} with it."
        )
    return Section("Last resort, apart from physics", f"{text}\n\n{said}")
