"""Ten Dynamixel motors on a serial bus, and the cameras that see the markers."""
