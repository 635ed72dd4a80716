//! The image lies where it should, whatever of it is there; and looks as it should.

use glam::DVec3;
use terrasoar_render::{
    Contours, DeviceWatch, FrameView, Gpu, Haze, ImageTileId, ImageryFormat, ImageryShape, Look, RenderError,
    Sun, Surface, Wireframe, wgpu,
};

use crate::support::image::{Image, Texel, drape, encoded, give, in_565, linear_of};
use crate::support::landscape::hills;
use crate::support::picture::Picture;
use crate::support::refiner::Square;
use crate::support::scene::Scene;
use crate::{Outcome, Test, ensure};

pub fn tests() -> Vec<(&'static str, Test)> {
    vec![
        ("imagery::a_checkerboard_lands_on_the_right_metre", checkerboard),
        ("imagery::levels_agree_with_a_filter_on_the_cpu", between_levels),
        ("imagery::ancestors_stand_in_for_missing_tiles", ancestors),
        ("imagery::what_is_wanted_is_what_pixels_need", needed),
        ("imagery::many_tiles_may_be_coarsest", few_levels),
        ("imagery::same_picture_a_thousand_km_from_the_origin", far_away),
        ("imagery::to_and_fro_in_a_small_pool", to_and_fro),
        ("imagery::what_is_ahead_is_there_in_time", ahead),
        ("imagery::no_seam_between_tiles", seams),
        ("imagery::no_image_shows_the_tint", transparent),
        ("imagery::half_transparent_is_half_the_light", half_transparent),
        ("imagery::absent_tiles_are_asked_for_once", absent),
        ("imagery::blocks_look_as_their_texels", blocks),
        ("imagery::a_device_without_blocks_takes_texels", without_blocks),
        ("imagery::flat_views_are_sharp_across_and_calm_along", anisotropy),
        ("imagery::light_does_not_double", light),
        ("imagery::lines_and_edges_lie_over_it", lines),
        ("imagery::wrong_use_is_told", wrong_use),
    ]
}

const SIZE_PX: [u32; 2] = [240, 180];

/// Level ground, 1,280 m a side.
fn level_ground() -> Square {
    Square::new(6, [0, 0], [20.0, 20.0], |_, _| 100.0)
}

/// Straight down from so many metres above the level ground.
fn down(east_m: f64, north_m: f64, above_m: f64) -> FrameView {
    let eye = DVec3::new(east_m, north_m, 100.0 + above_m);
    FrameView { vertical_fov_rad: 0.5, ..FrameView::look_at(eye, eye - DVec3::Z, SIZE_PX) }
}

/// The image's own colours.
fn bare() -> Look {
    Look { imagery: 1.0, shading: 0.0, haze: Haze::Off, morph: false, ..Look::default() }
}

fn show_all(scene: &mut Scene<'_>, image: &Image, view: &FrameView) {
    while give(&mut scene.renderer, image, view, usize::MAX, |_| false) > 0 {}
}

fn pixel(picture: &Picture, x: u32, y: u32) -> [u8; 4] {
    let at = 4 * (y * picture.size_px[0] + x) as usize;
    [0, 1, 2, 3].map(|i| picture.rgba[at + i])
}

/// Where the line of sight through the middle of a pixel meets the level ground, and from how far.
fn ground_of(view: &FrameView, x: u32, y: u32) -> (DVec3, f64) {
    let [tan_x, tan_y] = view.half_tangents();
    let [wide, high] = view.viewport_px.map(f64::from);
    let ray = view.forward
        + view.right * (tan_x * (2.0 * (f64::from(x) + 0.5) / wide - 1.0))
        + view.up * (tan_y * (1.0 - 2.0 * (f64::from(y) + 0.5) / high));
    let at = view.eye_m + ray * ((100.0 - view.eye_m.z) / ray.z);
    (at, at.distance(view.eye_m))
}

/// Largest difference from a picture of the level ground computed here, its texels moved by `moved` for comparison.
fn off(picture: &Picture, view: &FrameView, image: &Image, moved: [f64; 2]) -> f64 {
    let shape = &image.shape;
    let texel_m = (shape.texel_m[0] * shape.texel_m[1]).sqrt();
    let mut most = 0.0_f64;
    for (x, y) in (0..SIZE_PX[1]).flat_map(|y| (0..SIZE_PX[0]).map(move |x| (x, y))) {
        let (at, distance_m) = ground_of(view, x, y);
        let texels = [0, 1].map(|i| (at[i] - shape.origin_m[i]) / shape.texel_m[i] + moved[i]);
        let level = (distance_m / view.pixels_per_radian() / texel_m).log2().max(0.0);
        let [fine, coarse] = [level as u32, level as u32 + 1]
            .map(|l| image.bilinear(l, texels.map(|t| t / f64::from(1 << l))));
        for (i, shown) in pixel(picture, x, y).iter().take(3).enumerate() {
            let expected = fine[i] + (coarse[i] - fine[i]) * level.fract();
            most = most.max((encoded(expected) - f64::from(*shown)).abs());
        }
    }
    most
}

