//! Where the pixels of a file lie on the ground.

use terrasoar_layout::file::header::Header;
use terrasoar_layout::read::window::SampleWindow;

/// Tags of the place: columns and rows from the north to coordinates, at the samples themselves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Place {
    /// Pixel sizes and the first pixel's coordinates: the form that all readers know.
    NorthUp { size: [f64; 2], first: [f64; 2] },
    /// A matrix: x = m0 col + m1 row + m2, y = m3 col + m4 row + m5.
    Matrix([f64; 6]),
}

impl Place {
    /// The place of a window; in metres from the terrain's south-west sample, where nothing else is known.
    pub(super) fn of(header: &Header, window: &SampleWindow) -> Self {
        let [dx, dy] = header.grid.spacing_m();
        let [x, x_east, x_north, y, y_east, y_north] =
            header.sample_to_crs.unwrap_or([0.0, dx, 0.0, 0.0, 0.0, dy]);
        let step = f64::from(window.step);
        // The north-west sample.
        let [east, north] = [window.from[0], window.last()[1]].map(f64::from);
        let first = [x + x_east * east + x_north * north, y + y_east * east + y_north * north];
        if x_north == 0.0 && y_east == 0.0 && x_east > 0.0 && y_north > 0.0 {
            return Self::NorthUp { size: [x_east * step, y_north * step], first };
        }
        Self::Matrix([x_east * step, -x_north * step, first[0], y_east * step, -y_north * step, first[1]])
    }
}
