"""Write reports, style plots, and record for rerun."""
