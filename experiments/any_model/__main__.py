"""Measure whether the trace names what models of others lack: a law at a place, and its strength.

The logs come from an independent integration, in which the fault is no effect of the twin. The same command
goes on where it stopped.
"""

from functools import partial
from typing import Any

from experiments.any_model.score import covered, off, right, told, undecided
from experiments.any_model.trial import AnyModel, machines, run
from experiments.result_page import publish, store
from experiments.result_rows import Results
from serpent_twin.command_line import cli
from serpent_twin.numerals import counted
from serpent_twin.runs.run_lock import claimed

SETTINGS = "any_model.json"


def main(config: AnyModel) -> None:  # noqa: D103 tyro would print it above the config's own
    every = machines(config.only, config.rows, config.times)
    settings = {"sessions": config.sessions, "seed": config.seed}
    if config.rows == "torque":
        settings |= {"rows": config.rows, "times": config.times}
    with claimed(config.out, SETTINGS, settings):
        results = Results(config.out / "results.jsonl")
        results.complete(every, partial(run, config), line, config.workers, "machine")
        rows, failures = results.scored, results.failed
        print(f"{counted(len(rows), 'machine')} traced, {len(failures)} failed.")
        print(f"named right: {sum(map(right, rows))} of {len(rows)}")
        if rows:
            figures = {"rows": rows, "failed": failures, "settings": settings}
            found = store(config.out / "results.json", "experiments.any_model", figures)
            publish(found, config.page)


def line(row: dict[str, Any]) -> str:
    """What is printed of a machine."""
    verdict = "right" if right(row) else "undecided" if undecided(row) else "WRONG"
    said = " + ".join(row["named"]) or ("unexplained" if row["unexplained"] else "nothing")
    strength = f"{told(row)}, off by {off(row):.1%}" if told(row) else ""
    inside = {None: "", True: "", False: ", outside its interval"}[covered(row)]
    return f"{verdict:9} {row['id']:36} {said} {strength}{inside}, {row['seconds']:.0f} s"


if __name__ == "__main__":
    cli.run(main)
