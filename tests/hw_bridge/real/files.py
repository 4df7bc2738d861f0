"""EDS files as vendors write them, in this project's own words and numbers: the objects that matter, and no others."""

VAR, ARRAY = 7, 8
U8, U16, U32, I8, I16, I32 = 5, 6, 7, 2, 3, 4
ZERO = {VAR: "0x7", ARRAY: "0x8"}


def section(title, **keys):
    return f"[{title}]\n" + "".join(f"{key}={value}\n" for key, value in keys.items()) + "\n"


def variable(title, name, kind, access, default=None, pdo=0):
    keys = {
        "ParameterName": name,
        "ObjectType": "0x7",
        "DataType": f"0x{kind:04X}",
        "AccessType": access,
        "PDOMapping": pdo,
    }
    return section(title, **keys, **({} if default is None else {"DefaultValue": default}))


def record(index, name, *rows, count_access="ro"):
    """Rows: subindex, type, access, default, mappable."""
    text = section(f"{index:X}", ParameterName=name, ObjectType="0x8", SubNumber=len(rows) + 1)
    text += variable(
        f"{index:X}sub0", "Number of entries", U8, count_access, rows[-1][0] if count_access == "ro" else len(rows)
    )
    return text + "".join(
        variable(f"{index:X}sub{sub:X}", f"{name} {sub}", kind, access, default, pdo)
        for sub, kind, access, default, pdo in rows
    )


def pdo(number, receive, base, words, entries, mapping_access="rw"):
    """Communication and mapping of a PDO with room for so many objects."""
    start, kind = (0x1400, "RPDO") if receive else (0x1800, "TPDO")
    text = record(
        start + number, f"{kind} {number + 1}", (1, U32, "rw", f"$NODEID+0x{base:X}", 0), (2, U8, "rw", 255, 0)
    )
    index = start + 0x200 + number
    text += section(f"{index:X}", ParameterName=f"{kind} {number + 1} mapping", ObjectType="0x8", SubNumber=entries + 1)
    text += variable(f"{index:X}sub0", "Number of objects", U8, mapping_access, len(words))
    padded = [*words, *[0] * (entries - len(words))]
    return text + "".join(
        variable(f"{index:X}sub{place:X}", f"Object {place}", U32, mapping_access, word)
        for place, word in enumerate(padded, 1)
    )


COMMUNICATION = (
    variable("1001", "Error register", U8, "ro", 0, 1)
    + record(0x1003, "Errors", *((n, U32, "ro", None, 0) for n in range(1, 9)), count_access="rw")
    + variable("1005", "COB-ID SYNC", U32, "rw", "0x80")
    + variable("1014", "COB-ID EMCY", U32, "rw", "$NODEID+0x80")
)
HEARTBEAT = record(0x1016, "Consumer heartbeat", (1, U32, "rw", 0, 0)) + variable(
    "1017", "Producer heartbeat", U16, "rw", 0
)
PDOS_OF_FOUR = "".join(
    pdo(n, True, 0x200 + 0x100 * n, [0x60400010], 4) + pdo(n, False, 0x180 + 0x100 * n, [0x60410010], 4)
    for n in range(4)
)
HEAD = "[FileInfo]\nFileName=drive.eds\nFileVersion=1\n\n[DeviceInfo]\nVendorName=X\nProductName=X\nBaudRate_1000=1\n\n"


def words(*more, modes=None):
    """Control, modes and actual values that every drive has."""
    return (
        variable("6040", "Controlword", U16, "rw", 0, 1)
        + variable("6041", "Statusword", U16, "ro", 0, 1)
        + variable("6060", "Modes of operation", I8, "rw", 0, 1)
        + variable("6061", "Modes of operation display", I8, "ro", 0, 1)
        + variable("6064", "Position actual value", I32, "ro", 0, 1)
        + variable("606C", "Velocity actual value", I32, "ro", 0, 1)
        + variable("607A", "Target position", I32, "rw", 0, 1)
        + variable("6502", "Supported drive modes", U32, "ro", modes)
        + "".join(more)
    )


