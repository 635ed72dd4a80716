//! JPEG XL (ISO/IEC 18181): what a stream says of its picture, and the picture, decoded by jxl-oxide as a whole.
//!
//! Invariant: the decoder takes no more memory than [`Frame::memory_bytes`], which follows from the header: what it asks for beyond that is refused. A colour profile is compared with its limit
//! before, for it may unpack to any length. Boxes beside the stream are not read ([`container`]). Cost: some 30 bytes a texel while decoding, by one thread.

mod container;

pub(crate) use container::is_jxl;

use container::Stream;
use jxl_bitstream::Bitstream;
use jxl_oxide::image::BitDepth;
use jxl_oxide::{
    AllocTracker, EnumColourEncoding, ExtraChannelType, ImageHeader, InitializeResult, JxlImage,
    JxlThreadPool, Render, RenderingIntent,
};
use jxl_oxide_common::Bundle;
use std::error::Error;
use std::io::{Cursor, Read, Seek};

/// Bytes of a stream in which its header ends.
const MAX_HEADER_BYTES: u64 = 64 << 10;
/// Bytes read at once.
const READ_BYTES: usize = 1 << 16;
/// Longest colour profile, as it is packed.
const MAX_PROFILE_BYTES: u64 = 2 << 20;
/// Frames of a picture: its layers, and those that they are made with.
const MAX_FRAMES: usize = 64;
/// Memory of a texel while it is decoded: of its colours, and of each channel beside them.
const TEXEL_BYTES: u64 = 30;
const EXTRA_BYTES: u64 = 10;
/// Memory of tables and of the work on groups of texels, and of a profile.
const WORK_BYTES: u64 = 8 << 20;
const PROFILE_BYTES: u64 = 32 << 20;

/// Why there is no picture.
#[derive(Debug)]
pub(crate) enum Trouble {
    Io(std::io::Error),
    Damaged(&'static str),
    Unsupported(&'static str),
}

impl From<std::io::Error> for Trouble {
    fn from(error: std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::UnexpectedEof => Self::Damaged("it is cut short"),
            std::io::ErrorKind::InvalidData => Self::Damaged("a box of it is damaged"),
            _ => Self::Io(error),
        }
    }
}

type Boxed = Box<dyn Error + Send + Sync>;

impl From<Boxed> for Trouble {
    fn from(error: Boxed) -> Self {
        let error = match error.downcast::<std::io::Error>() {
            Ok(io) => return (*io).into(),
            Err(error) => error,
        };
        // The decoder keeps the reason in words alone.
        match error.to_string().contains("failed to allocate") {
            true => {
                Self::Unsupported("its decoding takes more memory than that of a plain picture of its size")
            }
            false => Self::Damaged("its JPEG XL stream is damaged"),
        }
    }
}

/// What the numbers of a channel are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Depth {
    /// Whole numbers of so many bits.
    Whole(u32),
    /// Reals of so many bits, of which 1 is white.
    Real(u32),
}

impl Depth {
    fn of(depth: BitDepth) -> Self {
        match depth {
            BitDepth::IntegerSample { bits_per_sample } => Self::Whole(bits_per_sample),
            BitDepth::FloatSample { bits_per_sample, .. } => Self::Real(bits_per_sample),
        }
    }

    /// The number that is white.
    pub(crate) fn white(self) -> f32 {
        match self {
            Self::Whole(bits) => ((1u64 << bits.min(32)) - 1) as f32,
            Self::Real(_) => 1.0,
        }
    }
}

/// What is said of a picture before it is decoded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Frame {
    /// Columns and rows as they are stored.
    stored: [u32; 2],
    /// As of EXIF.
    orientation: u32,
    /// 1 or 3.
    pub(crate) colours: usize,
    pub(crate) depth: Depth,
    /// What each channel beside the colours is.
    pub(crate) extra: Vec<Extra>,
    /// Whether it is stored as people see, and so lossy.
    pub(crate) is_lossy: bool,
    has_profile: bool,
}

/// A channel beside the colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Extra {
    /// Alpha; and whether the colours were multiplied by it.
    Alpha(bool),
    /// The black of inks.
    Black,
    Other(Depth),
}

