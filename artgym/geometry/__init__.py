"""Frames, rotations, cameras and joint motion, in plain numpy."""
