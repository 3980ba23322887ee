"""Read a LeRobot data set, whose tables hold a row for each frame of each episode."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from serpent_twin import tables
from serpent_twin.errors import SerpentError
from serpent_twin.exchange.messages import Recorded
from serpent_twin.exchange.table_source import messages_of
from serpent_twin.tables.lerobot import EPISODE

_TIME = "timestamp"


class LeRobotSource:
    """An episode is one recording, whose numbers have the names of meta/info.json, too."""

    about = "a LeRobot data set, a folder with meta/info.json"

    def reads(self, path: Path) -> bool:
        """Whether it looks like a data set."""
        return (path / "meta" / "info.json").is_file()

    def recordings(self, path: Path, topics: Sequence[str]) -> Mapping[str, Recorded]:
        """The episodes, in their order."""
        files = sorted((path / "data").rglob("*.parquet"))
        if not files:
            raise SerpentError(f"{path} holds no tables: data/ is empty. Download them.")
        found: dict[str, Recorded] = {}
        for file in files:
            table = tables.read(file, "Download it again.")
            if lacking := [n for n in (EPISODE, _TIME) if n not in table]:
                raise SerpentError(f"{file} has no {lacking[0]}. Give a LeRobot data set.")
            episode = table.numbers(EPISODE).astype(int)
            for number in dict.fromkeys(episode.tolist()):
                rows = messages_of(table, episode == number)
                units = {**rows.units, _TIME: "s"}
                found[f"episode_{number:06d}"] = {"": replace(rows, units=units)}
        return dict(sorted(found.items()))


SOURCE = LeRobotSource()
