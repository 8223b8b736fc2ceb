"""Every detector on real attacks, and on attacks that are injected into clean records, at one false-alarm rate."""
