"""Simulate the hardware: a motor bus in process, motors on a wire, cameras."""
