//! MBTiles that are damaged, unusual, or made to do harm.

use crate::hostile::refused;
use crate::make::{Tiles, mapbox, mbtiles, tiles};
use crate::read;
use rusqlite::Connection;
use std::path::{Path, PathBuf};
use tempfile::tempdir;
use terrasoar_import::TileOptions;

fn flat() -> Tiles {
    tiles(5, 10..13, 8..10, 16, |col, row| mapbox((col + row) as i64))
}

/// A database of some statements.
fn database(folder_of: &Path, name: &str, statements: &str) -> PathBuf {
    let path = folder_of.join(format!("{name}.mbtiles"));
    let made = Connection::open(&path).unwrap();
    made.execute_batch(statements).unwrap();
    made.close().unwrap();
    path
}

#[test]
fn databases_without_plain_tables_of_pictures_are_refused() {
    let folder_of = tempdir().unwrap();
    let columns = "SELECT x AS zoom_level, x AS tile_column, x AS tile_row, x AS tile_data";
    for (name, statements, wanted) in [
        (
            "recursion",
            format!("CREATE VIEW tiles AS WITH RECURSIVE a(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM a) {columns} FROM a"),
            "do more than to join tables",
        ),
        (
            "function",
            "CREATE VIEW tiles AS SELECT 5 AS zoom_level, 1 AS tile_column, 1 AS tile_row, randomblob(2000000000) AS tile_data".into(),
            "do more than to join tables",
        ),
        (
            "sorted",
            format!("CREATE TABLE t (x); CREATE VIEW tiles AS {columns} FROM (SELECT a.x FROM t a, t b ORDER BY b.x LIMIT 1000)"),
            "sorts or copies rows",
        ),
        ("itself", "CREATE VIEW tiles AS SELECT * FROM b; CREATE VIEW b AS SELECT * FROM tiles".into(), ""),
        ("no tiles", "CREATE TABLE other (x)".into(), "no table tiles as MBTiles have"),
        ("no column", "CREATE TABLE tiles (zoom_level, tile_column)".into(), "no table tiles as MBTiles have"),
        (
            "empty",
            "CREATE TABLE tiles (zoom_level, tile_column, tile_row, tile_data)".into(),
            "there are no tiles in it",
        ),
        (
            "vectors",
            "CREATE TABLE metadata (name, value); INSERT INTO metadata VALUES ('format', 'pbf'); \
             CREATE TABLE tiles (zoom_level, tile_column, tile_row, tile_data)"
                .into(),
            "its tiles are pbf",
        ),
    ] {
        let words = refused(&database(folder_of.path(), name, &statements));
        assert!(words.contains(wanted), "{name}: {words}");
    }
}

#[test]
fn a_join_without_end_stops() {
    let folder_of = tempdir().unwrap();
    let path = database(
        folder_of.path(),
        "product",
        "CREATE TABLE t (x); WITH RECURSIVE a(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM a LIMIT 300) INSERT INTO t SELECT x FROM a; \
         CREATE VIEW tiles AS SELECT 5 AS zoom_level, a.x AS tile_column, b.x AS tile_row, c.x AS tile_data FROM t a, t b, t c, t d, t e",
    );
    let words = refused(&path);
    assert!(words.contains("far more steps than a file of its size should"), "{words}");
}

#[test]
fn values_of_other_kinds_are_damage_or_missing() {
    let folder_of = tempdir().unwrap();
    let table = "CREATE TABLE tiles (zoom_level, tile_column, tile_row, tile_data); INSERT INTO tiles VALUES";
    for (name, values, wanted) in [
        ("text", "(5, 10, 20, 'a text')", "it is empty"),
        ("null", "(5, 10, 20, NULL)", "it is empty"),
        ("far", "(5, 10, 2000000000000, x'00')", "there are no tiles in it"),
        ("negative", "(5, -1, 20, x'00')", "there are no tiles in it"),
        ("deep", "(31, 10, 20, x'00')", "there are no tiles in it"),
        ("real", "(5, 10.5, 20, x'00')", "damaged"),
        ("large", "(5, 10, 20, zeroblob(40000000))", "more bytes than a tile can have"),
        ("long", "(5, 10, 20, zeroblob(30000000))", ""),
    ] {
        let path = database(folder_of.path(), name, &format!("{table} {values}"));
        let words = refused(&path);
        assert!(words.contains(wanted), "{name}: {words}");
    }
}

#[test]
fn nothing_appears_beside_a_database_and_what_is_unfinished_is_not_read() {
    let folder_of = tempdir().unwrap();
    let path = folder_of.path().join("a%20?b#c.mbtiles");
    mbtiles(&path, &flat(), &[("name", "a")], false);
    let before = std::fs::read(&path).unwrap();
    let grid = read(&path, Some("mapbox"), TileOptions::default()).unwrap();
    assert_eq!(grid.info.samples_wide, 48);
    assert_eq!(std::fs::read_dir(folder_of.path()).unwrap().count(), 1);
    assert_eq!(std::fs::read(&path).unwrap(), before);

    // A database that another program has open, with changes in its log.
    let writer = Connection::open(&path).unwrap();
    writer.execute_batch("PRAGMA journal_mode = WAL; INSERT INTO metadata VALUES ('b', 'c');").unwrap();
    let words = refused(&path);
    assert!(words.contains("-wal is beside it"), "{words}");
    writer.close().unwrap();
    // Its log is gone with it, and the file that once had one is read as any other.
    assert_eq!(read(&path, Some("mapbox"), TileOptions::default()).unwrap().info.samples_wide, 48);
    assert_eq!(std::fs::read_dir(folder_of.path()).unwrap().count(), 1);
}

#[test]
fn damage_anywhere_ends_in_words_or_in_heights_of_the_tiles() {
    let folder_of = tempdir().unwrap();
    let path = folder_of.path().join("a.mbtiles");
    mbtiles(&path, &flat(), &[("name", "a")], true);
    let sound = std::fs::read(&path).unwrap();
    let grid = read(&path, Some("mapbox"), TileOptions::default()).unwrap();
    let [low, high] = [
        grid.samples.iter().copied().fold(f64::INFINITY, f64::min),
        grid.samples.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    ];
    let mut were_read = 0;
    for i in 0..200 {
        let mut bytes = sound.clone();
        let at = (i * 7919) % bytes.len();
        bytes[at] ^= 1 << (i % 8);
        bytes[(at + 4096) % sound.len()] = 255;
        std::fs::write(&path, &bytes).unwrap();
        match read(&path, Some("mapbox"), TileOptions::default()) {
            Err(error) => assert!(!error.to_string().is_empty()),
            // A tile may be lost, or may have come to another place or zoom, but its heights are whole.
            Ok(grid) => {
                let is_one = |height: &f64| height.is_nan() || (low..=high).contains(height);
                assert!(grid.samples.iter().all(is_one), "{i}");
                were_read += 1;
            }
        }
    }
    assert!(were_read > 20, "{were_read}");
    std::fs::write(&path, &sound[..sound.len() / 3]).unwrap();
    assert!(!refused(&path).is_empty());
}
