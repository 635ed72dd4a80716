#!/usr/bin/env python3
"""Makes the small pictures in import/tests/image_fixtures: one for each way of storing one that is read, and those that are refused.

Usage: data-scripts/make-image-fixtures.py        (from anywhere; needs gdal-bin 3.6 or later and libjpeg-turbo-progs, no Python packages)

All show the same 72 x 56 texels, whose colours `colour` gives; tests compute them again. Fixtures with alpha have a hole where
x + y < 20. Georeference: 2 m a texel, north-west corner at 1000, 5000.
"""
import pathlib
import subprocess
import tempfile

OUT = pathlib.Path(__file__).resolve().parent.parent / "import" / "tests" / "image_fixtures"
WIDTH, HEIGHT = 72, 56
PLACE = ["-a_ullr", "1000", "5000", "1144", "4888"]


def colour(x, y):
    return 40 + 2 * x + y, 220 - x - y, 60 + x * y // 40


def is_hole(x, y):
    return x + y < 20


def run(*command):
    subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)


def pnm(path, kind, texels):
    path.write_bytes(f"{kind}\n{WIDTH} {HEIGHT}\n255\n".encode() + bytes(v for t in texels for v in t))


def chroma(path):
    """Luma and chroma in units of 2 x 2 texels, 16 rows a strip, which GDAL does not write without JPEG."""
    def codes(x, y):
        r, g, b = colour(x, y)
        luma = 0.299 * r + 0.587 * g + 0.114 * b
        return round(luma), round(128 + (b - luma) / 1.772), round(128 + (r - luma) / 1.402)

    strips = []
    for top in range(0, HEIGHT, 16):
        strip = bytearray()
        for y in range(top, min(top + 16, HEIGHT), 2):
            for x in range(0, WIDTH, 2):
                strip += bytes(codes(x + i, y + j)[0] for j in (0, 1) for i in (0, 1)) + bytes(codes(x, y)[1:])
        strips.append(bytes(strip))
    tags = {256: (3, [WIDTH]), 257: (3, [HEIGHT]), 258: (3, [8, 8, 8]), 259: (3, [1]), 262: (3, [6]), 277: (3, [3]), 278: (3, [16]), 530: (3, [2, 2])}
    places = 8 + 2 + 12 * (len(tags) + 2) + 4
    out, behind = bytearray(), bytearray()
    begin = places + 6 + 8 * len(strips)
    offsets = [begin + sum(map(len, strips[:i])) for i in range(len(strips))]
    tags |= {273: (4, offsets), 279: (4, [len(strip) for strip in strips])}
    for tag, (kind, values) in sorted(tags.items()):
        raw = b"".join(value.to_bytes(2 if kind == 3 else 4, "little") for value in values)
        if len(raw) > 4:
            at = places + len(behind)
            behind += raw
            raw = at.to_bytes(4, "little")
        out += tag.to_bytes(2, "little") + kind.to_bytes(2, "little") + len(values).to_bytes(4, "little") + raw.ljust(4, b"\0")
    head = b"II*\0" + (8).to_bytes(4, "little") + len(tags).to_bytes(2, "little")
    path.write_bytes(head + out + bytes(4) + behind + b"".join(strips))


