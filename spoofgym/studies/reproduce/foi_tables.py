"""What FOI-R-5687 prints: its tables 1 to 9."""

from __future__ import annotations

from dataclasses import dataclass

from spoofgym.attacks.azimuth import FOI_SCENARIOS
from spoofgym.studies.reproduce.verdict import NEVER


@dataclass(frozen=True)
class Setting:
    """A detector and what follows its alarm (tables 2, 4 and 8).

    Attributes:
        number: in the report.
        test: 1 = relative motion, 3 = sum of the normalised innovations.
        window: k, samples.
        depth: samples from before the detection that are recomputed; 0 = none.
    """

    number: int
    test: int
    window: int
    depth: int

    @property
    def label(self) -> str:
        """How a line of a table names it."""
        return f"k={self.window}, back {self.depth}"


SETTINGS = {
    setting.number: setting
    for setting in (
        Setting(1, 1, 20, 20),
        Setting(2, 1, 5, 20),
        Setting(3, 1, 20, 0),
        Setting(4, 1, 5, 0),
        Setting(5, 3, 20, 20),
        Setting(6, 3, 5, 20),
        Setting(7, 3, 20, 0),
        Setting(8, 3, 5, 0),
        Setting(9, 3, 5, 10),
    )
}


@dataclass(frozen=True)
class Attacked:
    """The attack of a scenario (tables 1 and 7).

    Attributes:
        start: s.
        end: s.
        growth: time in which the azimuth error grows, s.
        azimuth: its largest value, degrees.
    """

    start: float
    end: float
    growth: float
    azimuth: float


ATTACKS = {number: Attacked(*values) for number, values in FOI_SCENARIOS.items()}

UNDEFENDED = {
    1: (13.0, 26.0),
    2: (19.0, 55.0),
    3: (89.0, 178.0),
    4: (127.0, 369.0),
    5: (4.0, 12.0),
    6: (4.0, 8.0),
    7: (1.0, 5.0),
    8: (1.0, 6.0),
}
"""RMSE and largest error without a detector, m, by scenario (tables 3 and 9; table 5 prints 18 for the 19)."""

Outcome = tuple[float, float, float, float | str, float]
"""First alarm s, receiver error then m, RMSE m, time from the attack's end to steady use of GNSS s, largest error m."""

TABLE_3: dict[tuple[int, int], Outcome] = {
    (1, 1): (106, 9, 12, 20, 28),
    (2, 1): (118, 4, 8, 20, 25),
    (3, 1): (100, 9, 65, 20, 165),
    (4, 1): (110, 10, 8, 20, 22),
    (1, 2): (101, 3, 11, 5, 26),
    (2, 2): (116, 2, 7, 5, 33),
    (3, 2): (98, 3, 59, 5, 152),
    (4, 2): (104, 3, 28, 5, 219),
    (1, 3): (106, 9, 13, 20, 30),
    (2, 3): (118, 4, 7, 20, 20),
    (3, 3): (100, 9, 69, 20, 173),
    (4, 3): (110, 10, 9, 20, 23),
    (1, 4): (101, 3, 11, 5, 26),
    (2, 4): (116, 2, 8, 5, 25),
    (3, 4): (98, 3, 60, 5, 155),
    (4, 4): (104, 3, 40, 5, 169),
}

TABLE_5: dict[tuple[int, int], Outcome] = {
    (1, 5): (102, 4, 4, 20, 12),
    (2, 5): (117, 2, 2, 20, 6),
    (3, 5): (99, 5, 5, 20, 14),
    (4, 5): (104, 3, 4, 20, 11),
    (1, 6): (101, 3, 4, 5, 11),
    (2, 6): (116, 2, 2, 5, 5),
    (3, 6): (98, 3, 4, 5, 12),
    (4, 6): (103, 3, 4, 5, 10),
    (1, 7): (102, 4, 17, NEVER, 41),
    (2, 7): (117, 2, 20, NEVER, 49),
    (3, 7): (99, 5, 15, NEVER, 36),
    (4, 7): (104, 3, 19, NEVER, 45),
    (1, 8): (101, 3, 4, 5, 10),
    (2, 8): (116, 2, 23, NEVER, 55),
    (3, 8): (98, 3, 2, 5, 6),
    (4, 8): (103, 3, 7, 53, 19),
}

TABLE_6: dict[int, tuple[float, float, float, float]] = {
    1: (108, 10.43, 1.2, 0.03916),
    2: (93, 4.29, 1.3, 0.01218),
    3: (111, 12.10, 1.2, 0.04343),
    4: (106, 9.40, 1.1, 0.05680),
}
"""Setting 5, by scenario: time without GNSS s, growth of the error m, exponent a, factor b in m/s^a."""

TABLE_9: dict[tuple[int, int], Outcome] = {
    (5, 6): (110, 3, 931, NEVER, 2319),
    (5, 9): (110, 3, 2, 0, 5),
    (5, 5): (113, 4, 2, 5, 6),
    (6, 5): (117, 4, 2, 20, 6),
    (7, 5): (131, 1, 1, 20, 3),
    (8, 5): (132, 1, 1, 20, 3),
    (5, 8): (110, 3, 20, NEVER, 49),
    (5, 7): (113, 4, 28, NEVER, 66),
    (6, 7): (117, 4, 9, NEVER, 22),
    (7, 7): (131, 1, 10, NEVER, 24),
    (8, 7): (132, 1, 9, NEVER, 24),
}
