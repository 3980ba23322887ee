"""Train readouts on session logs, score them, adapt them to an arm, and report."""
