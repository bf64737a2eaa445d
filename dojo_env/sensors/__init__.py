"""Sensors: cameras and lidar, where they hang, and what their pictures suffer from."""