def main():
    places = [(x, y) for y in range(HEIGHT) for x in range(WIDTH)]
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        rgb, grey, hole, alpha = folder / "rgb.ppm", folder / "grey.pgm", folder / "hole.ppm", folder / "alpha.pgm"
        pnm(rgb, "P6", (colour(x, y) for x, y in places))
        pnm(grey, "P5", ((colour(x, y)[0],) for x, y in places))
        pnm(hole, "P6", ((0, 0, 0) if is_hole(x, y) else colour(x, y) for x, y in places))
        pnm(alpha, "P5", ((0 if is_hole(x, y) else 255,) for x, y in places))
        rgba = folder / "rgba.vrt"
        bands = "".join(
            f'<VRTRasterBand dataType="Byte" band="{i + 1}"><ColorInterp>{name}</ColorInterp><SimpleSource>'
            f"<SourceFilename>{file}</SourceFilename><SourceBand>{band}</SourceBand></SimpleSource></VRTRasterBand>"
            for i, (name, file, band) in enumerate(
                [("Red", rgb, 1), ("Green", rgb, 2), ("Blue", rgb, 3), ("Alpha", alpha, 1)]
            )
        )
        rgba.write_text(f'<VRTDataset rasterXSize="{WIDTH}" rasterYSize="{HEIGHT}">{bands}</VRTDataset>')
        grey16 = folder / "grey16.tif"
        run("gdal_translate", "-ot", "UInt16", "-scale", "0", "255", "0", "65535", grey, grey16)
        rgb16 = folder / "rgb16.tif"
        run("gdal_translate", "-ot", "UInt16", "-scale", "0", "255", "0", "65535", rgb, rgb16)
        tiles = ["-co", "TILED=YES", "-co", "BLOCKXSIZE=32", "-co", "BLOCKYSIZE=16"]

        def tiff(name, source, *options):
            run("gdal_translate", "-q", "--config", "GDAL_PAM_ENABLED", "NO", *PLACE, *options, source, OUT / f"{name}.tif")

        tiff("rgb-strips", rgb)
        tiff("rgb-one-strip", rgb, "-co", "BLOCKYSIZE=56")
        tiff("rgb-tiles-deflate-p2", rgb, *tiles, "-co", "COMPRESS=DEFLATE", "-co", "PREDICTOR=2")
        tiff("rgb-tiles-big-endian-lzw", rgb, *tiles, "-co", "ENDIANNESS=BIG", "-co", "COMPRESS=LZW", "-co", "BIGTIFF=YES")
        tiff("rgba-tiles-zstd", rgba, *tiles, "-co", "COMPRESS=ZSTD")
        tiff("rgb-nodata", hole, "-a_nodata", "0", "-co", "COMPRESS=DEFLATE")
        tiff("grey", grey, "-co", "COMPRESS=PACKBITS")
        tiff("grey-16", grey16, *tiles, "-co", "COMPRESS=LZW", "-co", "PREDICTOR=2")
        tiff("rgb-16-big-endian", rgb16, "-co", "ENDIANNESS=BIG", "-co", "COMPRESS=DEFLATE", "-co", "PREDICTOR=2")
        tiff("jpeg-ycbcr", rgb, *tiles, "-co", "COMPRESS=JPEG", "-co", "PHOTOMETRIC=YCBCR", "-co", "JPEG_QUALITY=95")
        tiff("jpeg-rgb", rgb, "-co", "COMPRESS=JPEG", "-co", "JPEG_QUALITY=95")
        tiff("jpeg-grey", grey, *tiles, "-co", "COMPRESS=JPEG", "-co", "JPEG_QUALITY=95")
        chroma(OUT / "chroma.tif")
        tiff("rgb-planes", rgb, "-co", "INTERLEAVE=BAND")
        tiff("cmyk", rgba, "-co", "PHOTOMETRIC=CMYK", "-co", "COMPRESS=DEFLATE")
        run("gdal_translate", "-q", "-of", "PNG", "-co", "WORLDFILE=YES", *PLACE, rgba, folder / "rgba.png")
        (OUT / "rgba.png").write_bytes((folder / "rgba.png").read_bytes())
        (OUT / "rgba.pgw").write_bytes((folder / "rgba.wld").read_bytes())
        run("gdal_translate", "-q", "-of", "PNG", rgb16, OUT / "rgb-16.png")
        for name, options in [("baseline", []), ("progressive", ["-co", "PROGRESSIVE=YES"])]:
            run("gdal_translate", "-q", "-of", "JPEG", "-co", "QUALITY=95", *options, rgb, OUT / f"{name}.jpg")
        run("gdal_translate", "-q", "-of", "JPEG", "-co", "QUALITY=95", grey, OUT / "grey.jpg")
        run("gdal_translate", "-q", "-of", "JPEG", "-co", "QUALITY=90", rgba, OUT / "cmyk.jpg")
        # A mark after every third unit of blocks.
        run("jpegtran", "-restart", "3B", "-outfile", OUT / "restart.jpg", OUT / "baseline.jpg")

        def jp2(name, source, *options):
            lossless = ["-co", "REVERSIBLE=YES", "-co", "QUALITY=100", "-co", "RESOLUTIONS=2"]
            run("gdal_translate", "-q", "-of", "JP2OpenJPEG", *lossless, *options, source, OUT / name)

        jp2("rgb-tiles.jp2", OUT / "rgb-strips.tif", "-co", "BLOCKXSIZE=32", "-co", "BLOCKYSIZE=32", "-co", "GMLJP2=NO")
        jp2("rgb-gml.jp2", OUT / "rgb-strips.tif", "-a_srs", "EPSG:32632", "-co", "GEOJP2=NO")
        jp2("rgba.jp2", rgba, "-co", "BLOCKXSIZE=48", "-co", "BLOCKYSIZE=32")
        places_of_16, palette = folder / "places.pgm", folder / "palette.vrt"
        pnm(places_of_16, "P5", ((colour(x, y)[0] // 16,) for x, y in places))
        entries = "".join(f'<Entry c1="{17 * i}" c2="{255 - 17 * i}" c3="{5 * i}" c4="255"/>' for i in range(16))
        palette.write_text(
            f'<VRTDataset rasterXSize="{WIDTH}" rasterYSize="{HEIGHT}"><VRTRasterBand dataType="Byte" band="1"><ColorInterp>Palette</ColorInterp>'
            f"<ColorTable>{entries}</ColorTable><SimpleSource><SourceFilename>{places_of_16}</SourceFilename><SourceBand>1</SourceBand></SimpleSource>"
            "</VRTRasterBand></VRTDataset>"
        )
        jp2("palette.jp2", palette, "-co", "BLOCKXSIZE=32", "-co", "BLOCKYSIZE=32")
        jp2("grey.j2k", grey, "-co", "CODEC=J2K")
        run("gdal_translate", "-q", "-of", "WEBP", "-co", "LOSSLESS=YES", rgba, OUT / "rgba.webp")
        run("gdal_translate", "-q", "-of", "WEBP", "-co", "QUALITY=90", rgb, OUT / "rgb.webp")
        webp = ["-co", "TILED=YES", "-co", "BLOCKXSIZE=48", "-co", "BLOCKYSIZE=32", "-co", "COMPRESS=WEBP"]
        tiff("rgb-tiles-webp", rgb, *webp, "-co", "WEBP_LOSSLESS=YES")
        turned = folder / "turned.vrt"
        turned.write_text(
            f'<VRTDataset rasterXSize="{WIDTH}" rasterYSize="{HEIGHT}"><GeoTransform>1000, 2, 1, 5000, 1, -2</GeoTransform>'
            + bands.rsplit("<VRTRasterBand", 1)[0]
            + "</VRTDataset>"
        )
        run("gdal_translate", "-q", "-co", "COMPRESS=DEFLATE", turned, OUT / "refused-turned.tif")
    for aux in OUT.glob("*.aux.xml"):
        aux.unlink()


if __name__ == "__main__":
    main()
