"""Find the missing effect that explains the residual of a machine's logs: `serpent_twin.trace`."""

from serpent_twin.identification.run import Trace, trace

__all__ = ["Trace", "trace"]
