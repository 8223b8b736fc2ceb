"""The command ``spoofgym``: one face of all programs. ``spoofgym --help`` lists them."""
