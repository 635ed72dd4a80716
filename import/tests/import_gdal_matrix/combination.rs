//! One way to store a terrain, as a point in the space of ways: format, type of samples, storage, direction of rows, reference system, voids, meaning of numbers.

/// Samples of the usual terrain, wide and high.
pub(crate) const SAMPLES: [usize; 2] = [41, 31];

/// The type in which samples are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Kind {
    Int8,
    Byte,
    UInt16,
    Int16,
    UInt32,
    Int32,
    UInt64,
    Int64,
    /// Whole numbers of 12 bits.
    UInt12,
    Float16,
    Float32,
    Float64,
}

impl Kind {
    pub(crate) const WHOLE: [Self; 8] = [
        Self::Int8,
        Self::Byte,
        Self::UInt16,
        Self::Int16,
        Self::UInt32,
        Self::Int32,
        Self::UInt64,
        Self::Int64,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Int8 => "int8",
            Self::Byte => "uint8",
            Self::UInt16 => "uint16",
            Self::Int16 => "int16",
            Self::UInt32 => "uint32",
            Self::Int32 => "int32",
            Self::UInt64 => "uint64",
            Self::Int64 => "int64",
            Self::UInt12 => "uint12",
            Self::Float16 => "float16",
            Self::Float32 => "float32",
            Self::Float64 => "float64",
        }
    }

    /// GDAL's type that holds it.
    pub(crate) fn gdal(self) -> &'static str {
        match self {
            Self::Int8 | Self::Byte => "Byte",
            Self::UInt16 | Self::UInt12 => "UInt16",
            Self::Int16 => "Int16",
            Self::UInt32 => "UInt32",
            Self::Int32 => "Int32",
            Self::UInt64 => "UInt64",
            Self::Int64 => "Int64",
            Self::Float16 | Self::Float32 => "Float32",
            Self::Float64 => "Float64",
        }
    }

    pub(crate) fn is_real(self) -> bool {
        matches!(self, Self::Float16 | Self::Float32 | Self::Float64)
    }

    /// The number at a place, column from the west and row from the north where the file is north-up: a plane, so that a grid that is turned can be told, with a step that
    /// every type holds.
    pub(crate) fn number(self, col: f64, row: f64) -> f64 {
        let plane = 2.0 * col + 3.0 * row;
        match self {
            Self::Int8 => plane - 90.0,
            Self::Byte => plane + 20.0,
            Self::Int16 | Self::Int64 => plane - 70.0,
            Self::UInt16 | Self::UInt12 | Self::UInt32 | Self::UInt64 => plane + 1200.0,
            Self::Int32 => plane - 411.0,
            Self::Float16 => 0.25 * plane - 12.5,
            Self::Float32 => 0.125 * plane - 3.0625,
            Self::Float64 => 0.1 * plane + 1000.03,
        }
    }

    /// Its bytes, the lowest first, as [`Kind::gdal`] takes them.
    pub(crate) fn bytes(self, number: f64) -> Vec<u8> {
        match self {
            Self::Int8 => vec![(number as i8) as u8],
            Self::Byte => vec![number as u8],
            Self::UInt16 | Self::UInt12 => (number as u16).to_le_bytes().to_vec(),
            Self::Int16 => (number as i16).to_le_bytes().to_vec(),
            Self::UInt32 => (number as u32).to_le_bytes().to_vec(),
            Self::Int32 => (number as i32).to_le_bytes().to_vec(),
            Self::UInt64 => (number as u64).to_le_bytes().to_vec(),
            Self::Int64 => (number as i64).to_le_bytes().to_vec(),
            Self::Float16 | Self::Float32 => (number as f32).to_le_bytes().to_vec(),
            Self::Float64 => number.to_le_bytes().to_vec(),
        }
    }
}

/// Which way columns and rows go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Turn {
    NorthUp,
    SouthUp,
    Mirrored,
    HalfTurned,
    Rotated,
    Sheared,
}

impl Turn {
    pub(crate) const ALL: [Self; 6] =
        [Self::NorthUp, Self::SouthUp, Self::Mirrored, Self::HalfTurned, Self::Rotated, Self::Sheared];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::NorthUp => "north-up",
            Self::SouthUp => "south-up",
            Self::Mirrored => "mirrored",
            Self::HalfTurned => "half turned",
            Self::Rotated => "rotated",
            Self::Sheared => "sheared",
        }
    }

    /// Whether samples lie elsewhere than on a north-up grid.
    pub(crate) fn is_resampled(self) -> bool {
        matches!(self, Self::Rotated | Self::Sheared)
    }

    /// Columns and rows to units of one sample, east and north: [[dx/dcol, dx/drow], [dy/dcol, dy/drow]].
    pub(crate) fn matrix(self) -> [[f64; 2]; 2] {
        match self {
            Self::NorthUp => [[1.0, 0.0], [0.0, -1.0]],
            Self::SouthUp => [[1.0, 0.0], [0.0, 1.0]],
            Self::Mirrored => [[-1.0, 0.0], [0.0, -1.0]],
            Self::HalfTurned => [[-1.0, 0.0], [0.0, 1.0]],
            // By the angle of the triangle of sides 3, 4 and 5.
            Self::Rotated => [[0.8, 0.6], [0.6, -0.8]],
            Self::Sheared => [[1.0, 0.25], [0.0, -1.0]],
        }
    }
}

/// What coordinates count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Unit {
    Metres(f64),
    Degrees,
    /// Metres of the web's Mercator projection, which are longer than those of the ground.
    Mercator,
}

