"""Open the pseudo-terminal through which programs reach the device."""

import fcntl
import heapq
import os
import pty
import struct
import termios
import tty
from itertools import count
from pathlib import Path

from serpent_twin.errors import SerpentError

_CHUNK = 65536
_TCGETS2 = 0x802C542A  # Linux: _IOR('T', 0x2A, struct termios2), where a speed is a plain number
_TERMIOS2 = struct.Struct(
    "4I20B2I"
)  # flags, line discipline and characters, input and output speed
_RATES: dict[int, int] = {
    value: int(name[1:])
    for name, value in vars(termios).items()
    if name.startswith("B") and name[1:].isdecimal()
}


class Terminal:
    """A pseudo-terminal, optionally with a link to it, and the bytes on their way to its client.

    It can be unplugged and plugged in again, as a USB adapter: the link stays, the terminal is another.
    """

    def __init__(self, link: Path | None = None) -> None:
        if link is not None:
            _require_free(link)
        self.link = link
        self.port = ""
        self._master = self._slave = -1
        self._outgoing: list[tuple[float, int, bytes]] = []
        self._order = count()

    @property
    def plugged(self) -> bool:
        """Whether the port exists."""
        return self._master >= 0

    def fileno(self) -> int:
        """What to `select` on while it is plugged."""
        return self._master

    def plug(self) -> None:
        """Make the port, and link to it; harmless when it is there."""
        if self.plugged:
            return
        if self.link is not None:
            _require_free(self.link)
        self._master, self._slave = pty.openpty()
        tty.setraw(self._master)
        tty.setraw(self._slave)  # kept open: otherwise the port would close with its first client
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._slave)
        if self.link is not None:
            _point(self.link, self.port)

    def unplug(self) -> None:
        """Remove the port with all pending bytes; harmless when it is gone."""
        if not self.plugged:
            return
        if self.link is not None and os.path.realpath(self.link) == self.port:
            self.link.unlink()
        os.close(self._slave)
        os.close(self._master)
        self._master = self._slave = -1
        self._outgoing.clear()

    def speed(self) -> int:
        """The speed that the port is set to [bit/s], also one that no constant of `termios` names."""
        try:
            settings = fcntl.ioctl(self._slave, _TCGETS2, bytes(_TERMIOS2.size))
        except OSError:  # no Linux
            speed = int(termios.tcgetattr(self._slave)[5])
            return _RATES.get(speed, speed)
        return _TERMIOS2.unpack(settings)[-1]

    def read(self) -> bytes:
        """What has arrived."""
        try:
            return os.read(self._master, _CHUNK)
        except OSError:  # no bytes after all
            return b""

    def send(self, data: bytes, due: float) -> None:
        """Send bytes when the clock of `flush` is at `due`; what is due together keeps its order."""
        if data and self.plugged:
            heapq.heappush(self._outgoing, (due, next(self._order), data))

    @property
    def next_due(self) -> float | None:
        """When the next bytes are due."""
        return self._outgoing[0][0] if self._outgoing else None

    def flush(self, now: float) -> None:
        """Send what is due. Without a reader, bytes are lost, as on a wire."""
        due = []
        while self._outgoing and self._outgoing[0][0] <= now:
            due.append(heapq.heappop(self._outgoing)[2])
        data = b"".join(due)
        while data:
            try:
                data = data[os.write(self._master, data) :]
            except OSError:
                return


def _require_free(link: Path) -> None:
    """Refuse a path where anything lies but what a device left that was killed."""
    if not link.parent.is_dir():
        raise SerpentError(f"--link {link}: there is no folder {link.parent}; make it first.")
    if link.is_symlink() and link.readlink().is_relative_to("/dev/pts"):
        if link.exists():
            raise SerpentError(
                f"--link {link} leads to {link.readlink()}, which is alive: another device may serve "
                "it. End that device, or name another path; remove the link if no device serves it."
            )
    elif os.path.lexists(link):
        raise SerpentError(f"--link {link}: something else lies there; name a path that is free.")


def _point(link: Path, port: str) -> None:
    try:
        link.unlink(missing_ok=True)
        link.symlink_to(port)
    except OSError as error:
        raise SerpentError(
            f"--link {link} cannot be made: {error.strerror}. Name a path in a folder that is yours."
        ) from None
