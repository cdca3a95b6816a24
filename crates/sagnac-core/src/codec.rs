//! The image as bytes: little-endian, fixed layout, CRC-32 at the end.
//!
//! ```text
//! 0        128               128 + 64·m            128 + 64·m + 12·t      + 4
//! ┌────────┬─────────────────┬─────────────────────┬──────┐
//! │ head   │ m inputs        │ t terms             │ CRC  │
//! └────────┴─────────────────┴─────────────────────┴──────┘
//! ```
//!
//! `docs/reference/image-format.md` lists every field and works an example. The CRC is CRC-32/ISO-HDLC over
//! everything before it; its Hamming distance over these lengths is at least 4, so every one-, two-
//! and three-bit error is refused. Reserved bytes must be zero: one image, one byte string.

use core::fmt;

use crate::bytes::{Reader, Writer, crc32};
use crate::image::{Description, Image, ImageError, Kind, MAX_INPUTS, MAX_TERMS, Multiplier, Shape, Term};
use crate::input::{Gain, InputSpec, LagSpec, ValueSource};

/// First eight bytes of every image.
pub const MAGIC: [u8; 8] = *b"SAGNACIM";
/// Version of the layout this code reads and writes.
pub const FORMAT_VERSION: u16 = 1;
/// Newest minor version that this code reads. A new shape or source raises it; an image carries the lowest minor version that has
/// all its shapes and sources.
pub const FORMAT_MINOR: u16 = 5;
/// The minor version that added harmonics.
const MINOR_OF_HARMONICS: u16 = 1;
/// The minor version that added inputs that repeat another one.
const MINOR_OF_REPEATS: u16 = 2;
/// The minor version that added warm-ups.
const MINOR_OF_WARM_UPS: u16 = 3;
/// The minor version that added largest steps.
const MINOR_OF_STEPS: u16 = 4;
/// The minor version that added largest steps that grow.
const MINOR_OF_GROWTH: u16 = 5;
const HEAD_LEN: usize = 128;
const INPUT_LEN: usize = 64;
const TERM_LEN: usize = 12;
const CRC_LEN: usize = 4;
/// Length of the largest image.
pub const MAX_IMAGE_LEN: usize = HEAD_LEN + INPUT_LEN * MAX_INPUTS + TERM_LEN * MAX_TERMS + CRC_LEN;

/// Why bytes are refused as an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DecodeError {
    /// Fewer bytes than the head, or than the head announces.
    TooShort {
        /// Bytes needed.
        needed: usize,
        /// Bytes given.
        given: usize,
    },
    /// The first eight bytes are not an image's.
    NotAnImage,
    /// A layout that this code does not know.
    UnknownVersion(u16),
    /// The layout is known, but the image uses a shape or source that is newer than this code.
    UnknownMinor(u16),
    /// The minor version is not the lowest one that has all shapes and sources of the image: one image, one byte string.
    WrongMinor {
        /// Minor version in the image.
        stored: u16,
        /// Lowest minor version that has all its shapes and sources.
        needed: u16,
    },
    /// Bytes after the end that the head announces.
    TooLong {
        /// Bytes announced.
        needed: usize,
        /// Bytes given.
        given: usize,
    },
    /// The checksum does not match.
    Crc {
        /// Checksum in the image.
        stored: u32,
        /// Checksum of its bytes.
        computed: u32,
    },
    /// Reserved bytes are not zero.
    Reserved(&'static str),
    /// A kind of term that this code cannot evaluate.
    UnknownKind {
        /// Index of the term, from 0.
        term: u8,
        /// The kind found.
        kind: u8,
    },
    /// A multiplier that this code cannot evaluate.
    UnknownMultiplier {
        /// Index of the term, from 0.
        term: u8,
        /// The multiplier found.
        multiplier: u8,
    },
    /// A shape that this code cannot evaluate.
    UnknownShape {
        /// Index of the term, from 0.
        term: u8,
        /// The shape found.
        shape: u8,
    },
    /// The bytes are intact, but a value is out of range.
    Invalid(ImageError),
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooShort { needed, given } => {
                write!(f, "{given} bytes where an image needs {needed}")
            }
            Self::NotAnImage => f.write_str("does not begin like a Sagnac image"),
            Self::UnknownVersion(v) => write!(f, "image format version {v}; this program reads {FORMAT_VERSION}"),
            Self::UnknownMinor(minor) => write!(
                f,
                "image format version {FORMAT_VERSION}.{minor}; this program reads up to {FORMAT_VERSION}.{FORMAT_MINOR}"
            ),
            Self::WrongMinor { stored, needed } => write!(
                f,
                "image format version {FORMAT_VERSION}.{stored}, but its contents are of version {FORMAT_VERSION}.{needed}"
            ),
            Self::TooLong { needed, given } => {
                write!(f, "{given} bytes where the image ends at {needed}")
            }
            Self::Crc { stored, computed } => {
                write!(f, "CRC-32 {stored:08x} in the image, {computed:08x} of its bytes: damaged")
            }
            Self::Reserved(place) => write!(f, "reserved bytes of {place} are not zero"),
            Self::UnknownKind { term, kind } => write!(f, "term {term} is of unknown kind {kind}"),
            Self::UnknownMultiplier { term, multiplier } => {
                write!(f, "term {term} has the unknown multiplier {multiplier}")
            }
            Self::UnknownShape { term, shape } => write!(f, "term {term} has the unknown shape {shape}"),
            Self::Invalid(error) => write!(f, "{error}"),
        }
    }
}