def identity(vendor, product):
    return record(
        0x1018,
        "Identity",
        (1, U32, "ro", vendor, 0),
        (2, U32, "ro", product, 0),
        (3, U32, "ro", None, 0),
        (4, U32, "ro", None, 0),
    )


def mc5004():
    """A FAULHABER MC5004: four objects a PDO, and neither 603Fh, 6075h, 607Fh, 60C2h nor 60FEh; constants have no default."""
    return (
        HEAD
        + variable("1000", "Device type", U32, "ro", 0x00420192)
        + COMMUNICATION
        + HEARTBEAT
        + identity(327, None)
        + PDOS_OF_FOUR
        + variable("2320", "Error word", U16, "ro", 0, 1)
        + record(0x2329, "Motor data", *((n, U16, "rw", None, 0) for n in (1, 2, 3)))
        + record(
            0x2344,
            "Velocity control",
            (1, U32, "rw", None, 0),
            (2, U16, "rw", None, 0),
            (3, U16, "rw", 65535, 0),
            (4, U16, "rw", 100, 0),
        )
        + variable("6007", "Abort connection option", I16, "rw", 1)
        + variable("605A", "Quick stop option", I16, "rw", 2)
        + words(
            variable("6065", "Following error window", U32, "rw", None),
            variable("6066", "Following error time", U16, "rw", None),
            variable("6071", "Target torque", I16, "rw", 0, 1),
            variable("6072", "Max torque", U16, "ro", None),
            variable("6077", "Torque actual value", I16, "ro", 0, 1),
            record(0x607D, "Software position limit", (1, I32, "rw", -(2**31), 0), (2, I32, "rw", 2**31 - 1, 0)),
            variable("6080", "Max motor speed", U32, "rw", 32767),
            variable("6081", "Profile velocity", U32, "rw", 32767),
            *(variable(f"{index:X}", "Ramp", U32, "rw", 30000) for index in (0x6083, 0x6084, 0x6085)),
            record(0x608F, "Encoder resolution", (1, U32, "ro", None, 0), (2, U32, "ro", None, 0)),
            record(0x6091, "Gear ratio", (1, U32, "rw", 1, 0), (2, U32, "rw", 1, 0)),
            record(0x6092, "Feed constant", (1, U32, "rw", 4096, 0), (2, U32, "rw", 1, 0)),
            record(0x6096, "Velocity factor", (1, U32, "rw", 1, 0), (2, U32, "rw", 4096, 0)),
            variable("6098", "Homing method", I8, "rw", 0),
            record(0x6099, "Homing speeds", (1, U32, "rw", 400, 0), (2, U32, "rw", 400, 0)),
            variable("60E0", "Positive torque limit", U16, "rw", 6000),
            variable("60E1", "Negative torque limit", U16, "rw", 6000),
            variable("60FF", "Target velocity", I32, "rw", 0, 1),
        )
    )


def gripper(*, pdos=None, current=True, heartbeat=True, modes=67, velocity=False, telling=()):
    """A drive of CiA 402 of no known vendor: pp, two RPDOs, no ramps down, no units; as arms of robots have them."""
    two = pdo(0, True, 0x200, [0x60400010], 8) + pdo(1, True, 0x300, [], 8)
    four = "".join(pdo(n, False, 0x180 + 0x100 * n, [], 8) for n in range(4))
    return (
        HEAD
        + variable("1000", "Device type", U32, "ro", None)
        + COMMUNICATION
        + (HEARTBEAT if heartbeat else "")
        + identity(None, None)
        + (two + four if pdos is None else pdos)
        + words(
            variable("6065", "Following error window", U32, "rw", 0),
            *([variable("6077", "Torque actual value", I16, "ro", 0, 1)] if current else []),
            record(0x607D, "Software position limit", (1, I32, "rw", 0, 0), (2, I32, "rw", 0, 0)),
            variable("6081", "Profile velocity", U32, "rw", 10000),
            variable("6083", "Profile acceleration", U32, "rw", 0),
            *([variable("60FF", "Target velocity", I32, "rw", 0, 1)] if velocity else []),
            *telling,
            modes=modes,
        )
    )
