"""How uncertain the parameters of a fit are, by scatter, by priors and by what segments disagree on."""

from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from serpent_twin.arrays import Array
from serpent_twin.identification.fitting.fitted import NORMAL_95, Fit
from serpent_twin.identification.fitting.free_parameters import prior_information
from serpent_twin.machines.case import Case

_ALONE = 0.1
"""No segment is left out along a direction of which the others hold less than this share of the information
"""
_IDEALISED = 0.005
"""Part of a residual's squares that counts as one beside what a twin idealises, as much as a number that is
off by its prior
"""
_LEAST = 25.0
"""Times as many numbers of a residual count as one at least, where segments disagree"""
_SHARED = 1 / 3
"""Variance of what is wrong with a twin in all segments alike, in variances of what is wrong with it in one
alone: as found on arms whose true parts are known
"""


def standard_errors(
    jacobian: Array,
    residual: Array,
    each: float,
    prior: Array,
    shared: float = 0.0,
    weak: bool = False,
) -> tuple[Array, Array]:
    """Standard errors, (m,), and correlations of m free parameters, from a derivative, (m, S, n), a residual,
    (S, n), of which so many numbers count as one, and the priors' information.

    The greater of two, because no twin is exact, and its errors within a segment are correlated: from scatter
    and priors; and from priors and the disagreement of segments, each taken as one independent draw (Liang
    and Zeger 1986). A fit takes up part of what segments disagree on, so each is left out in turn (the
    jackknife; Bell and McCaffrey, Survey Methodology 28 (2002) 169), but not along a direction that it
    alone tells, in which the others predict nothing. Where they disagree more than independent numbers would,
    the twin lacks something, of which `shared` is what is wrong in all segments alike, as a multiple of the
    variance in one. None is greater than its prior's; nor, where `weak` directions were followed by what a
    twin idealises, than if as many numbers counted as one.
    """
    # Single precision would lose parameters of which priors alone say anything.
    told = [part.astype(float) @ part.T.astype(float) / each for part in jacobian.swapaxes(0, 1)]
    data, weight = sum(told), np.diag(prior.astype(float))
    square = data + weight
    covariance = _inverse(square)
    error = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(error, error)
    segments = residual.shape[0]
    if segments < 3 or not np.isfinite(correlation).all():
        return error, correlation
    pull = np.einsum("msn,sn->ms", jacobian, residual, dtype=float) / each
    variance, along = np.linalg.eigh(correlation)
    root = error[:, None] * along * np.sqrt(np.maximum(variance, 0.0))
    each_alone = zip(told, pull.T, strict=True)
    left_out = np.stack([_left_out(root, part, by) for part, by in each_alone], axis=1)
    one_less = (segments - 1) / segments
    between = np.maximum(_squares(covariance @ pull) / one_less, _squares(left_out) * one_less)
    if shared:
        independent = _inverse(each * data + weight)
        chance = np.diag(independent) - independent**2 @ prior
        between += shared * segments * np.maximum(0.0, between - chance)
    between *= (float(scipy.special.stdtrit(segments - 1, 0.975)) / NORMAL_95) ** 2
    own = covariance**2 @ prior  # what the priors leave uncertain, were the data exact
    most = prior**-0.5
    if weak:
        share = each / max(idealised(residual), _LEAST * each)
        most = np.sqrt(np.diag(_inverse(share * data + weight)))
    return np.maximum(error, np.minimum(np.sqrt(between + own), most)), correlation


def idealised(residual: Array) -> float:
    """How many numbers of a residual count as one beside what a twin idealises."""
    return _IDEALISED * float((residual.astype(float) ** 2).sum())


def stated(case: Case[Any], found: Fit) -> Fit:
    """The fit with the standard errors that its stated intervals have, in which more segments do not help
    against what the twin lacks in all of them.
    """
    prior = prior_information(case, found.free)
    about = (found.jacobian, found.residual, found.variance_inflation, prior)
    weak = bool(case.weak_rounds)
    return replace(found, error=np.maximum(found.error, standard_errors(*about, _SHARED, weak)[0]))


def _left_out(root: Array, part: Array, pull: Array) -> Array:
    """What leaving out a segment moves m parameters by, (m,), from a root of their covariance, (m, m), and
    the segment's information, (m, m), and pull, (m,).
    """
    share, along = np.linalg.eigh(root.T @ part @ root)
    left = np.where(share > 1 - _ALONE, 1.0, 1 - share)
    return root @ (along @ (along.T @ (root.T @ pull) / left))


def _inverse(square: Array) -> Array:
    """Inverse of an information matrix whose units may differ by orders of magnitude."""
    width = np.sqrt(np.diag(square))
    return np.linalg.inv(square / np.outer(width, width)) / np.outer(width, width)


def _squares(shift: Array) -> Array:
    """Sum of the squares of what each of S segments moves m parameters by, (m, S), about the mean, (m,)."""
    return ((shift - shift.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
