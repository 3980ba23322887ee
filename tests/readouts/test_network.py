"""Test the networks in torch and in numpy, and their training."""

import numpy as np
import pytest
import torch

from serpent_twin.arm import geometry
from serpent_twin.readouts import Epoch
from serpent_twin.readouts.network import fit, forward, modules

torch.set_num_threads(1)  # networks this small only wait for a second thread


def quiet(*_: object) -> None:
    """Report no progress."""


def test_torch_and_numpy_place_the_markers_alike():
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (50, 9))
    place = torch.tensor(geometry.ARM.markers_in_links)
    found = modules.markers(torch.tensor(q), place).numpy()
    np.testing.assert_allclose(found, geometry.markers(q), atol=1e-12)
    single = modules.markers(torch.tensor(q, dtype=torch.float32), place.float()).numpy()
    np.testing.assert_allclose(single, geometry.markers(q), atol=1e-6)


def test_torch_and_numpy_run_the_same_perceptron():
    net = modules.MlpModule(7, 16, 3, 5, "silu")
    x = torch.randn(20, 7)
    expected = net(x).detach().numpy()
    np.testing.assert_allclose(
        forward.mlp(x.numpy(), fit.weights(net), "silu"), expected, atol=1e-6
    )


def test_our_lstm_is_torchs_lstm():
    net, reference = modules.LstmModule(6, 8, 5), torch.nn.LSTM(6, 8, batch_first=True)
    state = {
        "weight_ih_l0": net.input.weight,
        "bias_ih_l0": net.input.bias,
        "weight_hh_l0": net.hidden.weight,
        "bias_hh_l0": torch.zeros(32),
    }
    reference.load_state_dict(state)
    x = torch.randn(20, 4, 6)
    expected = net.output(reference(x)[0][:, -1]).detach().numpy()
    np.testing.assert_allclose(net(x).detach().numpy(), expected, atol=1e-6)
    np.testing.assert_allclose(forward.lstm(x.numpy(), fit.weights(net)), expected, atol=1e-6)


def test_the_published_schedule_lowers_the_rate_after_three_rises_and_then_ends():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(300, 4)), rng.normal(size=(300, 27))  # nothing to learn: overfits soon
    net = fit.build(lambda: modules.MlpModule(4, 32, 2, 27, "relu"), rng)
    train, validation = fit.samples(x[:150], y[:150]), fit.samples(x[150:], y[150:])
    schedule = fit.Plateau(epochs=400, batch=10, rate=1e-2, least_rate=1e-4)
    history = []
    fit.train(
        net, train, validation, schedule, rng, lambda *numbers: history.append(Epoch(*numbers))
    )
    rate, rises, last = 1e-2, 0, np.inf
    for epoch in history:
        assert epoch.rate == pytest.approx(rate)
        rises = rises + 1 if epoch.validation_loss > last else 0
        last = epoch.validation_loss
        if rises == 3:
            rate, rises = rate / 10, 0
    assert rate == pytest.approx(1e-5)
    assert len(history) < 400
    best = min(epoch.validation_loss for epoch in history)
    with torch.inference_mode():
        assert fit.squared_error(net, validation).item() == pytest.approx(best)


def test_lost_markers_do_not_enter_the_loss():
    x, y = np.ones((2, 3)), np.zeros((2, 27))
    y[0, :] = np.nan
    net = modules.MlpModule(3, 4, 1, 27, "relu")
    for loss in (fit.squared_error, fit.distance):
        masked, whole = loss(net, fit.samples(x, y)), loss(net, fit.samples(x[1:], y[1:]))
        assert masked.item() == pytest.approx(whole.item())


def test_the_distance_loss_is_the_mean_distance():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(40, 3)), rng.normal(0, 10, (40, 27))
    y[3, 6:9] = np.nan
    net = modules.MlpModule(3, 4, 1, 27, "relu")
    estimate = forward.mlp(x, fit.weights(net), "relu").reshape(-1, 9, 3)
    expected = np.nanmean(np.linalg.norm(estimate - y.reshape(-1, 9, 3), axis=2))
    assert fit.distance(net, fit.samples(x, y), rounding=1e-6).item() == pytest.approx(expected)
