#!/usr/bin/env python3
"""Makes the OpenEXR pictures of import/tests/format_fixtures with OpenEXR's own library.

Usage: data-scripts/make-openexr-fixtures.py        (from anywhere; needs the packages OpenEXR 3.3 or later and numpy)

All have 43 x 37 samples, whose values `height` gives; tests compute them again. Where a fixture has voids, they are where (x + y) % 11 == 0.
"""
import pathlib

import numpy
import OpenEXR

OUT = pathlib.Path(__file__).resolve().parent.parent / "import" / "tests" / "format_fixtures"
WIDE, HIGH = 43, 37


def height(kind="f4", voids=False):
    y, x = numpy.mgrid[0:HIGH, 0:WIDE]
    heights = 100 + 3 * x - 2 * y if kind != "u4" else 3_000_000_000 + 100_000 * x + 7 * y
    if kind != "u4":
        heights = heights + 0.5
    if voids:
        heights = numpy.where((x + y) % 11 == 0, numpy.nan, heights)
    return numpy.ascontiguousarray(heights.astype(kind))


def write(name, channels, compression, **header):
    OpenEXR.File({"compression": compression, "type": OpenEXR.scanlineimage, **header}, channels).write(str(OUT / name))


def main():
    write("float-zip.exr", {"Y": height(voids=True)}, OpenEXR.ZIP_COMPRESSION)
    write("float-raw.exr", {"Y": height()}, OpenEXR.NO_COMPRESSION)
    write("float-falling.exr", {"Y": height()}, OpenEXR.ZIPS_COMPRESSION, lineOrder=OpenEXR.DECREASING_Y)
    write("half-piz.exr", {"Z": height("f2")}, OpenEXR.PIZ_COMPRESSION)
    write("half-b44.exr", {"Z": numpy.full((HIGH, WIDE), 12.5, "f2")}, OpenEXR.B44_COMPRESSION)
    write("half-dwaa.exr", {"Y": height("f2")}, OpenEXR.DWAA_COMPRESSION)
    write("uint-rle.exr", {"id": height("u4")}, OpenEXR.RLE_COMPRESSION)
    write("float-pxr24.exr", {"Y": height()}, OpenEXR.PXR24_COMPRESSION)
    colours = {name: height("f2") * 0 for name in "RGB"}
    write("channels.exr", {**colours, "A": height("f2") * 0 + 1, "terrain.Z": height(voids=True)}, OpenEXR.ZIP_COMPRESSION)
    write("with-alpha.exr", {"Y": height(), "A": height("f2") * 0 + 1}, OpenEXR.ZIP_COMPRESSION)
    window = (numpy.array([-5, 7], "i4"), numpy.array([-5 + WIDE - 1, 7 + HIGH - 1], "i4"))
    shown = (numpy.array([0, 0], "i4"), numpy.array([99, 49], "i4"))
    write("data-window.exr", {"Y": height(voids=True)}, OpenEXR.ZIP_COMPRESSION, dataWindow=window, displayWindow=shown)
    tiles = OpenEXR.TileDescription()
    tiles.xSize, tiles.ySize = 16, 8
    write("tiles.exr", {"Y": height(voids=True)}, OpenEXR.ZIP_COMPRESSION, type=OpenEXR.tiledimage, tiles=tiles)
    parts = [
        OpenEXR.Part({"name": "colour", "compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, colours, "colour"),
        OpenEXR.Part({"name": "ground", "compression": OpenEXR.PIZ_COMPRESSION, "type": OpenEXR.scanlineimage}, {"Z": height()}, "ground"),
    ]
    OpenEXR.File(parts).write(str(OUT / "parts.exr"))


if __name__ == "__main__":
    main()
