"""What do the readouts share that are networks? Torch trains them, numpy runs them."""

import os

# Threads of torch that spin while they wait train ten times slower on cores that are also busy
# with something else. Read once, when torch is loaded; what the user has set stays.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
