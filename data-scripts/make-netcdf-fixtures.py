#!/usr/bin/env python3
"""Makes the small netCDF, DTED and USGS DEM files in import/tests/format_fixtures.

Usage: data-scripts/make-netcdf-fixtures.py        (from anywhere; needs netcdf-bin, gmt and gdal-bin)

Unless its name says otherwise a file is of 9 columns and 7 rows, half a degree apart from 10 degrees east and 40 degrees north on, and the height of a sample is
100 + 3 * (samples east of the south-west one) + 7 * (samples north of it).
"""
import pathlib
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
OUT = ROOT / "import" / "tests" / "format_fixtures"
WIDE, HIGH = 9, 7


def run(*command, **more):
    subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL, **more)


def height(col, row):
    return 100 + 3 * col + 7 * row


def cdl(name, kind, text):
    with tempfile.TemporaryDirectory() as folder:
        source = pathlib.Path(folder) / "a.cdl"
        source.write_text(text)
        run("ncgen", "-k", kind, "-o", OUT / f"{name}.nc", source)


def values(order, change=lambda value: value):
    return ", ".join(str(change(height(col, row))) for col, row in order)


NORTH_UP = [(col, row) for row in reversed(range(HIGH)) for col in range(WIDE)]
SOUTH_UP = [(col, row) for row in range(HIGH) for col in range(WIDE)]
COLUMNS = [(col, row) for col in range(WIDE) for row in range(HIGH)]
LON = ", ".join(str(10 + 0.5 * col) for col in range(WIDE))
LAT = [str(40 + 0.5 * row) for row in range(HIGH)]
UP, DOWN = ", ".join(LAT), ", ".join(reversed(LAT))
AXES = 'double lat(lat); lat:units = "degrees_north"; double lon(lon); lon:units = "degrees_east";'


