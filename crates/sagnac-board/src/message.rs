//! Messages: the payloads of frames as fields. One table has every kind; `docs/reference/serial-line.md` says the widths and units.
//!
//! ```text
//! messages! { kind, payload, direction, words } ─▶ Message, its codec ─▶ frames
//!                                               └▶ KINDS ─▶ the kinds in ports/c/sagnac_frame.h, the tables of the page
//! ```
//!
//! A payload has one reading: a length or a value that no sender writes is no message.

use sagnac_core::bytes::{Reader, Writer};
use sagnac_core::{CHALLENGE_LEN, Loaded, Origin, Status};

use crate::frame::Frame;

/// Value of [`Reply::to`] in the reply that is sent at power-on.
pub const POWER_ON: u8 = 0;
/// Bytes of an output frame.
pub const OUTPUT_LEN: usize = 59;
/// Bytes of an image in one message.
const PIECE_LEN: usize = 60;

/// Who sends a message to whom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// From the gyro.
    FromGyro,
    /// To the gyro.
    ToGyro,
    /// To a board without a gyro.
    ToRig,
}

/// A kind of message, for the C header and the page.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct MessageKind {
    /// Its name in C.
    pub name: &'static str,
    /// Its name in words.
    pub label: &'static str,
    /// Its number in the frame.
    pub number: u8,
    /// Who sends it to whom.
    pub direction: Direction,
    /// Its payload in words.
    pub payload: &'static str,
    /// What it says or does.
    pub effect: &'static str,
}

