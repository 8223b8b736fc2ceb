"""Aids: sensors that GNSS does not own. They correct a filter at their own times, whatever becomes of the fixes."""

from spoofgym.navigation.aids.aid import Aid, AidStates, Place
from spoofgym.navigation.aids.registry import AIDS, IN_THE_AIR, ON_THE_ROAD, make_aids, spell_aids

__all__ = ["AIDS", "IN_THE_AIR", "ON_THE_ROAD", "Aid", "AidStates", "Place", "make_aids", "spell_aids"]