def plain(name, kind, dtype="short", data=None, extra="", lat=UP, lon=LON, sides=(HIGH, WIDE), units="m"):
    data = data or values(SOUTH_UP)
    cdl(name, kind, f"""netcdf a {{ dimensions: lat = {sides[0]}; lon = {sides[1]};
variables: {AXES} {dtype} elevation(lat, lon); elevation:units = "{units}"; {extra}
data: lat = {lat}; lon = {lon}; elevation = {data}; }}""")


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    for kind, name in (("classic", "classic"), ("64-bit offset", "offset-64"), ("cdf5", "cdf-5"), ("netCDF-4", "nc4"), ("netCDF-4 classic model", "nc4-classic")):
        plain(name, kind)
    plain("falling-latitude", "classic", "float", values(NORTH_UP, float), lat=DOWN)
    fill = values(SOUTH_UP).replace("127", "-9999", 1)
    plain("fill", "classic", "int", fill, "elevation:_FillValue = -9999; elevation:missing_value = 100;")
    plain("default-fill", "classic", "float", fill.replace("-9999", "_"))
    plain("packed", "netCDF-4", "short", values(SOUTH_UP, lambda v: (v - 100) * 10), "elevation:scale_factor = 0.1; elevation:add_offset = 100.;")
    plain("unsigned", "classic", "short", values(SOUTH_UP, lambda v: v + 40000 - 65536), 'elevation:_Unsigned = "true"; elevation:_FillValue = -1s;')
    plain("feet", "classic", units="feet")
    plain("depth", "classic", data=values(SOUTH_UP, lambda v: -v), extra='elevation:standard_name = "sea_floor_depth_below_geoid"; elevation:positive = "down";')
    plain("chunks", "netCDF-4", extra="elevation:_ChunkSizes = 2, 4; elevation:_DeflateLevel = 5; elevation:_Shuffle = \"true\"; elevation:_Fletcher32 = \"true\";")
    plain("east-of-180", "classic", lon=", ".join(str(350 + 0.5 * col) for col in range(WIDE)))
    plain("uneven", "classic", lat=UP.replace("41.5", "41.7"))
    types = {"byte": lambda v: v - 120, "ubyte": int, "ushort": int, "int": int, "uint": int, "int64": int, "uint64": int, "float": float, "double": float}
    for dtype, change in types.items():
        plain(f"type-{dtype}", "netCDF-4", dtype, values(SOUTH_UP, change))
    cdl("columns-first", "classic", f"""netcdf a {{ dimensions: lon = {WIDE}; lat = {HIGH};
variables: {AXES} short elevation(lon, lat); elevation:units = "m";
data: lat = {UP}; lon = {LON}; elevation = {values(COLUMNS)}; }}""")
    one = f"""netcdf a {{ dimensions: time = UNLIMITED; latitude = {HIGH}; longitude = {WIDE};
variables: int time(time); time:units = "hours since 1900-01-01"; float latitude(latitude); latitude:units = "degrees_north";
float longitude(longitude); longitude:units = "degrees_east"; short z(time, latitude, longitude); z:units = "m**2 s**-2";
z:standard_name = "geopotential"; z:scale_factor = 0.980665; z:add_offset = 0.; z:_FillValue = -32767s; z:missing_value = -32767s;
data: time = 1; latitude = {DOWN}; longitude = {LON}; z = {values(NORTH_UP, lambda v: 10 * v)}; }}"""
    cdl("era5", "classic", one)
    two = one.replace("time = 1;", "time = 1, 2;").replace(f"z = {values(NORTH_UP, lambda v: 10 * v)};", f"z = {values(NORTH_UP, lambda v: 10 * v)}, {values(NORTH_UP, lambda v: 20 * v)};")
    cdl("layers", "netCDF-4", two)
    cdl("two-grids", "classic", f"""netcdf a {{ dimensions: lat = {HIGH}; lon = {WIDE};
variables: {AXES} short first(lat, lon); short second(lat, lon);
data: lat = {UP}; lon = {LON}; first = {values(SOUTH_UP)}; second = {values(SOUTH_UP, lambda v: v + 1000)}; }}""")
    cdl("groups", "netCDF-4", f"""netcdf a {{ group: data {{ dimensions: lat = {HIGH}; lon = {WIDE};
variables: {AXES} short elevation(lat, lon);
data: lat = {UP}; lon = {LON}; elevation = {values(SOUTH_UP)}; }} }}""")
    cdl("kilometres", "classic", f"""netcdf a {{ dimensions: y = {HIGH}; x = {WIDE};
variables: int crs; crs:grid_mapping_name = "polar_stereographic"; crs:straight_vertical_longitude_from_pole = -45.; crs:standard_parallel = 70.;
crs:latitude_of_projection_origin = 90.; crs:semi_major_axis = 6378137.; crs:inverse_flattening = 298.257223563;
double x(x); x:units = "km"; x:standard_name = "projection_x_coordinate"; double y(y); y:units = "km"; y:standard_name = "projection_y_coordinate";
float bed(y, x); bed:units = "m"; bed:grid_mapping = "crs"; float thickness(y, x); thickness:units = "m";
data: x = {", ".join(str(-100 + 0.5 * c) for c in range(WIDE))}; y = {", ".join(str(-2000 + 0.5 * r) for r in range(HIGH))};
bed = {values(SOUTH_UP)}; thickness = {values(SOUTH_UP)}; }}""")
    cdl("curvilinear", "classic", f"""netcdf a {{ dimensions: y = {HIGH}; x = {WIDE};
variables: double lat(y, x); lat:units = "degrees_north"; double lon(y, x); lon:units = "degrees_east"; float z(y, x); z:coordinates = "lon lat";
data: lat = {", ".join(str(40 + r + c / 10) for c, r in SOUTH_UP)}; lon = {", ".join(str(10 + c + r / 10) for c, r in SOUTH_UP)}; z = {values(SOUTH_UP)}; }}""")
    # GMT, of now and of before version 4, with samples at nodes and in areas.
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        table = folder / "a.xyz"
        table.write_text("".join(f"{10 + 0.5 * c} {40 + 0.5 * r} {height(c, r)}\n" for c, r in SOUTH_UP))
        region = ["-R10/14/40/43", "-I0.5", "-fg"]
        run("gmt", "xyz2grd", table, *region, f"-G{OUT}/gmt.nc=ns", cwd=folder)
        run("gmt", "xyz2grd", table, *region, f"-G{OUT}/gmt-old.nc=cs", cwd=folder)
        area = ["-R9.75/14.25/39.75/43.25", "-I0.5", "-r", "-fg"]
        run("gmt", "xyz2grd", table, *area, f"-G{OUT}/gmt-area.nc=nf", cwd=folder)
        run("gmt", "xyz2grd", table, *area, f"-G{OUT}/gmt-old-area.nc=cf", cwd=folder)
        # A cell of level 0 with negative heights and voids, and one near the pole; and a sheet of the USGS in UTM.
        grid = folder / "a.asc"

        def ascii_grid(wide, high, west, south, step, voids):
            rows = [" ".join(str(-9999 if voids and (c + r) % 11 == 5 else 3 * c - 7 * r) for c in range(wide)) for r in reversed(range(high))]
            grid.write_text(f"ncols {wide}\nnrows {high}\nxllcenter {west}\nyllcenter {south}\ncellsize {step}\nNODATA_value -9999\n" + "\n".join(rows) + "\n")

        ascii_grid(121, 121, -7, -33, 1 / 120, True)
        run("gdal_translate", "-q", "-of", "DTED", "-a_srs", "EPSG:4326", grid, OUT / "s33w007.dt0", stderr=subprocess.DEVNULL)
        ascii_grid(40, 30, 560000, 4750000, 30, True)
        run("gdal_translate", "-q", "-of", "GTiff", "-a_srs", "EPSG:26710", grid, folder / "a.tif")
        run("gdal_translate", "-q", "-of", "USGSDEM", "-co", "ZRESOLUTION=0.1", folder / "a.tif", OUT / "utm-tenths.dem", stderr=subprocess.DEVNULL)
        run("gdal_translate", "-q", "-of", "USGSDEM", folder / "a.tif", OUT / "utm.dem", stderr=subprocess.DEVNULL)
        run("gdal_translate", "-q", "-of", "BAG", folder / "a.tif", OUT / "utm.bag", stderr=subprocess.DEVNULL)
    for path in OUT.glob("*.aux.xml"):
        path.unlink()
    total = sum(path.stat().st_size for path in OUT.iterdir())
    print(f"{len(list(OUT.iterdir()))} fixtures, {total / 1024:.0f} KiB")


main()
