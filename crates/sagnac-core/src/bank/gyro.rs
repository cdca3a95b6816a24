//! Which gyro this is, and what an image must be to be its own.

use core::fmt;

use crate::image::{Description, Image, Kind};

/// What the board knows of its gyro without any image.
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
    /// Largest believable |increment|, counts·2⁻³² per tick: d·tick/S0·2³² of the worst drift this gyro can have.
    pub largest_increment: i64,
    /// Largest believable |k − 1|, 2⁻³²: 4295 is 1 ppm.
    pub largest_scale: i64,
}

/// Why an intact image is not for this gyro.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unfit {
    /// Another gyro's.
    Serial,
    /// Another axis of it.
    Axis,
    /// For another length of the tick.
    Tick,
    /// For another scale factor.
    ScaleFactor,
    /// For another unit of the output.
    Quantum,
    /// Its bias terms could reach a drift that this gyro cannot have.
    AbsurdBias,
    /// Its scale terms could reach a change that this gyro cannot have.
    AbsurdScale,
}

impl fmt::Display for Unfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Serial => "made for a gyro of another serial number",
            Self::Axis => "made for another axis",
            Self::Tick => "made for another length of the tick",
            Self::ScaleFactor => "made for another scale factor",
            Self::Quantum => "made for another quantum",
            Self::AbsurdBias => "its bias terms reach beyond what this gyro can drift",
            Self::AbsurdScale => "its scale terms reach beyond what this gyro can change",
        })
    }
}

impl core::error::Error for Unfit {}

impl Gyro {
    /// The gyro that an image was made for, believing drifts and scale changes up to `times` what the image can reach.
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
        }
    }

    /// Says whether an image is this gyro's.
    ///
    /// # Errors
    /// The first thing that does not fit.
    pub fn accept(&self, image: &Image) -> Result<(), Unfit> {
        let d = image.description();
        let rules = [
            (d.serial == self.serial, Unfit::Serial),
            (d.axis == self.axis, Unfit::Axis),
            (d.tick_ns == self.tick_ns, Unfit::Tick),
            (d.scale_factor_femto_arcsec == self.scale_factor_femto_arcsec, Unfit::ScaleFactor),
            (d.quantum_nano_counts == self.quantum_nano_counts, Unfit::Quantum),
            (image.reach(Kind::Bias) <= self.largest_increment, Unfit::AbsurdBias),
            (image.reach(Kind::Scale) <= self.largest_scale, Unfit::AbsurdScale),
        ];
        rules.iter().find(|(holds, _)| !holds).map_or(Ok(()), |(_, unfit)| Err(*unfit))
    }

    /// What runs while no image is valid: counts pass through. The status of its ticks is clean, because an image
    /// without terms does all it was made for: who runs it on [`crate::Origin::FactoryDefaults`] adds
    /// [`crate::Status::UNCORRECTED`].
    pub fn factory_defaults(&self) -> Image {
        let described = Description {
            serial: self.serial,
            axis: self.axis,
            tick_ns: self.tick_ns.max(1),
            scale_factor_femto_arcsec: self.scale_factor_femto_arcsec.max(1),
            quantum_nano_counts: self.quantum_nano_counts.max(1),
            ..Description::empty()
        };
        // A serial or axis that no image can hold falls back to the empty one.
        Image::new(described).unwrap_or_else(|_| Image::empty())
    }
}
