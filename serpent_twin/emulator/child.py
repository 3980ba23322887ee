"""Start a device from another program's test, and make it fail."""

import queue
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from serpent_twin.errors import SerpentError
from serpent_twin.stored import parse_json

_START = 60.0  # [s] a device takes about two to start, more where many start at once
_ANSWER = 10.0  # [s]
_ENDED = ""  # instead of a line


class Running:
    """A device in a process of its own; `port` stays good when it is unplugged and plugged in."""

    def __init__(self, link: Path, arguments: tuple[str, ...]) -> None:
        self.port = str(link)
        self._errors = tempfile.TemporaryFile("w+")  # noqa: SIM115 lives as long as the process
        command = [sys.executable, "-m", "serpent_twin.bus.device", "--until-eof"]
        command += ["--link", str(link), *arguments]
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            bufsize=1,
        )
        self._lines: queue.Queue[str] = queue.Queue()
        self._plugged, self._spoke = False, threading.Event()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def wait_until_plugged(self) -> None:
        """Return when the port is there; raises `SerpentError` with the device's message if it ended."""
        self._spoke.wait(_START)
        if not self._plugged:
            self.process.kill()
            self.process.wait()
            raise SerpentError(f"the device did not start: {self._words()}")

    def trigger(self, name: str, motor: int | None = None, seconds: float | None = None) -> str:
        """Let a fault strike once, now; returns the device's answer. Raises `SerpentError` if it refuses,
        has ended, or does not answer.
        """
        assert self.process.stdin is not None
        words = (name, "-" if motor is None else motor, "" if seconds is None else seconds)
        try:
            print(*words, file=self.process.stdin, flush=True)
            answer = self._lines.get(timeout=_ANSWER)
        except OSError:
            answer = _ENDED
        except queue.Empty:
            raise SerpentError(
                f"the device did not answer {name!r} within {_ANSWER:g} s; start another."
            ) from None
        if answer.startswith("error: "):
            raise SerpentError(answer.removeprefix("error: "))
        if not answer.startswith("done: "):
            raise SerpentError(f"the device has ended, so no {name!r} can strike: {self._words()}")
        return answer.removeprefix("done: ")

    def stop(self) -> dict[str, Any]:
        """End the device as Ctrl-C does; returns what it counted."""
        self.end()
        self._reader.join(_ANSWER)
        while not self._lines.empty():
            if (line := self._lines.get()).startswith("{"):
                return parse_json(line.encode(), dict[str, Any], "what the device counted")
        raise SerpentError(f"the device ended without saying what it counted: {self._words()}")

    def end(self) -> None:
        """End the process, by force if it does not exit."""
        self.process.terminate()
        try:
            self.process.wait(_ANSWER)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def _words(self) -> str:
        """What the process wrote to standard error."""
        self._errors.seek(0)
        return self._errors.read().strip() or "it gave no reason."

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line.startswith("port: "):
                self._plugged = True
                self._spoke.set()
            elif line.startswith(("done: ", "error: ", "{")):  # MuJoCo prints warnings between
                self._lines.put(line.strip())
        self._spoke.set()
        self._lines.put(_ENDED)


@contextmanager
def running(*arguments: str) -> Iterator[Running]:
    """A device with these command-line arguments, for the length of a `with` block."""
    with tempfile.TemporaryDirectory(prefix="serpent-") as folder:
        device = Running(Path(folder) / "port", arguments)
        try:
            device.wait_until_plugged()
            yield device
        finally:
            device.end()
