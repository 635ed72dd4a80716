//! MBTiles 1.3: an SQLite database with a table or view `tiles` of zoom, column, row from the south and bytes, and a table `metadata` of names and values.
//!
//! Anybody can make such a file, and SQL in its views runs when it is read. So the database is opened as one that cannot change, with no file beside it; statements may read and
//! count, and nothing else: no recursion, no virtual tables, no functions, nothing that sorts or copies rows ([`refuse_copies`]). A statement has an allowance of steps in proportion to the file. Values have a
//! longest length. Cost: some tens of microseconds a tile.

use super::about::About;
use super::archive::{Archive, Level, Levels};
use super::grid::{MAX_ZOOM, Span, Tile, last};
use crate::input;
use rusqlite::hooks::{AuthAction, AuthContext, Authorization};
use rusqlite::limits::Limit;
use rusqlite::{Connection, Error, ErrorCode, OpenFlags, Params, Row};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use terrasoar_layout::error::LayoutError;

/// Longest value that is read.
const MAX_VALUE_BYTES: i32 = 32 << 20;
/// Steps between two looks at what a statement has left of its allowance.
const STEPS_AT_ONCE: i32 = 1000;
/// Steps that any statement may take, and how many more for each byte of the file: a row of any table has some bytes, and takes some steps.
const STEPS: i64 = 20_000_000;
const STEPS_A_BYTE: i64 = 8;
/// Pairs of metadata that are read.
const PAIRS: usize = 1000;

const COUNT: &str = "SELECT count(*), min(tile_column), max(tile_column), min(tile_row), max(tile_row) FROM tiles \
    WHERE zoom_level = ?1 AND tile_column BETWEEN ?2 AND ?3 AND tile_row BETWEEN ?4 AND ?5";
const SAMPLES: &str = "SELECT tile_column, tile_row FROM tiles \
    WHERE zoom_level = ?1 AND tile_column BETWEEN ?2 AND ?3 AND tile_row BETWEEN ?4 AND ?5 LIMIT 64";
const PLACES: &str = "SELECT tile_column, tile_row FROM tiles \
    WHERE zoom_level = ?1 AND tile_column BETWEEN ?2 AND ?3 AND tile_row BETWEEN ?4 AND ?5";
const HAS: &str = "SELECT 1 FROM tiles WHERE zoom_level = ?1 AND tile_column = ?2 AND tile_row = ?3 LIMIT 1";
const TILE: &str =
    "SELECT tile_data FROM tiles WHERE zoom_level = ?1 AND tile_column = ?2 AND tile_row = ?3 LIMIT 1";
const METADATA: &str = "SELECT name, value FROM metadata";

/// An archive of tiles.
pub(super) struct Mbtiles {
    path: PathBuf,
    about: About,
    database: Mutex<Connection>,
    /// Steps that the statement under way has left.
    left: Arc<AtomicI64>,
    allowance: i64,
}

/// The file's name as SQLite takes it, with a promise that it does not change.
fn uri(path: &Path) -> String {
    let mut uri = "file:".to_owned();
    let text = path.to_string_lossy();
    #[cfg(unix)]
    let bytes = std::os::unix::ffi::OsStrExt::as_bytes(path.as_os_str());
    #[cfg(not(unix))]
    let bytes = text.as_bytes();
    if cfg!(windows) && path.is_absolute() {
        uri.push('/');
    }
    for byte in bytes {
        match byte {
            b'\\' if cfg!(windows) => uri.push('/'),
            b'/' | b'.' | b'-' | b'_' | b':' => uri.push(char::from(*byte)),
            _ if byte.is_ascii_alphanumeric() => uri.push(char::from(*byte)),
            // Writing to a text does not fail.
            _ => _ = write!(uri, "%{byte:02x}"),
        }
    }
    drop(text);
    uri + "?immutable=1"
}

/// What statements may do: read columns, and count.
fn allowed(asked: &AuthContext<'_>) -> Authorization {
    match asked.action {
        AuthAction::Select | AuthAction::Read { .. } => Authorization::Allow,
        AuthAction::Function { function_name } if ["count", "min", "max"].contains(&function_name) => {
            Authorization::Allow
        }
        _ => Authorization::Deny,
    }
}

