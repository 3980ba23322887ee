"""Jobs that kill the process that does them; light, because processes import it anew."""

import os
import signal
import time
from pathlib import Path


def fragile(job):
    """Do what a pair of a kind and a value asks; "once" dies unless the path that is its value is there."""
    kind, value = job
    if kind == "sleep":
        time.sleep(value)
    if kind == "say":
        print(value, flush=True)
    if kind == "deadly" or (kind == "once" and not Path(value).exists()):
        if kind == "once":
            Path(value).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return value
