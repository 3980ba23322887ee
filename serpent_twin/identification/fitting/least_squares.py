"""Fit parameters to the logs by least squares, with standard errors.

Gauss-Newton with priors, on some of the segments; all perturbed twins of one derivative step side by
side. A residual's numbers are correlated in time and between markers, so the data are weighted by their
effective sample size.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting import weak_steps
from serpent_twin.identification.fitting.far_steps import elsewhere
from serpent_twin.identification.fitting.fitted import Fit
from serpent_twin.identification.fitting.free_parameters import FreeParameters, between
from serpent_twin.identification.fitting.objective import At, Objective
from serpent_twin.identification.fitting.standard_errors import idealised, standard_errors
from serpent_twin.machines.case import Case
from serpent_twin.machines.machine import ParameterVector

_SETTLED = 0.5
"""A step that reduces the cost by less, about half a standard error, is the last"""
_SMALL_SHARE = 5e-4
"""A step that reduces the cost by less than this share is the last, too"""
_SMALL_PART = 0.1
"""A step that brings the cost less than this part of the way to a near one is the last, too"""
_SETTLED_SHARE = 1e-2
"""A derivative whose steps reduce the cost by less than this share is the last: another gains about a tenth
"""
_STILL = 0.5
"""A fit has also converged if its last derivative changed its effects by fewer standard errors"""
_STEPS, _MORE = 10, 3
"""Steps that a derivative serves which costs much more than they do; where it costs hardly more, it serves
fewer, and there are so many times as many derivatives
"""
OnProgress = Callable[[str], None]


def _silent(_: str) -> None: ...


def fit(
    case: Case[Any],
    pieces: Any,
    start: ParameterVector,
    free: FreeParameters,
    derivatives: int,
    most: int,
    on_progress: OnProgress = _silent,
    known: Fit | None = None,
    carried: Fit | None = None,
    steps: int | None = None,
    near: float = np.inf,
    rounds: int = 0,
    afresh: bool = False,
    used: Sequence[int] = (),
    far: bool = False,
) -> Fit:
    """Fit to at most so many segments, those `used` or spread evenly, with at most so many derivatives.

    A derivative serves several steps, with Broyden's rank-one update after each. From a fit that is `known`,
    the segments and the derivative by the declared parameters are taken, so that only the effects' are
    simulated, unless all are to be taken `afresh`. From one that is `carried` over from other weights, and
    maybe fewer segments, the derivative is taken for the first steps instead of a simulation. The fit has
    converged when a new derivative gives no better step; with no steps it is the derivative at the start.
    Above the cost `near` there is no second derivative, and small steps are not worth it. In so many `rounds`
    at most a fit is finished with what a twin idealises in mind. It may also go `far` with one number, after
    its first derivative.
    """
    if steps is None:
        steps = case.steps_of_derivative
        derivatives *= _MORE if derives_cheaply(case) else 1
    first = carried.used if carried else used
    used = known.used if known else spread(len(pieces), most, first)
    problem = Objective(case, case.take(pieces, used), free, known, afresh)
    at, jacobian = problem.carry(start, carried, used) if carried else problem.begin(start)

    def small(before: At, after: At) -> bool:
        least = max(_SETTLED, _SMALL_SHARE * after.cost, _SMALL_PART * (after.cost - near))
        return before.cost - after.cost < least

    settled, begun = False, at.point
    for n in range(derivatives + (carried is not None)):
        if n:
            at, jacobian = problem.again(at.point)
        before, begun = at.cost, at.point
        at, jacobian = descend(problem, at, jacobian, steps, small)
        if far and n == (carried is not None):
            at = elsewhere(problem, at, jacobian)
        what = (
            f"derivative {n + (not carried)} of {derivatives}"
            if n or not carried
            else "first steps"
        )
        on_progress(f"{what}: cost {before:.0f} → {at.cost:.0f}")
        fell = before - at.cost
        settled = steps > 0 and fell < max(2 * _SETTLED, _SETTLED_SHARE * at.cost)
        if (settled or at.cost > near) and (n or not carried):
            break
    if rounds:
        at, jacobian, settled = _finished(problem, at, jacobian, rounds, steps, small, on_progress)
    at = problem.exact(at)
    inflation, noise = problem.variance_inflation, case.noise
    told = (jacobian, at.residual, inflation, problem.prior)
    error, correlation = standard_errors(*told, weak=bool(rounds))
    if steps > 0 and free.effects:
        late = np.abs(between(begun, at.point, free) / error)[len(free.declared) :]
        settled = settled or bool((late < _STILL).all())
    about = (error, correlation, settled, jacobian, at.residual, used, noise)
    return Fit(at.point, free, at.cost, inflation, *about)


def _finished(
    problem: Objective,
    at: At,
    jacobian: Array,
    rounds: int,
    steps: int,
    small: Callable[[At, At], bool],
    on_progress: OnProgress,
) -> tuple[At, Array, bool]:
    """Where a fit ends after so many rounds at most, the derivative there, and whether the last round moved
    it by less than half a standard error.

    No twin is exact, and its simplifications add up over thousands of rows as if they were information: a
    time step of a millisecond is enough to prefer forces that are a third too small. The data therefore weigh
    less: half a percent of the residual's squares counts as one. A derivative that is right tells of what
    they hardly tell, too; where it is dear, and so of differences, the fit goes along that by itself.
    """
    inflation, gained = problem.variance_inflation, np.inf
    problem.variance_inflation = max(inflation, idealised(at.residual))
    at = replace(at, cost=problem.cost(at.residual, at.point))
    for n in range(rounds):
        on_progress(
            f"round {n + 1} of {rounds} of what numbers can hardly tell apart: cost {at.cost:.0f}"
        )
        before = at.cost
        if problem.case.machine.differentiates:
            at, jacobian = problem.again(at.point)
            at, jacobian = descend(problem, at, jacobian, steps, small)
        else:
            at, jacobian = weak_steps.follow(problem, at, jacobian)
        gained = before - at.cost
        if gained < _SETTLED:
            break
    problem.variance_inflation = inflation
    at = replace(at, cost=problem.cost(at.residual, at.point))
    return at, jacobian, gained < 2 * _SETTLED


def derives_cheaply(case: Case[Any]) -> bool:
    """Whether a derivative costs hardly more than the steps that it serves."""
    return case.steps_of_derivative < _STEPS


def descend(
    problem: Objective, at: At, jacobian: Array, steps: int, small: Callable[[At, At], bool]
) -> tuple[At, Array]:
    """Take at most `steps` steps with one derivative, until none reduces the cost or one is `small`; returns
    where they end, and the derivative as they changed it.
    """
    for _ in range(steps):
        taken = problem.step(at, jacobian)
        if taken is None:
            break
        step, change = between(at.point, taken.point, problem.free), taken.residual - at.residual
        jacobian = bettered(jacobian, change, step, problem.variance_inflation)
        before, at = at, taken
        if small(before, at):
            break
    return at, jacobian


def telling(squares: Array, chosen: Sequence[int]) -> tuple[int, ...]:
    """Some segments in which, on average, a twin leaves as much as in all, from its squares in each, (S,):
    those that leave most take the place of the next ones of those `chosen`, until they do. What a robot does
    seldom, as to reach a limit, is in few segments.
    """
    some, taken = np.array(chosen), set[int]()
    for worst in np.argsort(-squares).tolist():
        if squares[some].mean() >= squares.mean():
            break
        left = [n for n, k in enumerate(some.tolist()) if k not in taken]
        if worst not in some and left:
            nearest = min(left, key=lambda n: abs(int(some[n]) - worst))
            some[nearest] = worst
        taken.add(worst)
    return tuple(sorted(some.tolist()))


def spread(segments: int, most: int, used: Sequence[int] = ()) -> tuple[int, ...]:
    """Segments that a fit uses: the middles of so many equal parts; beside those `used` already, the ones
    that lie farthest from all others.
    """
    n = min(segments, most)
    if not used:
        return tuple(int((k + 0.5) * segments / n) for k in range(n))
    chosen = list(used)
    while len(chosen) < n:
        apart = np.abs(np.subtract.outer(np.arange(segments), chosen)).min(axis=1)
        chosen.append(int(apart.argmax()))
    return tuple(sorted(chosen))


def bettered(jacobian: Array, change: Array, step: Array, each: float) -> Array:
    """The derivative, changed in place to explain the change along the step (Broyden 1965)."""
    flat = jacobian.reshape(len(jacobian), -1)
    metric = (flat**2).sum(axis=1) / each
    length = float(step @ (metric * step))
    if length < 1.0:  # of about a standard error: noise of sticking hinges is larger
        return jacobian
    missed = change - np.tensordot(step, jacobian, 1)
    along = (metric * step / length).astype(np.float32)
    missed = missed.astype(np.float32)
    for each_row, by in zip(jacobian, along, strict=True):
        each_row += by * missed
    return jacobian