impl core::error::Error for DecodeError {}

impl Image {
    /// Number of bytes of this image.
    pub fn encoded_len(&self) -> usize {
        HEAD_LEN + INPUT_LEN * self.inputs().len() + TERM_LEN * self.terms().len() + CRC_LEN
    }

    /// The minor version of its format: the lowest one that has all its shapes and sources.
    pub fn format_minor(&self) -> u16 {
        minor_of(self.inputs(), self.terms())
    }

    /// Writes the image to the front of `out`; returns its length, or `None` if `out` is too small.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let len = self.encoded_len();
        let out = out.get_mut(..len)?;
        let (body, tail) = out.split_at_mut_checked(len - CRC_LEN)?;
        let mut w = Writer::new(body);
        write_head(&mut w, self, len)?;
        for input in self.inputs() {
            write_input(&mut w, input)?;
        }
        for term in self.terms() {
            write_term(&mut w, term)?;
        }
        tail.copy_from_slice(&crc32(body).to_le_bytes());
        Some(len)
    }

    /// Reads an image that fills `bytes` exactly.
    ///
    /// # Errors
    /// [`DecodeError`], cheapest check first: length, magic, version, CRC, then every value.
    ///
    /// **SAG-CORE-018** Bytes with another magic, version, length or CRC-32 are no image.
    pub fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let (announced, stored_minor) = announced(bytes)?;
        let (needed, given) = (announced, bytes.len());
        if given < needed {
            return Err(DecodeError::TooShort { needed, given });
        }
        if given > needed {
            return Err(DecodeError::TooLong { needed, given });
        }
        let short = DecodeError::TooShort { needed, given };
        let (body, tail) = bytes.split_last_chunk::<CRC_LEN>().map(|(b, t)| (b, *t)).ok_or(short)?;
        let (stored, computed) = (u32::from_le_bytes(tail), crc32(body));
        if stored != computed {
            return Err(DecodeError::Crc { stored, computed });
        }
        // Filled in place: a description is a kilobyte, and every value returned may be one more on a small stack.
        let mut description = Description::empty();
        read_body(&mut Reader::new(body), &mut description, short)?;
        let inputs = description.inputs.get(..usize::from(description.input_count)).unwrap_or(&[]);
        let terms = description.terms.get(..usize::from(description.term_count)).unwrap_or(&[]);
        let needed = minor_of(inputs, terms);
        if stored_minor != needed {
            return Err(DecodeError::WrongMinor { stored: stored_minor, needed });
        }
        Image::new(description).map_err(DecodeError::Invalid)
    }
}

/// The lowest minor version that has the sources of all these inputs and the shapes of all these terms.
fn minor_of(inputs: &[InputSpec], terms: &[Term]) -> u16 {
    if inputs.iter().any(|input| input.step_growth != 0) {
        MINOR_OF_GROWTH
    } else if inputs.iter().any(|input| input.largest_step_q8 != 0) {
        MINOR_OF_STEPS
    } else if inputs.iter().any(|input| input.source == ValueSource::WarmUp) {
        MINOR_OF_WARM_UPS
    } else if inputs.iter().any(|input| matches!(input.source, ValueSource::Repeat { .. })) {
        MINOR_OF_REPEATS
    } else if terms.iter().any(|term| term.shape.turns_q18().is_some()) {
        MINOR_OF_HARMONICS
    } else {
        0
    }
}

