//! What is asked for, what is kept, and what stands in for what has not come.

use glam::DVec3;
use terrasoar_render::{Gpu, ImageryShape, Pyramid, RenderError, TileId, View};

use super::{SIZE_PX, bare, down, level_ground, show_all};
use crate::support::image::{Image, Texel, drape, give};
use crate::support::landscape::hills;
use crate::support::picture::Picture;
use crate::support::refiner::Square;
use crate::support::scene::Scene;
use crate::{Outcome, Test, ensure};

pub fn tests() -> Vec<(&'static str, Test)> {
    vec![
        ("imagery::ancestors_stand_in_for_missing_tiles", ancestors),
        ("imagery::what_is_wanted_is_what_pixels_need", needed),
        ("imagery::many_tiles_may_be_coarsest", few_levels),
        ("imagery::to_and_fro_in_a_small_pool", to_and_fro),
        ("imagery::what_is_ahead_is_there_in_time", ahead),
        ("imagery::absent_tiles_are_asked_for_once", absent),
        ("imagery::changed_tiles_show_until_they_come_anew", changed),
        ("imagery::wrong_use_is_told", wrong_use),
    ]
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
    let root = Pyramid::of_image(&image.shape).root();
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

    let withheld = TileId { level: 0, x: 2, y: 1 };
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
    let pyramid = Pyramid::of_image(&image.shape);
    let mut uneven =
        View::look_at(DVec3::new(300.0, 200.0, 1100.0), DVec3::new(1300.0, 1700.0, 500.0), SIZE_PX.into());
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
            for tile in (0..east * north).map(|i| TileId { level, x: i % east, y: i / east }) {
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
        let mut coming: Vec<(u32, TileId)> = Vec::new();
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

/// Tiles without image are never asked for again, nor is anything below them, and what is there is not touched.
fn absent(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let image = painted(Image::shape_over(&square.terrain, 0.5));
    drape(&mut scene, &image, 64);
    let view = down(504.0, 504.0, 400.0);
    let pyramid = Pyramid::of_image(&image.shape);
    let gone = TileId { level: 1, x: 0, y: 0 };
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

/// Tiles whose texels changed are asked for anew, coarse before fine and so many a frame; the old ones show until then, and the others are not touched.
fn changed(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    scene.show(&square.down_to(0));
    let shape = Image::shape_over(&square.terrain, 0.5);
    let (before, after) = (painted(shape), Image::new(shape, |_, _, _| LEVELS[5]));
    // Around the meeting point of four of the finest tiles, of which one changes, and all above it.
    let view = down(504.0, 504.0, 80.0);
    let all = (SIZE_PX[0] * SIZE_PX[1]) as usize;
    drape(&mut scene, &before, 64);
    show_all(&mut scene, &before, &view);
    let unchanged = scene.draw(&view, &bare());
    let stats = scene.renderer.imagery_stats();
    let tile = TileId { level: 0, x: 2, y: 1 };
    let elsewhere = TileId { level: 0, x: 0, y: 0 };
    let mut tiles: Vec<_> = (0..Pyramid::of_image(&shape).levels())
        .map(|level| TileId { level, x: tile.x >> level, y: tile.y >> level })
        .collect();
    tiles.push(elsewhere);
    scene.renderer.change_imagery(&tiles);
    tiles.pop();
    tiles.reverse();
    for i in 0..tiles.len() {
        let asked = scene.renderer.want_imagery(&view, 9).to_vec();
        ensure(asked == tiles[i..], || format!("{asked:?} are asked for of {tiles:?}"))?;
        ensure(scene.draw(&view, &bare()) == unchanged, || format!("frame {i} shows another picture"))?;
        give(&mut scene.renderer, &after, &view, 1, |_| false);
    }
    let picture = scene.draw(&view, &bare());
    let (levels, none) = count(&picture);
    ensure(none == 0 && levels[5].abs_diff(all / 4) < 300 && levels[0] + levels[5] == all, || {
        format!("one of four tiles changed: {levels:?}, {none} of no level")
    })?;
    let pairs = picture.rgba.chunks_exact(4).zip(unchanged.rgba.chunks_exact(4));
    let differing = pairs.filter(|(a, b)| a != b).count();
    ensure(differing == levels[5], || format!("{differing} pixels differ, {} are new", levels[5]))?;
    let later = scene.renderer.imagery_stats();
    ensure((later.resident, later.evicted, later.missing) == (stats.resident, stats.evicted, 0), || {
        format!("{later:?}")
    })?;
    // What is absent may come to be.
    scene.renderer.set_imagery_absent(tile).map_err(|e| e.to_string())?;
    ensure(scene.renderer.want_imagery(&view, 9).is_empty(), || "an absent tile is asked for".into())?;
    scene.renderer.change_imagery(&[tile]);
    ensure(scene.renderer.want_imagery(&view, 9) == [tile], || "it stays absent".into())
}

fn wrong_use(gpu: &Gpu) -> Outcome {
    let square = level_ground();
    let mut scene = Scene::new(gpu, &square);
    let tile = TileId { level: 0, x: 0, y: 0 };
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
        // More tiles at the coarsest level than anyone could list.
        ImageryShape { texels: [1 << 29; 2], levels: 1, ..shape },
        // A coarsest level of many tiles in a pool of one.
        ImageryShape { levels: 1, ..shape },
    ] {
        let refused = renderer.set_imagery(&wrong, wrong.format, 1);
        ensure(matches!(refused, Err(RenderError::Usage(_))), || format!("{wrong:?}: {refused:?}"))?;
    }
    renderer.set_imagery(&shape, shape.format, 1).map_err(|e| e.to_string())?;
    let short = renderer.give_imagery(tile, &[0; 7]);
    ensure(matches!(short, Err(RenderError::TileSize { .. })), || format!("{short:?}"))?;
    let nowhere = TileId { level: 0, x: 99, y: 0 };
    let outside = renderer.set_imagery_absent(nowhere);
    ensure(matches!(outside, Err(RenderError::NoSuchTile { .. })), || format!("{outside:?}"))?;
    renderer.clear_imagery();
    ensure(renderer.imagery().is_none() && renderer.imagery_stats() == Default::default(), || {
        "the image is still there".into()
    })
}
