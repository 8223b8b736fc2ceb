"""The page: games and results as one HTML file that is read offline.

    from spoofgym.report.page import write_page

    write_page("report.html", [play_game("foi-drive", "ramp:0.5", response="snapshot > exclude")])

A source (a game, a report that a program has written as JSON, a folder of a run) becomes sections of figures
(`figures`); every figure is drawn in the page by JavaScript of ``assets/``, one file per idea, from data in the page.
"""
