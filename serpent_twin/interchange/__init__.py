"""Let a corrected twin run in any MuJoCo program, and write it for other programs."""
