"""Run commands on the motor bus: `doctor`, `zero`, and `device`, which simulates motors on a wire."""
