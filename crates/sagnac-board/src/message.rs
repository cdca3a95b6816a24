//! Messages: the payloads of frames as fields. Widths and units: `docs/reference/serial-line.md`.

use sagnac_core::bytes::{Reader, Writer};
use sagnac_core::{CHALLENGE_LEN, Loaded, Origin, Status};

use crate::frame::Frame;

const OUTPUT: u8 = 0x01;
const REPLY: u8 = 0x02;
const CHALLENGE: u8 = 0x03;
#[cfg(feature = "rig")]
const SETTINGS: u8 = 0x10;
#[cfg(feature = "rig")]
const ROW: u8 = 0x11;
/// Kind of [`Message::Piece`], as in [`Reply::to`].
pub const PIECE: u8 = 0x20;
/// Kind of [`Message::Commit`].
pub const COMMIT: u8 = 0x21;
/// Kind of [`Message::RollBack`].
pub const ROLL_BACK: u8 = 0x22;
/// Kind of [`Message::Confirm`].
pub const CONFIRM: u8 = 0x23;
/// Kind of [`Message::Service`].
pub const SERVICE: u8 = 0x24;
/// Kind of [`Message::Answer`].
pub const ANSWER: u8 = 0x25;
/// Value of [`Reply::to`] in the reply that is sent at power-on.
pub const POWER_ON: u8 = 0;
#[cfg(feature = "rig")]
const STOP: u8 = 0x30;

/// Bytes of an output frame.
pub const OUTPUT_LEN: usize = 41;
/// Bytes of an image in one message.
const PIECE_LEN: usize = 60;

/// Frame that the gyro sends every [`crate::FRAME_TICKS`] ticks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Output {
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
}

/// One row of a log, for a rig.
#[cfg(feature = "rig")]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Row {
    /// Length, ticks.
    pub ticks: u32,
    /// Counts in these ticks.
    pub counts: i32,
    /// Bit i: input i has a sample.
    pub present: u8,
    /// Codes of the inputs.
    pub codes: [i32; 4],
}

/// Parameters of the rig that replaces the gyro.
#[cfg(feature = "rig")]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RigSettings {
    /// Amplitude of the dither, counts; 0 for none.
    pub dither_counts: u32,
    /// Phase of the dither per tick, 2⁻³² turns.
    pub dither_step: u32,
    /// Position of the light's peak at code 0 of the first input, actuator codes.
    pub peak: i32,
    /// Movement of the peak for 2²⁴ codes of that input, 2⁻¹⁶ actuator codes.
    pub peak_slope: i32,
    /// One wavelength, actuator codes.
    pub wavelength: i32,
    /// Fraction of the light that is lost per squared code of distance from the peak, 2⁻⁴⁸.
    pub curvature: u32,
    /// Light at the peak per code of the current, 2⁻¹⁶ codes.
    pub lamp_gain: u32,
    /// Time constant with which the light follows the current: 2^lamp_lag ticks.
    pub lamp_lag: u8,
    /// Time constant with which the path follows the actuator: 2^actuator_lag ticks.
    pub actuator_lag: u8,
    /// Noise of the light code, bits.
    pub noise_bits: u8,
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

/// All messages of the serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Message {
    /// From the gyro: corrected counts and status.
    Output(Output),
    /// From the gyro: the result of a message.
    Reply(Reply),
    /// From the gyro: sign this ([`sagnac_core::service_message`]) to open the service mode.
    Challenge([u8; CHALLENGE_LEN]),
    /// To a rig: its parameters. Restarts the board.
    #[cfg(feature = "rig")]
    Settings(RigSettings),
    /// To a rig: run one row of a log.
    #[cfg(feature = "rig")]
    Row(Row),
    /// To the gyro: bytes of an image.
    Piece {
        /// Offset of the first byte in the image.
        offset: u16,
        /// Number of bytes.
        len: u8,
        /// The bytes.
        bytes: [u8; PIECE_LEN],
    },
    /// To the gyro: the image is complete; store it.
    Commit {
        /// Its length, with the signature block if it has one.
        len: u16,
        /// Store it on trial ([`sagnac_core::Banks::start`]).
        trial: bool,
    },
    /// To the gyro: the image on trial has proved itself.
    Confirm,
    /// To the gyro: go back to the image before this one.
    RollBack,
    /// To the gyro: open the service mode. The answer is a [`Message::Challenge`].
    Service,
    /// To the gyro: the signature of its challenge.
    Answer([u8; 64]),
    /// To a rig: the end of the run.
    #[cfg(feature = "rig")]
    Stop,
}

