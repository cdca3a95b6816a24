//! A term of a noise budget: its value with an interval, or the reason why there is none; and the interval of a deviation.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::laws::terms::AllanTerm;
use sagnac_units::ARCSEC_RT_S_PER_DEG_RT_H;

/// 97.5 % quantile of the normal distribution.
pub(crate) const NORMAL_975: f64 = 1.96;

/// Confidence of every interval here.
pub const CONFIDENCE: f64 = 0.95;

/// N and Q.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseTerms {
    /// Angle random walk, arcsec/√s.
    pub n_arcsec_rt_s: f64,
    /// Quantization, arcsec.
    pub q_arcsec: f64,
}

impl NoiseTerms {
    /// Angle random walk in °/√h.
    pub fn n_deg_rt_h(&self) -> f64 {
        self.n_arcsec_rt_s / ARCSEC_RT_S_PER_DEG_RT_H
    }

    /// σ of the mean rate over `tau_s` that this noise alone makes, °/h: √(N²/τ + 2Q²/τ²).
    pub fn floor_dph(&self, tau_s: f64) -> f64 {
        (self.n_arcsec_rt_s.powi(2) / tau_s + 2.0 * self.q_arcsec.powi(2) / tau_s.powi(2)).sqrt()
    }
}

/// The noise of a log.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuredNoise {
    /// N and Q.
    pub terms: NoiseTerms,
    /// 95 % interval of N, arcsec/√s; from zero where N is not resolved, and `None` where the five laws do not describe the curve.
    pub n_ends_arcsec_rt_s: Option<[f64; 2]>,
    /// Cut-off of a low-pass filter that hides the shorter τ, Hz.
    pub filter_hz: Option<f64>,
}

impl MeasuredNoise {
    /// Noise that is stated, without an uncertainty.
    pub fn stated(terms: NoiseTerms) -> Self {
        Self { terms, n_ends_arcsec_rt_s: None, filter_hz: None }
    }

    /// N in °/√h, and the ends of its interval.
    pub fn n_deg_rt_h(&self) -> (f64, Option<[f64; 2]>) {
        let ends = self.n_ends_arcsec_rt_s.map(|ends| ends.map(|end| end / ARCSEC_RT_S_PER_DEG_RT_H));
        (self.terms.n_deg_rt_h(), ends)
    }

    /// Standard error of [`NoiseTerms::floor_dph`] as a part of it: that of N.
    pub fn relative_sigma_of_floor(&self, tau_s: f64) -> f64 {
        let Some([lower, upper]) = self.n_ends_arcsec_rt_s else { return 0.0 };
        let sigma = (upper - lower) / (2.0 * NORMAL_975);
        self.terms.n_arcsec_rt_s * sigma / tau_s / self.terms.floor_dph(tau_s).powi(2)
    }
}

/// A term of the budget.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum TermValue {
    /// Found.
    Found {
        /// Value.
        value: f64,
        /// Lower end of its 95 % interval; null if the uncertainty of the curve is unknown.
        lower: Option<f64>,
        /// Upper end.
        upper: Option<f64>,
    },
    /// Not resolvable from this record.
    Unresolved {
        /// Why.
        unresolved: String,
    },
}

/// The five terms, in the field's units.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Terms {
    /// Quantization, arcsec.
    pub q_arcsec: TermValue,
    /// Angle random walk, °/√h.
    pub n_deg_rt_h: TermValue,
    /// Bias instability, °/h.
    pub b_dph: TermValue,
    /// Rate random walk, °/h/√h.
    pub k_dph_rt_h: TermValue,
    /// Rate ramp, °/h/h.
    pub r_dph_h: TermValue,
}

impl Terms {
    /// In the order of [`AllanTerm::ALL`].
    pub fn get(&self, term: AllanTerm) -> &TermValue {
        match term {
            AllanTerm::Quantization => &self.q_arcsec,
            AllanTerm::AngleRandomWalk => &self.n_deg_rt_h,
            AllanTerm::BiasInstability => &self.b_dph,
            AllanTerm::RateRandomWalk => &self.k_dph_rt_h,
            AllanTerm::RateRamp => &self.r_dph_h,
        }
    }

    /// None of them, for one reason.
    pub(crate) fn none(why: &str) -> Self {
        Self::from_each(|_| TermValue::Unresolved { unresolved: why.to_owned() })
    }

    /// Without the values that were found, for one reason. Bounds of the others stay.
    #[must_use]
    pub fn withheld(&self, why: &str) -> Self {
        Self::from_each(|term| match self.get(term) {
            TermValue::Found { .. } => TermValue::Unresolved { unresolved: why.to_owned() },
            unresolved => unresolved.clone(),
        })
    }

    pub(crate) fn from_each(mut value: impl FnMut(AllanTerm) -> TermValue) -> Self {
        Self {
            q_arcsec: value(AllanTerm::Quantization),
            n_deg_rt_h: value(AllanTerm::AngleRandomWalk),
            b_dph: value(AllanTerm::BiasInstability),
            k_dph_rt_h: value(AllanTerm::RateRandomWalk),
            r_dph_h: value(AllanTerm::RateRamp),
        }
    }
}

impl AllanTerm {
    /// Letter and unit of the field.
    pub fn name(self) -> (&'static str, &'static str) {
        match self {
            Self::Quantization => ("quantization Q", "arcsec"),
            Self::AngleRandomWalk => ("angle random walk N", "°/√h"),
            Self::BiasInstability => ("bias instability B", "°/h"),
            Self::RateRandomWalk => ("rate random walk K", "°/h/√h"),
            Self::RateRamp => ("rate ramp R", "°/h/h"),
        }
    }

    /// From arcsec and seconds to its unit.
    pub fn in_its_unit(self, root: f64) -> f64 {
        match self {
            Self::Quantization | Self::BiasInstability => root,
            Self::AngleRandomWalk => root / ARCSEC_RT_S_PER_DEG_RT_H,
            Self::RateRandomWalk => root * 60.0,
            Self::RateRamp => root * 3600.0,
        }
    }
}

/// Ends of a deviation's interval: σ·√(edf/χ²).
pub(crate) fn interval(variance: f64, edf: Option<f64>, confidence: f64) -> [Option<f64>; 2] {
    let chi = edf.and_then(|edf| Some((edf, ChiSquared::new(edf).ok()?)));
    let Some((edf, chi)) = chi.filter(|_| variance > 0.0) else { return [None, None] };
    let tail = (1.0 - confidence) / 2.0;
    [1.0 - tail, tail].map(|part| {
        let end = (variance * edf / chi.inverse_cdf(part)).sqrt();
        end.is_finite().then_some(end)
    })
}
