"""Commands that speak to the motors: `doctor`, `zero`, and `device`, the simulated ones on a wire."""
