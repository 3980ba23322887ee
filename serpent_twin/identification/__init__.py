"""Which missing effect explains the residual of a machine's logs? `python -m serpent_twin.trace --help`."""

from serpent_twin.identification.run import Trace, trace

__all__ = ["Trace", "trace"]
