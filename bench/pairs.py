"""Alternating measurements of two programs within a time limit, and the spread of their results."""

import math
import os
import statistics
from dataclasses import dataclass

# CPU seconds planned for a quick measurement, of all its programs: five minutes on one processor.
QUICK_SECONDS = 300


class Budget:
    """CPU time of a measurement: five minutes for a quick one, no limit for a full one.

    CPU time does not depend on other work of the machine. Every row is measured at least once.
    """

    def __init__(self, options):
        self.end = cpu_seconds() + (math.inf if options.full else QUICK_SECONDS)

    def shares(self, items):
        """Yields each item with an equal share of the remaining CPU seconds."""
        items = list(items)
        for index, item in enumerate(items):
            yield item, max(self.end - cpu_seconds(), 0) / (len(items) - index)

    def in_turns(self, first, second, most, limit):
        """Returns pairs of results, measured alternately (A B A B): one, then more for about `limit` CPU seconds."""
        begin, found = cpu_seconds(), []
        while len(found) < most:
            found.append((first(), second()))
            spent = cpu_seconds() - begin
            if spent * (len(found) + 1) / len(found) > limit:
                break
        return found


def cpu_seconds():
    """Returns the CPU seconds of this process and of all programs that it has run."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


@dataclass
class Spread:
    """Median, minimum, maximum and number of some values."""

    values: list

    @property
    def median(self):
        return statistics.median(self.values)

    def __str__(self):
        if len(self.values) == 1:
            return f"{self.median:.2f}"
        return f"{self.median:.2f} ({min(self.values):.2f} to {max(self.values):.2f})"


def geometric_mean(values):
    """Returns the geometric mean of positive numbers."""
    return math.exp(sum(map(math.log, values)) / len(values))


def print_trust(options):
    """Prints the reliability of a quick measurement's figures."""
    if options.full:
        return
    load, processors = os.getloadavg()[0], os.cpu_count()
    print(
        "\nA ratio is the median of pairs that ran in turns, with the smallest and the largest in brackets. "
        "One pair alone, or a wide range, tells little.\n"
        f"Processes that wanted a processor in the last minute: {load:.1f}; processors: {processors}. "
        "Where others work, trust ratios of CPU time and not seconds.\n"
        "In films this short, differences up to 0.1 dB, 1 % of bits or 10 % of flicker are chance. "
        "`--full` measures more."
    )
