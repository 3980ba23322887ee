"""Serve simulated motors on a serial port: `python -m serpent_twin.bus.device`."""

import json
import signal

from serpent_twin import next_step
from serpent_twin.command_line import cli
from serpent_twin.emulator.device import Running, running
from serpent_twin.emulator.device.options import DeviceOptions, build
from serpent_twin.emulator.device.orders import Orders

__all__ = ["Running", "running"]


def main(options: DeviceOptions) -> None:
    device = build(options)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, device.stop)
    device.serve(Orders(hint=_hint if options.is_the_arm else _no_hint), options.until_eof)
    print(json.dumps(device.tally()), flush=True)


def _hint(port: str) -> str:
    return next_step.line(next_step.after_device(port))


def _no_hint(port: str) -> str:
    return ""


if __name__ == "__main__":
    cli.run(main)
