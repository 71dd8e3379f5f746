"""Plots of FLIP over CPU time, for each scene and each position in a film."""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.ticker import NullFormatter  # noqa: E402

# Names of the plotted lines, and their renderers.
LINES = {
    "Mitsuba": lambda renderer: renderer.startswith("Mitsuba") and "OIDN" not in renderer,
    "Mitsuba + OIDN": lambda renderer: "OIDN" in renderer,
    "ours": lambda renderer: renderer.startswith("ours"),
}


def write(found, path):
    """Writes the plots of entries by scene."""
    places = list(dict.fromkeys(entry.place for entries in found.values() for entry in entries))
    size = (4 * len(found), 3.5 * len(places))
    figure, axes = plt.subplots(len(places), len(found), figsize=size, squeeze=False, sharey=True)
    for column, (name, entries) in enumerate(found.items()):
        for row, place in enumerate(places):
            draw(axes[row][column], [entry for entry in entries if entry.place == place])
            axes[row][column].set(title=f"{name}, {place}", xlabel="CPU s", ylabel="FLIP")
    axes[0][0].legend()
    figure.tight_layout()
    figure.savefig(path, dpi=80)


def draw(axes, entries):
    """Draws a line for each kind of renderer."""
    for label, belongs in LINES.items():
        points = [(max(entry.seconds, 0.01), entry.errors[2]) for entry in entries if belongs(entry.renderer)]
        axes.loglog(*zip(*points), "o-", label=label)
    axes.grid(True, which="both", alpha=0.3)
    axes.xaxis.set_minor_formatter(NullFormatter())
