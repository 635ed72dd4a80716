#!/usr/bin/env python3
"""Writes import/tests/grib_fixtures: small GRIB 2 files of every packing, order of samples and grid, by ECMWF's ecCodes.

Needs: pip install eccodes numpy. Run it in the root of the repository. The heights are those of `height` in import/tests/grib/main.rs.
"""

import os

import eccodes as ec
import numpy as np

FOLDER = "import/tests/grib_fixtures"
WIDE, HIGH = 37, 23


def heights(voids=False):
    """Rows from the north."""
    row, col = np.mgrid[0:HIGH, 0:WIDE]
    values = (1000 + 13 * col + 29 * row + (7 * col + 11 * row) % 17 * 4).astype(float)
    if voids:
        values[(5 * col + 3 * row) % 23 == 0] = np.nan
    return values


def made(keys, values, packing="grid_simple", order=None, after=None):
    message = ec.codes_grib_new_from_samples("regular_ll_sfc_grib2")
    for key, value in keys.items():
        ec.codes_set(message, key, value)
    # A kind of grid has an order of its own.
    ec.codes_set(message, "scanningMode", keys.get("scanningMode", 0))
    values = np.asarray(values, dtype=float).ravel()
    if np.isnan(values).any():
        ec.codes_set(message, "bitmapPresent", 1)
        ec.codes_set(message, "missingValue", -9999.0)
        values = np.where(np.isnan(values), -9999.0, values)
    ec.codes_set(message, "decimalPrecision", 0)
    ec.codes_set_values(message, values)
    if packing != "grid_simple":
        ec.codes_set(message, "packingType", packing)
        if order is not None:
            ec.codes_set(message, "orderOfSpatialDifferencing", order)
        if packing != "grid_ieee":
            ec.codes_set(message, "bitsPerValue", 16)
        ec.codes_set_values(message, values)
    for key, value in (after or {}).items():
        ec.codes_set(message, key, value)
    if after:
        ec.codes_set_values(message, values)
    bytes_ = ec.codes_get_message(message)
    ec.codes_release(message)
    return bytes_


HGT = {"discipline": 0, "parameterCategory": 3, "parameterNumber": 5, "typeOfFirstFixedSurface": 1}
SPHERE = {"shapeOfTheEarth": 6}


def degrees(west=10.0, north=50.0, step=0.25, wide=WIDE, high=HIGH, **more):
    return {
        **HGT,
        "shapeOfTheEarth": 5,
        "Ni": wide,
        "Nj": high,
        "latitudeOfFirstGridPointInDegrees": north,
        "longitudeOfFirstGridPointInDegrees": west,
        "latitudeOfLastGridPointInDegrees": north - step * (high - 1),
        "longitudeOfLastGridPointInDegrees": (west + step * (wide - 1)) % 360,
        "iDirectionIncrementInDegrees": step,
        "jDirectionIncrementInDegrees": step,
        **more,
    }


def write(name, *messages):
    with open(os.path.join(FOLDER, name), "wb") as file:
        for message in messages:
            file.write(message)