impl Reply {
    /// The reply to a message of this kind, with what flash holds now.
    pub(crate) const fn new(to: u8, code: ReplyCode, loaded: &Loaded) -> Self {
        Self { to, code, sequence: loaded.image.description().sequence, origin: loaded.origin, trial: loaded.trial }
    }
}

impl ReplyCode {
    const ALL: [Self; 11] = [
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
    ];
}

impl Message {
    /// The pieces of an image, in order, without the commit.
    pub fn pieces(image: &[u8]) -> impl Iterator<Item = Self> + '_ {
        image.chunks(PIECE_LEN).zip(0_u16..).map(|(chunk, index)| {
            let mut bytes = [0; PIECE_LEN];
            bytes.iter_mut().zip(chunk).for_each(|(slot, byte)| *slot = *byte);
            Self::Piece { offset: index.saturating_mul(PIECE_LEN as u16), len: chunk.len() as u8, bytes }
        })
    }

    /// Its kind: the number in the frame.
    pub const fn kind(&self) -> u8 {
        match self {
            Self::Output(_) => OUTPUT,
            Self::Reply(_) => REPLY,
            Self::Challenge(_) => CHALLENGE,
            #[cfg(feature = "rig")]
            Self::Settings(_) => SETTINGS,
            #[cfg(feature = "rig")]
            Self::Row(_) => ROW,
            Self::Piece { .. } => PIECE,
            Self::Commit { .. } => COMMIT,
            Self::Confirm => CONFIRM,
            Self::RollBack => ROLL_BACK,
            Self::Service => SERVICE,
            Self::Answer(_) => ANSWER,
            #[cfg(feature = "rig")]
            Self::Stop => STOP,
        }
    }

    /// Its frame. Never `None`: every payload fits (a test confirms it).
    pub fn frame(&self) -> Option<Frame> {
        let mut payload = [0; crate::frame::MAX_PAYLOAD];
        let mut w = Writer::new(&mut payload);
        let len = self.write(&mut w)?;
        Frame::new(self.kind(), payload.get(..len)?)
    }

    fn write(&self, w: &mut Writer<'_>) -> Option<usize> {
        match self {
            Self::Output(o) => {
                w.put(o.sequence.to_le_bytes())?;
                w.put(o.tick.to_le_bytes())?;
                w.put(o.counts.to_le_bytes())?;
                w.put(o.raw.to_le_bytes())?;
                w.put(o.status.bits().to_le_bytes())?;
                w.put([o.path_status, o.light_status])?;
                for value in [o.actuator, o.current, o.temperature.unwrap_or(0)] {
                    w.put(value.to_le_bytes())?;
                }
                w.put(o.lost_steps.to_le_bytes())?;
                w.put([u8::from(o.temperature.is_some()) | image_code(o.origin, o.trial) << 1])?;
                Some(OUTPUT_LEN - 8)
            }
            Self::Reply(reply) => {
                w.put([reply.to, reply.code as u8])?;
                w.put(reply.sequence.to_le_bytes())?;
                w.put([image_code(reply.origin, reply.trial)])?;
                Some(7)
            }
            Self::Challenge(challenge) => {
                w.put(*challenge)?;
                Some(CHALLENGE_LEN)
            }
            #[cfg(feature = "rig")]
            Self::Settings(s) => {
                for value in [s.dither_counts, s.dither_step, s.curvature, s.lamp_gain] {
                    w.put(value.to_le_bytes())?;
                }
                for value in [s.peak, s.peak_slope, s.wavelength] {
                    w.put(value.to_le_bytes())?;
                }
                w.put([s.lamp_lag, s.actuator_lag, s.noise_bits])?;
                Some(31)
            }
            #[cfg(feature = "rig")]
            Self::Row(row) => {
                w.put(row.ticks.to_le_bytes())?;
                w.put(row.counts.to_le_bytes())?;
                w.put([row.present])?;
                for code in row.codes {
                    w.put(code.to_le_bytes())?;
                }
                Some(25)
            }
            Self::Piece { offset, len, bytes } => {
                w.put(offset.to_le_bytes())?;
                w.put(*bytes)?;
                Some(2 + usize::from(*len).min(PIECE_LEN))
            }
            Self::Commit { len, trial } => {
                w.put(len.to_le_bytes())?;
                w.put([u8::from(*trial)])?;
                Some(3)
            }
            Self::Answer(signature) => {
                w.put(*signature)?;
                Some(64)
            }
            Self::Confirm | Self::RollBack | Self::Service => Some(0),
            #[cfg(feature = "rig")]
            Self::Stop => Some(0),
        }
    }

    /// The message of a frame; `None` for an unknown kind or a payload of the wrong length.
    pub fn parse(frame: &Frame) -> Option<Self> {
        let mut r = Reader::new(frame.payload());
        let message = match frame.kind {
            OUTPUT => Self::Output(read_output(&mut r)?),
            REPLY => {
                let [to, code] = r.take()?;
                let (code, sequence) = (*ReplyCode::ALL.get(usize::from(code))?, r.u32()?);
                let (origin, trial) = image_of(r.u8()?)?;
                Self::Reply(Reply { to, code, sequence, origin, trial })
            }
            CHALLENGE => Self::Challenge(r.take()?),
            #[cfg(feature = "rig")]
            SETTINGS => Self::Settings(read_settings(&mut r)?),
            #[cfg(feature = "rig")]
            ROW => {
                let (ticks, counts, present) = (r.u32()?, r.i32()?, r.u8()?);
                Self::Row(Row { ticks, counts, present, codes: [r.i32()?, r.i32()?, r.i32()?, r.i32()?] })
            }
            PIECE => {
                let offset = r.u16()?;
                let (mut bytes, mut len) = ([0; PIECE_LEN], 0);
                for slot in &mut bytes {
                    let Some(byte) = r.u8() else { break };
                    (*slot, len) = (byte, len + 1);
                }
                Self::Piece { offset, len, bytes }
            }
            COMMIT => {
                let (len, trial) = (r.u16()?, r.u8()?);
                Self::Commit { len, trial: flag(trial)? }
            }
            CONFIRM => Self::Confirm,
            ROLL_BACK => Self::RollBack,
            SERVICE => Self::Service,
            ANSWER => Self::Answer(r.take()?),
            #[cfg(feature = "rig")]
            STOP => Self::Stop,
            _ => return None,
        };
        r.is_empty().then_some(message)
    }
}

/// 0 newest, 1 survivor, 2 factory defaults; 4 more on trial.
const fn image_code(origin: Origin, trial: bool) -> u8 {
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

fn read_output(r: &mut Reader<'_>) -> Option<Output> {
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
    Some(Output {
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
    })
}

#[cfg(feature = "rig")]
fn read_settings(r: &mut Reader<'_>) -> Option<RigSettings> {
    let (dither_counts, dither_step, curvature, lamp_gain) = (r.u32()?, r.u32()?, r.u32()?, r.u32()?);
    let (peak, peak_slope, wavelength) = (r.i32()?, r.i32()?, r.i32()?);
    let (lamp_lag, actuator_lag, noise_bits) = (r.u8()?, r.u8()?, r.u8()?);
    Some(RigSettings {
        dither_counts,
        dither_step,
        peak,
        peak_slope,
        wavelength,
        curvature,
        lamp_gain,
        lamp_lag,
        actuator_lag,
        noise_bits,
    })
}
