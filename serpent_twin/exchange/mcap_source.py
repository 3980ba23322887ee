"""Read an MCAP file whose messages are ROS 2's or JSON."""

import json
import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from serpent_twin.errors import SerpentError
from serpent_twin.exchange.messages import Recorded, of_decoded
from serpent_twin.extras import requires

_LONGEST = 160
"""Characters of an error of mcap, which may quote a schema"""


class McapSource:
    """A file is one recording."""

    about = "an MCAP file, .mcap"

    def reads(self, path: Path) -> bool:
        """Whether it has such a file's name."""
        return path.is_file() and path.suffix == ".mcap"

    def recordings(self, path: Path, topics: Sequence[str]) -> Mapping[str, Recorded]:
        """The file, by its name; of a file that ends early, what it has."""
        with requires("logs", "An MCAP file"):
            from mcap.exceptions import DecoderNotFoundError
            from mcap.reader import NonSeekingReader, make_reader
            from mcap_ros2.decoder import DecoderFactory
        decoders: list[Any] = [DecoderFactory(), _Json()]
        found = _Found()
        try:
            with path.open("rb") as file:
                try:
                    reader = make_reader(file, decoder_factories=decoders)
                    summary = reader.get_summary()
                except Exception:  # the summary is at the file's end
                    file.seek(0)
                    reader, summary = NonSeekingReader(file, decoder_factories=decoders), None
                found.topics |= (
                    {each.topic for each in summary.channels.values()} if summary else {*topics}
                )
                for each in reader.iter_decoded_messages(
                    list(topics), log_time_order=summary is not None
                ):
                    found.add(each.channel, each.message.log_time, each.decoded_message)
        except DecoderNotFoundError as error:
            encoding = re.search(r"message encoding (\S+),", str(error))
            named = (
                f"messages encoded as {encoding[1]}" if encoding else "messages of another encoding"
            )
            raise SerpentError(
                f"{path} has {named}, which are not read. Convert it to messages of ROS 2 (cdr) or JSON."
            ) from None
        except Exception as error:  # of a damaged file, mcap raises whatever its parts come upon
            if not found.times:
                why = " ".join(str(error).split())[:_LONGEST] or type(error).__name__
                raise SerpentError(
                    f"{path} cannot be read: {why}. Give a whole file, with messages of ROS 2 or JSON."
                ) from None
            found.notes = (f"{path.name} ends early; what comes before was read",)
        return {path.stem: found.streams()}


class _Found:
    """Messages that were read, by topic."""

    def __init__(self) -> None:
        self.topics = set[str]()
        self.times = defaultdict[str, list[float]](list)
        self.senders = defaultdict[str, list[str]](list)
        self.decoded = defaultdict[str, list[Any]](list)
        self.notes: tuple[str, ...] = ()

    def add(self, channel: Any, log_time: int, message: Any) -> None:
        """Take in one message, recorded at so many ns."""
        self.times[channel.topic].append(1e-9 * log_time)
        self.decoded[channel.topic].append(message)
        self.senders[channel.topic].append(
            channel.metadata.get("callerid") or f"channel {channel.id}"
        )

    def streams(self) -> Recorded:
        """The messages of each topic."""
        return {
            topic: replace(
                of_decoded(self.times[topic], self.decoded[topic], self.senders[topic]),
                notes=self.notes,
            )
            for topic in sorted(self.topics)
        }


class _Json:
    """Decodes messages that are JSON; `DecoderFactory` of mcap in form."""

    def decoder_for(self, encoding: str, schema: Any) -> Callable[[bytes], Any] | None:
        """What decodes messages of an encoding, if it is JSON."""
        return json.loads if encoding == "json" else None


SOURCE = McapSource()