/// Checks magic and both versions; the length that the head announces, and its minor version.
fn announced(bytes: &[u8]) -> Result<(usize, u16), DecodeError> {
    let given = bytes.len();
    let mut r = Reader::new(bytes);
    let short = DecodeError::TooShort { needed: HEAD_LEN + CRC_LEN, given };
    if r.take::<8>().ok_or(short)? != MAGIC {
        return Err(DecodeError::NotAnImage);
    }
    let version = r.u16().ok_or(short)?;
    if version != FORMAT_VERSION {
        return Err(DecodeError::UnknownVersion(version));
    }
    let minor = r.u16().ok_or(short)?;
    if minor > FORMAT_MINOR {
        return Err(DecodeError::UnknownMinor(minor));
    }
    Ok((r.u32().ok_or(short)? as usize, minor))
}

fn write_head(w: &mut Writer<'_>, image: &Image, len: usize) -> Option<()> {
    let d = image.description();
    w.put(MAGIC)?;
    w.put(FORMAT_VERSION.to_le_bytes())?;
    w.put(image.format_minor().to_le_bytes())?;
    w.put(u32::try_from(len).ok()?.to_le_bytes())?;
    w.put(d.serial)?;
    w.put([d.axis, d.input_count, d.term_count, 0])?;
    w.put(d.tick_ns.to_le_bytes())?;
    w.put(d.period_ticks.to_le_bytes())?;
    w.put(d.slew_ticks.to_le_bytes())?;
    w.put(d.scale_factor_femto_arcsec.to_le_bytes())?;
    w.put(d.quantum_nano_counts.to_le_bytes())?;
    w.put(d.reference_q24.to_le_bytes())?;
    w.put(d.sequence.to_le_bytes())?;
    w.put(d.output_limit.to_le_bytes())?;
    w.put(d.parent)?;
    w.put([0; 4])
}

fn read_body(r: &mut Reader<'_>, d: &mut Description, short: DecodeError) -> Result<(), DecodeError> {
    read_head(r, d).ok_or(short)??;
    for slot in d.inputs.iter_mut().take(usize::from(d.input_count)) {
        *slot = read_input(r).ok_or(short)??;
    }
    for (i, slot) in (0_u8..).zip(d.terms.iter_mut().take(usize::from(d.term_count))) {
        *slot = read_term(r, i).ok_or(short)??;
    }
    if r.is_empty() { Ok(()) } else { Err(DecodeError::Reserved("the end (length and counts disagree)")) }
}

/// `None`: the bytes ended. The inner error: a value is unknown.
type Parsed<T> = Option<Result<T, DecodeError>>;

fn read_head(r: &mut Reader<'_>, d: &mut Description) -> Parsed<()> {
    // Magic, versions and length are checked.
    r.take::<16>()?;
    d.serial = r.take()?;
    let [axis, input_count, term_count, zero] = r.take()?;
    (d.axis, d.input_count, d.term_count) = (axis, input_count, term_count);
    let mut reserved = zero != 0;
    d.tick_ns = r.u32()?;
    d.period_ticks = r.u32()?;
    d.slew_ticks = r.u32()?;
    d.scale_factor_femto_arcsec = u64::from_le_bytes(r.take()?);
    d.quantum_nano_counts = u64::from_le_bytes(r.take()?);
    d.reference_q24 = r.i32()?;
    d.sequence = r.u32()?;
    d.output_limit = r.u32()?;
    d.parent = r.take()?;
    reserved |= r.u32()? != 0;
    Some(if reserved { Err(DecodeError::Reserved("the head")) } else { Ok(()) })
}

fn write_input(w: &mut Writer<'_>, t: &InputSpec) -> Option<()> {
    w.put(t.offset_q24.to_le_bytes())?;
    w.put(t.gain.mantissa.to_le_bytes())?;
    let source = match t.source {
        ValueSource::Code => [0; 3],
        ValueSource::Difference { of, less } => [1, of, less],
        ValueSource::Repeat { of } => [2, of, 0],
        ValueSource::WarmUp => [3, 0, 0],
    };
    w.put([t.gain.shift, t.x_shift, t.lag.alpha_shift, t.lag.rate_shift, t.lag.y_shift])?;
    w.put(source)?;
    for value in [t.valid_lo_q24, t.valid_hi_q24, t.span_lo_q24, t.span_hi_q24] {
        w.put(value.to_le_bytes())?;
    }
    w.put(t.x_mantissa.to_le_bytes())?;
    w.put(t.lag.alpha_mantissa.to_le_bytes())?;
    w.put(t.lag.rate_lo.to_le_bytes())?;
    w.put(t.lag.rate_hi.to_le_bytes())?;
    w.put(t.lag.y_mantissa.to_le_bytes())?;
    w.put(t.stale_after_updates.to_le_bytes())?;
    w.put(t.settling_updates.to_le_bytes())?;
    w.put([t.unit_exponent.cast_unsigned()])?;
    w.put(t.largest_step_q8.to_le_bytes())?;
    w.put([t.step_growth])
}