impl Mbtiles {
    /// Opens the database and reads its metadata.
    pub(super) fn open(path: &Path) -> Result<Self, LayoutError> {
        let file = input::open(path, "cannot open the MBTiles file")?;
        let bytes =
            file.metadata().map_err(|e| LayoutError::io(path, "cannot read the MBTiles file", e))?.len();
        for ending in ["-wal", "-journal"] {
            let mut beside = path.as_os_str().to_owned();
            beside.push(ending);
            if std::fs::metadata(&beside).is_ok_and(|found| found.len() > 0) {
                return Err(LayoutError::unsupported(
                    path,
                    format!(
                        "a program is writing to it, or left it unfinished: {} is beside it; close that program, or finish it with: sqlite3 FILE 'PRAGMA wal_checkpoint(TRUNCATE)'",
                        terrasoar_layout::words::harmless(&PathBuf::from(beside).display().to_string(), 200)
                    ),
                ));
            }
        }
        let flags =
            OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_URI | OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let allowance =
            STEPS.saturating_add(STEPS_A_BYTE.saturating_mul(i64::try_from(bytes).unwrap_or(i64::MAX)));
        let left = Arc::new(AtomicI64::new(allowance));
        let opened = Connection::open_with_flags(uri(path), flags).and_then(|mut database| {
            guard(&mut database, Arc::clone(&left))?;
            Ok(database)
        });
        let database = Mutex::new(opened.map_err(|error| told(path, "header", error))?);
        let mut archive = Self { path: path.to_owned(), about: About::default(), database, left, allowance };
        for statement in [COUNT, SAMPLES, PLACES, HAS, TILE] {
            archive.refuse_copies(statement)?;
        }
        archive.about = archive.read_about()?;
        Ok(archive)
    }

    fn database(&self) -> MutexGuard<'_, Connection> {
        let database = self.database.lock().unwrap_or_else(PoisonError::into_inner);
        // Behind the lock, for another thread's statement would go on with this one's allowance.
        self.left.store(self.allowance, Ordering::Relaxed);
        database
    }

    /// Calls `each` with the rows of a statement, until it wants no more.
    fn rows(
        &self,
        place: &str,
        statement: &str,
        values: impl Params,
        mut each: impl FnMut(&Row<'_>) -> Result<bool, Error>,
    ) -> Result<(), LayoutError> {
        let database = self.database();
        let run = || {
            let mut statement = database.prepare(statement)?;
            let mut rows = statement.query(values)?;
            while let Some(row) = rows.next()? {
                if !each(row)? {
                    break;
                }
            }
            Ok(())
        };
        run().map_err(|error| told(&self.path, place, error))
    }

    /// Refuses a view that sorts rows or keeps copies of them before it gives the first, for that may take any memory.
    fn refuse_copies(&self, statement: &str) -> Result<(), LayoutError> {
        const COPYING: [&str; 5] = ["SorterOpen", "OpenEphemeral", "OpenAutoindex", "OpenDup", "VOpen"];
        let copies = || -> Result<bool, Error> {
            let database = self.database();
            let mut explained = database.prepare(&format!("EXPLAIN {statement}"))?;
            let mut steps = explained.raw_query();
            let mut copies = false;
            while let Some(step) = steps.next()? {
                copies |= COPYING.contains(&&*step.get::<_, String>(1)?);
            }
            Ok(copies)
        };
        if copies().map_err(|error| told(&self.path, "table tiles", error))? {
            return Err(LayoutError::unsupported(
                &self.path,
                "its view of tiles sorts or copies rows, which may take any memory; write the tiles into a table: CREATE TABLE plain AS SELECT * FROM tiles",
            ));
        }
        Ok(())
    }

    fn read_about(&self) -> Result<About, LayoutError> {
        let mut about = About::default();
        let mut pairs = 0;
        let read = self.rows("table metadata", METADATA, [], |row| {
            // Values of other kinds say nothing that is asked for.
            if let (Ok(name), Ok(value)) = (row.get::<_, String>(0), row.get::<_, String>(1)) {
                about.take_pair(&name, &value, "its metadata");
            }
            pairs += 1;
            Ok(pairs < PAIRS)
        });
        match read {
            // Not every maker writes it.
            Err(LayoutError::NotThisFormat { .. }) | Ok(()) => Ok(about),
            Err(error) => Err(error),
        }
    }

    /// A zoom's tiles within a span whose rows are counted from the north.
    fn level(&self, zoom: u8, span: Span) -> Result<Option<Level>, LayoutError> {
        let place = format!("zoom {zoom}");
        let turn = |y: u32| last(zoom) - y;
        let values = values_of(zoom, span);
        let mut found = None;
        self.rows(&place, COUNT, values, |row| {
            let count = u64::try_from(row.get::<_, i64>(0)?).unwrap_or(0);
            if count > 0 {
                let at = |i: usize| row.get::<_, u32>(i).map(|number| number.min(last(zoom)));
                let span = Span { x: [at(1)?, at(2)?], y: [turn(at(4)?), turn(at(3)?)] };
                found = Some(Level { count, span, samples: Vec::new() });
            }
            Ok(true)
        })?;
        let Some(mut level) = found else { return Ok(None) };
        // The first of each half, for they come column by column.
        let middle = level.span.x[0] + (level.span.x[1] - level.span.x[0]) / 2;
        for first in [span.x[0], middle.max(span.x[0])] {
            let values = [values[0], first, values[2], values[3], values[4]];
            self.rows(&place, SAMPLES, values, |row| {
                let (x, y): (u32, u32) = (row.get(0)?, row.get(1)?);
                let tile = Tile { zoom, x, y: turn(y.min(last(zoom))) };
                if !level.samples.contains(&tile) {
                    level.look_at(tile);
                }
                Ok(true)
            })?;
        }
        Ok(Some(level))
    }
}