def packings():
    for name, packing, order in [
        ("simple", "grid_simple", None),
        ("complex", "grid_complex", None),
        ("differences-1", "grid_complex_spatial_differencing", 1),
        ("differences-2", "grid_complex_spatial_differencing", 2),
        ("jpeg", "grid_jpeg", None),
        ("png", "grid_png", None),
        ("ccsds", "grid_ccsds", None),
        ("reals", "grid_ieee", None),
    ]:
        write(f"{name}.grib2", made(degrees(), heights(), packing, order))
        write(f"{name}-voids.grib2", made(degrees(), heights(True), packing, order))
    row, col = np.mgrid[0:HIGH, 0:WIDE]
    zeros = np.where(col * row % 97 == 3, 5.0 + col, 0.0)
    write("ccsds-zeros.grib2", made(degrees(), zeros, "grid_ccsds", after={"ccsdsBlockSize": 16, "ccsdsRsi": 20}))
    pairs = ((col // 3 + row // 2) % 2).astype(float)
    write("ccsds-pairs.grib2", made(degrees(), pairs, "grid_ccsds", after={"ccsdsBlockSize": 8, "ccsdsRsi": 128, "bitsPerValue": 3}))
    write("constant.grib2", made(degrees(), np.full((HIGH, WIDE), 77.0)))


def orders():
    """Samples in every order that GRIB knows; the ground is the same."""
    for i in (0, 1):
        for j in (0, 1):
            for down in (0, 1):
                for ploughed in (0, 1):
                    values = heights()
                    keys = degrees()
                    if i:
                        values = values[:, ::-1]
                        a, b = "longitudeOfFirstGridPointInDegrees", "longitudeOfLastGridPointInDegrees"
                        keys[a], keys[b] = keys[b], keys[a]
                    if j:
                        values = values[::-1]
                        a, b = "latitudeOfFirstGridPointInDegrees", "latitudeOfLastGridPointInDegrees"
                        keys[a], keys[b] = keys[b], keys[a]
                    lines = values.T.copy() if down else values.copy()
                    if ploughed:
                        lines[1::2] = lines[1::2, ::-1]
                    keys["scanningMode"] = 128 * i + 64 * j + 32 * down + 16 * ploughed
                    write(f"order-{i}{j}{down}{ploughed}.grib2", made(keys, lines))


def grids():
    """Maps whose first sample is the north-western one, 5 km apart."""
    flat = {**HGT, **SPHERE}
    lambert = {
        **flat,
        "gridType": "lambert",
        "Nx": WIDE,
        "Ny": HIGH,
        "latitudeOfFirstGridPointInDegrees": 47.0,
        "longitudeOfFirstGridPointInDegrees": 9.0,
        "LaDInDegrees": 46.5,
        "LoVInDegrees": 10.0,
        "DxInMetres": 5000,
        "DyInMetres": 5000,
        "Latin1InDegrees": 45.0,
        "Latin2InDegrees": 48.0,
    }
    write("lambert.grib2", made(lambert, heights()))
    write("albers.grib2", made({**lambert, "gridType": "albers"}, heights()))
    polar = {
        **flat,
        "gridType": "polar_stereographic",
        "Nx": WIDE,
        "Ny": HIGH,
        "latitudeOfFirstGridPointInDegrees": 60.0,
        "longitudeOfFirstGridPointInDegrees": 250.0,
        "LaDInDegrees": 60.0,
        "orientationOfTheGridInDegrees": 249.0,
        "DxInMetres": 5000,
        "DyInMetres": 5000,
    }
    write("polar.grib2", made(polar, heights()))
    south = {**polar, "latitudeOfFirstGridPointInDegrees": -75.0, "projectionCentreFlag": 128, "LaDInDegrees": -71.0}
    write("polar-south.grib2", made(south, heights()))
    mercator = {
        **flat,
        "gridType": "mercator",
        "Ni": WIDE,
        "Nj": HIGH,
        "latitudeOfFirstGridPointInDegrees": 20.0,
        "longitudeOfFirstGridPointInDegrees": 179.0,
        "LaDInDegrees": 15.0,
        "latitudeOfLastGridPointInDegrees": 19.0,
        "longitudeOfLastGridPointInDegrees": 180.7,
        "DiInMetres": 5000,
        "DjInMetres": 5000,
    }
    write("mercator.grib2", made(mercator, heights()))
    laea = {
        **HGT,
        "shapeOfTheEarth": 4,
        "gridType": "lambert_azimuthal_equal_area",
        "Nx": WIDE,
        "Ny": HIGH,
        "latitudeOfFirstGridPointInDegrees": 47.0,
        "longitudeOfFirstGridPointInDegrees": 9.0,
        "standardParallelInDegrees": 52.0,
        "centralLongitudeInDegrees": 10.0,
        "xDirectionGridLengthInMetres": 5000,
        "yDirectionGridLengthInMetres": 5000,
    }
    write("equal-area.grib2", made(laea, heights()))


def choices():
    usual = made(degrees(), heights())
    kelvin = {"discipline": 0, "parameterCategory": 0, "parameterNumber": 0}
    level = {"parameterCategory": 3, "parameterNumber": 5, "typeOfFirstFixedSurface": 100, "scaleFactorOfFirstFixedSurface": 0}
    high = [made(degrees(**level, scaledValueOfFirstFixedSurface=pascal), heights() + 5000) for pascal in (50000, 85000)]
    other = made(degrees(**kelvin), np.full((HIGH, WIDE), 280.0))
    write("several.grib2", other, high[0], b"between messages", usual, high[1])
    write("levels.grib2", *high)
    write("kelvin.grib2", other)
    write("geopotential.grib2", made(degrees(parameterNumber=4), heights() * 9.80665, "grid_ieee"))
    write("terrain.grib2", other, made(degrees(discipline=2, parameterCategory=0, parameterNumber=7), heights()))
    write("pacific.grib2", made(degrees(west=176.0), heights()))
    write("west.grib2", made(degrees(west=235.0), heights()))
    write("greenwich.grib2", made(degrees(west=356.0), heights()))
    globe = degrees(west=0.0, north=90.0, step=5.0, wide=72, high=37)
    row, col = np.mgrid[0:37, 0:72]
    write("globe.grib2", made(globe, 10 * col + row))
    third = degrees(west=10.0, north=50.0, step=1 / 3)
    write("third.grib2", made(third, heights()))
    gauss = ec.codes_grib_new_from_samples("regular_gg_sfc_grib2")
    write("gaussian.grib2", ec.codes_get_message(gauss))
    reduced = ec.codes_grib_new_from_samples("reduced_gg_sfc_grib2")
    write("reduced.grib2", ec.codes_get_message(reduced))
    rotated = ec.codes_grib_new_from_samples("rotated_ll_sfc_grib2")
    write("rotated.grib2", ec.codes_get_message(rotated))
    waves = ec.codes_grib_new_from_samples("sh_sfc_grib2")
    write("waves.grib2", ec.codes_get_message(waves))
    first = ec.codes_grib_new_from_samples("regular_ll_sfc_grib1")
    write("edition-1.grib", ec.codes_get_message(first))


os.makedirs(FOLDER, exist_ok=True)
packings()
orders()
grids()
choices()
