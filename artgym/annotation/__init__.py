"""Grasp labels: candidate poses, a geometric filter, and one trial in physics each."""
