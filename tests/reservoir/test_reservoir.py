"""Test the reservoir measures on delay lines, filters, networks and NARMA10."""

from collections import Counter

import numpy as np
import pytest
from scipy.stats import ortho_group

from serpent_twin.reservoir import (
    basis,
    beyond_taps,
    capacities,
    chance_cut,
    channel_consistency,
    consistency_spectrum,
    contraction_rate,
    distance,
    expand,
    label,
    legendre,
    memory,
    state_rank,
    streams,
    taps,
)

ROWS, WASHOUT = 20_000, 500


def drawn(rows=ROWS, inputs=1, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (rows, inputs))


def driven(W, b, u, start=None, law=np.asarray):
    """States (T, N) of x ← law(W x + b u), after each of the inputs (T, 1)."""
    x = np.zeros(len(b)) if start is None else start
    states = np.empty((len(u), len(b)))
    for t, force in enumerate(u[:, :1] * b):
        x = states[t] = law(W @ x + force)
    return states


def network(N, seed=0, radius=0.9):
    """Weights of a random network of this spectral radius, and of its input."""
    rng = np.random.default_rng(seed)
    W = rng.standard_normal((N, N))
    return radius * W / np.abs(np.linalg.eigvals(W)).max(), rng.uniform(-1, 1, N)


def test_a_delay_line_remembers_as_many_inputs_as_it_has_taps():
    u, N = drawn(), 12
    found = memory(taps(u, N), u, 30)
    assert found.total == pytest.approx(N, abs=1e-6)
    assert found.mean_delay == pytest.approx((N - 1) / 2, abs=1e-6)
    ipc = capacities(taps(u, N), u, 2, (30, 15))
    assert ipc.by_degree == pytest.approx([0, N, 0], abs=1e-6)
    assert ipc.by_degree[2] == 0


def test_noise_holds_nothing():
    u = drawn()
    noise = np.random.default_rng(1).standard_normal((ROWS, 20))
    ipc = capacities(noise, u, 3, (50, 20, 8))
    assert ipc.total == 0 and ipc.products == ()
    assert memory(noise, u, 100).total == 0
    assert np.isnan(memory(noise, u, 100).mean_delay)


def test_nine_mixed_functions_count_three_and_six():
    u = drawn(inputs=3)
    parts = [*u.T, *legendre(u, 2).T, u[:, 0] * u[:, 1], u[:, 0] * u[:, 2], u[:, 1] * u[:, 2]]
    mixed = np.stack(parts, axis=1) @ np.random.default_rng(1).standard_normal((9, 9))
    ipc = capacities(mixed, u, 3, (5, 2, 1))
    assert ipc.by_degree == pytest.approx([0, 3, 6, 0], abs=1e-6)
    assert Counter(sum(d for *_, d in p) for p in ipc.products) == {1: 3, 2: 6}
    assert ipc.r == 9


def test_a_first_order_filter_forgets_geometrically():
    u, a = drawn(40_000), 0.8
    found = memory(driven(np.array([[a]]), np.ones(1), u), u, 30, WASHOUT)
    k = np.arange(31)
    assert found.profile[0] == pytest.approx((1 - a**2) * a ** (2 * k), abs=0.012)
    assert found.total == pytest.approx(1, abs=0.03)
    assert found.mean_delay == pytest.approx(a**2 / (1 - a**2), abs=0.15)


def test_powers_split_into_their_degrees():
    u = drawn(40_000)
    assert capacities(u**2, u, 3, (4, 4, 4)).by_degree == pytest.approx([0, 0, 1, 0], abs=1e-9)
    cubed = capacities(u**3, u, 3, (4, 4, 4))
    assert cubed.by_degree == pytest.approx([0, 0.84, 0, 0.16], abs=0.005)


def test_three_inputs_with_four_taps_count_twelve():
    u = drawn(inputs=3)
    found = memory(taps(u, 4), u, 10)
    assert found.total == pytest.approx(12, abs=1e-6)
    assert found.profile[:, :4] == pytest.approx(1, abs=1e-9)
    assert capacities(taps(u, 4), u, 2, (8, 4)).total == pytest.approx(12, abs=1e-6)


@pytest.mark.parametrize("N", [10, 30, 100])
def test_an_orthogonal_linear_network_remembers_as_much_as_it_has_units(N):
    rng = np.random.default_rng(0)
    u, W = drawn(), 0.9 * ortho_group.rvs(N, random_state=rng)
    found = memory(driven(W, rng.standard_normal(N), u), u, 3 * N + 50, WASHOUT)
    assert found.r == N
    assert found.total == pytest.approx(N, rel=0.01)


