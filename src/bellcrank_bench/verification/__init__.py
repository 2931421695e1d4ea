"""Compiled equations of motion against analytic ones: what `bellcrank verify` runs."""

VERIFIABLE = (
    "planar_2r",
    "planar_2r_swing",
    "spring_pendulum",
    "four_bar",
    "rolling_disk",
)  # light: `--help` names them
