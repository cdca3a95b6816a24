//! A figure as data: what is drawn, not how. [`super::svg`] draws it for paper, the page's script on screen.

use sagnac_log::setup::RateUnit;
use serde::Serialize;

/// The meaning of a layer; each role has one colour throughout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Role {
    Before,
    After,
    Fit,
    Floor,
    Heating,
    Cooling,
    Steady,
    Temperature,
    Excluded,
    ExcludedToo,
    ExcludedAlso,
}

impl Role {
    /// Its colour's name in the page's style.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Before => "before",
            Self::After => "after",
            Self::Fit => "fit",
            Self::Floor => "floor",
            Self::Heating => "heating",
            Self::Cooling => "cooling",
            Self::Steady => "steady",
            Self::Temperature => "temperature",
            Self::Excluded => "excluded",
            Self::ExcludedToo => "excluded_too",
            Self::ExcludedAlso => "excluded_also",
        }
    }
}

/// Lengths of strokes and gaps, px; none: an unbroken line. It distinguishes the lines of a figure where there is no colour.
pub(crate) type Dash = &'static [u8];

/// An unbroken line.
pub(crate) const SOLID: Dash = &[];
/// Broken lines that can be distinguished from each other.
pub(crate) const DASHES: [Dash; 6] = [&[8, 5], &[2, 4], &[12, 4, 2, 4], &[16, 6], &[8, 3, 2, 3, 2, 3], &[5, 2]];

impl Role {
    /// How its broken lines are broken.
    pub(crate) fn dash(self) -> Dash {
        match self {
            Self::Cooling | Self::After => DASHES[1],
            Self::Floor => DASHES[2],
            Self::ExcludedToo => DASHES[3],
            Self::Excluded | Self::ExcludedAlso => DASHES[4],
            Self::Before | Self::Heating | Self::Fit | Self::Steady | Self::Temperature => DASHES[0],
        }
    }
}

/// One thing drawn.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub(crate) enum Layer {
    Dots {
        label: String,
        role: Role,
        x: Vec<f64>,
        y: Vec<f64>,
    },
    Line {
        label: String,
        role: Role,
        x: Vec<f64>,
        y: Vec<f64>,
        dash: Dash,
    },
    Band {
        label: String,
        role: Role,
        x: Vec<f64>,
        lo: Vec<f64>,
        hi: Vec<f64>,
    },
    /// A vertical bar of uncertainty and its middle.
    Whiskers {
        label: String,
        role: Role,
        x: Vec<f64>,
        y: Vec<f64>,
        half: Vec<f64>,
        /// A line from middle to middle.
        joined: bool,
    },
    Bars {
        label: String,
        role: Role,
        edges: Vec<f64>,
        heights: Vec<f64>,
    },
    /// Stretches of x with a reason.
    Shades {
        label: String,
        role: Role,
        stretches: Vec<[f64; 2]>,
    },
}

impl Layer {
    /// The class of its sign in the legend on screen.
    pub(crate) fn sign(&self) -> &'static str {
        match self {
            Self::Dots { role: Role::Cooling, .. } => "cross",
            Self::Dots { role: Role::Before, .. } => "ring",
            Self::Dots { role: Role::Steady, .. } => "point",
            Self::Dots { .. } => "dot",
            Self::Whiskers { joined: false, .. } => "bar",
            Self::Line { .. } | Self::Whiskers { .. } => "solid",
            Self::Band { .. } | Self::Shades { .. } => "pale",
            Self::Bars { .. } => "full",
        }
    }

    /// How its line is broken; nothing for an unbroken one, and for what is no line.
    pub(crate) fn dash(&self) -> Dash {
        match self {
            Self::Line { dash, .. } => dash,
            _ => SOLID,
        }
    }

    pub(crate) fn label(&self) -> (&str, Role) {
        match self {
            Self::Dots { label, role, .. }
            | Self::Line { label, role, .. }
            | Self::Band { label, role, .. }
            | Self::Whiskers { label, role, .. }
            | Self::Bars { label, role, .. }
            | Self::Shades { label, role, .. } => (label, *role),
        }
    }
}

/// A figure.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Figure {
    /// Unique on the page.
    pub(crate) id: String,
    /// The question it answers.
    #[serde(skip)]
    pub(crate) title: String,
    /// What to see in it.
    #[serde(skip)]
    pub(crate) caption: String,
    pub(crate) x_label: String,
    pub(crate) y_label: String,
    /// Figures of one group share their cursor and their zoom along x.
    pub(crate) group: String,
    pub(crate) x: [f64; 2],
    pub(crate) y: [f64; 2],
    /// Both axes in decades.
    pub(crate) decades: bool,
    pub(crate) layers: Vec<Layer>,
}

