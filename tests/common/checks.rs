//! What must hold of any mesh: no crack, exact cover, one winding, and the tolerance at every sample in view.

use rustc_hash::{FxHashMap, FxHashSet};
use terrasoar::flight::FlightFrame;
use terrasoar::mesh::{Triangle, TriangleKey, has_area, is_drawn, twice_area, with_apex_first};
use terrasoar::refine::Engine;
use terrasoar::view::{ErrorMetric, View, Viewport};
use terrasoar_layout::grid::GridPoint;
use terrasoar_layout::read::store::RecordStore;

pub const VIEWPORT: Viewport = Viewport { width_px: 320, height_px: 240 };

pub fn views(frames: impl IntoIterator<Item = FlightFrame>, tolerance_px: f64) -> Vec<View> {
    frames.into_iter().map(|f| f.view(VIEWPORT, tolerance_px)).collect()
}

/// The same views with errors measured in another way.
pub fn measured(views: &[View], metric: ErrorMetric) -> Vec<View> {
    views.iter().map(|view| view.metric(metric)).collect()
}

pub fn triangles(engine: &impl Engine) -> Vec<Triangle> {
    let mut all = Vec::new();
    engine.for_each_triangle(&mut |t| all.push(t));
    all
}

pub fn keys(triangles: &[Triangle]) -> FxHashSet<TriangleKey> {
    triangles.iter().map(|t| TriangleKey::of(*t)).collect()
}

/// Every triangle once, all counter-clockwise, exactly covering the square, no vertex inside another triangle's edge.
pub fn check_conforming(records: &impl RecordStore, triangles: &[Triangle]) {
    let grid = records.grid();
    let n = i64::from(grid.side_steps());
    assert_eq!(keys(triangles).len(), triangles.len(), "a triangle twice");
    let mut area = 0;
    // Edges that one side has come by.
    let mut open: FxHashMap<(u64, u64), bool> = FxHashMap::default();
    for t in triangles {
        let twice = twice_area(*t);
        assert!(twice > 0, "{t:?} is clockwise or empty");
        area += twice;
        for i in 0..3 {
            let (p, q) = (t[i].packed(), t[(i + 1) % 3].packed());
            // A conforming mesh uses each inner edge once in each direction.
            let edge = (p.min(q), p.max(q));
            match open.remove(&edge) {
                None => drop(open.insert(edge, p < q)),
                Some(upwards) => assert!(upwards != (p < q), "an edge of {t:?} twice in one direction"),
            }
        }
    }
    assert_eq!(area, 2 * n * n, "the square is covered exactly");
    for (p, q) in open.into_keys() {
        let point = |v: u64| GridPoint::new(v as u32, (v >> 32) as u32);
        let (p, q) = (point(p), point(q));
        let on_border = (p.x() == q.x() && (p.x() == 0 || i64::from(p.x()) == n))
            || (p.y() == q.y() && (p.y() == 0 || i64::from(p.y()) == n));
        assert!(on_border, "a crack along {p:?} {q:?}");
    }
    check_drawn_cover(records, triangles);
}

/// What is drawn covers the data, and leaves out only triangles that touch a void.
pub fn check_drawn_cover(records: &impl RecordStore, triangles: &[Triangle]) {
    let grid = records.grid();
    let [wide, high] = grid.samples();
    let twice_data = 2 * i64::from(wide - 1) * i64::from(high - 1);
    let folded = |t: &Triangle| t.map(|p| grid.fold(p));
    let twice_all: i64 = triangles.iter().map(|t| twice_area(folded(t))).sum();
    assert!(triangles.iter().all(|t| twice_area(folded(t)) >= 0), "a folded triangle turns over");
    assert_eq!(twice_all, twice_data, "the data is covered exactly once");
    for t in triangles.iter().filter(|t| has_area(grid, **t)) {
        let drawn = is_drawn(records, *t);
        if drawn {
            assert!(t.iter().all(|p| !records.vertex_at(*p).class.is_void()), "{t:?} has a void corner");
        } else {
            assert!(records.shape().has_voids, "{t:?} is left out without reason");
        }
    }
}

/// The angle between two directions from the eye.
fn angle_rad(a: glam::DVec3, b: glam::DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// Every sample in view is drawn within the tolerance, or hidden by a void within it. Returns the largest error in pixels, as it shows and as it would from the side.
pub fn check_tolerance(records: &impl RecordStore, view: &View, triangles: &[Triangle]) -> [f64; 2] {
    let grid = records.grid();
    let [right, up, forward] = view.axes();
    let tan_y = (view.vertical_fov_rad / 2.0).tan();
    let mut largest_px = [0.0f64; 2];
    let tan_x = tan_y * f64::from(view.viewport.width_px) / f64::from(view.viewport.height_px);
    for t in triangles.iter().filter(|t| has_area(grid, **t)) {
        let folded = t.map(|p| grid.fold(p));
        let corners = t.map(|p| {
            let [x, y] = grid.position_m(p);
            [x, y, records.vertex_at(p).height_m]
        });
        let drawn = is_drawn(records, *t);
        let (x0, x1) =
            (folded.iter().map(|p| p.x()).min().unwrap(), folded.iter().map(|p| p.x()).max().unwrap());
        let (y0, y1) =
            (folded.iter().map(|p| p.y()).min().unwrap(), folded.iter().map(|p| p.y()).max().unwrap());
        let whole = twice_area(folded) as f64;
        for y in y0..=y1 {
            for x in x0..=x1 {
                let p = GridPoint::new(x, y);
                let [a, b, c] = folded;
                let w = [twice_area([p, b, c]), twice_area([a, p, c]), twice_area([a, b, p])];
                if w.iter().any(|w| *w < 0) {
                    continue;
                }
                let sample = records.vertex_at(p);
                let [px, py] = grid.position_m(p);
                let to = glam::DVec3::new(px, py, sample.height_m) - view.eye_m;
                let depth = to.dot(forward);
                let in_view =
                    depth > 0.0 && to.dot(right).abs() <= depth * tan_x && to.dot(up).abs() <= depth * tan_y;
                if !in_view {
                    continue;
                }
                let pixels_a_metre = view.pixels_per_radian() / to.length();
                if drawn {
                    let height = (0..3).map(|i| w[i] as f64 / whole * corners[i][2]).sum::<f64>();
                    let side_px = (sample.height_m - height).abs() * pixels_a_metre;
                    let drawn_at = glam::DVec3::new(px, py, height) - view.eye_m;
                    let shown_px = angle_rad(to, drawn_at) * view.pixels_per_radian();
                    let error_px = if view.metric == ErrorMetric::Ball { side_px } else { shown_px };
                    largest_px = [largest_px[0].max(shown_px), largest_px[1].max(side_px)];
                    assert!(error_px <= view.tolerance_px * (1.0 + 1e-9), "{error_px} px at {p:?} in {t:?}");
                } else if !sample.class.is_void() && w.iter().all(|w| *w > 0) {
                    // Left out for a void: the hole is too large by less than the triangle's longest edge.
                    let [_, b, d] = with_apex_first(*t).map(|p| grid.position_m(p));
                    let edge_m = (b[0] - d[0]).hypot(b[1] - d[1]);
                    assert!(
                        edge_m * pixels_a_metre <= view.tolerance_px * 1.5,
                        "{t:?}: a hole of {edge_m} m"
                    );
                }
            }
        }
    }
    largest_px
}
