"""Bring logs of other tools in as a machine's logs, and take logs out to where others look at them."""