/// [`Message`], its codec and [`KINDS`] from one row per kind.
macro_rules! messages {
    ($(
        #[doc = $effect:literal]
        $(#[cfg($condition:meta)])?
        $name:ident = $number:literal $label:literal, $variant:ident $(($payload:ty))?, $direction:ident, $words:literal;
    )*) => {
        /// All messages of the serial line.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Message {
            $(#[doc = $effect] $(#[cfg($condition)])? $variant $(($payload))?,)*
        }

        /// Every kind, in the order of its number.
        pub const KINDS: &[MessageKind] = &[$($(#[cfg($condition)])? MessageKind {
            name: stringify!($name),
            label: $label,
            number: $number,
            direction: Direction::$direction,
            payload: $words,
            effect: $effect,
        },)*];

        impl Message {
            $($(#[cfg($condition)])? #[doc = concat!("Kind of [`Self::", stringify!($variant), "`], as in [`Reply::to`].")]
            pub const $name: u8 = $number;)*

            /// Its kind: the number in the frame.
            pub const fn kind(&self) -> u8 {
                match self {
                    $($(#[cfg($condition)])? Self::$variant { .. } => Self::$name,)*
                }
            }

            fn write(&self, w: &mut Writer<'_>) -> Option<usize> {
                $($(#[cfg($condition)])? {
                    $(if let Self::$variant(payload) = self {
                        return <$payload as Payload>::put(payload, w);
                    })?
                })*
                Some(0)
            }

            /// The message of a frame; `None` for an unknown kind or a payload of the wrong length.
            pub fn parse(frame: &Frame) -> Option<Self> {
                let mut r = Reader::new(frame.payload());
                let message = match frame.kind {
                    $($(#[cfg($condition)])? Self::$name => Self::$variant $((<$payload as Payload>::take(&mut r)?))?,)*
                    _ => return None,
                };
                r.is_empty().then_some(message)
            }
        }
    };
}

messages! {
    /// Corrected counts, their angle, status and what may be wrong, every `frame_ticks` ticks.
    OUTPUT = 0x01 "output", Output(OutputFrame), FromGyro, "51 bytes, below";
    /// The result of a message, and which image runs.
    REPLY = 0x02 "reply", Reply(Reply), FromGyro, "7 bytes, below";
    /// A gyro with a key asks: sign this ([`sagnac_core::service_message`]) to open the service mode.
    CHALLENGE = 0x03 "challenge", Challenge([u8; CHALLENGE_LEN]), FromGyro, "16 bytes";
    /// The parameters of the rig. The board starts again.
    #[cfg(feature = "rig")]
    SETTINGS = 0x10 "settings of the rig", Settings(RigSettings), ToRig, "31 bytes: `RigSettings`";
    /// Run one row of a log.
    #[cfg(feature = "rig")]
    ROW = 0x11 "row of a log", Row(Row), ToRig, "u32 ticks, i32 counts, u8 bits of the inputs that have a sample, 4 × i32 codes";
    /// A piece of an image; in any order, as often as needed.
    PIECE = 0x20 "piece of an image", Piece(Piece), ToGyro, "u16 offset, up to 60 bytes";
    /// The image is complete: the gyro checks it, stores it in the other bank, reads it back and uses it from the next tick on.
    COMMIT = 0x21 "commit of an image", Commit(Commit), ToGyro, "u16 length, u8 1 on trial or 0";
    /// Go back to the image before this one.
    ROLL_BACK = 0x22 "roll back", RollBack, ToGyro, "";
    /// The image on trial has proved itself.
    CONFIRM = 0x23 "confirmation", Confirm, ToGyro, "";
    /// Open the service mode for one change: a gyro with a key answers with a challenge.
    SERVICE = 0x24 "service mode", Service(Change), ToGyro, "u8 kind of the change: 21, 22 or 23";
    /// The signature of the challenge.
    ANSWER = 0x25 "answer to a challenge", Answer([u8; 64]), ToGyro, "64 bytes";
    /// The end of the run.
    #[cfg(feature = "rig")]
    STOP = 0x30 "stop", Stop, ToRig, "";
}

/// Fields of a payload, little-endian, one after the other.
trait Payload: Sized {
    /// Writes it; how many bytes it has.
    fn put(&self, w: &mut Writer<'_>) -> Option<usize>;
    fn take(r: &mut Reader<'_>) -> Option<Self>;
}

/// A number as its little-endian bytes.
macro_rules! number {
    ($($type:ty),*) => {$(
        impl Payload for $type {
            fn put(&self, w: &mut Writer<'_>) -> Option<usize> {
                self.to_le_bytes().put(w)
            }

            fn take(r: &mut Reader<'_>) -> Option<Self> {
                Payload::take(r).map(Self::from_le_bytes)
            }
        }
    )*};
}

number!(u16, u32, i32, i64);

impl<const N: usize> Payload for [u8; N] {
    fn put(&self, w: &mut Writer<'_>) -> Option<usize> {
        w.put(*self)?;
        Some(N)
    }

    fn take(r: &mut Reader<'_>) -> Option<Self> {
        r.take()
    }
}

impl Payload for u8 {
    fn put(&self, w: &mut Writer<'_>) -> Option<usize> {
        [*self].put(w)
    }

    fn take(r: &mut Reader<'_>) -> Option<Self> {
        r.u8()
    }
}

impl Payload for bool {
    fn put(&self, w: &mut Writer<'_>) -> Option<usize> {
        u8::from(*self).put(w)
    }

    fn take(r: &mut Reader<'_>) -> Option<Self> {
        flag(r.u8()?)
    }
}

#[cfg(feature = "rig")]
impl Payload for [i32; 4] {
    fn put(&self, w: &mut Writer<'_>) -> Option<usize> {
        self.iter().try_fold(0, |len, code| Some(len + code.put(w)?))
    }

    fn take(r: &mut Reader<'_>) -> Option<Self> {
        Some([r.i32()?, r.i32()?, r.i32()?, r.i32()?])
    }
}

/// A payload whose bytes are its fields in their order.
macro_rules! payload {
    ($(#[$of_struct:meta])* $name:ident { $($(#[$of_field:meta])* $field:ident: $type:ty,)* }) => {
        $(#[$of_struct])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct $name {
            $($(#[$of_field])* pub $field: $type,)*
        }

        impl Payload for $name {
            fn put(&self, w: &mut Writer<'_>) -> Option<usize> {
                Some(0 $(+ self.$field.put(w)?)*)
            }

            fn take(r: &mut Reader<'_>) -> Option<Self> {
                Some(Self { $($field: Payload::take(r)?,)* })
            }
        }
    };
}

payload! {
    /// The end of an upload.
    Commit {
        /// Length of the image, with the signature block if it has one.
        len: u16,
        /// Store it on trial ([`sagnac_core::Banks::start`]).
        trial: bool,
    }
}

#[cfg(feature = "rig")]
payload! {
    /// One row of a log, for a rig.
    Row {
        /// Length, ticks.
        ticks: u32,
        /// Counts in these ticks.
        counts: i32,
        /// Bit i: input i has a sample.
        present: u8,
        /// Codes of the inputs.
        codes: [i32; 4],
    }
}

#[cfg(feature = "rig")]
payload! {
    /// Parameters of the rig that replaces the gyro.
    RigSettings {
        /// Amplitude of the dither, counts; 0 for none.
        dither_counts: u32,
        /// Phase of the dither per tick, 2⁻³² turns.
        dither_step: u32,
        /// Fraction of the light that is lost per squared code of distance from the peak, 2⁻⁴⁸.
        curvature: u32,
        /// Light at the peak per code of the current, 2⁻¹⁶ codes.
        lamp_gain: u32,
        /// Position of the light's peak at code 0 of the first input, actuator codes.
        peak: i32,
        /// Movement of the peak for 2²⁴ codes of that input, 2⁻¹⁶ actuator codes.
        peak_slope: i32,
        /// One wavelength, actuator codes.
        wavelength: i32,
        /// Time constant with which the light follows the current: 2^lamp_lag ticks.
        lamp_lag: u8,
        /// Time constant with which the path follows the actuator: 2^actuator_lag ticks.
        actuator_lag: u8,
        /// Noise of the light code, bits.
        noise_bits: u8,
    }
}

/// Bytes of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Offset of the first byte in the image.
    pub offset: u16,
    /// Number of bytes.
    pub len: u8,
    /// The bytes.
    pub bytes: [u8; PIECE_LEN],
}

impl Payload for Piece {
    fn put(&self, w: &mut Writer<'_>) -> Option<usize> {
        let head = self.offset.put(w)?;
        self.bytes.put(w)?;
        Some(head + usize::from(self.len).min(PIECE_LEN))
    }

    fn take(r: &mut Reader<'_>) -> Option<Self> {
        let offset = r.u16()?;
        let (mut bytes, mut len) = ([0; PIECE_LEN], 0);
        for slot in &mut bytes {
            let Some(byte) = r.u8() else { break };
            (*slot, len) = (byte, len + 1);
        }
        Some(Self { offset, len, bytes })
    }
}

/// Frame that the gyro sends every [`crate::BoardSetup::frame_ticks`] ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OutputFrame {
    /// Number of the frame, from 0, modulo 2¹⁶.
    pub sequence: u16,
    /// Ticks since power-on, at the end of the frame, modulo 2³².
    pub tick: u32,
    /// Corrected counts of the frame's ticks.
    pub counts: i32,
    /// Counts before the correction.
    pub raw: i32,
    /// All status bits of those ticks.
    pub status: Status,
    /// All bits of the path-length loop's status.
    pub path_status: u8,
    /// All bits of the intensity loop's status.
    pub light_status: u8,
    /// Actuator without its modulation, code.
    pub actuator: i32,
    /// Current, code.
    pub current: i32,
    /// Code of the image's first input at the last slow update; `None` without a sample.
    pub temperature: Option<i32>,
    /// Quadrature steps of unknown direction since power-on, modulo 2¹⁶.
    pub lost_steps: u16,
    /// Where the active image comes from.
    pub origin: Origin,
    /// The active image is on trial.
    pub trial: bool,
    /// Angle of the corrected counts, 10⁻⁹ arcsec. The rest of the division is in the next frame, so the sum has no error of its own.
    pub angle_nano_arcsec: i64,
    /// How far a fault may have moved the correction in this frame ([`sagnac_core::ErrorBound`]), 0.001 °/h; the largest number: no bound.
    pub error_milli_dph: u32,
    /// Ticks of a frame without missed ones.
    pub frame_ticks: u16,
    /// Length of a tick, ns.
    pub tick_ns: u32,
}

impl Payload for OutputFrame {
    fn put(&self, w: &mut Writer<'_>) -> Option<usize> {
        let has_sample = u8::from(self.temperature.is_some());
        Some(
            self.sequence.put(w)?
                + self.tick.put(w)?
                + self.counts.put(w)?
                + self.raw.put(w)?
                + self.status.bits().put(w)?
                + self.path_status.put(w)?
                + self.light_status.put(w)?
                + self.actuator.put(w)?
                + self.current.put(w)?
                + self.temperature.unwrap_or(0).put(w)?
                + self.lost_steps.put(w)?
                + (has_sample | image_code(self.origin, self.trial) << 1).put(w)?
                + self.angle_nano_arcsec.put(w)?
                + self.error_milli_dph.put(w)?
                + self.frame_ticks.put(w)?
                + self.tick_ns.put(w)?,
        )
    }

    fn take(r: &mut Reader<'_>) -> Option<Self> {
        let (sequence, tick, counts, raw) = (r.u16()?, r.u32()?, r.i32()?, r.i32()?);
        let status = Status::from_bits(r.u16()?);
        let (path_status, light_status) = (r.u8()?, r.u8()?);
        let (actuator, current, temperature) = (r.i32()?, r.i32()?, r.i32()?);
        let (lost_steps, source) = (r.u16()?, r.u8()?);
        // One frame, one meaning: a code without its bit is no frame.
        let temperature = match source & 1 {
            0 if temperature != 0 => return None,
            0 => None,
            _ => Some(temperature),
        };
        let (origin, trial) = image_of(source >> 1)?;
        let (angle_nano_arcsec, error_milli_dph) = (Payload::take(r)?, r.u32()?);
        let (frame_ticks, tick_ns) = (r.u16()?, r.u32()?);
        Some(Self {
            sequence,
            tick,
            counts,
            raw,
            status,
            path_status,
            light_status,
            actuator,
            current,
            temperature,
            lost_steps,
            origin,
            trial,
            angle_nano_arcsec,
            error_milli_dph,
            frame_ticks,
            tick_ns,
        })
    }
}

/// Result of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReplyCode {
    /// Done.
    Done = 0,
    /// The bytes are not an image: damaged, or a value out of range.
    NotAnImage = 1,
    /// The image is for another gyro, or its terms exceed the limits of this one.
    Mismatch = 2,
    /// The image is not newer than the active one.
    NotNewer = 3,
    /// There is no older image to go back to.
    NoOlderImage = 4,
    /// The flash failed.
    Flash = 5,
    /// A piece or a commit beyond the longest image.
    BadPiece = 6,
    /// The board has a key, and its service mode is closed.
    Locked = 7,
    /// The board has a key, and the image no signature.
    Unsigned = 8,
    /// The signature of an image or an answer does not match, or is by another key.
    BadSignature = 9,
    /// There is no image on trial to confirm.
    NotOnTrial = 10,
    /// An image is on trial over a confirmed one, which another upload would erase.
    OnTrial = 11,
}

impl ReplyCode {
    const ALL: [Self; 12] = [
        Self::Done,
        Self::NotAnImage,
        Self::Mismatch,
        Self::NotNewer,
        Self::NoOlderImage,
        Self::Flash,
        Self::BadPiece,
        Self::Locked,
        Self::Unsigned,
        Self::BadSignature,
        Self::NotOnTrial,
        Self::OnTrial,
    ];
}

/// The reply to a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reply {
    /// Kind of the message, or [`POWER_ON`].
    pub to: u8,
    /// Its result.
    pub code: ReplyCode,
    /// Sequence number of the active image; 0 for the factory defaults.
    pub sequence: u32,
    /// Where the active image comes from.
    pub origin: Origin,
    /// The active image is on trial: confirm it, or it is withdrawn after some starts.
    pub trial: bool,
}

impl Payload for Reply {
    fn put(&self, w: &mut Writer<'_>) -> Option<usize> {
        let head = self.to.put(w)? + (self.code as u8).put(w)?;
        Some(head + self.sequence.put(w)? + image_code(self.origin, self.trial).put(w)?)
    }

    fn take(r: &mut Reader<'_>) -> Option<Self> {
        let [to, code] = r.take()?;
        let (code, sequence) = (*ReplyCode::ALL.get(usize::from(code))?, r.u32()?);
        let (origin, trial) = image_of(r.u8()?)?;
        Some(Self { to, code, sequence, origin, trial })
    }
}

impl Reply {
    /// The reply at power-on.
    pub(crate) const fn at_power_on(loaded: &Loaded) -> Self {
        let sequence = loaded.image.description().sequence;
        Self { to: POWER_ON, code: ReplyCode::Done, sequence, origin: loaded.origin, trial: loaded.trial }
    }
}

/// A change of the images, which a board with a key makes only in its service mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// [`Message::Commit`], with its pieces.
    Commit = Message::COMMIT as isize,
    /// [`Message::RollBack`].
    RollBack = Message::ROLL_BACK as isize,
    /// [`Message::Confirm`].
    Confirm = Message::CONFIRM as isize,
}

impl Change {
    /// The change that a message is part of.
    pub(crate) const fn of(message: &Message) -> Option<Self> {
        match message {
            Message::Piece(_) | Message::Commit(_) => Some(Self::Commit),
            Message::RollBack => Some(Self::RollBack),
            Message::Confirm => Some(Self::Confirm),
            _ => None,
        }
    }
}

impl Payload for Change {
    fn put(&self, w: &mut Writer<'_>) -> Option<usize> {
        (*self as u8).put(w)
    }

    fn take(r: &mut Reader<'_>) -> Option<Self> {
        match r.u8()? {
            Message::COMMIT => Some(Self::Commit),
            Message::ROLL_BACK => Some(Self::RollBack),
            Message::CONFIRM => Some(Self::Confirm),
            _ => None,
        }
    }
}

impl Message {
    /// The pieces of an image, in order, without the commit.
    pub fn pieces(image: &[u8]) -> impl Iterator<Item = Self> + '_ {
        image.chunks(PIECE_LEN).zip(0_u16..).map(|(chunk, index)| {
            let mut bytes = [0; PIECE_LEN];
            bytes.iter_mut().zip(chunk).for_each(|(slot, byte)| *slot = *byte);
            Self::Piece(Piece { offset: index.saturating_mul(PIECE_LEN as u16), len: chunk.len() as u8, bytes })
        })
    }

    /// Its frame. Never `None`: every payload fits (a test confirms it).
    pub fn frame(&self) -> Option<Frame> {
        let mut payload = [0; crate::frame::MAX_PAYLOAD];
        let mut w = Writer::new(&mut payload);
        let len = self.write(&mut w)?;
        Frame::new(self.kind(), payload.get(..len)?)
    }
}

/// 0 newest, 1 survivor, 2 factory defaults; 4 more on trial.
pub(crate) const fn image_code(origin: Origin, trial: bool) -> u8 {
    let origin = match origin {
        Origin::Newest => 0,
        Origin::Survivor => 1,
        Origin::FactoryDefaults => 2,
    };
    origin | (trial as u8) << 2
}

fn image_of(code: u8) -> Option<(Origin, bool)> {
    let origin = *[Origin::Newest, Origin::Survivor, Origin::FactoryDefaults].get(usize::from(code & 3))?;
    Some((origin, flag(code >> 2)?))
}

/// One byte, one meaning.
const fn flag(byte: u8) -> Option<bool> {
    match byte {
        0 => Some(false),
        1 => Some(true),
        _ => None,
    }
}
