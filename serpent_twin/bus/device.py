"""Serve simulated motors on a serial port: `python -m serpent_twin.bus.device`."""

import json
import signal
from pathlib import Path

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.emulator.child import Running, running
from serpent_twin.emulator.device_options import DeviceOptions, build
from serpent_twin.emulator.orders import Orders
from serpent_twin.runs.files import unused

__all__ = ["Running", "running"]


def main(options: DeviceOptions) -> None:
    device = build(options)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, device.stop)
    device.serve(Orders(hint=_hint if options.is_the_arm else _no_hint), options.until_eof)
    print(json.dumps(device.tally()), flush=True)


def _hint(port: str) -> str:
    step = next_step.step("examine", port=port, setup=unused(Path("sim.toml")))
    return next_step.line(step)


def _no_hint(port: str) -> str:
    return ""


if __name__ == "__main__":
    cli.run(main)
