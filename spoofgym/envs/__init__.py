"""The environments: the spoofer's game, single and vectorised."""
