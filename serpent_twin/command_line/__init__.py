"""Make commands: their options, with bounds and requirements, and their errors."""