fn read_input(r: &mut Reader<'_>) -> Parsed<InputSpec> {
    let offset_q24 = r.i32()?;
    let mantissa = r.i32()?;
    let [gain_shift, x_shift, alpha_shift, rate_shift, y_shift, source @ ..] = r.take::<8>()?;
    let (valid_lo_q24, valid_hi_q24) = (r.i32()?, r.i32()?);
    let (span_lo_q24, span_hi_q24) = (r.i32()?, r.i32()?);
    let (x_mantissa, alpha_mantissa) = (r.u32()?, r.u32()?);
    let (rate_lo, rate_hi, y_mantissa) = (r.i32()?, r.i32()?, r.u32()?);
    let (stale_after_updates, settling_updates) = (r.u32()?, r.u32()?);
    let [unit_exponent, step_low, step_high, step_growth] = r.take::<4>()?;
    let source = match source {
        [0, 0, 0] => ValueSource::Code,
        [1, of, less] => ValueSource::Difference { of, less },
        [2, of, 0] => ValueSource::Repeat { of },
        [3, 0, 0] => ValueSource::WarmUp,
        _ => return Some(Err(DecodeError::Reserved("an input"))),
    };
    let lag = LagSpec { alpha_mantissa, alpha_shift, rate_shift, rate_lo, rate_hi, y_mantissa, y_shift };
    Some(Ok(InputSpec {
        source,
        unit_exponent: unit_exponent.cast_signed(),
        offset_q24,
        gain: Gain { mantissa, shift: gain_shift },
        valid_lo_q24,
        valid_hi_q24,
        span_lo_q24,
        span_hi_q24,
        x_mantissa,
        x_shift,
        lag,
        stale_after_updates,
        settling_updates,
        largest_step_q8: u16::from_le_bytes([step_low, step_high]),
        step_growth,
    }))
}

fn write_term(w: &mut Writer<'_>, term: &Term) -> Option<()> {
    let kind = match term.kind {
        Kind::Bias => 1,
        Kind::Scale => 2,
    };
    let multiplier = match term.multiplier {
        Multiplier::One => 0,
        Multiplier::Rate => 1,
    };
    // The low 16 bits of a harmonic's turns use the bytes of a knot, the high 8 bits the byte of an order.
    let harmonic = |number: u8, turns_q18: u32| {
        let [low, middle, high, _] = turns_q18.to_le_bytes();
        (number, high, [low, middle])
    };
    let (shape, order, low) = match term.shape {
        Shape::Chebyshev(order) => (0, order, [0; 2]),
        Shape::Zone { knot_q15 } => (1, 0, knot_q15.to_le_bytes()),
        Shape::Step { knot_q15 } => (2, 0, knot_q15.to_le_bytes()),
        Shape::Cosine { turns_q18 } => harmonic(3, turns_q18),
        Shape::Sine { turns_q18 } => harmonic(4, turns_q18),
    };
    w.put([kind, term.input, order, multiplier])?;
    w.put(term.mantissa.to_le_bytes())?;
    w.put([term.shift, shape])?;
    w.put(low)
}

fn read_term(r: &mut Reader<'_>, index: u8) -> Parsed<Term> {
    let [kind, input, order, multiplier] = r.take()?;
    let mantissa = r.i32()?;
    let [shift, shape, low, middle] = r.take::<4>()?;
    let knot_q15 = i16::from_le_bytes([low, middle]);
    let turns_q18 = u32::from_le_bytes([low, middle, order, 0]);
    let shape = match (shape, order, knot_q15) {
        (0, order, 0) => Shape::Chebyshev(order),
        (1, 0, knot_q15) => Shape::Zone { knot_q15 },
        (2, 0, knot_q15) => Shape::Step { knot_q15 },
        (3, ..) => Shape::Cosine { turns_q18 },
        (4, ..) => Shape::Sine { turns_q18 },
        (0..=2, ..) => return Some(Err(DecodeError::Reserved("a term"))),
        (shape, ..) => return Some(Err(DecodeError::UnknownShape { term: index, shape })),
    };
    let kind = match kind {
        1 => Kind::Bias,
        2 => Kind::Scale,
        kind => return Some(Err(DecodeError::UnknownKind { term: index, kind })),
    };
    let multiplier = match multiplier {
        0 => Multiplier::One,
        1 => Multiplier::Rate,
        multiplier => {
            return Some(Err(DecodeError::UnknownMultiplier { term: index, multiplier }));
        }
    };
    Some(Ok(Term { kind, input, shape, multiplier, mantissa, shift }))
}