impl Frame {
    /// Reads the header.
    pub(crate) fn read(input: impl Read + Seek) -> Result<Self, Trouble> {
        let mut head = Vec::new();
        Stream::begin(input)?.take(MAX_HEADER_BYTES).read_to_end(&mut head)?;
        let damaged = |error: jxl_bitstream::Error| match error.unexpected_eof() {
            true => Trouble::Damaged("it is cut short"),
            false => Trouble::Damaged("its header is damaged"),
        };
        let mut bits = Bitstream::new(&head);
        let header = ImageHeader::parse(&mut bits, ()).map_err(damaged)?;
        let frame = Self::of(&header);
        if frame.has_profile && bits.read_u64().map_err(damaged)? > MAX_PROFILE_BYTES {
            return Err(Trouble::Unsupported("its colour profile is longer than 2 MiB"));
        }
        if frame.stored.contains(&0) {
            return Err(Trouble::Damaged("it has no texels"));
        }
        if header.metadata.animation.is_some() {
            return Err(Trouble::Unsupported("it moves, and a picture does not"));
        }
        Ok(frame)
    }

    fn of(header: &ImageHeader) -> Self {
        let metadata = &header.metadata;
        let extra = metadata.ec_info.iter().map(|extra| match extra.ty {
            ExtraChannelType::Alpha { alpha_associated } => Extra::Alpha(alpha_associated),
            ExtraChannelType::Black => Extra::Black,
            _ => Extra::Other(Depth::of(extra.bit_depth)),
        });
        Self {
            stored: [header.size.width, header.size.height],
            orientation: metadata.orientation,
            colours: if metadata.grayscale() { 1 } else { 3 },
            depth: Depth::of(metadata.bit_depth),
            extra: extra.collect(),
            is_lossy: metadata.xyb_encoded,
            has_profile: metadata.colour_encoding.want_icc(),
        }
    }

    /// Columns and rows as they are shown: the standard has a decoder turn the picture.
    pub(crate) fn size(&self) -> [u32; 2] {
        let [wide, high] = self.stored;
        if self.orientation >= 5 { [high, wide] } else { [wide, high] }
    }

    /// The first channel of alpha that is a picture's; whether the colours were multiplied by it.
    pub(crate) fn alpha(&self) -> Option<bool> {
        self.extra.iter().find_map(|extra| match extra {
            Extra::Alpha(is_multiplied) => Some(*is_multiplied),
            _ => None,
        })
    }

    /// Whether its colours are inks.
    pub(crate) fn is_press(&self) -> bool {
        self.extra.contains(&Extra::Black)
    }

    /// Memory that decoding takes at most of a stream that is so many bytes long.
    pub(crate) fn memory_bytes(&self, length: u64) -> u64 {
        // Work is on groups, which reach beyond the picture.
        let [wide, high] = self.stored.map(|side| u64::from(side) + 8);
        let profile = if self.has_profile { PROFILE_BYTES } else { 0 };
        let texels = wide.saturating_mul(high).saturating_mul(texel_bytes(self.extra.len() as u64));
        texels.saturating_add(2 * length).saturating_add(WORK_BYTES + profile)
    }
}

/// Memory of a texel that has so many channels beside its colours.
fn texel_bytes(extra: u64) -> u64 {
    TEXEL_BYTES + EXTRA_BYTES * extra
}

/// Memory that [`chunk`] takes at most, of so many texels of so many channels in a stream of so many bytes.
pub(crate) fn chunk_bytes(texels: u64, channels: u64, length: u64) -> u64 {
    // All channels side by side as reals, and as bytes of the type.
    let texel = texel_bytes(channels) + 8 * channels;
    texels.saturating_mul(texel).saturating_add(2 * length).saturating_add(WORK_BYTES)
}

