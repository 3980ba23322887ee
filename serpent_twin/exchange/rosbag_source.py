"""Read a bag of ROS 1 or ROS 2."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from serpent_twin.errors import SerpentError
from serpent_twin.exchange.messages import Recorded, of_decoded
from serpent_twin.extras import requires


class RosBagSource:
    """A bag is one recording."""

    about = "a ROS 2 bag, a folder with metadata.yaml; a ROS 1 bag, .bag"

    def reads(self, path: Path) -> bool:
        """Whether it looks like a bag."""
        return (path / "metadata.yaml").is_file() or (path.is_file() and path.suffix == ".bag")

    def recordings(self, path: Path, topics: Sequence[str]) -> Mapping[str, Recorded]:
        """The bag, by its name."""
        with requires("logs", "A ROS bag"):
            from rosbags.highlevel import AnyReader, AnyReaderError
            from rosbags.typesys import Stores, get_typestore
        times, decoded = defaultdict[str, list[float]](list), defaultdict[str, list[Any]](list)
        senders = defaultdict[str, list[str]](list)
        try:
            with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
                known = {each.topic for each in reader.connections}
                some = [each for each in reader.connections if each.topic in topics]
                for connection, stamp, raw in reader.messages(some) if some else ():
                    times[connection.topic].append(1e-9 * stamp)
                    decoded[connection.topic].append(reader.deserialize(raw, connection.msgtype))
                    sender = (
                        getattr(connection.ext, "callerid", None) or f"connection {connection.id}"
                    )
                    senders[connection.topic].append(sender)
        except (AnyReaderError, KeyError, ValueError) as error:
            raise SerpentError(
                f"{path} cannot be read: {' '.join(str(error).split())}. Give a whole bag."
            ) from None
        streams = {t: of_decoded(times[t], decoded[t], senders[t]) for t in sorted(known)}
        return {path.stem: streams}


SOURCE = RosBagSource()
