"""`python -m serpent_twin.bus.device`."""

import json
import signal

from serpent_twin import cli
from serpent_twin.bus.device.options import Options, build
from serpent_twin.bus.device.orders import Orders


def main(options: Options) -> None:  # noqa: D103 tyro would print it above the options' own
    device = build(options)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, device.stop)
    device.serve(Orders(), options.until_eof)
    print(json.dumps(device.tally()), flush=True)


if __name__ == "__main__":
    cli.run(main)
