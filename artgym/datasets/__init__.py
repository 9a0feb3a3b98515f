"""Labelled RGB-D samples: what one is, and the files they live in."""
