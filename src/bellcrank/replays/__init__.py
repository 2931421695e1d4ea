"""Replay: a run or a motion as one page that opens in any browser."""
