"""Drive ten Dynamixel motors on a serial bus, and read the cameras that track the markers."""
