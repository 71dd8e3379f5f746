"""Settings of quick and full measurements."""

from running import ROOT, Failure


def fill_in(options, quick, full):
    """Sets each missing option to its value of the quick or the full measurement."""
    for name, value in (full if options.full else quick).items():
        if getattr(options, name, None) is None:
            setattr(options, name, value)


def shipped(name):
    """Returns the path of a shipped scene."""
    return ROOT / "scenes" / name / f"{name}.glb"


def numbers(text):
    """Parses a list such as 2,16,48."""
    try:
        return [int(word) for word in text.split(",")]
    except ValueError:
        raise Failure(f"{text} is no list of whole numbers such as 2,16,48") from None