/// A reference system, and where in it the terrain lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct System {
    pub(crate) name: &'static str,
    /// As GDAL takes it; empty for none.
    pub(crate) text: &'static str,
    pub(crate) unit: Unit,
    /// Coordinates of the outer corner of the first sample, and the distance of samples, both in its units.
    pub(crate) corner: [f64; 2],
    pub(crate) step: [f64; 2],
    /// Metres a unit of heights, where the system says it.
    pub(crate) height_unit_m: Option<f64>,
}

/// How voids are marked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Void {
    None,
    /// By the number of the type that [`Void::mark`] tells, stated in the file.
    Declared,
    /// By not-a-number, stated or not.
    Nan,
    InsideMask,
    MaskFile,
    Alpha,
    AuxXml,
    /// By the lowest single, as ESRI writes it.
    Lowest,
}

impl Void {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Declared => "declared value",
            Self::Nan => "not a number",
            Self::InsideMask => "mask inside",
            Self::MaskFile => "mask beside (.msk)",
            Self::Alpha => "alpha",
            Self::AuxXml => "value beside (.aux.xml)",
            Self::Lowest => "lowest single",
        }
    }

    /// The number that stands for no data, if one does.
    pub(crate) fn mark(self, kind: Kind) -> Option<f64> {
        match self {
            Self::Declared | Self::AuxXml => Some(match kind {
                Kind::Int8 => -128.0,
                Kind::Byte => 255.0,
                Kind::UInt16 => 65_535.0,
                Kind::UInt12 => 4095.0,
                Kind::UInt32 | Kind::UInt64 => 4_294_967_295.0,
                Kind::Int16 | Kind::Int64 => -9999.0,
                Kind::Int32 => -2_147_483_648.0,
                Kind::Float16 => -999.0,
                Kind::Float32 => -9999.9,
                Kind::Float64 => -1e30,
            }),
            Self::Nan => Some(f64::NAN),
            Self::Lowest => Some(f64::from(f32::MIN)),
            _ => None,
        }
    }
}

/// What a number means.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Meaning {
    /// The unit's name as the file states it; empty for none.
    pub(crate) unit: &'static str,
    pub(crate) unit_m: f64,
    pub(crate) scale: f64,
    pub(crate) offset: f64,
}

pub(crate) const METRES: Meaning = Meaning { unit: "", unit_m: 1.0, scale: 1.0, offset: 0.0 };

/// A format, and what writes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Format {
    /// Its name for people.
    pub(crate) name: &'static str,
    /// GDAL's driver.
    pub(crate) driver: &'static str,
    /// The ending of its files.
    pub(crate) ending: &'static str,
}

/// A file to be made, read and compared.
#[derive(Debug, Clone)]
pub(crate) struct Combination {
    pub(crate) format: Format,
    pub(crate) kind: Kind,
    /// How samples are stored, for people.
    pub(crate) storage: String,
    /// The same for GDAL: what goes to `-co`.
    pub(crate) creation: Vec<String>,
    pub(crate) turn: Turn,
    pub(crate) system: System,
    pub(crate) is_point: bool,
    pub(crate) void: Void,
    pub(crate) meaning: Meaning,
    pub(crate) samples: [usize; 2],
}

impl Combination {
    pub(crate) fn new(format: Format, kind: Kind, system: System) -> Self {
        Self {
            format,
            kind,
            storage: "plain".into(),
            creation: Vec::new(),
            turn: Turn::NorthUp,
            system,
            is_point: false,
            void: Void::None,
            meaning: METRES,
            samples: SAMPLES,
        }
    }

    pub(crate) fn stored(mut self, storage: &str, creation: &[&str]) -> Self {
        self.storage = storage.into();
        self.creation = creation.iter().map(|&option| option.to_owned()).collect();
        self
    }

    pub(crate) fn turned(self, turn: Turn) -> Self {
        Self { turn, ..self }
    }

    pub(crate) fn with(self, void: Void) -> Self {
        Self { void, ..self }
    }

    pub(crate) fn meaning(self, meaning: Meaning) -> Self {
        Self { meaning, ..self }
    }

    /// The map from columns and rows, counted from the outer corner, to coordinates, as GDAL counts.
    pub(crate) fn map(&self) -> [f64; 6] {
        let [[a, b], [c, d]] = self.turn.matrix();
        let System { corner, step, .. } = self.system;
        [corner[0], a * step[0], b * step[0], corner[1], c * step[1], d * step[1]]
    }

    /// Whether a sample is void, column and row as stored.
    pub(crate) fn is_void(&self, col: usize, row: usize) -> bool {
        let [wide, high] = self.samples;
        self.void != Void::None && [(5, 6), (6, 6), (20, 0), (wide - 1, high - 1)].contains(&(col, row))
    }

    /// Metres a unit of heights: of the band's, else of the system's.
    pub(crate) fn height_unit_m(&self) -> f64 {
        let Meaning { unit, unit_m, .. } = self.meaning;
        if unit.is_empty() { self.system.height_unit_m.unwrap_or(1.0) } else { unit_m }
    }

    /// Metres of height at a place between samples, whatever is void.
    pub(crate) fn height_m(&self, col: f64, row: f64) -> f64 {
        let Meaning { scale, offset, .. } = self.meaning;
        (self.kind.number(col, row) * scale + offset) * self.height_unit_m()
    }

    /// Its name in messages.
    pub(crate) fn name(&self) -> String {
        let Meaning { unit, scale, offset, .. } = self.meaning;
        format!(
            "{} {} {} | {} {}{} | voids {} | unit \"{unit}\" x {scale} + {offset}",
            self.format.name,
            self.kind.name(),
            self.storage,
            self.system.name,
            self.turn.name(),
            if self.is_point { " (points)" } else { "" },
            self.void.name(),
        )
    }
}
