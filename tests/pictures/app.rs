//! The program's own scene, taken in as it is.

#![allow(dead_code, reason = "tests use a part of it")]

#[path = "../../src/app/border.rs"]
mod border;
#[path = "../../src/app/drape.rs"]
pub mod drape;
#[path = "../../src/app/feed.rs"]
pub mod feed;
#[path = "../../src/app/full_mesh.rs"]
pub mod full_mesh;
#[path = "../../src/app/options.rs"]
mod options;
#[path = "../../src/app/pending.rs"]
mod pending;
#[path = "../../src/app/repaint.rs"]
pub mod repaint;
#[path = "../../src/app/scene.rs"]
pub mod scene;
#[path = "../../src/app/sight.rs"]
mod sight;
#[path = "../../src/app/streamed.rs"]
pub mod streamed;
#[path = "../../src/app/tile_reader.rs"]
mod tile_reader;
