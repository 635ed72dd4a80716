#!/usr/bin/env python3
"""Makes import/src/crs/registry/shifts.txt: shifts to WGS 84 that crate crs-definitions has otherwise than PROJ, or lacks, and by how much places may be off where one shift does not do.
And datums.txt beside it: names of datums, letters and digits alone, with the code of their longitudes and latitudes, for texts that name no code, EPSG's own name first; reach.txt: where on the
globe PROJ has a shift for them; and import/tests/crs_places.txt: places by PROJ in the midst of areas, and at their rims where it shifts nothing, for tests.

Needs PROJ's library (9.1 or later) with its proj.db, and numpy. Usage: make-shift-table.py PROJ_DB CRS_DEFINITIONS_DEFS_RS FOLDER

Each system is tried at 25 places of its area. Where PROJ makes one shift of three or seven parameters there, that one is taken. Where it makes several steps, or those of Molodensky and
Badekas, seven parameters are fitted to within a metre. Where its shifts differ from region to region, the one of most places is taken, and the largest distance is written beside it. Where PROJ has shifts for a part of the area alone, reach.txt tells.
"""
import collections
import ctypes
import math
import re
import sqlite3
import sys

import numpy

DATUMS = {
    "WGS84": "0,0,0",
    "NAD83": "0,0,0",
    "GGRS87": "-199.87,74.79,246.62",
    "carthage": "-263,6,431",
    "potsdam": "598.1,73.7,418.2,0.202,0.045,-2.455,6.7",
    "hermannskogel": "577.326,90.129,463.919,5.137,1.474,5.297,2.4232",
    "ire65": "482.530,-130.596,564.557,-1.042,-0.214,-0.631,8.15",
    "nzgd49": "59.47,-5.04,187.44,0.47,-0.1,1.024,-4.5993",
    "OSGB36": "446.448,-125.157,542.060,0.1502,0.2470,0.8421,-20.4894",
}
WGS84 = (6378137.0, 1 / 298.257223563)
SECOND = math.pi / 180 / 3600
NEAR_M = 3.0
# A shift for Kosovo that turns the other way than all of its neighbours', by 1.6 km.
WRONG = "+x=628.54052"


class Coordinate(ctypes.Structure):
    _fields_ = [("v", ctypes.c_double * 4)]


proj = ctypes.CDLL("libproj.so.25")
pointer, number, text = ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p
for name, result, takes in [
    ("proj_context_create", pointer, []),
    ("proj_log_level", number, [pointer, number]),
    ("proj_create_crs_to_crs", pointer, [pointer, text, text, pointer]),
    ("proj_normalize_for_visualization", pointer, [pointer, pointer]),
    ("proj_trans", Coordinate, [pointer, number, Coordinate]),
    ("proj_trans_get_last_used_operation", pointer, [pointer]),
    ("proj_as_proj_string", text, [pointer, pointer, number, pointer]),
    ("proj_create", pointer, [pointer, text]),
    ("proj_create_operation_factory_context", pointer, [pointer, text]),
    ("proj_operation_factory_context_set_spatial_criterion", None, [pointer, pointer, number]),
    ("proj_operation_factory_context_set_grid_availability_use", None, [pointer, pointer, number]),
    ("proj_create_operations", pointer, [pointer, pointer, pointer, pointer]),
    ("proj_list_get_count", number, [pointer]),
    ("proj_list_get", pointer, [pointer, pointer, number]),
    ("proj_coordoperation_has_ballpark_transformation", number, [pointer, pointer]),
    ("proj_destroy", pointer, [pointer]),
    ("proj_list_destroy", None, [pointer]),
    ("proj_operation_factory_context_destroy", None, [pointer]),
    ("proj_get_area_of_use", number, [pointer, pointer] + [ctypes.POINTER(ctypes.c_double)] * 4 + [pointer]),
]:
    function = getattr(proj, name)
    function.restype, function.argtypes = result, takes
context = proj.proj_context_create()
proj.proj_log_level(context, 0)


class Way:
    """From one system to another, x or longitude first."""

    def __init__(self, old, new):
        made = proj.proj_create_crs_to_crs(context, old.encode(), new.encode(), None)
        self.way = proj.proj_normalize_for_visualization(context, made) if made else None

    def go(self, at, back=False):
        found = proj.proj_trans(self.way, -1 if back else 1, Coordinate((ctypes.c_double * 4)(*at, 0, math.inf)))
        return (found.v[0], found.v[1]) if math.isfinite(found.v[0] + found.v[1]) else None

    def steps(self):
        """The last operation as PROJ writes it, and its steps between datums."""
        used = proj.proj_trans_get_last_used_operation(self.way)
        written = proj.proj_as_proj_string(context, used, 0, None) if used else None
        if not written:
            return "", None
        written = written.decode()
        return written, [step for step in written.split("+step") if re.search(r"\+proj=(helmert|molobadekas)", step)]


