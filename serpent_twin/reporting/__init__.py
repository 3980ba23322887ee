"""Reports, the style of plots, and recordings for rerun."""
