//! Where a terrain lies on the globe.

use terrasoar_import::Coordinates;
use terrasoar_layout::file::header::Header;

/// Points on each side that are brought over.
const STEPS: u32 = 32;

/// The terrain's reference system, if it is tied to the ground in a way that is known.
pub(super) fn coordinates(header: &Header) -> Option<Coordinates> {
    let about = &header.about;
    let by_text = || Coordinates::of(&about.crs_text, about.horizontal_unit.as_ref());
    let by_code = || Coordinates::of(&format!("EPSG:{}", header.epsg?), about.horizontal_unit.as_ref());
    by_text().or_else(by_code)
}

/// West, south, east and north of the outermost samples in degrees of WGS 84, or of the body. Across the date line east is beyond 180.
pub(super) fn bounds_deg(header: &Header) -> Option<[f64; 4]> {
    let coordinates = coordinates(header)?;
    let map = header.sample_to_crs?;
    let [columns, rows] = header.grid.samples().map(|count| f64::from(count - 1));
    let at = |x: f64, y: f64| {
        let point = [map[0] + map[1] * x + map[2] * y, map[3] + map[4] * x + map[5] * y];
        coordinates.longitude_latitude(point)
    };
    let [centre, _] = at(columns / 2.0, rows / 2.0)?;
    let mut bounds: Option<[f64; 4]> = None;
    for i in 0..=STEPS {
        let share = f64::from(i) / f64::from(STEPS);
        let (x, y) = (columns * share, rows * share);
        for point in [at(x, 0.0), at(x, rows), at(0.0, y), at(columns, y)] {
            let [mut lon, lat] = point?;
            lon += 360.0 * ((centre - lon) / 360.0).round();
            let [west, south, east, north] = bounds.unwrap_or([lon, lat, lon, lat]);
            bounds = Some([west.min(lon), south.min(lat), east.max(lon), north.max(lat)]);
        }
    }
    bounds
}
