"""Train networks with torch, and run them with numpy."""

import os

# Threads of torch that spin while they wait train ten times slower on cores that are also busy
# with something else. Read once, when torch is loaded; what the user has set stays.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
