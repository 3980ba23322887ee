"""Read an MCAP file whose messages are ROS 2's or JSON."""

import json
import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from serpent_twin.errors import SerpentError
from serpent_twin.exchange.messages import Recorded, of_decoded
from serpent_twin.exchange.sources import lacks

_LONGEST = 160
"""Characters of an error of mcap, which may quote a schema"""


class McapSource:
    """A file is one recording."""

    about = "an MCAP file, .mcap"
    extra = "logs"

    def reads(self, path: Path) -> bool:
        """Whether it has such a file's name."""
        return path.is_file() and path.suffix == ".mcap"

    def recordings(self, path: Path, topics: Sequence[str]) -> Mapping[str, Recorded]:
        """The file, by its name."""
        try:
            from mcap.exceptions import DecoderNotFoundError, McapError
            from mcap.reader import make_reader
            from mcap_ros2.decoder import DecoderFactory
        except ImportError as error:
            raise lacks(self.extra, error) from None
        decoders: list[Any] = [DecoderFactory(), _Json()]
        times, decoded = defaultdict[str, list[float]](list), defaultdict[str, list[Any]](list)
        senders = defaultdict[str, list[str]](list)
        try:
            with path.open("rb") as file:
                reader = make_reader(file, decoder_factories=decoders)
                summary = reader.get_summary()
                known = {each.topic for each in summary.channels.values()} if summary else {*topics}
                for _, channel, message, content in reader.iter_decoded_messages(list(topics)):
                    times[channel.topic].append(1e-9 * message.log_time)
                    decoded[channel.topic].append(content)
                    sender = channel.metadata.get("callerid") or f"channel {channel.id}"
                    senders[channel.topic].append(sender)
        except DecoderNotFoundError as error:
            found = re.search(r"message encoding (\S+),", str(error))
            named = f"messages encoded as {found[1]}" if found else "messages of another encoding"
            raise SerpentError(
                f"{path} has {named}, which are not read. Convert it to messages of ROS 2 (cdr) or JSON."
            ) from None
        except (McapError, EOFError, OSError, ValueError, KeyError) as error:
            why = " ".join(str(error).split())[:_LONGEST] or type(error).__name__
            raise SerpentError(
                f"{path} cannot be read: {why}. Give a whole file, with messages of ROS 2 or JSON."
            ) from None
        streams = {t: of_decoded(times[t], decoded[t], senders[t]) for t in sorted(known)}
        return {path.stem: streams}


class _Json:
    """Decodes messages that are JSON; `DecoderFactory` of mcap in form."""

    def decoder_for(self, encoding: str, schema: Any) -> Callable[[bytes], Any] | None:
        """What decodes messages of an encoding, if it is JSON."""
        return json.loads if encoding == "json" else None


SOURCE = McapSource()