def reach(code):
    """Rectangles of longitude and latitude in which PROJ has a shift to WGS 84: west, south, east, north. None where it shifts everywhere."""
    factory = proj.proj_create_operation_factory_context(context, None)
    partial_intersection, discard_if_missing = 1, 1
    proj.proj_operation_factory_context_set_spatial_criterion(context, factory, partial_intersection)
    proj.proj_operation_factory_context_set_grid_availability_use(context, factory, discard_if_missing)
    ends = [proj.proj_create(context, f"EPSG:{end}".encode()) for end in (code, 4326)]
    ways = proj.proj_create_operations(context, *ends, factory) if all(ends) else None
    boxes, shifts_everywhere = set(), True
    for i in range(proj.proj_list_get_count(ways) if ways else 0):
        way = proj.proj_list_get(context, ways, i)
        if proj.proj_coordoperation_has_ballpark_transformation(context, way):
            shifts_everywhere = False
            continue
        sides = [ctypes.c_double() for _ in range(4)]
        if proj.proj_get_area_of_use(context, way, *map(ctypes.byref, sides), None):
            boxes.add(tuple(round(side.value, 4) for side in sides))
        proj.proj_destroy(way)
    proj.proj_list_destroy(ways)
    proj.proj_operation_factory_context_destroy(factory)
    for end in ends:
        proj.proj_destroy(end)
    holds = lambda a, b: a != b and a[0] <= b[0] and a[1] <= b[1] and a[2] >= b[2] and a[3] >= b[3] and a[0] < a[2] and b[0] < b[2]
    return [] if shifts_everywhere else sorted(box for box in boxes if not any(holds(other, box) for other in boxes))


def geocentric(at, body):
    a, f = body
    lon, lat = map(math.radians, at)
    e2 = f * (2 - f)
    n = a / math.sqrt(1 - e2 * math.sin(lat) ** 2)
    return numpy.array([n * math.cos(lat) * math.cos(lon), n * math.cos(lat) * math.sin(lon), n * (1 - e2) * math.sin(lat)])


def geodetic(at, body):
    a, f = body
    x, y, z = at
    e2, p = f * (2 - f), math.hypot(x, y)
    lat = math.atan2(z, p * (1 - e2))
    for _ in range(8):
        lat = math.atan2(z + e2 * a / math.sqrt(1 - e2 * math.sin(lat) ** 2) * math.sin(lat), p)
    return math.degrees(math.atan2(y, x)), math.degrees(lat)


def turned(shift, at):
    x, y, z = at
    dx, dy, dz, rx, ry, rz, s = list(shift) + [0] * (7 - len(shift))
    rx, ry, rz, m = rx * SECOND, ry * SECOND, rz * SECOND, 1 + s * 1e-6
    return dx + m * (x - rz * y + ry * z), dy + m * (rz * x + y - rx * z), dz + m * (-ry * x + rx * y + z)


def apart(a, b):
    across = (a[0] - b[0] + 180) % 360 - 180
    return math.hypot(across * 111320 * math.cos(math.radians(b[1])), (a[1] - b[1]) * 110900)


def parameters(step):
    """Of a step in PROJ's words; None for one with a pivot."""
    if "molobadekas" in step:
        return None
    found = [re.search(rf"\+{key}=(\S+)", step) for key in ("x", "y", "z", "rx", "ry", "rz", "s")]
    values = [float(value[1]) if value else 0.0 for value in found]
    if "coordinate_frame" in step:
        values[3:6] = [-value for value in values[3:6]]
    if "+inv" in step:
        values = [-value for value in values]
    return tuple(values) if any(values[3:]) else tuple(values[:3])


def fitted(places, body):
    """Seven parameters by least squares."""
    rows, wanted = [], []
    for own, world in places:
        x, y, z = geocentric(own, body)
        rows += [[1, 0, 0, 0, z * SECOND, -y * SECOND, x * 1e-6], [0, 1, 0, -z * SECOND, 0, x * SECOND, y * 1e-6], [0, 0, 1, y * SECOND, -x * SECOND, 0, z * 1e-6]]
        there = geocentric(world, WGS84)
        # Heights are free: the place at the height at which the shift leaves it.
        wanted += list(there - numpy.array([x, y, z]))
    found, *_ = numpy.linalg.lstsq(numpy.array(rows), numpy.array(wanted), rcond=None)
    return tuple(round(float(value), 6) for value in found)


