"""Alternating measurements of two programs within a time limit, and the spread of their results."""

import math
import os
import statistics
import sys
import time
from dataclasses import dataclass

# Wall-clock seconds planned for a quick measurement. The rest of the five minutes is a reserve for the last pair.
QUICK_SECONDS = 270


class Budget:
    """Wall-clock time of a measurement: five minutes from now for a quick one, no limit for a full one."""

    def __init__(self, options):
        self.end = time.monotonic() + (math.inf if options.full else QUICK_SECONDS)
        self.longest_pair = 0

    def shares(self, items, name):
        """Yields each item with an equal share of the remaining seconds. Prints the items without enough time."""
        items = list(items)
        for index, item in enumerate(items):
            left = self.end - time.monotonic()
            if left > self.longest_pair:
                yield item, left / (len(items) - index)
            else:
                print(f"left out, as the time is over: {name(item)}", file=sys.stderr)

    def in_turns(self, first, second, most, limit):
        """Returns pairs of results, measured alternately (A B A B): at least one, at most `most`, for about `limit` seconds."""
        begin, found = time.monotonic(), []
        while len(found) < most:
            found.append((first(), second()))
            spent = time.monotonic() - begin
            self.longest_pair = max(self.longest_pair, spent / len(found))
            if spent * (len(found) + 1) / len(found) > limit:
                break
        return found


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
