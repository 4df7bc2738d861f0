"""What a simulated device holds, for tests that compare it before and after."""

ACTING = {0x6040, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60FF}  # commands and targets
HISTORY = {0x1003}  # of errors
OUTPUTS = {0x60FE, 0x6200}  # stay safe after a stop


def held(device):
    """All values that a person could have set; not targets, commands and outputs."""
    dictionary = device.dictionary
    return {
        (one.index, one.sub): dictionary.values[one.index, one.sub]
        for one in dictionary.entries()
        if one.access == "rw" and one.index not in ACTING | OUTPUTS | HISTORY
    }


def each_write(device, act):
    """Call `act(index, sub, data)` before each write by SDO."""
    dictionary = device.dictionary
    download = dictionary.download

    def watched(index, sub, data):
        act(index, sub, data)
        return download(index, sub, data)

    dictionary.download = watched
