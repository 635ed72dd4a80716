#!/usr/bin/env python3
"""Makes the JPEG XL pictures of import/tests/image_fixtures, and the GeoTIFF with chunks of JPEG XL of import/tests/fixtures.

Usage: data-scripts/make-jpegxl-fixtures.py        (from anywhere; needs `cjxl` of libjxl 0.7 or later and the packages imagecodecs, numpy and tifffile)

Pictures show the 72 x 56 texels of `make-image-fixtures.py`. Heights are 50 x 40 samples, whose values `height` gives; tests compute both again. libjxl packs all of them, as it does for GDAL.
"""
import pathlib
import subprocess
import tempfile

import imagecodecs
import numpy
import tifffile

TESTS = pathlib.Path(__file__).resolve().parent.parent / "import" / "tests"
PICTURES = TESTS / "image_fixtures"
HEIGHTS = TESTS / "fixtures"
WIDTH, HEIGHT = 72, 56
WIDE, HIGH = 50, 40
# Of TIFF: JPEG XL as GDAL writes it, and as of DNG 1.7.
JPEG_XL, JPEG_XL_DNG = 50002, 52546


def picture():
    y, x = numpy.mgrid[0:HEIGHT, 0:WIDTH]
    return numpy.stack([40 + 2 * x + y, 220 - x - y, 60 + x * y // 40], axis=-1).astype("u1")


def alpha():
    y, x = numpy.mgrid[0:HEIGHT, 0:WIDTH]
    return numpy.where(x + y < 20, 0, 255).astype("u1")


def height(kind):
    y, x = numpy.mgrid[0:HIGH, 0:WIDE]
    return {
        "u1": 20 + 3 * x + 2 * y,
        "u2": 1000 + 300 * x + 1100 * y,
        # Voids, and numbers far from those of a picture.
        "f4": numpy.where((x + y) % 13 == 0, -9999, -420.125 + 0.375 * x + 33.5 * y),
    }[kind].astype(kind)


def pnm(path, texels):
    high, wide, channels = texels.shape
    most = 65535 if texels.itemsize == 2 else 255
    kind = {1: "GRAYSCALE", 2: "GRAYSCALE_ALPHA", 3: "RGB", 4: "RGB_ALPHA"}[channels]
    if channels in (1, 3):
        head = f"P{5 if channels == 1 else 6}\n{wide} {high}\n{most}\n"
    else:
        head = f"P7\nWIDTH {wide}\nHEIGHT {high}\nDEPTH {channels}\nMAXVAL {most}\nTUPLTYPE {kind}\nENDHDR\n"
    path.write_bytes(head.encode() + texels.astype(texels.dtype.newbyteorder(">")).tobytes())


def upright_as(tag, jpeg):
    """A JPEG that says how the camera was held."""
    entry = bytes([0x12, 0x01, 3, 0, 1, 0, 0, 0, tag, 0, 0, 0])
    exif = b"Exif\0\0II*\0\x08\0\0\0\x01\0" + entry + bytes(4)
    return jpeg[:2] + b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif + jpeg[2:]


def main():
    rgb = picture()
    rgba = numpy.dstack([rgb, alpha()])
    grey = rgb[..., :1].astype("u2") * 257
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)

        def jxl(name, source, *options):
            subprocess.run(["cjxl", "--quiet", source, PICTURES / name, *options], check=True, stderr=subprocess.DEVNULL)

        sources = {"rgb.ppm": rgb, "rgba.pam": rgba, "grey.pgm": grey}
        for name, texels in sources.items():
            pnm(folder / name, texels)
        jxl("rgb.jxl", folder / "rgb.ppm", "-d", "0")
        jxl("rgb-boxes.jxl", folder / "rgb.ppm", "-d", "0", "--container=1")
        jxl("rgba.jxl", folder / "rgba.pam", "-d", "0")
        jxl("grey-16.jxl", folder / "grey.pgm", "-d", "0")
        jxl("lossy.jxl", folder / "rgb.ppm", "-d", "0.5")
        jxl("squeezed.jxl", folder / "rgb.ppm", "-m", "1", "-d", "0.3")
        # A quarter turn to the right is asked for: the stream of a JPEG goes on in another.
        turned = folder / "turned.jpg"
        turned.write_bytes(upright_as(6, (PICTURES / "baseline.jpg").read_bytes()))
        jxl("turned.jxl", turned, "--lossless_jpeg=1")
        (PICTURES / "real.jxl").write_bytes(imagecodecs.jpegxl_encode(rgb[..., 0].astype("f4") / 4 - 10, lossless=True))

    def tiff(path, data, *, tile=None, photometric="minisblack", code=JPEG_XL, **options):
        tifffile.imwrite(
            path, data, compression="jpegxl", compressionargs={"lossless": True}, tile=tile, photometric=photometric,
            metadata=None, software=False, **options,
        )
        if code != JPEG_XL:
            bytes_of = path.read_bytes()
            entry = b"\x03\x01\x03\x00\x01\x00\x00\x00"
            old = entry + JPEG_XL.to_bytes(4, "little")
            assert bytes_of.count(old) == 1
            path.write_bytes(bytes_of.replace(old, entry + code.to_bytes(4, "little")))

    # Steps of 2, north-west corner of the first sample at 1000, 5000.
    place = [(33550, "d", 3, (2.0, 2.0, 0.0), True), (33922, "d", 6, (0.0, 0.0, 0.0, 1000.0, 5000.0, 0.0), True)]
    voids = [(42113, "s", 0, "-9999", True)]
    tiff(HEIGHTS / "jpegxl-byte.tif", height("u1"), rowsperstrip=16, extratags=place)
    tiff(HEIGHTS / "jpegxl-uint16.tif", height("u2"), tile=(16, 32), extratags=place)
    tiff(HEIGHTS / "jpegxl-float32.tif", height("f4"), tile=(48, 64), extratags=place + voids, code=JPEG_XL_DNG)
    # Some of its tiles are read by libjxl alone: differences of reals of both signs are larger than the numbers of the format.
    tiff(PICTURES / "jpegxl-both-signs.tif", height("f4"), tile=(32, 16), extratags=place + voids)
    tiff(PICTURES / "jpegxl-rgb.tif", rgb, tile=(32, 48), photometric="rgb", extratags=place)
    tiff(PICTURES / "jpegxl-rgba.tif", rgba, rowsperstrip=20, photometric="rgb", extrasamples=["unassalpha"], extratags=place)
    tiff(PICTURES / "jpegxl-grey-16.tif", grey[..., 0], tile=(32, 32), extratags=place)
    planes = numpy.moveaxis(rgb, -1, 0).astype("f4") * 8 - 100
    tiff(PICTURES / "jpegxl-planes-real.tif", planes, tile=(48, 32), photometric="rgb", planarconfig="separate", extratags=place)


if __name__ == "__main__":
    main()
