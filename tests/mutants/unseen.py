"""The list of changes that no test can see, unseen.txt: blocks of four lines, file, line, change and reason."""

KEYS = ("file", "line", "change", "reason")


class Entry:
    def __init__(self, values):
        self.path, self.line, self.what, self.reason = (values[key] for key in KEYS)

    def matches(self, change):
        return (self.path == change.path and self.line in (change.line, "any") and self.what in (change.what, "any"))

    def __str__(self):
        return f"{self.path}: {self.what}: {self.line}"


def read(path):
    """The entries; raises ValueError where a block has not its four lines."""
    entries, values = [], {}
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        key, _, value = line.partition(" ")
        if key != KEYS[len(values)] or not value:
            raise ValueError(f"{path.name}:{number}: '{KEYS[len(values)]} …' is expected here")
        values[key] = value
        if len(values) == len(KEYS):
            entries.append(Entry(values))
            values = {}
    if values:
        raise ValueError(f"{path.name}: the last entry has no {KEYS[len(values)]}")
    return entries
