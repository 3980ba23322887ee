"""Commands: their options, with bounds and needs, and their errors."""