/// Fields of eight finest texels: two dark colours of a chart, brighter ones left to the picture's shoulder.
fn chart(shape: ImageryShape) -> Image {
    Image::new(shape, |level, x, y| {
        let field = 8 >> level.min(3);
        if (x / field + y / field) % 2 == 0 { [200, 60, 30, 255] } else { [20, 90, 160, 255] }
    })
}

/// At an odd place, with texels of odd size and shape, seen so that a texel is some pixels wide and across a tile's border.
fn checkerboard(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let texel_m = [0.73, 0.61];
    let image = chart(ImageryShape {
        format: ImageryFormat::Rgba8,
        texels: [1100, 1301],
        levels: 9,
        origin_m: [210.3, -40.7],
        texel_m,
    });
    drape(&mut scene, &image, 16);
    let view = down(210.3 + 504.0 * 0.73 + 1.1, 504.0 * 0.61 - 47.0, 60.0);
    show_all(&mut scene, &image, &view);
    let picture = scene.draw(&view, &bare());
    let right = off(&picture, &view, &image, [0.0; 2]);
    ensure(right < 3.0, || format!("the picture is off by up to {right:.1} of 255"))?;
    // Edges are four pixels wide, so the test sees far less than half a texel.
    for moved in [[0.1, 0.0], [0.0, 0.1], [-0.1, 0.0], [0.0, -0.1]] {
        let wrong = off(&picture, &view, &image, moved);
        ensure(wrong > 2.0 * right + 3.0, || {
            format!("moved by {moved:?} texels it is off by {wrong:.1} alone")
        })?;
    }
    Ok(())
}

/// A texel between one and four pixels large, seen through two levels at once.
fn between_levels(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    // Rings, filtered by their own formula: every level holds the mean of the one below, in linear light.
    let image = Image::new(Image::shape_over(&square.terrain, 0.5), |level, x, y| {
        let size = f64::from(1 << level);
        let [u, v] = [x, y].map(|c| ((c as f64 + 0.5) * size - 1280.0) / 9.0);
        let fade = (-0.5 * (size / 30.0).powi(2)).exp();
        let wave = 0.35 + 0.3 * fade * (u.hypot(v)).sin();
        // A step of blue from level to level, so that it matters how much of either shows.
        [encoded(wave).round() as u8, encoded(0.7 - wave).round() as u8, 40 + 25 * level as u8, 255]
    });
    drape(&mut scene, &image, 64);
    for above_m in [90.0, 150.0, 240.0, 430.0] {
        let view = down(640.0, 650.0, above_m);
        show_all(&mut scene, &image, &view);
        let picture = scene.draw(&view, &bare());
        let right = off(&picture, &view, &image, [0.0; 2]);
        ensure(right < 4.0, || format!("{above_m} m above it is off by up to {right:.1} of 255"))?;
        let half = off(&picture, &view, &image, [0.5, 0.0]);
        ensure(half > right, || format!("{above_m} m above half a texel makes no difference"))?;
    }
    Ok(())
}

/// One plain colour a level, so that a pixel says which level it is from.
const LEVELS: [Texel; 6] = [
    [180, 30, 30, 255],
    [30, 160, 40, 255],
    [40, 50, 180, 255],
    [150, 150, 30, 255],
    [140, 30, 140, 255],
    [30, 150, 150, 255],
];

fn painted(shape: ImageryShape) -> Image {
    Image::new(shape, |level, _, _| LEVELS[level.min(5) as usize])
}

/// Pixels that are mostly of each level's colour, and those of none.
fn count(picture: &Picture) -> ([usize; 6], usize) {
    let mut levels = [0; 6];
    let mut none = 0;
    for p in picture.rgba.chunks_exact(4) {
        let near = |t: &Texel| (0..3).all(|i| t[i].abs_diff(p[i]) <= 2);
        match LEVELS.iter().position(near) {
            Some(level) => levels[level] += 1,
            None => none += 1,
        }
    }
    (levels, none)
}

fn ancestors(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let image = painted(Image::shape_over(&square.terrain, 0.5));
    drape(&mut scene, &image, 64);
    let root = image.shape.pyramid().root();
    // Around the meeting point of four of the finest tiles.
    let view = down(504.0, 504.0, 80.0);
    let all = (SIZE_PX[0] * SIZE_PX[1]) as usize;
    let look = bare();
    let level_at = |levels: [usize; 6], of: u32| levels[of as usize];

    give(&mut scene.renderer, &image, &view, 1, |_| false);
    let (levels, none) = count(&scene.draw(&view, &look));
    ensure((level_at(levels, root.level), none) == (all, 0), || {
        format!("the root alone: {levels:?}, {none}")
    })?;
    let stats = scene.renderer.imagery_stats();
    ensure(stats.resident == 1 && stats.most_levels_off == root.level, || format!("{stats:?}"))?;

    let withheld = ImageTileId { level: 0, x: 2, y: 1 };
    while give(&mut scene.renderer, &image, &view, usize::MAX, |t| t == withheld) > 0 {}
    let stats = scene.renderer.imagery_stats();
    ensure(stats.missing == 1 && stats.most_levels_off == 1 && stats.ideal_share < 1.0, || {
        format!("{stats:?}")
    })?;
    ensure(scene.renderer.want_imagery(&view, 9) == [withheld], || "another tile is wanted".into())?;
    let (levels, none) = count(&scene.draw(&view, &look));
    // The south-east quarter, but for lines of pixels on its edges.
    ensure(none == 0 && levels[1].abs_diff(all / 4) < 300 && levels[0] + levels[1] == all, || {
        format!("one tile missing: {levels:?}, {none} of no level")
    })?;
    scene.renderer.give_imagery(withheld, &image.tile(withheld)).map_err(|e| e.to_string())?;
    let (levels, _) = count(&scene.draw(&view, &look));
    ensure(levels[0] == all, || format!("with all tiles: {levels:?}"))?;
    let stats = scene.renderer.imagery_stats();
    ensure((stats.missing, stats.most_levels_off, stats.ideal_share) == (0, 0, 1.0), || {
        format!("{stats:?}")
    })?;

    scene.renderer.forget_imagery(withheld);
    ensure(scene.renderer.want_imagery(&view, 9) == [withheld], || "it is not wanted anew".into())
}

