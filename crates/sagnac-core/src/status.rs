//! What the user of a corrected count must know about it.

use core::ops::{BitOr, BitOrAssign};

/// Status bits of every corrected value. Zero: corrected, inside the span, nothing lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Status(u16);

impl Status {
    /// Corrected, nothing to report.
    pub const OK: Self = Self(0);
    /// An input or its rate is outside the fit span; the correction is that of the border.
    pub const OUT_OF_SPAN: Self = Self(1);
    /// A rate is outside its span. Always set together with `OUT_OF_SPAN`.
    pub const RATE_OUT_OF_SPAN: Self = Self(1 << 1);
    /// An input had no valid value at the last slow update; the last correction is kept.
    pub const HELD: Self = Self(1 << 2);
    /// Held for longer than the hold time of the image.
    pub const STALE: Self = Self(1 << 3);
    /// A lag filter still remembers its start, or an input took a step that no value makes, and has not stepped back.
    pub const SETTLING: Self = Self(1 << 4);
    /// No correction has been computed yet; counts pass through unchanged.
    pub const UNCORRECTED: Self = Self(1 << 5);
    /// The output limit was reached; the excess stays in the accumulator and is output later.
    pub const LIMITED: Self = Self(1 << 6);
    /// The accumulator exceeded its bound. Latched until [`crate::State::clear_overflow`]; the output is zero and has no meaning.
    pub const OVERFLOW: Self = Self(1 << 7);

    /// The board found no dither: lock-in, and counts that still contain what there was of it.
    pub const NO_DITHER: Self = Self(1 << 8);
    /// The board's counter saw a step of unknown direction: counts are missing.
    pub const COUNTS_LOST: Self = Self(1 << 9);
    /// The image is the only usable one of two ([`crate::Origin::Survivor`]); it may be the older.
    pub const SURVIVOR: Self = Self(1 << 10);

    /// A thermometer stands still although another one, or the heater's command, moved ([`crate::Watch`]).
    pub const STUCK: Self = Self(1 << 11);
    /// A thermometer is outvoted by the others of its place, or two disagree ([`crate::vote`]).
    pub const OUTVOTED: Self = Self(1 << 12);
    /// Ticks passed without a call, for example while flash was erased: their correction was made up, their inputs are missing.
    pub const MISSED_TICKS: Self = Self(1 << 13);
    /// A bit of memory turned over: the image is the one of flash again, or the state began again ([`crate::State::checksum`]).
    pub const UPSET: Self = Self(1 << 14);

    /// The bits that a board adds to those of the compensator, with their names.
    pub const BOARD_NAMES: [(Self, &'static str); 7] = [
        (Self::NO_DITHER, "NO_DITHER"),
        (Self::COUNTS_LOST, "COUNTS_LOST"),
        (Self::SURVIVOR, "SURVIVOR"),
        (Self::STUCK, "STUCK"),
        (Self::OUTVOTED, "OUTVOTED"),
        (Self::MISSED_TICKS, "MISSED_TICKS"),
        (Self::UPSET, "UPSET"),
    ];

    /// Every bit of a compensator with its name in scripts and reports.
    pub const NAMES: [(Self, &'static str); 8] = [
        (Self::OUT_OF_SPAN, "OUT_OF_SPAN"),
        (Self::RATE_OUT_OF_SPAN, "RATE_OUT_OF_SPAN"),
        (Self::HELD, "HELD"),
        (Self::STALE, "STALE"),
        (Self::SETTLING, "SETTLING"),
        (Self::UNCORRECTED, "UNCORRECTED"),
        (Self::LIMITED, "LIMITED"),
        (Self::OVERFLOW, "OVERFLOW"),
    ];

    /// The raw bits, as in a frame or a register.
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// Both.
    pub(crate) const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// The status with these raw bits, including bits that this code does not know.
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits)
    }

    /// True when every bit of `other` is set here.
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

impl BitOr for Status {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitOrAssign for Status {
    fn bitor_assign(&mut self, other: Self) {
        self.0 |= other.0;
    }
}
