"""The simulated counterparts: a motor bus in process, motors on a wire, cameras."""