/// Every tile of the image on the device makes no other picture than those that the view asked for.
fn needed(gpu: &Gpu) -> Outcome {
    let square = Square::new(7, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let image = painted(Image::shape_over(&square.terrain, 0.5));
    let pyramid = image.shape.pyramid();
    let mut uneven =
        FrameView::look_at(DVec3::new(300.0, 200.0, 1100.0), DVec3::new(1300.0, 1700.0, 500.0), SIZE_PX);
    for exaggeration in [1.0, 1.7] {
        uneven.vertical_exaggeration = exaggeration;
        uneven.eye_m.z *= exaggeration;
        scene.give_tiles(&uneven);
        drape(&mut scene, &image, pyramid.len() as u64);
        show_all(&mut scene, &image, &uneven);
        let wanted = scene.renderer.imagery_stats().resident;
        let asked_for = scene.draw(&uneven, &bare());
        for level in 0..pyramid.levels() {
            let [east, north] = pyramid.across(level);
            for tile in (0..east * north).map(|i| ImageTileId { level, x: i % east, y: i / east }) {
                scene.renderer.give_imagery(tile, &image.tile(tile)).map_err(|e| e.to_string())?;
            }
        }
        let all = scene.renderer.imagery_stats().resident;
        ensure(all as usize == pyramid.len() && wanted < all * 3 / 4, || {
            format!("{wanted} of {all} are wanted")
        })?;
        ensure(scene.draw(&uneven, &bare()) == asked_for, || {
            "pixels need tiles that the view does not want".into()
        })?;
    }
    Ok(())
}

/// A pyramid that ends early keeps all of its coarsest tiles, however small the rest of the pool.
fn few_levels(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let image = painted(ImageryShape { levels: 2, ..Image::shape_over(&square.terrain, 0.5) });
    drape(&mut scene, &image, 10);
    for (east_m, north_m) in [(200.0, 200.0), (1000.0, 300.0), (600.0, 1100.0)] {
        let view = down(east_m, north_m, 90.0);
        show_all(&mut scene, &image, &view);
        let stats = scene.renderer.imagery_stats();
        ensure(stats.resident == 10 && stats.most_levels_off <= 1, || format!("{stats:?}"))?;
        let (_, none) = count(&scene.draw(&view, &bare()));
        ensure(none == 0, || format!("{none} pixels show no level"))?;
    }
    Ok(())
}

fn far_away(gpu: &Gpu) -> Outcome {
    let corner = [65_536 - 64, 65_536 - 64];
    let pictures = [[0, 0], corner].map(|corner| {
        let square = Square::new(6, corner, [16.0, 16.0], hills);
        let start = DVec3::new(f64::from(corner[0]) * 16.0, f64::from(corner[1]) * 16.0, 0.0);
        let image = chart(ImageryShape {
            format: ImageryFormat::Rgba8,
            texels: [1024, 1024],
            levels: 9,
            origin_m: [start.x + 64.0, start.y + 32.0],
            texel_m: [0.75, 0.5],
        });
        let mut scene = Scene::new(gpu, &square);
        scene.show(&square.down_to(0));
        drape(&mut scene, &image, 16);
        [0.0, 1.0 / 256.0, 0.5].map(|further_m| {
            let eye = start + DVec3::new(400.0 + further_m, 300.0, 900.0);
            let view = FrameView::look_at(eye, eye + DVec3::new(0.125, 0.25, -0.5), SIZE_PX);
            show_all(&mut scene, &image, &view);
            scene.draw(&view, &bare())
        })
    });
    for (near, far) in pictures[0].iter().zip(&pictures[1]) {
        ensure(near == far, || format!("the pictures differ by {}", near.difference(far)))?;
    }
    ensure(pictures[0][0] != pictures[0][2], || "half a metre makes no difference".into())
}

/// In a pool that holds about what a view wants: no hole, no frame without end of uploads, none where nothing moves.
fn to_and_fro(gpu: &Gpu) -> Outcome {
    const MOST: usize = 4;
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let image = Image::new(Image::shape_over(&square.terrain, 0.25), |_, _, _| LEVELS[0]);
    let views: Vec<_> = (0..24).map(|i| down(300.0 + 680.0 * f64::from(i) / 23.0, 640.0, 160.0)).collect();
    for tiles in [64, 20, 9] {
        drape(&mut scene, &image, tiles);
        show_all(&mut scene, &image, &views[0]);
        let mut ways = Vec::new();
        for way in 0..6 {
            for i in 0..views.len() {
                let view = &views[if way % 2 == 0 { i } else { views.len() - 1 - i }];
                let given = give(&mut scene.renderer, &image, view, MOST, |_| false);
                ensure(given <= MOST, || format!("{given} uploads in a frame"))?;
                let stats = scene.renderer.imagery_stats();
                ensure(u64::from(stats.resident) <= tiles, || format!("{stats:?}"))?;
            }
            ways.push(scene.renderer.imagery_stats().uploads);
        }
        let each: Vec<u64> = ways.windows(2).map(|w| w[1] - w[0]).collect();
        println!("a pool of {tiles} tiles: {} uploads on the first way, then {each:?}", ways[0]);
        // Where all has room, what the last view of the first way still lacked comes on the second, and no more.
        let few = |n: &u64| *n <= if tiles < 64 { ways[0] } else { 0 };
        ensure(each[0] <= ways[0] && each[1..].iter().all(few), || {
            format!("a pool of {tiles} tiles: {ways:?} uploads after each way")
        })?;
        for view in [&views[11], &views[20]] {
            let (levels, none) = count(&scene.draw(view, &bare()));
            ensure(none == 0, || format!("a pool of {tiles} tiles leaves {none} pixels bare, {levels:?}"))?;
        }
        for _ in 0..30 {
            give(&mut scene.renderer, &image, &views[20], MOST, |_| false);
        }
        let settled = scene.renderer.imagery_stats();
        for _ in 0..30 {
            give(&mut scene.renderer, &image, &views[20], MOST, |_| false);
        }
        let later = scene.renderer.imagery_stats();
        ensure((later.uploads, later.evicted) == (settled.uploads, settled.evicted), || {
            format!("a pool of {tiles} tiles at rest goes from {settled:?} to {later:?}")
        })?;
    }
    Ok(())
}

/// A flight whose next frames are foreseen finds its tiles waiting; one whose are not does not.
fn ahead(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let image = painted(Image::shape_over(&square.terrain, 0.25));
    let view = |frame: u32| down(200.0 + 12.0 * f64::from(frame), 640.0, 90.0);
    let mut late = [0, 0];
    for (foresight, late) in [false, true].into_iter().zip(&mut late) {
        let mut scene = Scene::new(gpu, &square);
        drape(&mut scene, &image, 48);
        show_all(&mut scene, &image, &view(0));
        // What is asked for comes eight frames later.
        let mut coming: Vec<(u32, ImageTileId)> = Vec::new();
        for frame in 1..70 {
            let renderer = &mut scene.renderer;
            let mut asked = renderer.want_imagery(&view(frame), 4).to_vec();
            // What comes into view by then was not foreseen.
            *late += u32::from(frame > 20 && renderer.imagery_stats().ideal_share < 1.0);
            if foresight {
                asked.extend_from_slice(renderer.want_imagery_ahead(&view(frame + 20), 4));
            }
            for tile in asked {
                if !coming.iter().any(|(_, t)| *t == tile) {
                    coming.push((frame + 8, tile));
                }
            }
            for (due, tile) in &coming {
                if *due == frame {
                    renderer.give_imagery(*tile, &image.tile(*tile)).map_err(|e| e.to_string())?;
                }
            }
            coming.retain(|(due, _)| *due > frame);
        }
    }
    ensure(late[1] == 0 && late[0] > 10, || {
        format!("{} frames lack tiles without foresight, {} with", late[0], late[1])
    })
}

/// Slow colours, so that a step between neighbours can only be a seam: straight down, aslant, and where levels pass into another.
fn seams(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let image = Image::new(Image::shape_over(&square.terrain, 0.4), |level, x, y| {
        let [u, v] = [x, y].map(|c| (c as f64 + 0.5) * f64::from(1 << level) / 3200.0);
        [encoded(0.05 + 0.6 * u).round() as u8, encoded(0.05 + 0.6 * v).round() as u8, 40, 255]
    });
    drape(&mut scene, &image, 100);
    let look = bare();
    let middle = 3.0 * 504.0 * 0.4;
    let eye = DVec3::new(middle - 30.0, middle - 260.0, 160.0);
    let aslant = FrameView::look_at(eye, DVec3::new(middle, middle, 100.0), SIZE_PX);
    for (name, view) in [
        ("near", down(middle, middle, 40.0)),
        ("two levels", down(middle, middle, 300.0)),
        ("aslant", aslant),
    ] {
        show_all(&mut scene, &image, &view);
        let picture = scene.draw(&view, &look);
        let mut most = 0;
        for y in 0..SIZE_PX[1] - 1 {
            for x in 0..SIZE_PX[0] - 1 {
                if ground_of(&view, x, y).0.truncate().cmplt(DVec3::splat(1270.0).truncate()).all()
                    && ground_of(&view, x, y).1 < 900.0
                    && ground_of(&view, x, y).0.truncate().min_element() > 5.0
                {
                    let here = pixel(&picture, x, y);
                    for there in [pixel(&picture, x + 1, y), pixel(&picture, x, y + 1)] {
                        most = most.max((0..3).map(|i| here[i].abs_diff(there[i])).max().unwrap_or(0));
                    }
                }
            }
        }
        let allowed = if name == "aslant" { 6 } else { 3 };
        ensure(most <= allowed, || format!("{name}: neighbours differ by {most}"))?;
    }
    Ok(())
}

/// East of the middle the image is transparent, and it ends before the ground does.
fn transparent(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let shape = ImageryShape {
        origin_m: [100.0, 100.0],
        texels: [2160, 2160],
        ..Image::shape_over(&square.terrain, 0.5)
    };
    let image =
        Image::new(shape, |level, x, _| if (x << level) < 1080 { [60, 60, 200, 255] } else { [0; 4] });
    drape(&mut scene, &image, 64);
    let view = FrameView::look_at(DVec3::new(640.0, 640.0, 2400.0), DVec3::new(640.0, 640.0, 0.0), SIZE_PX);
    show_all(&mut scene, &image, &view);
    scene.give_tiles(&view);
    let look = Look { haze: Haze::Off, morph: false, ..Look::default() };
    let tint = scene.draw(&view, &look);
    let photo = scene.draw(&view, &Look { imagery: 1.0, ..look });
    let half = scene.draw(&view, &Look { imagery: 0.5, ..look });
    let depth = scene.depth_m();
    let [tan_x, tan_y] = view.half_tangents();
    let [mut inside, mut outside] = [0, 0];
    for (i, depth_m) in (0..).zip(&depth) {
        let (x, y) = (i % SIZE_PX[0], i / SIZE_PX[0]);
        let across = |p: u32, n: u32, tan: f64| tan * (2.0 * (f64::from(p) + 0.5) / f64::from(n) - 1.0);
        let at = view.eye_m
            + f64::from(*depth_m)
                * (view.forward + view.right * across(x, SIZE_PX[0], tan_x)
                    - view.up * across(y, SIZE_PX[1], tan_y));
        let [a, b, c] = [&tint, &photo, &half].map(|p| pixel(p, x, y));
        let margin_m = 30.0;
        let [east, north] = [at.x - 100.0, at.y - 100.0];
        if *depth_m == 0.0 || !(-80.0..1150.0).contains(&east) || !(-80.0..1150.0).contains(&north) {
            continue;
        }
        let along = (margin_m..1080.0 - margin_m).contains(&north);
        if (margin_m..540.0 - margin_m).contains(&east) && along {
            inside += 1;
            let between =
                (0..3).all(|i| c[i] + 1 >= a[i].min(b[i]) && c[i] <= a[i].max(b[i]).saturating_add(1));
            ensure(b[2] > b[0] && b != a && c != a && c != b && between, || {
                format!("pixel {x}, {y} of the image is {b:?}, {c:?} at half, {a:?} without")
            })?;
        } else if east < -margin_m
            || east > 540.0 + margin_m
            || north < -margin_m
            || north > 1080.0 + margin_m
        {
            outside += 1;
            ensure(a == b && a == c, || format!("pixel {x}, {y} beside the image is {b:?}, not {a:?}"))?;
        }
    }
    ensure(inside > 1000 && outside > 1000, || format!("{inside} pixels inside, {outside} outside"))
}

/// Of every format that has such texels, BC7 of squares of one colour.
fn half_transparent(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let view = down(640.0, 640.0, 1500.0);
    // A height whose colour is too dark for the shoulder.
    let look = Look { tint_range_m: Some([0.0, 9000.0]), rock: 0.0, ..bare() };
    let tint = scene.draw(&view, &Look { imagery: 0.0, ..look });
    let colour = [151, 75, 201, 129];
    for format in gpu.capabilities.imagery_formats().iter().filter(|f| **f != ImageryFormat::Bc1) {
        let shape = ImageryShape { format: *format, ..Image::shape_over(&square.terrain, 1.0) };
        let image = Image::new(shape, move |_, _, _| colour);
        drape(&mut scene, &image, 16);
        show_all(&mut scene, &image, &view);
        let shown = scene.draw(&view, &look);
        let share = 129.0 / 255.0;
        let photo = linear_of(colour);
        for (x, y) in (0..SIZE_PX[1]).flat_map(|y| (0..SIZE_PX[0]).map(move |x| (x, y))) {
            let below = linear_of(pixel(&tint, x, y));
            for (channel, code) in pixel(&shown, x, y).iter().take(3).enumerate() {
                let expected = encoded(share * photo[channel] + (1.0 - share) * below[channel]);
                ensure((expected - f64::from(*code)).abs() < 3.0, || {
                    format!("{format:?}: pixel {x}, {y} is {code} in channel {channel}, not {expected:.1}")
                })?;
            }
        }
    }
    Ok(())
}

/// Tiles without image are never asked for again, nor is anything below them, and what is there is not touched.
fn absent(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let image = painted(Image::shape_over(&square.terrain, 0.5));
    drape(&mut scene, &image, 64);
    let view = down(504.0, 504.0, 400.0);
    let pyramid = image.shape.pyramid();
    let gone = ImageTileId { level: 1, x: 0, y: 0 };
    let mut asked = 0;
    loop {
        let wanted = scene.renderer.want_imagery(&view, 8).to_vec();
        if wanted.is_empty() {
            break;
        }
        for tile in wanted {
            ensure(pyramid.contains(tile) && (tile.level > 0 || tile.parent() != gone), || {
                format!("{tile} is asked for, which lies below an absent one")
            })?;
            if tile == gone {
                asked += 1;
                scene.renderer.set_imagery_absent(tile).map_err(|e| e.to_string())?;
            } else {
                scene.renderer.give_imagery(tile, &image.tile(tile)).map_err(|e| e.to_string())?;
            }
        }
    }
    let stats = scene.renderer.imagery_stats();
    ensure(asked == 1 && stats.absent == 1 && stats.missing == 0 && stats.ideal_share == 1.0, || {
        format!("asked {asked} times: {stats:?}")
    })?;
    // Where it would be, its ancestor shows what there is, here the root's colour.
    let (levels, _) = count(&scene.draw(&view, &bare()));
    ensure(levels[2] > 1000, || format!("{levels:?}"))?;
    scene.renderer.forget_imagery(gone);
    ensure(scene.renderer.want_imagery(&view, 8).first() == Some(&gone), || "it stays absent".into())
}

/// Squares of two colours a block and transparent ones, stored both ways.
fn blocks(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    let view = FrameView::look_at(DVec3::new(300.0, 100.0, 900.0), DVec3::new(700.0, 900.0, 500.0), SIZE_PX);
    scene.show(&square.refine(&view));
    scene.give_tiles(&view);
    let texel = |_: u32, x: i64, y: i64| {
        // Tiles begin at multiples of 504 less 4, so blocks lie the same in all of them.
        let [i, j] = [x.div_euclid(4), y.div_euclid(4)];
        let hash = |seed: i64| ((i * 7919 + j * 104_729 + seed * 31).wrapping_mul(2_654_435_761) >> 7) as u8;
        match (x + 2 * y).rem_euclid(3) {
            0 if hash(9) < 60 => [0; 4],
            0 => in_565([hash(1), hash(2), hash(3)]),
            _ => in_565([hash(4), hash(5), hash(6)]),
        }
    };
    let shape = Image::shape_over(&square.terrain, 1.5);
    let look = Look { imagery: 1.0, ..Look::default() };
    let mut pictures = Vec::new();
    for format in [ImageryFormat::Bc1, ImageryFormat::Rgba8] {
        let image = Image::new(ImageryShape { format, ..shape }, texel);
        drape(&mut scene, &image, 32);
        show_all(&mut scene, &image, &view);
        let stats = scene.renderer.imagery_stats();
        ensure(stats.uploaded_bytes >= stats.uploads * format.tile_bytes() as u64, || format!("{stats:?}"))?;
        pictures.push(scene.draw(&view, &look));
    }
    let most = pictures[0].rgba.iter().zip(&pictures[1].rgba).map(|(a, b)| a.abs_diff(*b)).max();
    ensure(most <= Some(3), || format!("the pictures differ by up to {most:?}"))?;
    // Squares of one colour, in blocks of the other kind.
    let plain = |_: u32, x: i64, y: i64| {
        let [i, j] = [x.div_euclid(4), y.div_euclid(4)];
        [(i * 37 % 200) as u8 | 1, (j * 53 % 200) as u8 | 1, ((i + j) * 11 % 200) as u8 | 1, 255]
    };
    let [seven, raw] = [ImageryFormat::Bc7, ImageryFormat::Rgba8].map(|format| {
        let image = Image::new(ImageryShape { format, ..shape }, plain);
        drape(&mut scene, &image, 32);
        show_all(&mut scene, &image, &view);
        scene.draw(&view, &look)
    });
    let most = seven.rgba.iter().zip(&raw.rgba).map(|(a, b)| a.abs_diff(*b)).max();
    ensure(most <= Some(3), || format!("the pictures of BC7 differ by up to {most:?}"))?;
    let plain = scene.draw(&view, &Look::default());
    ensure(plain.difference(&pictures[0]) > 0.05, || "there is no image to see".into())
}

/// As some phones are: made here by not asking for the feature. The picture is the other device's.
fn without_blocks(gpu: &Gpu) -> Outcome {
    // An adapter of its own: on OpenGL devices of one adapter share what they are made of.
    let Gpu { adapter, mut capabilities, .. } = Gpu::headless_blocking().map_err(|e| e.to_string())?;
    capabilities.texture_compression_bc = false;
    let request = adapter.request_device(&wgpu::DeviceDescriptor {
        label: Some("no blocks"),
        required_limits: adapter.limits(),
        ..Default::default()
    });
    let (device, queue) = pollster::block_on(request).map_err(|e| e.to_string())?;
    let watch = DeviceWatch::install(&device);
    let plain = Gpu { adapter, device, queue, capabilities, watch };
    ensure(plain.capabilities.imagery_formats() == [ImageryFormat::Rgba8], || "it takes blocks".into())?;
    let square = Square::new(6, [0, 0], [20.0, 20.0], hills);
    let view = FrameView::look_at(DVec3::new(300.0, 100.0, 900.0), DVec3::new(700.0, 900.0, 500.0), SIZE_PX);
    let image = chart(Image::shape_over(&square.terrain, 4.0));
    let pictures = [gpu, &plain].map(|gpu| {
        let mut scene = Scene::new(gpu, &square);
        scene.show(&square.refine(&view));
        drape(&mut scene, &image, 32);
        show_all(&mut scene, &image, &view);
        scene.draw(&view, &Look { imagery: 1.0, ..Look::default() })
    });
    ensure(pictures[0] == pictures[1], || {
        format!("they differ by {}", pictures[0].difference(&pictures[1]))
    })?;
    let mut scene = Scene::new(&plain, &square);
    for format in [ImageryFormat::Bc1, ImageryFormat::Bc7] {
        let refused = scene.renderer.set_imagery(Some(ImageryShape { format, ..image.shape }), 1 << 22);
        ensure(refused.is_err_and(|e| e.to_string().contains("RGBA8")), || format!("{format:?} is taken"))?;
    }
    Ok(())
}

/// Stripes along the line of sight stay, stripes across it become their mean, on ground that is seen at some ten degrees.
fn anisotropy(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [80.0, 80.0], |_, _| 100.0);
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let eye = DVec3::new(2560.0, 60.0, 170.0);
    let view = FrameView::look_at(eye, eye + DVec3::new(0.0, 400.0, -70.0), SIZE_PX);
    // At 400 m a texel is a pixel wide, and a pixel six texels long.
    let texel_m = 400.0 / view.pixels_per_radian();
    let shape = Image::shape_over(&square.terrain, texel_m);
    let spread = |picture: &Picture| {
        let row = |y: u32| (60..180).map(move |x| (x, y));
        let shown: Vec<f64> =
            (88..93).flat_map(row).map(|(x, y)| linear_of(pixel(picture, x, y))[1]).collect();
        let mean = shown.iter().sum::<f64>() / shown.len() as f64;
        let most = shown.iter().map(|v| (v - mean).abs()).fold(0.0, f64::max);
        (mean, most)
    };
    let stripes = |along: bool, texels: i64| {
        Image::new(shape, move |level, x, y| {
            let wide = texels >> level;
            let at = if along { x } else { y };
            let value = if wide == 0 { 0.35 } else { 0.1 + 0.5 * (at / wide % 2) as f64 };
            let code = encoded(value).round() as u8;
            [code, code, code, 255]
        })
    };
    let mut measured = Vec::new();
    for (along, texels) in [(true, 4), (false, 1)] {
        let image = stripes(along, texels);
        drape(&mut scene, &image, 64);
        show_all(&mut scene, &image, &view);
        measured.push(spread(&scene.draw(&view, &bare())));
    }
    let [(_, across), (mean, calm)] = [measured[0], measured[1]];
    println!("stripes along: +-{across:.3}; across: {mean:.3} +-{calm:.3}");
    ensure(across > 0.2, || format!("stripes along the line of sight are left at {across:.3} of 0.25"))?;
    ensure(calm < 0.06 && (mean - 0.35).abs() < 0.03, || {
        format!("stripes across it show as {mean:.3} +-{calm:.3} where 0.35 is meant")
    })
}

