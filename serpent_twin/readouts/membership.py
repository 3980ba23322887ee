"""State to which of a readout's sets of sessions a session belongs, and so what its error there means."""

from serpent_twin.readouts.trainable import Trainable
from serpent_twin.sessions import Session
from serpent_twin.tables.repeated import readings_hash

_LESS = "its error here may be less than on a new session."
_SAID = {
    "train": f"{{session}} is in the training set of {{readout}}: {_LESS}",
    "validate": f"{{session}} is in the validation set of {{readout}}: {_LESS}",
    "test": "{session} is in the test set of {readout}, which was not trained on it.",
}
_NEITHER = "{session} is neither in the training nor in the validation set of {readout}"
_UNKNOWN = (
    "It is unknown whether {session} is in the training, validation or test set of {readout}, which was "
    "saved without the hashes of its logs."
)


def told(readout: Trainable, session: Session) -> str:
    """Sentence that says in which set a session is; logs are compared by their motor readings."""
    names = {"session": session.name, "readout": readout.name}
    if not readout.trained_on:
        return _UNKNOWN.format(**names)
    own = readings_hash(session)
    of = (*readout.trained_on, *readout.tested_on)
    uses = [source.use for source in of if source.readings_sha256 == own]
    for use, text in _SAID.items():  # the worst first: adapted readouts have several sets
        if use in uses:
            return text.format(**names)
    rest = ", nor in its test set." if readout.tested_on else "; its test set is unknown."
    return _NEITHER.format(**names) + rest
