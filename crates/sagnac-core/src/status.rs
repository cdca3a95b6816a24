//! What the consumer of a corrected count must know about it.

use core::ops::{BitOr, BitOrAssign};

/// Status bits that travel with every corrected value. Zero means: corrected, inside the span.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Status(u16);

impl Status {
    /// Corrected, nothing to report.
    pub const OK: Self = Self(0);
    /// Temperature or its rate is outside the fit span; the correction is the one at the border.
    pub const OUT_OF_SPAN: Self = Self(1);
    /// It is the rate (not only the temperature) that is outside its span. Comes with `OUT_OF_SPAN`.
    pub const RATE_OUT_OF_SPAN: Self = Self(1 << 1);
    /// No plausible temperature at the last slow update; the last correction is kept.
    pub const HELD: Self = Self(1 << 2);
    /// Held for longer than the image allows.
    pub const STALE: Self = Self(1 << 3);
    /// The lag filter has not forgotten its start: min(3τ, 1 h) after the first temperature.
    pub const SETTLING: Self = Self(1 << 4);
    /// No correction was ever computed; counts pass through unchanged.
    pub const UNCORRECTED: Self = Self(1 << 5);
    /// The output limit was reached; the excess stays in the accumulator and comes out later.
    pub const LIMITED: Self = Self(1 << 6);
    /// The accumulator came near its bound. Latched; the output is zero and means nothing.
    pub const OVERFLOW: Self = Self(1 << 7);

    /// Every single bit with the name scripts and reports use.
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

    /// The raw bits, as a frame or a register carries them.
    pub const fn bits(self) -> u16 {
        self.0
    }

    /// The status with these raw bits, those without a meaning to this program too.
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
