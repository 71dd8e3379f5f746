"""Markdown tables, and how figures look in them."""

import math


def row(cells):
    """A row of a table."""
    return "| " + " | ".join(map(str, cells)) + " |"


def header(titles):
    """The first two lines of a table: the first column to the left, the others to the right."""
    return row(titles) + "\n|---|" + "---:|" * (len(titles) - 1)


def table(titles, rows):
    """A whole table."""
    return "\n".join([header(titles), *map(row, rows)])


def figure(value, form):
    """A number in a format such as "+.2f", or a dash where there is none."""
    return "–" if value is None or not math.isfinite(value) else format(value, form)


def decibels(value, form=".2f"):
    """A PSNR, or a difference of two; infinite where pictures are equal."""
    return "equal" if value == math.inf else f"{figure(value, form)} dB"


def change(ratio):
    """A ratio as a change in percent."""
    return f"{figure(100 * (ratio - 1), '+.1f')} %"


def share(value):
    """A share in percent."""
    return "–" if value is None else f"{figure(100 * value, '.0f')} %"
