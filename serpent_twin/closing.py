"""Make a class that can be closed a context manager, in the same way everywhere."""

from types import TracebackType
from typing import Protocol, Self


class Closing(Protocol):
    """A context manager that closes itself, however its block ends.

    If the block ends with an error, a failure of closing is added to that error as a note.
    """

    def close(self) -> None:
        """Release what is held; closing twice is harmless."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None:
            self.close()
            return
        try:
            self.close()
        except KeyboardInterrupt:
            pass  # closing is under way, and `error` says more
        except Exception as second:
            error.add_note(f"Besides, {second}")
