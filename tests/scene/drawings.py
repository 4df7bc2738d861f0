"""Drawings for tests: a straight channel as SVG and as GeoJSON, with something put in or left out."""

import json

SVG = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 -50 200 100" width="200mm" height="100mm">
<title>Channel</title>
{}
<g class="wall" data-friction="0.2" data-thickness="1 mm">
<path id="upper" d="M10 -5 H150"/>
<line id="lower" x1="10" y1="5" x2="150" y2="5"/>
</g>
<path id="middle" class="path" d="M0 0 L160 0"/>
</svg>
"""


def svg(folder, extra="", name="channel.svg"):
    """Write the channel with something in it."""
    (folder / name).write_text(SVG.format(extra))
    return folder / name


def replaced(folder, old, new, name="channel.svg"):
    """Write the channel with one text for another."""
    text = SVG.format("")
    assert old in text
    (folder / name).write_text(text.replace(old, new))
    return folder / name


def feature(kind, points, shape="LineString", **properties):
    """A feature of a GeoJSON file."""
    given = {"class": kind, **properties}
    return {"type": "Feature", "properties": given, "geometry": {"type": shape, "coordinates": points}}


def geojson(folder, *extra, units="mm", name="channel.geojson", **keys):
    """Write the channel with more features."""
    features = [
        feature("wall", [[10, 5], [150, 5]], name="upper", friction=0.2, thickness="1 mm"),
        feature("wall", [[10, -5], [150, -5]], name="lower", friction=0.2, thickness="1 mm"),
        feature("path", [[0, 0], [160, 0]], name="middle"),
        *extra,
    ]
    root = {"type": "FeatureCollection", "units": units, "title": "Channel", "features": features, **keys}
    (folder / name).write_text(json.dumps({key: value for key, value in root.items() if value is not None}))
    return folder / name