/// The unit of labels before a figure is shown in another.
const DPH: &str = "°/h";

impl Figure {
    /// With its rates in a unit: those axes whose label ends in °/h.
    pub(crate) fn shown_in(mut self, units: RateUnit) -> Self {
        let scaled = |values: &mut [f64]| values.iter_mut().for_each(|value| *value = units.of_dph(*value));
        if let Some(quantity) = self.x_label.strip_suffix(DPH) {
            self.x_label = format!("{quantity}{}", units.name());
            scaled(&mut self.x);
            for layer in &mut self.layers {
                match layer {
                    Layer::Dots { x, .. }
                    | Layer::Line { x, .. }
                    | Layer::Band { x, .. }
                    | Layer::Whiskers { x, .. } => scaled(x),
                    Layer::Bars { edges, .. } => scaled(edges),
                    Layer::Shades { stretches, .. } => stretches.iter_mut().for_each(|stretch| scaled(stretch)),
                }
            }
        }
        if let Some(quantity) = self.y_label.strip_suffix(DPH) {
            self.y_label = format!("{quantity}{}", units.name());
            scaled(&mut self.y);
            for layer in &mut self.layers {
                match layer {
                    Layer::Dots { y, .. } | Layer::Line { y, .. } => scaled(y),
                    Layer::Band { lo, hi, .. } => [lo, hi].into_iter().for_each(|edge| scaled(edge)),
                    Layer::Whiskers { y, half, .. } => [y, half].into_iter().for_each(|values| scaled(values)),
                    Layer::Bars { heights, .. } => scaled(heights),
                    Layer::Shades { .. } => {}
                }
            }
        }
        self
    }

    /// Frames what its layers hold; `None` where they hold nothing.
    pub(crate) fn framed(mut self, keep_zero: bool) -> Option<Self> {
        let (mut xs, mut ys) = (Range::EMPTY, Range::EMPTY);
        for layer in &self.layers {
            match layer {
                Layer::Dots { x, y, .. } | Layer::Line { x, y, .. } => {
                    xs.take(x);
                    ys.take(y);
                }
                Layer::Band { x, lo, hi, .. } => {
                    xs.take(x);
                    ys.take(lo);
                    ys.take(hi);
                }
                Layer::Whiskers { x, y, half, .. } => {
                    xs.take(x);
                    y.iter().zip(half).for_each(|(y, half)| ys.take(&[y - half, y + half]));
                }
                Layer::Bars { edges, heights, .. } => {
                    xs.take(edges);
                    ys.take(heights);
                }
                Layer::Shades { .. } => {}
            }
        }
        if keep_zero {
            ys.take(&[0.0]);
        }
        if xs.is_beyond() || ys.is_beyond() {
            return None;
        }
        if self.decades {
            if xs.has_too_many_decades() || ys.has_too_many_decades() {
                return None;
            }
            let padded = |range: &Range, part: f64| Some(range.log10().padded(part)?.map(|power| 10.0_f64.powf(power)));
            self.x = padded(&xs, 0.02)?;
            self.y = padded(&ys, 0.04)?;
            return Some(self);
        }
        self.x = xs.padded(0.02)?;
        self.y = ys.padded(0.06)?;
        self.clip_shades();
        Some(self)
    }

    /// The same with log10 of every value, for a drawing whose axes are straight. Values must be above zero.
    pub(crate) fn in_powers(&self) -> Self {
        let powers = |values: &mut [f64]| values.iter_mut().for_each(|value| *value = value.log10());
        let mut out = self.clone();
        powers(&mut out.x);
        powers(&mut out.y);
        for layer in &mut out.layers {
            match layer {
                Layer::Dots { x, y, .. } | Layer::Line { x, y, .. } => [x, y].into_iter().for_each(|v| powers(v)),
                Layer::Band { x, lo, hi, .. } => [x, lo, hi].into_iter().for_each(|v| powers(v)),
                Layer::Whiskers { x, .. } | Layer::Bars { edges: x, .. } => powers(x),
                Layer::Shades { stretches, .. } => stretches.iter_mut().for_each(|stretch| powers(stretch)),
            }
        }
        out
    }

