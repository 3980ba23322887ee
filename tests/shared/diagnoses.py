"""What a trace tells of an arm, made up."""

ERRORS = {"nominal": 9.0, "calibrated": 3.0, "corrected": 1.0, "noise_floor": 0.5}


def estimate(value, low, high, unit="kg"):
    return {"value": value, "low": low, "high": high, "unit": unit}


def diagnosis(named=(), unexplained=False):
    return {
        "arm": "a",
        "held_out": ["session_02.parquet"],
        "effects": [{"name": n, "parameters": p} for n, p in named],
        "unexplained": {"is": unexplained, "share": 0.3, "depends_on": "joint 4"},
        "error_mm": ERRORS,
        "load_error_percent": ERRORS,
        "seconds": 1.0,
        "identifiability": {"effects": [{"name": "payload", "limit": 0.01}]},
        "provenance": {"git_commit": "0123456789ab"},
    }
