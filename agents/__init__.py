"""Policies that play: learned and scripted."""
