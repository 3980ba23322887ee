"""Provide what every run needs: a lock, whole files, provenance, a pool of workers."""
