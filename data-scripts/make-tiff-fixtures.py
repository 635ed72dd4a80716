#!/usr/bin/env python3
"""Makes the small GeoTIFF files in import/tests/fixtures and the list of what GDAL reads in them.

Usage: data-scripts/make-tiff-fixtures.py        (from anywhere; needs gdal-bin 3.6 or later, no Python packages)

Sources are cuts of tests/data. Each fixture tests one way of storing samples. What is expected of it
comes from GDAL alone, as one line of expected.txt:

    name width height void-count crc32 m0 m1 m2 m3 m4 m5 epsg scale offset

The checksum is that of all samples as little-endian float64, row by row, voids as one NaN (0x7ff8...).
m0..m5 map sample centres to the ground; "-" stands for none.
"""
import json
import math
import pathlib
import struct
import subprocess
import sys
import tempfile
import zlib

ROOT = pathlib.Path(__file__).resolve().parent.parent
DATA = ROOT / "tests" / "data"
OUT = ROOT / "import" / "tests" / "fixtures"
NAN = struct.pack("<Q", 0x7FF8000000000000)


def run(*command):
    subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)


def info(path):
    return json.loads(subprocess.run(["gdalinfo", "-json", str(path)], check=True, capture_output=True).stdout)


def expected(path, epsg):
    about = info(path)
    width, height = about["size"]
    band = about["bands"][0]
    with tempfile.TemporaryDirectory() as folder:
        raw = pathlib.Path(folder) / "raw"
        # Explicitly the first band, without a mask; and an upright place, as ENVI knows no other.
        run("gdal_translate", "-q", "-b", "1", "-ot", "Float64", "-of", "ENVI", "-a_ullr", 0, 1, 1, 0, path, raw)
        values = struct.unpack(f"<{width * height}d", raw.read_bytes())
    nodata = band.get("noDataValue")
    nodata = None if nodata is None else float(nodata)
    floats = band["type"].startswith("Float")

    def void(value):
        if math.isnan(value) or math.isinf(value):
            return True
        if nodata is None or math.isnan(nodata):
            return False
        return value == nodata or (floats and nodata <= -3.39e38 and value <= -3.39e38)

    voids = [void(value) for value in values]
    checksum = zlib.crc32(b"".join(NAN if v else struct.pack("<d", x) for v, x in zip(voids, values)))
    transform = about.get("geoTransform")
    if transform is None:
        centres = ["-"] * 6
    else:
        x, a, b, y, d, e = transform
        centres = [repr(v) for v in (x + 0.5 * (a + b), a, b, y + 0.5 * (d + e), d, e)]
    fields = [path.name, width, height, sum(voids), f"{checksum:08x}", *centres]
    return " ".join(str(f) for f in [*fields, epsg, band.get("scale", 1.0), band.get("offset", 0.0)])


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    for old in OUT.glob("*.tif"):
        old.unlink()
    crater, puget = DATA / "crater_lake_1025.bt", DATA / "puget_sound_1025.png"
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        int16, uint16, hole = folder / "int16.tif", folder / "uint16.tif", folder / "hole.tif"
        run("gdal_translate", "-q", "-srcwin", 400, 300, 70, 50, "-a_nodata", "none", "-a_srs", "EPSG:26710", crater, int16)
        run("gdal_translate", "-q", "-srcwin", 500, 500, 70, 50, puget, uint16)
        # The same cut reaching beyond the data, so that a part of it is void.
        run("gdal_translate", "-q", "-srcwin", -20, -10, 70, 50, "-a_nodata", -32768, crater, hole)

        def make(name, source, *options, epsg="26710"):
            path = OUT / f"{name}.tif"
            run("gdal_translate", "-q", *options, source, path)
            path.with_suffix(".tif.aux.xml").unlink(missing_ok=True)
            lines.append(expected(path, epsg))

        tiled = ("-co", "TILED=YES", "-co", "BLOCKXSIZE=32", "-co", "BLOCKYSIZE=16")
        strips = ("-co", "BLOCKYSIZE=7")
        packed = lambda codec, predictor=1: ("-co", f"COMPRESS={codec}", "-co", f"PREDICTOR={predictor}")
        types = ["Byte", "UInt16", "Int16", "UInt32", "Int32", "Float32", "Float64"]
        for kind in types:
            scale = ("-scale", 6000, 10000, 0, 250) if kind == "Byte" else ()
            low = kind.lower()
            make(f"{low}-strips", int16, "-ot", kind, *scale, *strips)
            make(f"{low}-tiles-deflate-p2", int16, "-ot", kind, *scale, *tiled, *packed("DEFLATE", 2))
        for codec in ("LZW", "DEFLATE", "ZSTD"):
            for predictor in (1, 2):
                for shape, options in (("strips", strips), ("tiles", tiled)):
                    if (codec, predictor, shape) == ("DEFLATE", 2, "tiles"):
                        continue
                    make(f"int16-{shape}-{codec.lower()}-p{predictor}", int16, *options, *packed(codec, predictor))
        for codec in ("LZW", "DEFLATE", "ZSTD"):
            make(f"float32-tiles-{codec.lower()}-p3", int16, "-ot", "Float32", *tiled, *packed(codec, 3))
        make("float64-tiles-deflate-p3", int16, "-ot", "Float64", *tiled, *packed("DEFLATE", 3))
        make("float64-strips-lzw-p3", int16, "-ot", "Float64", *strips, *packed("LZW", 3))
        make("int16-strips-packbits", int16, *strips, "-co", "COMPRESS=PACKBITS")
        make("byte-tiles-packbits", int16, "-ot", "Byte", "-scale", 6000, 10000, 0, 250, *tiled, "-co", "COMPRESS=PACKBITS")
        make("int16-one-strip", int16, "-co", "BLOCKYSIZE=50")
        make("uint16-no-place", uint16, *tiled, epsg="-")
        make("uint16-min-is-white", uint16, *strips, *packed("LZW"), "-co", "PHOTOMETRIC=MINISWHITE", epsg="-")
        make("uint16-min-is-white-raw", uint16, *strips, "-co", "PHOTOMETRIC=MINISWHITE", epsg="-")
        for shape, options in (("strips", strips), ("tiles", tiled)):
            make(f"int16-{shape}-big-endian", int16, *options, "-co", "ENDIANNESS=BIG")
            make(f"int16-{shape}-bigtiff-deflate", int16, *options, *packed("DEFLATE", 2), "-co", "BIGTIFF=YES")
            make(f"float32-{shape}-bigtiff-big-endian-lzw", int16, "-ot", "Float32", *options, *packed("LZW", 2),
                 "-co", "BIGTIFF=YES", "-co", "ENDIANNESS=BIG")
        # Big-endian with predictor 3 is left out: GDAL 3.6 cannot read back what it writes so.

        # Voids.
        make("int16-nodata", hole, *tiled, *packed("DEFLATE", 2), epsg="26710")
        make("float32-nodata-nan", hole, "-ot", "Float32", "-a_nodata", "nan", *tiled)
        extreme = folder / "extreme.tif"
        run("gdalwarp", "-q", "-ot", "Float32", "-dstnodata", "-3.4028234663852886e+38", hole, extreme)
        make("float32-nodata-lowest", extreme, *tiled, *packed("DEFLATE", 3))
        make("float64-nodata-lowest", extreme, "-ot", "Float64", *strips, *packed("LZW", 2))
        sparse = ("-co", "SPARSE_OK=TRUE")
        flat = folder / "flat.tif"
        # Crossing zero makes whole blocks that GDAL leaves out.
        run("gdal_translate", "-q", "-ot", "Int16", "-scale", 6000, 10000, -300, 300, int16, folder / "low.tif")
        run("gdalwarp", "-q", "-te", 565000, 4752000, 568000, 4755000, "-ts", 150, 110, folder / "low.tif", flat)
        make("int16-sparse-zero", flat, *tiled, *packed("DEFLATE"), *sparse)
        make("int16-sparse-raw", flat, *tiled, *sparse)
        run("gdalwarp", "-q", "-dstnodata", -32768, "-te", 560500, 4759500, 562500, 4761500, "-ts", 150, 110, "-s_srs", "EPSG:26710", "-t_srs", "EPSG:26710", crater, folder / "void.tif")
        make("int16-sparse-nodata", folder / "void.tif", *tiled, *packed("LZW", 2), *sparse)
        make("int16-sparse-strips-nodata", folder / "void.tif", *strips, *sparse)

        # LERC, which needs a GDAL that has it, and samples of odd widths.
        nan = folder / "nan.tif"
        run("gdalwarp", "-q", "-ot", "Float32", "-dstnodata", "nan", hole, nan)
        make("int16-strips-lerc", int16, *strips, "-co", "COMPRESS=LERC")
        make("float32-tiles-lerc", nan, *tiled, "-co", "COMPRESS=LERC", "-co", "MAX_Z_ERROR=0.1")
        make("float32-tiles-lerc-deflate", nan, *tiled, "-co", "COMPRESS=LERC_DEFLATE")
        make("float64-tiles-lerc-zstd", int16, "-ot", "Float64", *tiled, "-co", "COMPRESS=LERC_ZSTD", "-co", "ENDIANNESS=BIG")
        wide = ("-scale", 6000, 10000, 0, 4000, "-ot", "UInt16")
        make("uint12-strips", int16, *wide, *strips, "-co", "NBITS=12")
        make("uint12-tiles-deflate-big-endian", int16, *wide, *tiled, *packed("DEFLATE"), "-co", "NBITS=12", "-co", "ENDIANNESS=BIG")
        make("uint4-strips-lzw", int16, "-scale", 6000, 10000, 0, 15, "-ot", "Byte", *strips, *packed("LZW"), "-co", "NBITS=4")
        make("uint24-tiles-big-endian", int16, "-ot", "UInt32", *tiled, "-co", "NBITS=24", "-co", "ENDIANNESS=BIG")
        make("float16-tiles-deflate-p3", int16, "-ot", "Float32", *tiled, *packed("DEFLATE", 3), "-co", "NBITS=16")

        # Several images in a file.
        big = folder / "big.tif"
        run("gdal_translate", "-q", "-srcwin", 400, 300, 150, 140, "-a_srs", "EPSG:26710", crater, big)
        make("int16-cog", big, "-of", "COG", "-co", "BLOCKSIZE=128", "-co", "COMPRESS=DEFLATE", "-co", "PREDICTOR=2")
        make("float32-cog-mask", hole, "-of", "COG", "-ot", "Float32", "-a_nodata", "none", "-mask", "1", "-co", "BLOCKSIZE=128")
        overview = OUT / "int16-overviews.tif"
        run("gdal_translate", "-q", *tiled, *packed("ZSTD", 2), big, overview)
        run("gdaladdo", "-q", overview, 2, 4)
        lines.append(expected(overview, "26710"))

        # Where it lies.
        make("place-point", int16, *strips, "-mo", "AREA_OR_POINT=Point")
        make("place-degrees", int16, *strips, "-a_srs", "EPSG:4326", "-a_ullr", 10, 50, 10.07, 49.95, epsg="4326")
        make("place-feet", int16, *strips, "-a_srs", "EPSG:2222", epsg="2222")
        make("place-us-feet", int16, *strips, "-a_srs", "EPSG:2225", epsg="2225")
        make("place-moon", int16, *strips, "-a_srs", "+proj=longlat +R=1737400 +no_defs", "-a_ullr", 10, 50, 10.07, 49.95, epsg="-")
        make("height-scale-offset", uint16, *strips, "-a_scale", 0.1, "-a_offset", -10000, epsg="-")
        vrt = folder / "rotated.vrt"
        run("gdal_translate", "-q", "-of", "VRT", int16, vrt)
        text = vrt.read_text()
        start, end = text.index("<GeoTransform>"), text.index("</GeoTransform>")
        rotated = folder / "r.vrt"
        rotated.write_text(text[:start] + "<GeoTransform>565000, 8.5, 3.25, 4757000, 2.75, -12.5" + text[end:])
        make("place-rotated", rotated, *strips)
        make("place-rotated-point", rotated, *strips, "-mo", "AREA_OR_POINT=Point")

        # What is refused.
        def refused(name, source, *options):
            run("gdal_translate", "-q", *options, source, OUT / f"refused-{name}.tif")
            (OUT / f"refused-{name}.tif.aux.xml").unlink(missing_ok=True)

        refused("two-bands", int16, "-b", 1, "-b", 1)
        refused("rgb", int16, "-ot", "Byte", "-b", 1, "-b", 1, "-b", 1, "-co", "PHOTOMETRIC=RGB")
        refused("jpeg", int16, "-ot", "Byte", "-co", "COMPRESS=JPEG")
        refused("lzma", int16, "-co", "COMPRESS=LZMA")
        refused("complex", int16, "-ot", "CInt16")
    (OUT / "expected.txt").write_text("".join(f"{line}\n" for line in sorted(lines)))
    total = sum(path.stat().st_size for path in OUT.iterdir())
    print(f"{len(lines)} fixtures, {total / 1024:.0f} KiB")


main()
