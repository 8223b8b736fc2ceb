"""Importers: what other programs and devices record, read into one object and written as a log folder."""
