"""Set a session up and record it: a bus and cameras in, a session log out."""
