"""Let the arm follow a path: plan it by the twin, and steer by what an observer estimates."""