/// What a statement about a zoom's tiles within a span, whose rows are counted from the north, is asked with.
fn values_of(zoom: u8, span: Span) -> [u32; 5] {
    let turn = |y: u32| last(zoom) - y;
    [u32::from(zoom), span.x[0], span.x[1], turn(span.y[1]), turn(span.y[0])]
}

/// Shuts out all that a database could do beside giving its tiles.
fn guard(database: &mut Connection, left: Arc<AtomicI64>) -> Result<(), Error> {
    for (limit, most) in [
        (Limit::SQLITE_LIMIT_LENGTH, MAX_VALUE_BYTES),
        (Limit::SQLITE_LIMIT_SQL_LENGTH, 1 << 20),
        (Limit::SQLITE_LIMIT_EXPR_DEPTH, 100),
        (Limit::SQLITE_LIMIT_COMPOUND_SELECT, 50),
        (Limit::SQLITE_LIMIT_COLUMN, 500),
        (Limit::SQLITE_LIMIT_VDBE_OP, 100_000),
        (Limit::SQLITE_LIMIT_ATTACHED, 0),
        (Limit::SQLITE_LIMIT_TRIGGER_DEPTH, 1),
        (Limit::SQLITE_LIMIT_WORKER_THREADS, 0),
    ] {
        database.set_limit(limit, most)?;
    }
    // Before anything is read, for reading the schema is work as well.
    database.progress_handler(
        STEPS_AT_ONCE,
        Some(move || left.fetch_sub(STEPS_AT_ONCE.into(), Ordering::Relaxed) < 0),
    )?;
    for (name, value) in [
        ("trusted_schema", 0),
        ("query_only", 1),
        ("cell_size_check", 1),
        ("mmap_size", 0),
        ("automatic_index", 0),
        ("temp_store", 2),
        ("cache_size", -4000),
    ] {
        database.pragma_update(None, name, value)?;
    }
    database.authorizer(Some(|asked: AuthContext<'_>| allowed(&asked)))
}

/// What SQLite says, in words.
fn told(path: &Path, place: &str, error: Error) -> LayoutError {
    let damaged = |words: &str| LayoutError::damaged(path, place, words);
    let code = error.sqlite_error_code();
    match (&error, code) {
        (_, Some(ErrorCode::OperationInterrupted)) => LayoutError::unsupported(
            path,
            format!(
                "{place}: looking for tiles takes far more steps than a file of its size should; it may lack an index: CREATE UNIQUE INDEX tile_index ON tiles (zoom_level, tile_column, tile_row)"
            ),
        ),
        (_, Some(ErrorCode::NotADatabase)) => LayoutError::not_this_format(
            path,
            "this is no SQLite database, or it is encrypted; fetch it again",
        ),
        (Error::SqlInputError { msg: words, .. } | Error::SqliteFailure(_, Some(words)), _)
            if words.contains("not authorized")
                || code == Some(ErrorCode::AuthorizationForStatementDenied) =>
        {
            LayoutError::unsupported(
                path,
                format!(
                    "{place}: its views do more than to join tables, which is not done for safety; write the tiles into a plain table"
                ),
            )
        }
        (_, Some(ErrorCode::TooBig)) => damaged("it holds more bytes than a tile can have; fetch it again"),
        (_, Some(ErrorCode::SystemIoFailure | ErrorCode::CannotOpen | ErrorCode::PermissionDenied)) => {
            damaged("it cannot be read; check the disk, and fetch the file again")
        }
        (Error::SqlInputError { .. }, _) | (Error::SqliteFailure(..), Some(ErrorCode::Unknown)) => {
            LayoutError::not_this_format(
                path,
                format!(
                    "this SQLite database has no {} as MBTiles have; if GDAL knows it, convert it: gdal_translate INPUT output.tif",
                    if place.starts_with("table") { place } else { "table tiles" }
                ),
            )
        }
        _ => damaged("the database is damaged; fetch it again"),
    }
}

impl Archive for Mbtiles {
    fn path(&self) -> &Path {
        &self.path
    }

    fn kind(&self) -> &'static str {
        "MBTiles"
    }

    fn about(&self) -> &About {
        &self.about
    }

    fn rows_in_doubt(&self) -> Option<&'static str> {
        (self.about.from_south == Some(false)).then_some(
            "rows of tiles are counted from the south, as in all MBTiles, though the metadata says xyz; if the ground lies on the other side of the equator, its writer counted from the north",
        )
    }

    fn memory_bytes(&self) -> u64 {
        // Pages, and a tile.
        8 << 20
    }

    fn survey(&self, within: &dyn Fn(u8) -> Option<Span>) -> Result<Levels, LayoutError> {
        let mut levels = Levels::new();
        for zoom in 0..=MAX_ZOOM {
            if let Some(span) = within(zoom)
                && let Some(level) = self.level(zoom, span)?
            {
                levels.insert(zoom, level);
            }
        }
        Ok(levels)
    }

    fn each_span(&self, zoom: u8, within: Span, each: &mut dyn FnMut(Span)) -> Result<(), LayoutError> {
        self.rows(&format!("zoom {zoom}"), PLACES, values_of(zoom, within), |row| {
            let (x, y): (u32, u32) = (row.get(0)?, row.get(1)?);
            each(Span::of(Tile { zoom, x, y: last(zoom) - y.min(last(zoom)) }));
            Ok(true)
        })
    }

    fn has(&self, tile: Tile) -> Result<bool, LayoutError> {
        let mut is_there = false;
        let values = [u32::from(tile.zoom), tile.x, tile.row_from_south()];
        self.rows(&self.label(tile), HAS, values, |_| {
            is_there = true;
            Ok(false)
        })?;
        Ok(is_there)
    }

    fn fetch(&self, tile: Tile, most: u64, into: &mut Vec<u8>) -> Result<bool, LayoutError> {
        let mut length = None;
        let values = [u32::from(tile.zoom), tile.x, tile.row_from_south()];
        self.rows(&self.label(tile), TILE, values, |row| {
            let value = row.get_ref(0)?;
            let bytes = value.as_blob_or_null().unwrap_or_default().unwrap_or_default();
            length = Some(bytes.len() as u64);
            into.clear();
            if bytes.len() as u64 <= most {
                into.extend_from_slice(bytes);
            }
            Ok(false)
        })?;
        match length {
            Some(bytes) if bytes > most => Err(self.too_long(tile, bytes, most)),
            found => Ok(found.is_some()),
        }
    }
}