/// Decodes a picture of so many texels and channels into samples of `depth`, all channels of a texel side by side: whole numbers of 8 or 16 bits, reals of 32, little-endian. Rows may be
/// `high` or fewer, but not fewer than `rows`.
pub(crate) fn chunk(
    packed: &[u8],
    [wide, high, rows]: [u32; 3],
    channels: usize,
    depth: Depth,
) -> Result<Vec<u8>, Trouble> {
    let frame = Frame::read(Cursor::new(packed))?;
    let is_alike = frame.stored[0] == wide && (rows..=high).contains(&frame.stored[1]);
    let is_of_depth = frame.extra.iter().all(|extra| match extra {
        Extra::Other(other) => *other == depth,
        _ => true,
    });
    if !is_alike || frame.orientation != 1 || frame.colours + frame.extra.len() != channels {
        return Err(Trouble::Damaged("its JPEG XL is of another size or of other channels than the image"));
    }
    if frame.depth != depth || !is_of_depth {
        return Err(Trouble::Damaged("its JPEG XL is of other samples than the image"));
    }
    if frame.has_profile {
        return Err(Trouble::Unsupported("its JPEG XL has a colour profile"));
    }
    let render = decode(Cursor::new(packed), packed.len() as u64, &frame, As::Stored).map_err(|trouble| {
        match (trouble, depth) {
            // Differences of reals of both signs, as whole numbers, are larger than the format's. libjxl cuts them in one way, and other decoders in another.
            (Trouble::Damaged(_), Depth::Real(_)) => Trouble::Damaged(
                "its JPEG XL stream is damaged, or has positive and negative reals side by side as only libjxl reads them",
            ),
            (trouble, _) => trouble,
        }
    })?;
    let all = render.image_all_channels();
    if [all.width(), all.height(), all.channels()] != [wide as usize, frame.stored[1] as usize, channels] {
        return Err(Trouble::Damaged("its JPEG XL is of another size or of other channels than the image"));
    }
    let white = depth.white();
    let whole = |share: &f32| (share * white).round();
    Ok(match depth {
        Depth::Whole(..=8) => all.buf().iter().map(|share| whole(share) as u8).collect(),
        Depth::Whole(_) => all.buf().iter().flat_map(|share| (whole(share) as u16).to_le_bytes()).collect(),
        Depth::Real(_) => all.buf().iter().flat_map(|share| share.to_le_bytes()).collect(),
    })
}

/// What becomes of colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum As {
    /// They are shown: brought into sRGB, unless they have a profile of their own.
    Shown,
    /// They stay as they are.
    Stored,
}

/// Decodes a picture of `wanted`'s header, in a stream that is so many bytes long.
pub(crate) fn decode(
    mut input: impl Read + Seek,
    length: u64,
    wanted: &Frame,
    as_what: As,
) -> Result<Render, Trouble> {
    if Frame::read(&mut input)? != *wanted {
        return Err(Trouble::Damaged("the file changed while it was read"));
    }
    input.seek(std::io::SeekFrom::Start(0))?;
    let most = usize::try_from(wanted.memory_bytes(length)).unwrap_or(usize::MAX);
    let mut image = load(Stream::begin(input)?, most)?;
    if image.num_loaded_keyframes() != 1 {
        return Err(Trouble::Unsupported("it is made of several pictures"));
    }
    if as_what == As::Shown && !wanted.has_profile {
        let intent = RenderingIntent::Relative;
        let shown = match wanted.colours {
            1 => EnumColourEncoding::gray_srgb(intent),
            _ => EnumColourEncoding::srgb(intent),
        };
        image.request_color_encoding(shown);
    }
    Ok(image.render_frame(0)?)
}

/// Gives all of a stream to a decoder that takes so much memory at most.
fn load(mut stream: impl Read, most: usize) -> Result<JxlImage, Trouble> {
    let builder =
        JxlImage::builder().pool(JxlThreadPool::none()).alloc_tracker(AllocTracker::with_limit(most));
    let (mut blank, mut image) = (Some(builder.build_uninit()), None::<JxlImage>);
    let mut bytes = vec![0; READ_BYTES];
    let mut held = 0;
    while !image.as_ref().is_some_and(JxlImage::is_loading_done) {
        let read = stream.read(&mut bytes[held..])?;
        if read == 0 {
            return Err(Trouble::Damaged("it is cut short"));
        }
        held += read;
        let used = match (&mut image, blank.take()) {
            (Some(image), _) => image.feed_bytes(&bytes[..held])?,
            (None, Some(mut uninit)) => {
                let used = uninit.feed_bytes(&bytes[..held])?;
                match uninit.try_init()? {
                    InitializeResult::NeedMoreData(uninit) => blank = Some(uninit),
                    InitializeResult::Initialized(ready) => image = Some(ready),
                }
                used
            }
            (None, None) => return Err(Trouble::Damaged("it is cut short")),
        };
        bytes.copy_within(used..held, 0);
        held -= used;
        if image.as_ref().is_some_and(|image| image.num_loaded_frames() > MAX_FRAMES) {
            return Err(Trouble::Unsupported("it is made of more than 64 frames"));
        }
    }
    image.ok_or(Trouble::Damaged("it is cut short"))
}
