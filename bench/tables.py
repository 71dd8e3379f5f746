"""Markdown tables, and formats of figures."""

import math


def row(cells):
    """Formats a row of a table."""
    return "| " + " | ".join(map(str, cells)) + " |"


def header(titles):
    """Formats the first two lines of a table: the first column left-aligned, the others right-aligned."""
    return row(titles) + "\n|---|" + "---:|" * (len(titles) - 1)


def table(titles, rows):
    """Formats a whole table."""
    return "\n".join([header(titles), *map(row, rows)])


def figure(value, form):
    """Formats a number, such as by "+.2f"; a missing or infinite one as a dash."""
    return "–" if value is None or not math.isfinite(value) else format(value, form)


def decibels(value, form=".2f"):
    """Formats a PSNR or a difference of two; "equal" for equal pictures."""
    return "equal" if value == math.inf else f"{figure(value, form)} dB"


def change(ratio):
    """Formats a ratio as a change in percent."""
    return f"{figure(100 * (ratio - 1), '+.1f')} %"


def share(value):
    """Formats a fraction in percent."""
    return "–" if value is None else f"{figure(100 * value, '.0f')} %"