def degrees_of(value, unit, factor):
    if "DMS" not in unit:
        return math.degrees(value * factor)
    whole = abs(value) + 1e-12
    minutes = (whole - int(whole)) * 100
    return math.copysign(int(whole) + int(minutes) / 60 + (minutes - int(minutes)) / 36, value)


def main(proj_db, defs, folder):
    db = sqlite3.connect(proj_db)
    strings = {int(m[1]): m[2] for m in re.finditer(r'^EPSG_(\d+)\|\d+\|"([^"]*)"', open(defs).read(), re.M)}
    for line in open(f"{folder}/missing.txt"):
        if line[0] != "#":
            fields = line.rstrip("\n").split("|")
            strings.setdefault(int(fields[0]), fields[6])
    systems = "select 'p', code, geodetic_crs_code from projected_crs where auth_name = 'EPSG' union all select 'g', code, code from geodetic_crs where auth_name = 'EPSG' and type like 'geographic%'"
    bases = {int(code): (kind, int(base)) for kind, code, base in db.execute(systems)}
    joins = (
        "from geodetic_crs g join geodetic_datum d on d.auth_name = g.datum_auth_name and d.code = g.datum_code join ellipsoid e on e.auth_name = d.ellipsoid_auth_name and e.code = d.ellipsoid_code "
        "join unit_of_measure u on u.auth_name = e.uom_auth_name and u.code = e.uom_code join prime_meridian p on p.auth_name = d.prime_meridian_auth_name and p.code = d.prime_meridian_code "
        "join unit_of_measure v on v.auth_name = p.uom_auth_name and v.code = p.uom_code where g.auth_name = 'EPSG'"
    )
    bodies = {}
    for code, a, b, rf, metres, meridian, unit, factor in db.execute(f"select g.code, e.semi_major_axis, e.semi_minor_axis, e.inv_flattening, u.conv_factor, p.longitude, v.name, v.conv_factor {joins}"):
        f = 1 / rf if rf else (1 - b / a if b else 0)
        bodies[int(code)] = ((a * metres, f), degrees_of(meridian, unit, factor))
    angles = "select g.code, u.conv_factor from geodetic_crs g join axis a on a.coordinate_system_auth_name = g.coordinate_system_auth_name and a.coordinate_system_code = g.coordinate_system_code join unit_of_measure u on u.auth_name = a.uom_auth_name and u.code = a.uom_code where g.auth_name = 'EPSG' and a.coordinate_system_order = 1"
    degrees = {int(code): math.degrees(factor or math.radians(1)) for code, factor in db.execute(angles)}
    areas = {}
    usage = "select u.object_code, west_lon, south_lat, east_lon, north_lat from usage u join extent e on e.auth_name = u.extent_auth_name and e.code = u.extent_code where u.object_table_name in ('projected_crs', 'geodetic_crs') and u.object_auth_name = 'EPSG'"
    for code, *area in db.execute(usage):
        if area[0] is not None:
            areas.setdefault(int(code), area)

    lines, tried, rims = [], [], []
    for code in sorted(set(strings) & set(bases) & set(areas)):
        kind, base = bases[code]
        world, own = Way(f"EPSG:{code}", "EPSG:4326"), Way(f"EPSG:{code}", f"EPSG:{base}")
        stated, datum = (re.search(rf"\+{key}=(\S+)", strings[code]) for key in ("towgs84", "datum"))
        known = stated[1] if stated else DATUMS.get(datum[1]) if datum else None
        is_grid = not stated and ("+nadgrids=" in strings[code] and "@null" not in strings[code] or datum and datum[1] not in DATUMS)
        if not (world.way and own.way and base in bodies) or is_grid:
            continue
        known = tuple(map(float, known.split(","))) if known else None
        body, meridian = bodies[base]
        shift_by = lambda shift, at: geodetic(turned(shift, geocentric(at, body)), WGS84) if shift else at
        west, south, east, north = areas[code]
        east += 360 * (east < west)
        places, bare, used, is_grid, rim = [], [], collections.Counter(), False, None
        for i in range(25):
            lon, lat = west + (east - west) * (0.08 + 0.21 * (i // 5)), south + (north - south) * (0.08 + 0.21 * (i % 5))
            at = world.go((lon - 360 * (lon > 180), lat), back=True)
            there = at and world.go(at)
            if not there or apart(there, (lon, lat)) > 2000:
                continue
            written, between = world.steps()
            if WRONG in written:
                continue
            if i == 12 and (kind == "g" or code % 8 == 0 or stated and between):
                tried.append((code, *at, *there))
            here = own.go(at) if kind == "p" else at
            here = (here[0] * degrees.get(base, 1) + meridian, here[1] * degrees.get(base, 1))
            if between is None or not (between or "gridshift" in written):
                bare.append((here, there))
                rim = rim or (code, *at, *there)
                continue
            places.append((here, there))
            is_grid |= "gridshift" in written
            if len(between) == 1 and parameters(between[0]) and "gridshift" not in written:
                used[parameters(between[0])] += 1

        def off(shift, among):
            return max((apart(shift_by(shift, here), there) for here, there in among), default=0.0)

        if not places:
            if known and off(known, bare) > NEAR_M:
                lines.append((code, "", math.ceil(off(known, bare))))
            continue
        if rim and known and off(known, bare) > NEAR_M:
            rims.append(rim)
        before = off(known, places)
        if before <= NEAR_M and (before <= 2 or not used):
            continue
        found = used.most_common(1)[0][0] if used else known
        if not is_grid and off(found, places) > NEAR_M:
            fit = fitted(places, body)
            found = fit if off(fit, places) <= 1.5 else found
        rest = off(found, places)
        is_better = found != known and (rest <= NEAR_M or (known and rest < before + 1))
        if is_better or known:
            shown = ",".join(f"{value:.10g}" for value in found) if is_better else ""
            rest = rest if is_better else before
            if shown or rest > NEAR_M:
                lines.append((code, shown, math.ceil(rest) if rest > NEAR_M else 0))
    with open(f"{folder}/shifts.txt", "w") as out:
        out.write("# code|shift to WGS 84, empty where the list of definitions has it|metres by which places may be off\n")
        out.writelines(f"{code}|{shift}|{rest}\n" for code, shift, rest in lines)
    shifted = {code for code, _, _ in lines}
    with open(f"{folder}/../../../tests/crs_places.txt", "w") as out:
        out.write("# code|x or longitude|y or latitude|longitude and latitude of WGS 84 by PROJ\n")
        kept = [place for place in tried if bases[place[0]][0] == "g" or place[0] % 8 == 0 or place[0] in shifted]
        for code, x, y, lon, lat in sorted(kept + rims):
            out.write(f"{code}|{x:.7f}|{y:.7f}|{lon:.9f}|{lat:.9f}\n")
    write_datums(db, strings, {code: shift for code, shift, _ in lines}, folder)


def write_datums(db, strings, shifts, folder):
    owner, own, names = {}, {}, {}
    for code, datum in db.execute("select code, datum_code from geodetic_crs where auth_name = 'EPSG' and type = 'geographic 2D' and datum_auth_name = 'EPSG' order by deprecated, cast(code as int)"):
        owner.setdefault(datum, int(code))
    key = lambda name: re.sub("[^a-z0-9]", "", name.lower())
    for datum, name in db.execute("select code, name from geodetic_datum where auth_name = 'EPSG'"):
        if datum in owner:
            own[owner[datum]] = key(name)
    every = "select code, name from geodetic_datum where auth_name = 'EPSG' union select code, alt_name from alias_name where table_name = 'geodetic_datum' and auth_name = 'EPSG'"
    for datum, name in db.execute(every):
        if datum in owner:
            names.setdefault(key(name), set()).add(owner[datum])
    names = {name: min(codes) for name, codes in names.items() if len(codes) == 1}
    # A name of its own alone tells nothing, unless there is a shift.
    counts = collections.Counter(names.values())
    stated = lambda code: shifts.get(code) or "".join(re.findall(r"\+towgs84=(\S+)", strings.get(code, ""))) or DATUMS.get("".join(re.findall(r"\+datum=(\S+)", strings.get(code, ""))), "")
    is_shifted = lambda code: any(float(value) for value in stated(code).split(",") if value)
    with open(f"{folder}/datums.txt", "w") as out:
        out.write("# name|code\n")
        for name, code in sorted(names.items(), key=lambda entry: (entry[1], entry[0] != own.get(entry[1]), entry[0])):
            if counts[code] > 1 or is_shifted(code):
                out.write(f"{name}|{code}\n")
    bases = dict(db.execute("select cast(code as int), cast(geodetic_crs_code as int) from projected_crs where auth_name = 'EPSG' and geodetic_crs_auth_name = 'EPSG'"))
    with open(f"{folder}/reach.txt", "w") as out:
        out.write("# code|west,south,east,north;... of longitudes and latitudes, and of maps where it is another; empty where the shift is taken everywhere\n")
        lines = {code: reach(code) for code in sorted(strings) if code not in bases and is_shifted(code)}
        of_maps = {code: reach(code) for code, base in sorted(bases.items()) if code in strings and base in lines}
        for code, boxes in sorted({**lines, **of_maps}.items()):
            is_told = bool(boxes) if code in lines else bool(boxes) != bool(lines[bases[code]])
            if is_told:
                out.write(f"{code}|{';'.join(','.join(f'{side:g}' for side in box) for box in boxes)}\n")


main(*sys.argv[1:])