def test_a_network_without_bias_has_no_even_degrees():
    u, (W, b) = drawn(), network(30)
    ipc = capacities(driven(W, b, u, law=np.tanh), u, 4, (80, 20, 10, 6), WASHOUT)
    assert ipc.by_degree[2] == 0 and ipc.by_degree[4] == 0
    assert ipc.by_degree[1] > 5 and ipc.by_degree[3] > 1


def test_noise_lowers_consistency_and_free_directions_have_none():
    rng, s = np.random.default_rng(0), 0.5
    x = rng.standard_normal((ROWS, 4))
    noisy = x + s * rng.standard_normal((3, ROWS, 4))
    assert channel_consistency(noisy) == pytest.approx(1 / (1 + s**2), abs=0.01)
    assert consistency_spectrum(noisy) == pytest.approx(1 / (1 + s**2), abs=0.03)
    free = rng.standard_normal((2, ROWS, 2))
    states = np.concatenate([np.stack([x[:, :3]] * 2), free], axis=2)
    mixed = states @ rng.standard_normal((5, 5))
    assert consistency_spectrum(mixed) == pytest.approx([1, 1, 1, 0, 0], abs=0.03)


def narma10(u):
    """NARMA10's y(0) … y(T) for inputs (T,) in [0, 0.5] (Atiya and Parlos 2000)."""
    drive, y = [0.0] * 9 + u.tolist(), [0.0] * 10
    for t in range(9, len(drive)):
        past = 0.05 * y[t] * sum(y[t - 9 : t + 1])
        y.append(0.3 * y[t] + past + 1.5 * drive[t - 9] * drive[t] + 0.1)
    return np.array(y[9:])


def test_narma10_is_made_of_the_published_products():
    # github.com/kubota0130/ipc, sample3_individual.ipynb: seed, 10,000 + 10⁶ rows and σ = 0.45
    zeta = 2 * np.random.RandomState(0).rand(1_010_000) - 1
    y = narma10(0.45 * 0.5 * (zeta + 1))[:-1]
    found = expand(y, zeta, 1, (12,), washout=10_000)
    share = {p[0][1]: s for p, (s,) in zip(found.products, found.share, strict=True)}
    assert found.T == 1_000_000
    published = {1: 0.282402, 2: 0.066684, 3: 0.018371, 10: 0.325264, 11: 0.088102, 12: 0.027427}
    assert {k: share[k] for k in published} == pytest.approx(published, abs=2e-6)


def test_legendre_polynomials_are_orthonormal():
    node, weight = np.polynomial.legendre.leggauss(20)
    columns = np.stack([legendre(node, d) for d in range(8)])
    assert columns * (weight / 2) @ columns.T == pytest.approx(np.eye(8), abs=1e-12)


def test_products_of_several_inputs_and_delays_are_found_by_name():
    u = drawn(inputs=2)
    now, before = u[5:], u[:-5]
    x = legendre(now[:, 0], 2) * before[:, 1] * before[:, 0]
    ipc = capacities(x, u[5:], 4, (5, 5, 5, 5))
    assert ipc.products[0] == ((0, 0, 2), (0, 5, 1), (1, 5, 1))
    assert ipc.capacity[0] == pytest.approx(1, abs=1e-9)
    # One channel's square goes with those of products that share its factors: chance is larger there.
    assert np.all(ipc.capacity[1:] < 2 * ipc.cut)
    assert label(ipc.products[0]) == "P2(u0[t]) P1(u0[t−5]) P1(u1[t−5])"
    assert ipc.by_degree == pytest.approx([0, 0, 0, 0, 1], abs=0.01)
    assert ipc.searched == 12 + 78 + 364 + 1365  # (12 + d − 1 choose d)


def test_inputs_out_of_order_have_no_capacity():
    u, (W, b) = drawn(6000), network(8, radius=0.5)
    x = driven(W, b, u, law=np.tanh)
    ipc = capacities(x, u, 3, (10, 6, 4), 100)
    assert ipc.cut == chance_cut(5900, basis(x[100:]).rank) < ipc.capacity.min()
    for seed in range(3):
        shuffled = np.random.default_rng(seed).permuted(u, axis=0)
        assert not len(capacities(x, shuffled, 3, (10, 6, 4), 100).capacity)


def test_the_threshold_is_that_of_99_channels():
    assert chance_cut(1000, 99) == pytest.approx(0.32, abs=0.005)
    assert chance_cut(20_000, 99) == pytest.approx(0.016, abs=0.0005)


