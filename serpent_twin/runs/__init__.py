"""Provide what every run needs: a lock, whole files, provenance, a report, a pool of workers."""
