"""A bad cable: a pseudo-terminal before another port, which passes bytes on and mutates some."""

import os
import select
import termios
import threading
import tty

import numpy as np


class BadCable:
    """Forwards both ways between a new port and `inner`; each byte is spoilt with probability `rate`.

    Spoilt is: a bit flipped, the byte lost, doubled, or random bytes put before it.
    """

    def __init__(self, inner, rate, seed=0):
        self.rate, self._rng = rate, np.random.default_rng(seed)
        self._host, slave = os.openpty()
        self._slave = slave
        tty.setraw(self._host)
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        self._inner = os.open(inner, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._inner)
        mode = termios.tcgetattr(self._inner)
        mode[4] = mode[5] = termios.B1000000  # servos hear their own speed only
        termios.tcsetattr(self._inner, termios.TCSANOW, mode)
        self._running = True
        self._thread = threading.Thread(target=self._forward, daemon=True)
        self.spoilt = 0

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._running = False
        self._thread.join()
        for handle in (self._host, self._slave, self._inner):
            os.close(handle)

    def _forward(self):
        other = {self._host: self._inner, self._inner: self._host}
        while self._running:
            for source in select.select(list(other), [], [], 0.05)[0]:
                os.write(other[source], self._spoil(os.read(source, 4096)))

    def _spoil(self, data):
        hit = np.flatnonzero(self._rng.random(len(data)) < self.rate)
        out = [bytes([b]) for b in data]
        for n in hit:
            self.spoilt += 1
            kind = self._rng.integers(4)
            flipped = bytes([data[n] ^ (1 << int(self._rng.integers(8)))])
            out[n] = (flipped, b"", out[n] * 2, self._rng.bytes(5) + out[n])[kind]
        return b"".join(out)
