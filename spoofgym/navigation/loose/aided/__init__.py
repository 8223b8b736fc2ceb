"""The loosely coupled filter with aids: the same filter, corrected on its way between the fixes, too."""
