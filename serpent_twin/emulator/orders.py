"""Read a person's orders to the device, and print its messages."""

import os
import sys
from collections.abc import Callable
from typing import TextIO

from serpent_twin.emulator.terminal import Terminal


class Orders:
    """Lines from standard input, each answered by a line on standard output."""

    def __init__(
        self,
        source: TextIO | None = sys.stdin,
        sink: TextIO = sys.stdout,
        hint: Callable[[str], str] = str,
    ) -> None:
        """`hint` makes a line from the port's name, printed once after it unless it is empty."""
        self._hint = hint
        self._fileno = _descriptor(source)
        self._sink = sink
        self._pending = b""
        self._new = True  # the port has not been printed yet

    def fileno(self) -> int:
        """The descriptor to `select` on; negative when no further order can come."""
        return self._fileno

    def read(self, obey: Callable[[str], str]) -> None:
        """Answer the lines that are there, and note when there will be no more."""
        try:
            if os.isatty(self._fileno) and os.tcgetpgrp(self._fileno) != os.getpgrp():
                return  # in the background: the terminal's lines are the shell's
            data = os.read(self._fileno, 4096)
        except OSError:  # a terminal that is not ours to read, or that was hung up
            data = b""
        if not data:
            self._fileno = -1
        *lines, self._pending = (self._pending + data).split(b"\n")
        for line in lines:
            if line.strip():
                self._say(obey(line.decode(errors="replace")))

    def tell_port(self, terminal: Terminal) -> None:
        """Print the device's port."""
        if terminal.link is not None:
            self._say(f"link: {terminal.link}")
        self._say(f"port: {terminal.port}")
        if self._new:
            self._new = False
            if hint := self._hint(str(terminal.link or terminal.port)):
                self._say(hint)

    def _say(self, line: str) -> None:
        print(line, file=self._sink, flush=True)


def _descriptor(source: TextIO | None) -> int:
    """A stream's descriptor, or -1 if it has none that can be waited on."""
    try:
        return source.fileno() if source is not None and not source.closed else -1
    except (OSError, ValueError):
        return -1
