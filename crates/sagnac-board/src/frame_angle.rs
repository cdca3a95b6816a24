//! The angle of a frame's counts, exact over any number of frames.
//!
//! ```text
//! angle = floor((counts·S + rest)/10⁶)      S the angle of a count, 10⁻¹⁵ arcsec; angle in 10⁻⁹ arcsec; the rest goes to the next frame
//! ```
//!
//! Where it fails: beyond thousands of turns in one frame the angle stays at its largest value.

use sagnac_core::Image;

/// 10⁻¹⁵ arcsec of the unit of an angle.
const UNIT_FEMTO: i64 = 1_000_000;

/// The scale of a count, and what the last frame left.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrameAngle {
    scale: CountScale,
    rest_femto: i64,
}

/// The angle of one count in two parts, and the counts beyond which the angle of a frame does not grow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct CountScale {
    nano_arcsec: i64,
    femto_arcsec: i64,
    most_counts: i64,
}

impl CountScale {
    fn of(image: &Image) -> Self {
        let femto = image.description().scale_factor_femto_arcsec;
        let unit = UNIT_FEMTO.cast_unsigned();
        let nano_arcsec = femto.div_euclid(unit).cast_signed();
        let most_counts = (i64::MAX / 2).checked_div(nano_arcsec + 1).unwrap_or(0);
        Self { nano_arcsec, femto_arcsec: femto.rem_euclid(unit).cast_signed(), most_counts }
    }
}

impl FrameAngle {
    pub(crate) fn of(image: &Image) -> Self {
        Self { scale: CountScale::of(image), rest_femto: 0 }
    }

    /// Goes on with another image of the same gyro.
    pub(crate) fn take_scale_of(&mut self, image: &Image) {
        self.scale = CountScale::of(image);
    }

    /// No bit of the scale turned over.
    pub(crate) fn has_scale_of(&self, image: &Image) -> bool {
        self.scale == CountScale::of(image)
    }

    /// The angle of a frame, 10⁻⁹ arcsec.
    pub(crate) fn of_counts(&mut self, counts: i32) -> i64 {
        let CountScale { nano_arcsec, femto_arcsec, most_counts } = self.scale;
        // `clamp` would be a panic path: nothing shows the linker that the limit is positive.
        let counts = i64::from(counts).max(-most_counts).min(most_counts);
        let femto = counts * femto_arcsec + self.rest_femto;
        let units = femto.div_euclid(UNIT_FEMTO);
        self.rest_femto = femto - units * UNIT_FEMTO;
        counts * nano_arcsec + units
    }
}
