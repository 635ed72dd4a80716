#!/usr/bin/env python3
"""Makes import/src/crs/registry/*.txt: systems of the EPSG dataset that crate crs-definitions lacks, from PROJ's copy of it.

Needs PROJ's proj.db and gdalsrsinfo. Usage: make-crs-tables.py PROJ_DB CRS_DEFINITIONS_DEFS_RS FOLDER
"""
import re
import sqlite3
import subprocess
import sys

proj_db, defs, folder = sys.argv[1:]
listed = {int(m[1]): m for m in re.finditer(r'^EPSG_(\d+)\|\d+\|"([^"]*)"\|r#"(.*)"#\|', open(defs).read(), re.M)}
# Some have a PROJ string and no text.
known = {code for code, m in listed.items() if m[3]}
db = sqlite3.connect(proj_db)


def write(name, head, lines):
    with open(f"{folder}/{name}", "w") as out:
        out.write(head + "\n")
        out.writelines(line + "\n" for line in lines)


axis = (
    "join axis a on a.coordinate_system_auth_name = v.coordinate_system_auth_name "
    "and a.coordinate_system_code = v.coordinate_system_code "
    "join unit_of_measure u on u.auth_name = a.uom_auth_name and u.code = a.uom_code "
)
rows = db.execute(
    f"select v.code, v.name, u.name, u.conv_factor, a.orientation from vertical_crs v {axis} where v.auth_name = 'EPSG' order by cast(v.code as int)"
)
write("vertical.txt", "# code|name|unit|metres|direction", [f"{c}|{n}|{u}|{repr(f)}|{o}" for c, n, u, f, o in rows])

rows = db.execute(
    "select code, horiz_crs_code, vertical_crs_code, name from compound_crs "
    "where auth_name = 'EPSG' and horiz_crs_auth_name = 'EPSG' and vertical_crs_auth_name = 'EPSG' order by cast(code as int)"
)
write("compound.txt", "# code|horizontal|vertical|name", ["|".join(map(str, row)) for row in rows])

rows = db.execute(
    "select code, name, type, conv_factor from unit_of_measure where auth_name = 'EPSG' and type in ('length', 'angle') "
    "and conv_factor > 0 order by cast(code as int)"
)
write("units.txt", "# code|name|type|metres or radians", [f"{c}|{n}|{t}|{repr(f)}" for c, n, t, f in rows])

datums = {
    str(code): name
    for code, name in db.execute(
        "select g.code, d.name from geodetic_crs g join geodetic_datum d on d.auth_name = g.datum_auth_name and d.code = g.datum_code "
        "where g.auth_name = 'EPSG'"
    )
}
bases = {str(code): str(base) for code, base in db.execute("select code, geodetic_crs_code from projected_crs where auth_name = 'EPSG'")}
methods = {
    str(code): method
    for code, method in db.execute(
        "select p.code, c.method_name from projected_crs p join conversion c on c.auth_name = p.conversion_auth_name and c.code = p.conversion_code "
        "where p.auth_name = 'EPSG'"
    )
}

lines = []
systems = list(db.execute("select code, name, 'p' from projected_crs where auth_name = 'EPSG'")) + list(
    db.execute("select code, name, 'g' from geodetic_crs where auth_name = 'EPSG' and type <> 'geocentric'")
)
for code, name, kind in sorted(systems, key=lambda row: int(row[0])):
    if int(code) in known:
        continue
    said = subprocess.run(["gdalsrsinfo", "-o", "proj4", f"EPSG:{code}"], capture_output=True, text=True)
    proj = listed[int(code)][2] if int(code) in listed else said.stdout.strip()
    # PROJ before 9.2 leaves out of its strings that this one is drawn on a sphere.
    if methods.get(str(code)) == "Lambert Azimuthal Equal Area (Spherical)" and "+R_A" not in proj:
        proj = proj.replace("+proj=laea", "+proj=laea +R_A")
    # It keeps PROJ from its file of defaults, of which there is none here.
    proj = proj.replace(" +no_defs", "")
    datum = datums.get(bases.get(str(code), str(code)), "")
    wkt = subprocess.run(["gdalsrsinfo", "-o", "wkt2", "--single-line", f"EPSG:{code}"], capture_output=True, text=True).stdout
    word = "LENGTHUNIT" if kind == "p" else "ANGLEUNIT"
    units = re.findall(word + r'\["([^"]*)",([0-9.eE+-]+)', wkt)
    if units:
        lines.append(f"{code}|{name}|{kind}|{units[-1][0]}|{units[-1][1]}|{datum}|{proj}")
write("missing.txt", "# code|name|kind|unit|metres or radians|datum|PROJ string", lines)
