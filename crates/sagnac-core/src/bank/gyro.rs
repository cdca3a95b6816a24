//! The identity of a gyro, and the check that an image is made for it.

use core::fmt;

use crate::image::{Description, Image, Kind};

/// What the board knows about its gyro without an image, from a fuse or its configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gyro {
    /// Serial number, UTF-8, padded with zero bytes.
    pub serial: [u8; 32],
    /// Axis letter.
    pub axis: u8,
    /// Length of a tick, ns.
    pub tick_ns: u32,
    /// Nominal scale factor of one output count, 1e-15 arcsec.
    pub scale_factor_femto_arcsec: u64,
    /// Counts of the counter per output count, 1e-9.
    pub quantum_nano_counts: u64,
    /// Largest |increment| that an image may reach, counts·2⁻³² per tick: d·tick/S0·2³² of the largest drift of this type of gyro.
    pub largest_increment: i64,
    /// Largest |k − 1| that an image may reach, 2⁻³²: 4295 is 1 ppm.
    pub largest_scale: i64,
    /// Most instructions that an image's slow update may have ([`Image::work`]): what the board can do between the update and its next tick,
    /// in the measure of the reference.
    pub largest_work: u32,
}

/// Why an intact image is refused for this gyro.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageMismatch {
    /// Another serial number.
    Serial,
    /// Another axis.
    Axis,
    /// Another length of the tick.
    Tick,
    /// Another scale factor.
    ScaleFactor,
    /// Another quantum (unit of the output counts).
    Quantum,
    /// Its bias terms can reach more than [`Gyro::largest_increment`].
    BiasTooLarge,
    /// Its scale terms can reach more than [`Gyro::largest_scale`].
    ScaleTooLarge,
    /// Its slow update has more instructions than [`Gyro::largest_work`].
    WorkTooLarge,
}

impl fmt::Display for ImageMismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Serial => "made for a gyro of another serial number",
            Self::Axis => "made for another axis",
            Self::Tick => "made for another length of the tick",
            Self::ScaleFactor => "made for another scale factor",
            Self::Quantum => "made for another quantum",
            Self::BiasTooLarge => "its bias terms reach beyond the largest drift of this gyro",
            Self::WorkTooLarge => "its slow update takes more instructions than this board has time for",
            Self::ScaleTooLarge => "its scale terms reach beyond the largest scale-factor change of this gyro",
        })
    }
}

impl core::error::Error for ImageMismatch {}

impl Gyro {
    /// The gyro that an image was made for, with limits of `times` what the image can reach.
    pub fn of(image: &Image, times: u32) -> Self {
        let d = image.description();
        Self {
            serial: d.serial,
            axis: d.axis,
            tick_ns: d.tick_ns,
            scale_factor_femto_arcsec: d.scale_factor_femto_arcsec,
            quantum_nano_counts: d.quantum_nano_counts,
            largest_increment: image.reach(Kind::Bias).saturating_mul(i64::from(times)),
            largest_scale: image.reach(Kind::Scale).saturating_mul(i64::from(times)),
            largest_work: image.work().instructions().saturating_mul(times),
        }
    }

    /// Checks that an image is made for this gyro.
    ///
    /// # Errors
    /// The first property that differs.
    ///
    /// **SAG-CORE-023** An image for another serial number, axis, tick or scale factor, or beyond the gyro's limits, is
    /// refused.
    pub fn accept(&self, image: &Image) -> Result<(), ImageMismatch> {
        let d = image.description();
        let rules = [
            (d.serial == self.serial, ImageMismatch::Serial),
            (d.axis == self.axis, ImageMismatch::Axis),
            (d.tick_ns == self.tick_ns, ImageMismatch::Tick),
            (d.scale_factor_femto_arcsec == self.scale_factor_femto_arcsec, ImageMismatch::ScaleFactor),
            (d.quantum_nano_counts == self.quantum_nano_counts, ImageMismatch::Quantum),
            (image.reach(Kind::Bias) <= self.largest_increment, ImageMismatch::BiasTooLarge),
            (image.reach(Kind::Scale) <= self.largest_scale, ImageMismatch::ScaleTooLarge),
            (image.work().instructions() <= self.largest_work, ImageMismatch::WorkTooLarge),
        ];
        rules.iter().find(|(holds, _)| !holds).map_or(Ok(()), |(_, mismatch)| Err(*mismatch))
    }

    /// The image to run while no bank holds a valid one: counts pass through.
    ///
    /// The status of its ticks is clean, because an image without terms has nothing to correct. With
    /// [`crate::Origin::FactoryDefaults`] the caller adds [`crate::Status::UNCORRECTED`].
    pub fn factory_defaults(&self) -> Image {
        let described = Description {
            serial: self.serial,
            axis: self.axis,
            tick_ns: self.tick_ns.max(1),
            scale_factor_femto_arcsec: self.scale_factor_femto_arcsec.max(1),
            quantum_nano_counts: self.quantum_nano_counts.max(1),
            ..Description::empty()
        };
        // Falls back to the empty image for a serial number or axis that no image can hold.
        Image::new(described).unwrap_or_else(|_| Image::empty())
    }
}