/// Level ground is the photograph by day; hills have about half the contrast of bare ones, in whatever sun.
fn light(gpu: &Gpu) -> Outcome {
    let sun = |elevation_deg: f32| Sun { elevation_rad: elevation_deg.to_radians(), ..Sun::default() };
    let grey = |shape| Image::new(shape, |_, _, _| [120, 120, 120, 255]);
    let look = Look { shading: 1.0, surface: Surface::Plain, ..bare() };
    let flat = level_ground();
    let mut scene = Scene::new(gpu, &flat);
    scene.show(&flat.down_to(0));
    let image = grey(Image::shape_over(&flat.terrain, 2.0));
    drape(&mut scene, &image, 16);
    let view = down(640.0, 640.0, 500.0);
    show_all(&mut scene, &image, &view);
    for elevation_deg in [35.0, 50.0, 85.0] {
        let shown = pixel(&scene.draw(&view, &Look { sun: sun(elevation_deg), ..look }), 100, 90);
        ensure(shown[..3].iter().all(|c| c.abs_diff(120) <= 1), || {
            format!("level ground is {shown:?} under a sun at {elevation_deg} degrees")
        })?;
    }
    let low = pixel(&scene.draw(&view, &Look { sun: sun(3.0), ..look }), 100, 90);
    ensure(low[0] < 100 && low[0] > 30, || format!("at sunset it is {low:?}"))?;

    let square = Square::new(6, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let image = grey(Image::shape_over(&square.terrain, 2.0));
    drape(&mut scene, &image, 16);
    let view = FrameView::look_at(DVec3::new(640.0, 640.0, 1500.0), DVec3::new(640.0, 640.0, 0.0), SIZE_PX);
    show_all(&mut scene, &image, &view);
    scene.give_tiles(&view);
    for azimuth_deg in [0.0_f32, 120.0, 250.0] {
        let sun = Sun { azimuth_rad: azimuth_deg.to_radians(), ..Sun::default() };
        // Spread of the logarithm of light over the picture.
        let [bare, photo] = [0.0, 1.0].map(|imagery| {
            let picture = scene.draw(&view, &Look { imagery, sun, ..look });
            let logs: Vec<f64> = picture
                .rgba
                .chunks_exact(4)
                .map(|p| linear_of([p[0], p[1], p[2], p[3]])[1].max(1e-3).ln())
                .collect();
            let mean = logs.iter().sum::<f64>() / logs.len() as f64;
            (logs.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / logs.len() as f64).sqrt()
        });
        ensure(photo > 0.4 * bare && photo < 0.65 * bare, || {
            format!("sun from {azimuth_deg}: contrast {photo:.3} on the image, {bare:.3} on bare ground")
        })?;
    }
    Ok(())
}

/// Edges that nobody sees change nothing though triangles have vertices of their own; contours are as dark as on bare ground.
fn lines(gpu: &Gpu) -> Outcome {
    let square = Square::new(6, [0, 0], [20.0, 20.0], hills);
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let image = Image::new(Image::shape_over(&square.terrain, 1.0), |_, _, _| [150, 140, 130, 255]);
    drape(&mut scene, &image, 16);
    let view = FrameView::look_at(DVec3::new(640.0, 640.0, 1500.0), DVec3::new(640.0, 640.0, 0.0), SIZE_PX);
    show_all(&mut scene, &image, &view);
    let look = bare();
    let plain = scene.draw(&view, &look);
    let unseen = Wireframe { opacity: 0.0, ..Wireframe::default() };
    let edges = scene.draw(&view, &Look { wireframe: Some(unseen), ..look });
    ensure(edges.difference(&plain) < 0.001, || format!("unseen edges: {}", edges.difference(&plain)))?;
    let black = Contours { colour: [0.0; 3], opacity: 1.0, interval_m: 40.0, ..Contours::default() };
    let contours = Some(black);
    let on_image = scene.draw(&view, &Look { contours, ..look });
    let on_tint = scene.draw(&view, &Look { contours, imagery: 0.0, ..look });
    let dark = |p: &Picture| p.rgba.chunks_exact(4).filter(|p| p[..3].iter().all(|c| *c < 20)).count();
    let [on_image, on_tint, none] = [&on_image, &on_tint, &plain].map(dark);
    ensure(on_tint > 100 && on_image.abs_diff(on_tint) * 20 < on_tint && none == 0, || {
        format!("{on_image} pixels of lines on the image, {on_tint} on bare ground, {none} without")
    })
}

fn wrong_use(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    let tile = ImageTileId { level: 0, x: 0, y: 0 };
    let renderer = &mut scene.renderer;
    let none = renderer.give_imagery(tile, &[]);
    ensure(matches!(none, Err(RenderError::Usage(_))), || format!("{none:?}"))?;
    let view = down(640.0, 640.0, 100.0);
    ensure(renderer.want_imagery(&view, 9).is_empty(), || "tiles of no image are wanted".into())?;
    let shape = Image::shape_over(&square.terrain, 0.5);
    for wrong in [
        ImageryShape { texels: [0, 5], ..shape },
        ImageryShape { texels: [5, u32::MAX], ..shape },
        ImageryShape { levels: 0, ..shape },
        ImageryShape { texel_m: [1.0, -1.0], ..shape },
        ImageryShape { origin_m: [f64::NAN, 0.0], ..shape },
        // More tiles than anyone could list.
        ImageryShape { texels: [1 << 22; 2], ..shape },
        // A coarsest level of many tiles in a pool of one.
        ImageryShape { levels: 1, ..shape },
    ] {
        let refused = renderer.set_imagery(Some(wrong), 1);
        ensure(matches!(refused, Err(RenderError::Usage(_))), || format!("{wrong:?}: {refused:?}"))?;
    }
    renderer.set_imagery(Some(shape), 1).map_err(|e| e.to_string())?;
    let short = renderer.give_imagery(tile, &[0; 7]);
    ensure(matches!(short, Err(RenderError::TileSize { .. })), || format!("{short:?}"))?;
    let nowhere = ImageTileId { level: 0, x: 99, y: 0 };
    let outside = renderer.set_imagery_absent(nowhere);
    ensure(matches!(outside, Err(RenderError::NoSuchTile { .. })), || format!("{outside:?}"))?;
    renderer.set_imagery(None, 0).map_err(|e| e.to_string())?;
    ensure(renderer.imagery().is_none() && renderer.imagery_stats() == Default::default(), || {
        "the image is still there".into()
    })
}
