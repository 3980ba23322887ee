"""Test that a fit takes short steps along what sites alone tell of rigid parts."""

from dataclasses import replace

import numpy as np
from linear_case import START, LinearCase, case, every

from serpent_twin.identification.fitting.free_parameters import free_parameters
from serpent_twin.identification.fitting.least_squares import fit


def test_steps_are_short_along_what_sites_tell_of_parts_by_themselves():
    """What others pull at goes its whole way; the optimum is the same one."""
    made = case(0.0)

    class Told(LinearCase):
        told = np.diag([1e6, 0.0])

    told = Told(**made.__dict__)
    plain, held = (
        fit(each, every(), START, free_parameters(each, ()), 1, 99, steps=1).point.declared
        for each in (made, told)
    )
    assert abs(held[0]) < 0.01 * abs(plain[0]) and abs(held[1]) > 0.5 * abs(plain[1])
    start = replace(START, declared=plain)
    again = fit(told, every(), start, free_parameters(told, ()), 1, 99, steps=1).point.declared
    np.testing.assert_allclose(again, plain, atol=1e-3)
