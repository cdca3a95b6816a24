//! Series over temperature on one basis, so that units of different spans can be compared, averaged and charted.
//!
//! ```text
//! x = (T − 20 °C)/60 °C     bias n: T_n(x)     rate n: Ṫ·T_n(x)     scale n: T_n(x)     T_n: Chebyshev polynomial
//! β' = M·β, Cov(β') = M·Cov(β)·Mᵀ
//! ```
//!
//! M is linear and exact for polynomials. The constant of a series in T belongs to the run offset and is not part of it; that of a rate
//! series is `rate 0`. Fails for zones, steps and harmonics, which have no such basis.

use crate::model::TermShape;
use crate::model::basis::Span;
use crate::model::powers::{powers_of_chebyshev, series_from_powers};

/// Where x is −1 and 1, °C.
pub const COMMON_SPAN: Span = Span { lo: -40.0, hi: 80.0 };

/// A term of a series over temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SeriesTerm {
    /// Same for all terms of a series.
    pub(crate) series: usize,
    pub(crate) shape: TermShape,
    pub(crate) times_rate: bool,
}

/// M: of each coefficient on the common basis, in the order of the own terms, the own terms that it is made of and how much of each.
/// `None` for a shape without a series, or a series without one of its lower orders.
pub(crate) fn onto_common(span: Span, terms: &[SeriesTerm]) -> Option<Vec<Vec<(usize, f64)>>> {
    let mut rows = vec![Vec::new(); terms.len()];
    for (own, term) in terms.iter().enumerate() {
        let order = term.shape.order()?;
        let powers = powers_of_chebyshev(span, u8::try_from(order).ok()?);
        let least = usize::from(!term.times_rate);
        let series = series_from_powers(COMMON_SPAN, &powers);
        for (n, weight) in series.into_iter().enumerate().take(order + 1).skip(least) {
            let is_of_order = |other: &SeriesTerm| other.series == term.series && other.shape.order() == Some(n);
            rows[terms.iter().position(is_of_order)?].push((own, weight));
        }
    }
    Some(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::chebyshev;

    /// A curve and a rate effect have the same values on either basis, but for the curve's constant.
    #[test]
    fn the_curve_stays_what_it_is() {
        let span = Span { lo: -12.0, hi: 51.0 };
        let term = |series: usize, order: u8| SeriesTerm {
            series,
            shape: TermShape::Chebyshev { order },
            times_rate: series == 1,
        };
        let terms = [term(0, 1), term(0, 2), term(0, 3), term(1, 0), term(1, 1)];
        let own = [0.3, -0.2, 0.05, 0.7, 0.11];
        let common: Vec<f64> =
            onto_common(span, &terms).unwrap().iter().map(|row| row.iter().map(|(at, w)| w * own[*at]).sum()).collect();
        let value = |span: Span, values: &[f64], series: usize, celsius: f64| -> f64 {
            let shapes = chebyshev(span.x(celsius));
            let of = |(term, value): (&SeriesTerm, &f64)| value * shapes[term.shape.order().unwrap()];
            terms.iter().zip(values).filter(|(term, _)| term.series == series).map(of).sum()
        };
        for celsius in [-12.0, 3.0, 20.0, 51.0] {
            let curve = |span, values: &[f64]| value(span, values, 0, celsius) - value(span, values, 0, 20.0);
            assert!((curve(span, &own) - curve(COMMON_SPAN, &common)).abs() < 1e-12);
            assert!((value(span, &own, 1, celsius) - value(COMMON_SPAN, &common, 1, celsius)).abs() < 1e-12);
        }
        assert!(onto_common(span, &[term(0, 2)]).is_none(), "a series without its first order");
        assert!(onto_common(span, &[SeriesTerm { shape: TermShape::Step { threshold: 1.0 }, ..terms[0] }]).is_none());
    }
}