def test_a_polynomial_expands_into_its_terms():
    u = drawn(40_000, inputs=2)
    a, b = taps(u, 4).reshape(-1, 4, 2).transpose(2, 1, 0)
    series = np.stack([2 * a[1] + 3 * a[0] * b[3], a[2] ** 3, np.full(len(u), 7.0)], axis=1)
    found = expand(series, u, 3, (4, 4, 4))
    share = dict(zip(found.products, found.share, strict=True))
    assert len(share) == 4
    assert share[((0, 1, 1),)] == pytest.approx([4 / 7, 0, 0], abs=0.01)  # 4/3 beside 9/9
    assert share[((0, 0, 1), (1, 3, 1))] == pytest.approx([3 / 7, 0, 0], abs=0.01)
    assert share[((0, 2, 1),)] == pytest.approx([0, 0.84, 0], abs=0.01)
    assert share[((0, 2, 3),)] == pytest.approx([0, 0.16, 0], abs=0.01)
    assert found.by_degree.sum(axis=0) == pytest.approx(found.explained)
    assert found.explained == pytest.approx([1, 1, 0], abs=0.02)
    assert found.overall[0] == pytest.approx(4 / 3 / (7 / 3 + 1 / 7), abs=0.01)


def test_taps_are_taken_from_what_the_body_adds():
    u, H = drawn(), 4
    body = np.stack([u[:, 0] + taps(u, 8)[:, 7], taps(u, 3)[:, 2] ** 2], axis=1)
    found = beyond_taps(body, u, H, 2, (12, 6))
    assert found.taps.by_degree == pytest.approx([0, H, 0], abs=1e-6)
    assert found.by_degree == pytest.approx([0, 1, 1], abs=1e-6)
    assert found.total == pytest.approx(2, abs=1e-6)
    leaking = beyond_taps(
        u + 1e-3 * np.random.default_rng(1).standard_normal(u.shape), u, H, 1, (12,)
    )
    assert leaking.total == pytest.approx(0, abs=1e-6)


def test_ranks_count_what_a_delay_line_tells_apart():
    rng, N = np.random.default_rng(0), 10
    for alike, rank in ((0, N), (4, N - 4), (N, 0)):
        u = streams(rng, 5 * N, 30, alike=alike)[..., 0]
        last = u[:, ::-1][:, :N] + 0.01 * rng.standard_normal((5 * N, N))
        assert state_rank(last, 0.01) == rank
        assert state_rank(last * np.arange(1, N + 1), 0.01 * np.arange(1, N + 1)) == rank


def test_states_contract_at_their_rate():
    u, a, period = drawn(400), 0.9, 0.02
    starts = np.array([[1.0], [-2.0]])
    runs = np.stack([driven(np.array([[a]]), np.ones(1), u, start) for start in starts])
    apart = distance(runs)
    assert contraction_rate(apart, period) == pytest.approx(-np.log(a) / period, rel=1e-6)
    noisy = apart + 1e-3
    assert contraction_rate(noisy, period, 0.05) == pytest.approx(-np.log(a) / period, rel=0.05)


def test_series_side_by_side_count_as_one_and_do_not_mix():
    """Forty delay lines that each begin with zeros: what was before a series' first row is not read."""
    u, N = drawn(inputs=2).reshape(40, 500, 2), 6
    line = taps(u, N)
    assert np.array_equal(line[7], taps(u[7], N))
    found = memory(line, u, 10)
    assert found.total == pytest.approx(2 * N, abs=1e-6)
    assert found.T == 40 * (500 - 10)
    assert memory(line.reshape(ROWS, -1), u.reshape(ROWS, 2), 10).total < 2 * N - 0.05
    ipc = capacities(line, u, 2, (10, 5))
    assert ipc.by_degree == pytest.approx([0, 2 * N, 0], abs=1e-6)
    assert expand(line, u, 1, (10,)).explained == pytest.approx(1, abs=0.02)
    assert beyond_taps(taps(u, N + 1), u, N, 1, (10,)).total == pytest.approx(2, abs=1e-6)
    products = capacities(np.stack([u[..., 0] * np.roll(u[..., 1], 3, axis=1)], -1), u, 2, (10, 5))
    assert products.products[0] == ((0, 0, 1), (1, 3, 1))


def test_the_basis_drops_what_does_not_vary():
    u = drawn()
    x = np.column_stack([u, 3 * u + 1, np.full(len(u), 0.1), taps(u, 2)[:, 1] * 1e-9])
    span = basis(x)
    assert (span.rank, span.dropped) == (2, 1)
    assert span.Q.T @ span.Q == pytest.approx(np.eye(2), abs=1e-12)
    assert capacities(x, u, 1, (5,)).dropped == 1
