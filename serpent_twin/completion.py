"""Print what completes these commands in a shell: `python -m serpent_twin.completion`."""

from pathlib import Path
from typing import Literal

from tyro.conf import Positional

from serpent_twin.command_line import cli
from serpent_twin.command_line.verbs import verbs

_SCRIPT = Path(cli.__file__).with_name("completion.bash")
_ZSH = "autoload -U +X bashcompinit && bashcompinit\n"


def main(shell: Positional[Literal["bash", "zsh"]]) -> None:
    """Print what completes these commands in a shell.

    The line for ~/.bashrc is: eval "$(serpent-twin completion bash)".

    Args:
        shell: The shell; the line of zsh belongs in ~/.zshrc.
    """
    names = list(verbs())
    first = " ".join(dict.fromkeys(name.partition(".")[0] for name in names))
    bus = " ".join(name.removeprefix("bus.") for name in names if name.startswith("bus."))
    script = _SCRIPT.read_text(encoding="utf-8").replace("@VERBS@", first).replace("@BUS@", bus)
    print((_ZSH if shell == "zsh" else "") + script, end="")


if __name__ == "__main__":
    cli.run(main)