    fn clip_shades(&mut self) {
        let [lo, hi] = self.x;
        for layer in &mut self.layers {
            if let Layer::Shades { stretches, .. } = layer {
                stretches.iter_mut().for_each(|stretch| *stretch = stretch.map(|x| x.clamp(lo, hi)));
            }
        }
    }
}

/// Lowest and highest finite value.
struct Range {
    lo: f64,
    hi: f64,
}

impl Range {
    const EMPTY: Self = Self { lo: f64::INFINITY, hi: f64::NEG_INFINITY };

    fn take(&mut self, values: &[f64]) {
        for value in values.iter().filter(|v| v.is_finite()) {
            self.lo = self.lo.min(*value);
            self.hi = self.hi.max(*value);
        }
    }

    /// Beyond what any quantity is and any axis can be divided into: too large, or too narrow.
    fn is_beyond(&self) -> bool {
        const DRAWABLE: f64 = 1e60;
        let width = self.hi - self.lo;
        self.lo.abs().max(self.hi.abs()) > DRAWABLE && width >= 0.0 || width > 0.0 && width < 1.0 / DRAWABLE
    }

    /// More powers of ten than an axis can be divided into.
    fn has_too_many_decades(&self) -> bool {
        const DRAWABLE: f64 = 60.0;
        self.lo > 0.0 && self.hi.log10() - self.lo.log10() > DRAWABLE
    }

    /// The range of the powers of ten; empty where something is not above zero.
    fn log10(&self) -> Self {
        if self.lo > 0.0 && self.lo <= self.hi {
            Self { lo: self.lo.log10(), hi: self.hi.log10() }
        } else {
            Self::EMPTY
        }
    }

    /// With a margin on both sides; never empty, so that something can be drawn.
    fn padded(&self, part: f64) -> Option<[f64; 2]> {
        if self.lo > self.hi {
            return None;
        }
        let width = self.hi - self.lo;
        let alike = if self.hi == 0.0 { 1.0 } else { self.hi.abs() };
        let margin = if width > 0.0 { part * width } else { alike };
        Some([self.lo - margin, self.hi + margin])
    }
}

/// Five significant digits, and a hundred-thousandth of the range where that is finer: finer than any screen, and a fifth of
/// the bytes.
pub(crate) fn rounded(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let values: Vec<f64> = values.into_iter().collect();
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    let width = finite().fold(f64::NEG_INFINITY, f64::max) - finite().fold(f64::INFINITY, f64::min);
    let of_range = (5.0 - width.log10().floor()).clamp(0.0, 15.0);
    let round = |value: f64| {
        let own = format!("{value:.4e}").parse().unwrap_or(value);
        // A range of nothing, or of one value, asks for no more.
        if !(width > 0.0 && width < 0.1 * value.abs()) {
            return own;
        }
        format!("{value:.*}", of_range as usize).parse().unwrap_or(value)
    };
    values.iter().map(|value| if value.is_finite() { round(*value) } else { *value }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_change_of_a_large_value_is_kept() {
        let values: Vec<f64> = (0..=20).map(|i| -527_850.0 - 0.37 * f64::from(i)).collect();
        let drawn = rounded(values.iter().copied());
        assert!(values.iter().zip(&drawn).all(|(a, b)| (a - b).abs() < 1e-3), "{drawn:?}");
        assert_eq!(rounded([1.234_567e-7, 1.0]), [1.2346e-7, 1.0]);
        assert_eq!(rounded([f64::NAN])[0].to_bits(), f64::NAN.to_bits());
        assert_eq!(rounded([123_456.789]), [123_460.0]);
    }

    #[test]
    fn a_frame_holds_everything_and_is_never_empty() {
        let line =
            |y: Vec<f64>| Layer::Line { label: String::new(), role: Role::Fit, x: vec![0.0, 1.0], y, dash: SOLID };
        let figure = |layer| Figure {
            id: String::new(),
            title: String::new(),
            caption: String::new(),
            x_label: String::new(),
            y_label: String::new(),
            group: String::new(),
            x: [0.0; 2],
            y: [0.0; 2],
            decades: false,
            layers: vec![layer],
        };
        let flat = figure(line(vec![3.0, 3.0])).framed(false).unwrap();
        assert!(flat.y[0] < 3.0 && flat.y[1] > 3.0);
        assert!(figure(line(vec![f64::NAN, f64::NAN])).framed(false).is_none());
        // An axis to 1e308 has no ticks, and its width no number.
        for huge in [1e308, -1e308, 1e61] {
            assert!(figure(line(vec![0.0, huge])).framed(false).is_none());
        }
    }
}
