"""Optimal flat motion planning for planar arms with an elastic last joint."""
