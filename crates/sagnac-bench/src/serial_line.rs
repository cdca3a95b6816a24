//! What a gyro says on its serial line, in words, and its clock over wraps and restarts.

use sagnac_board::frame::Frame;
use sagnac_board::{KINDS, Message, OutputFrame, POWER_ON, Reply, ReplyCode};
use sagnac_core::{Origin, Status};
use sagnac_loops::{IntensityStatus, PathLengthStatus};

/// A gap of more frames than this, five minutes, is a restart or a disorder.
const LONGEST_GAP: u16 = 1 << 15;

/// Counts the frames missing between outputs, and the ticks since power-on beyond the 32 bits of a frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct OutputClock {
    last: Option<OutputFrame>,
    /// Ticks since power-on at the newest output.
    pub ticks: u64,
    /// Frames missing between outputs.
    pub missing: u64,
    /// Places where the frames' count or clock jumps by more than lost frames explain.
    pub breaks: u64,
}

impl OutputClock {
    /// Power-on begins a new count.
    pub fn power_on(&mut self) {
        self.last = None;
    }

    /// The next output.
    pub fn follow(&mut self, output: &OutputFrame) {
        let Some(last) = self.last.replace(*output) else {
            self.ticks = output.tick.into();
            return;
        };
        let gap = output.sequence.wrapping_sub(last.sequence).wrapping_sub(1);
        let moved = output.tick.wrapping_sub(last.tick);
        if gap < LONGEST_GAP && moved < 1 << 31 {
            self.missing += u64::from(gap);
            self.ticks += u64::from(moved);
        } else {
            self.breaks += 1;
            self.ticks = output.tick.into();
        }
    }
}

/// A reply in words.
pub fn reply_words(reply: &Reply) -> String {
    let kind = KINDS.iter().find(|kind| kind.number == reply.to).map_or("message", |kind| kind.label);
    let what = if reply.to == POWER_ON { "power-on" } else { kind };
    let became = match reply.code {
        ReplyCode::Done => "done",
        ReplyCode::NotAnImage => "refused: not an image, or damaged",
        ReplyCode::Mismatch => "refused: for another gyro, or beyond its limits",
        ReplyCode::NotNewer => "refused: not newer than the active image",
        ReplyCode::NoOlderImage => "refused: no older image to go back to",
        ReplyCode::Flash => "failed: flash",
        ReplyCode::BadPiece => "refused: beyond the longest image",
        ReplyCode::Locked => "refused: the service mode is closed",
        ReplyCode::Unsigned => "refused: not signed, and this gyro has a key",
        ReplyCode::BadSignature => "refused: the signature does not match, or is by another key",
        ReplyCode::NotOnTrial => "refused: no image is on trial",
        ReplyCode::OnTrial => "refused: an image is on trial; confirm it or roll it back first",
    };
    let trial = if reply.trial { ", on trial: confirm it" } else { "" };
    match reply.sequence {
        0 => format!("{what}: {became}; factory defaults active"),
        number if reply.origin == Origin::Survivor => {
            format!(
                "{what}: {became}; image {number} active, the only usable one: the other bank is damaged or not for this gyro"
            )
        }
        number => format!("{what}: {became}; image {number} active{trial}"),
    }
}

/// The axis that a frame names, or nothing.
pub fn axis_letter(frame: &Frame) -> &'static str {
    ["", "x", "y", "z"].get(usize::from(frame.axis)).copied().unwrap_or_default()
}

/// The angle of an output in arcsec, every digit.
pub fn arcsec(nano: i64) -> String {
    let (sign, size) = (if nano < 0 { "-" } else { "" }, nano.unsigned_abs());
    format!("{sign}{}.{:09}", size / 1_000_000_000, size % 1_000_000_000)
}

/// True for the reply to a piece that was taken, of which an upload has many.
pub fn is_piece_done(reply: &Reply) -> bool {
    reply.to == Message::PIECE && reply.code == ReplyCode::Done
}

/// Where the active image of an output comes from.
pub fn image_words(output: &OutputFrame) -> &'static str {
    match output.origin {
        _ if output.trial => "on trial",
        Origin::Newest => "newest",
        Origin::Survivor => "survivor",
        Origin::FactoryDefaults => "factory defaults",
    }
}

/// The bits of an output's status.
pub fn status_words(output: &OutputFrame) -> String {
    let known = Status::NAMES.iter().chain(&Status::BOARD_NAMES);
    names(known.map(|(bit, name)| (bit.bits(), *name)), output.status.bits())
}

/// The bits of the path-length loop's status.
pub fn path_length_words(output: &OutputFrame) -> String {
    names(PathLengthStatus::NAMES.iter().map(|(bit, name)| (bit.bits().into(), *name)), output.path_status.into())
}

/// The bits of the intensity loop's status.
pub fn intensity_words(output: &OutputFrame) -> String {
    names(IntensityStatus::NAMES.iter().map(|(bit, name)| (bit.bits().into(), *name)), output.light_status.into())
}

/// Names of the bits that are set, joined; bits without a name as a number.
fn names<'a>(all: impl Iterator<Item = (u16, &'a str)>, bits: u16) -> String {
    let (mut set, mut rest) = (Vec::new(), bits);
    for (bit, name) in all.filter(|(bit, _)| bits & bit != 0) {
        set.push(name.to_owned());
        rest &= !bit;
    }
    if rest != 0 {
        set.push(format!("0x{rest:x}"));
    }
    if set.is_empty() { "OK".to_owned() } else { set.join("+") }
}
