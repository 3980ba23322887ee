"""Match columns to actuators and joints by the words and numbers of their names."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from serpent_twin.matching.robot import FORCE, SERVO, SPEED, Robot
from serpent_twin.matching.words import (
    COMMAND,
    EFFORT,
    POSITION,
    READING,
    VELOCITY,
    ColumnName,
    numbers_of,
    own_words,
    split,
)

_QUANTITY = {SERVO: POSITION, SPEED: VELOCITY, FORCE: EFFORT}
"""What the command of an actuator is"""
_CLEAR = 0.05
"""How much more a name must say for one thing than for another"""


@dataclass(frozen=True)
class Thing:
    """An actuator or joint, and names by which columns may call it."""

    name: str
    aliases: tuple[str, ...]


@dataclass
class NameMatches:
    """The column of each thing, why, and what names leave open."""

    column: dict[str, str] = field(default_factory=dict)
    """Column of each thing, by the thing's name"""
    why: dict[str, str] = field(default_factory=dict)
    by_order: set[str] = field(default_factory=set)
    """Things that were matched by the order of numbers alone"""
    alike: dict[str, list[str]] = field(default_factory=dict)
    """Columns of which names do not tell which is the thing's"""

    def has(self, column: ColumnName) -> bool:
        """Whether a column is matched to a thing."""
        return column.name in self.column.values()


def commands(robot: Robot, named: Mapping[str, ColumnName]) -> NameMatches:
    """The command columns of actuators; those that say another quantity are left out."""
    found = NameMatches()
    told = [each for each in named.values() if each.direction == COMMAND]
    for kind, quantity in _QUANTITY.items():
        things = _actuators(robot, kind)
        for tier in (quantity, ""):
            several = [each for each in told if each.quantity == tier and not found.has(each)]
            if any(each.name not in found.column for each in things):
                _match(several, things, found, alone=len(robot.actuators) == 1)
    return found


def efforts_as_commands(robot: Robot, named: Mapping[str, ColumnName]) -> NameMatches:
    """Columns of torques or currents that do not say that they are commands, for motors."""
    found = NameMatches()
    several = [each for each in named.values() if each.quantity == EFFORT]
    _match(several, _actuators(robot, FORCE), found, alone=len(robot.actuators) == 1)
    return found


def efforts(robot: Robot, named: Mapping[str, ColumnName]) -> NameMatches:
    """The columns of the joints' torques or currents: measured ones first, then commanded ones."""
    found = NameMatches()
    several = [each for each in named.values() if each.quantity == EFFORT]
    tiers = (
        [c for c in several if c.direction != COMMAND and not c.is_current],
        [c for c in several if c.direction != COMMAND],
        several,
    )
    for tier in tiers:
        if not found.column:
            _match(tier, _moved(robot), found, alone=len(robot.joints) == 1)
    return found


def readings(robot: Robot, named: Mapping[str, ColumnName], taken: Collection[str]) -> NameMatches:
    """The columns of joints' positions; names that tell it come first."""
    found, things = NameMatches(), _joints(robot)
    moved = dict.fromkeys(each.joint for each in robot.actuators)
    driven = [each for name in moved for each in things if each.name == name]
    left = [c for c in named.values() if c.direction != COMMAND and c.name not in taken]
    tiers = (
        [c for c in left if c.quantity == POSITION],
        [c for c in left if c.quantity == "" and c.direction == READING],
        [c for c in left if c.quantity == "" == c.direction and not _is_bare(c)],
    )
    for tier, several in enumerate(tiers):
        sure = tier < 2
        several = [each for each in several if not found.has(each)]
        open_ = [each for each in things if each.name not in found.column]
        if len(open_) == len(things):
            _match(several, things, found, alone=sure and len(things) == 1)
            if not found.column and not found.alike and len(driven) < len(things):
                _match(several, driven, found, alone=sure and len(driven) == 1)
        elif open_:
            _match(several, open_, found, numbers=False)
        if not sure:  # motion tells which of them is a command
            unsure = {each.name for each in several}
            found.alike = {k: v for k, v in found.alike.items() if not unsure & {*v}}
    return found


def whose(robot: Robot, columns: Sequence[ColumnName]) -> NameMatches:
    """The joints of columns that are known to be readings."""
    found = NameMatches()
    if not any(map(_is_bare, columns)):
        _match(columns, _joints(robot), found)
    return found


def families(joints: Sequence[str], columns: Sequence[ColumnName]) -> list[dict[str, str]]:
    """Columns that differ in a number, by joint, where there is one for each joint."""
    made = []
    for family in _by_family(columns):
        found = NameMatches()
        _match(family, [Thing(joint, (joint,)) for joint in joints], found)
        if len(found.column) == len(joints):
            made.append(found.column)
    return made


def _by_family(columns: Sequence[ColumnName]) -> list[list[ColumnName]]:
    """Columns that differ in numbers only, together."""
    found: dict[tuple[str, ...], list[ColumnName]] = {}
    for each in columns:
        found.setdefault(each.family, []).append(each)
    return list(found.values())


def _is_bare(name: ColumnName) -> bool:
    """Whether a name is a letter and a number, such as c3, which says nothing."""
    short = len(name.words) in (1, 2) and len(next(iter(name.words))) < 2
    return short and name.direction == "" == name.quantity


def _joints(robot: Robot) -> list[Thing]:
    return [Thing(each.name, (each.name, *each.sensors)) for each in robot.joints]


