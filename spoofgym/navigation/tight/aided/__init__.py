"""The tightly coupled filter with aids: they correct it at the epochs of the ranges, whatever becomes of these."""
