"""Scripted policies with privileged knowledge: the upper row of every table."""