def _moved(robot: Robot) -> list[Thing]:
    """Joints, which columns may also call by what moves them."""
    return [
        Thing(each.name, (each.name, *(a.name for a in robot.actuators if a.joint == each.name)))
        for each in robot.joints
    ]


def _actuators(robot: Robot, kind: str = "") -> list[Thing]:
    return [
        Thing(each.name, tuple(dict.fromkeys((each.name, each.joint or each.name))))
        for each in robot.actuators
        if kind in ("", each.kind)
    ]


def _match(
    several: Sequence[ColumnName],
    things: Sequence[Thing],
    found: NameMatches,
    alone: bool = False,
    numbers: bool = True,
) -> None:
    """Match columns to things that have none: by words, then by numbers; of one thing, its only column."""
    open_ = [each for each in things if each.name not in found.column]
    _by_words(several, open_, found)
    left = [each for each in several if not found.has(each)]
    open_ = [each for each in open_ if each.name not in found.column]
    if numbers and len(open_) == len(things) > 0:
        _by_numbers(left, open_, found)
    if alone and len(things) == 1 and things[0].name not in found.column and left:
        if len(left) == 1:
            found.column[things[0].name] = left[0].name
            found.why[things[0].name] = "the only such column"
        else:
            found.alike.setdefault(things[0].name, [each.name for each in left])


def _by_words(several: Sequence[ColumnName], things: Sequence[Thing], found: NameMatches) -> None:
    score = {(c.name, t.name): _likeness(c, t) for c in several for t in things}
    left, open_ = [c.name for c in several], [t.name for t in things]
    while True:
        new = [
            (c, t)
            for c in left
            for t in open_
            if score[c, t] > 0
            and all(score[c, t] > score[c, other] + _CLEAR for other in open_ if other != t)
            and all(score[c, t] > score[other, t] + _CLEAR for other in left if other != c)
        ]
        if not new:
            break
        for c, t in new:
            found.column[t], found.why[t] = c, "by name"
            left.remove(c)
            open_.remove(t)
    for t in open_:
        best = max((score[c, t] for c in left), default=0.0)
        alike = [c for c in left if best > 0 and score[c, t] >= best - _CLEAR]
        alike = [c for c in alike if all(score[c, t] >= score[c, other] for other in open_)]
        if len(alike) > 1:
            found.alike[t] = alike


def _likeness(column: ColumnName, thing: Thing) -> float:
    """How much of a thing's name a column's has; 0 where it is of another one."""
    found = 0.0
    for n, alias in enumerate(thing.aliases):
        words = split(alias)
        if words and _within(words, column.words) and _numbers_agree(column, alias):
            found = max(found, 2 + 0.1 * len("".join(words)) - 0.02 * n)
            continue
        mine = {*column.own, *map(str, column.numbers)}
        its = {*own_words(alias), *map(str, numbers_of(alias))}
        common = mine & its
        if not any(not each.isdecimal() for each in common) or not (mine <= its or its <= mine):
            continue
        found = max(found, 1 + 2 * len(common) / (len(mine) + len(its)) - 0.02 * n)
    return found


def _numbers_agree(column: ColumnName, alias: str) -> bool:
    """Whether a short name such as `q` is not taken for one of q1, q2."""
    return bool(numbers_of(alias)) or not column.numbers or any(len(w) > 1 for w in split(alias))


def _within(words: Sequence[str], whole: Sequence[str]) -> bool:
    """Whether words follow each other in a name."""
    n = len(words)
    return any(tuple(whole[k : k + n]) == tuple(words) for k in range(len(whole) - n + 1))


def _by_numbers(several: Sequence[ColumnName], things: Sequence[Thing], found: NameMatches) -> None:
    """Match columns that differ in one number to things that do, or to things in the model's order."""
    fits = []
    for family in _by_family([each for each in several if each.numbers]):
        varies = list(zip(*(each.numbers for each in family), strict=True))
        varies = [n for n in varies if len(set(n)) == len(family)]
        if len(varies) == 1 and (made := _paired(varies[0], things)):
            why, order = made
            fits.append((why, [family[k] for k in order]))
    if len(fits) > 1:
        for n, each in enumerate(things):
            found.alike[each.name] = [columns[n].name for _, columns in fits]
    elif fits:
        why, columns = fits[0]
        for each, column in zip(things, columns, strict=True):
            found.column[each.name], found.why[each.name] = column.name, why
            found.by_order.add(each.name)


def _paired(numbers: Sequence[int], things: Sequence[Thing]) -> tuple[str, list[int]] | None:
    """Which number is of each thing, and by what; None where numbers do not tell."""
    if len(numbers) < len(things):
        return None
    order = sorted(range(len(numbers)), key=lambda k: numbers[k])
    for alias in range(max(len(each.aliases) for each in things)):
        own = [numbers_of(each.aliases[min(alias, len(each.aliases) - 1)]) for each in things]
        if all(own) and len({each[-1] for each in own}) == len(things):
            last = [each[-1] for each in own]
            if set(last) == set(numbers):
                return "by its number", [list(numbers).index(n) for n in last]
            if len(numbers) == len(things):
                return "by the order of numbers", [order[k] for k in _ranks(last)]
            return None
    if sorted(numbers) in ([*range(len(things))], [*range(1, len(things) + 1)]):
        return "by its number, in the model's order", order
    return None


def _ranks(several: Sequence[int]) -> list[int]:
    ordered = sorted(several)
    return [ordered.index(each) for each in several]
