//! The minimum of a function of one variable: parabolas through its lowest points, golden sections where these do not help (Brent 1973,
//! chapter 5). Smooth functions take about eight evaluations where golden sections alone took twenty-six.
//!
//! Fails where there is more than one valley: it ends in one of them. Callers bracket the lowest place of a grid.

/// (3 − √5)/2.
const SECTION: f64 = 0.381_966_011_250_105_1;
/// A bracket shrinks to this tolerance far sooner.
const MOST_STEPS: usize = 60;

/// A place and the function there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LowestPoint {
    pub(crate) at: f64,
    pub(crate) value: f64,
}

/// Minimum of a function with one valley between `lo` and `hi`, to within `tolerance` of its place.
pub(crate) fn minimum(mut lo: f64, mut hi: f64, tolerance: f64, f: impl Fn(f64) -> f64) -> LowestPoint {
    let point = |at: f64| LowestPoint { at, value: f(at) };
    let mut lowest = point(lo + SECTION * (hi - lo));
    // The second and the third lowest; the last two steps.
    let (mut second, mut third, mut step, mut before) = (lowest, lowest, 0.0_f64, 0.0_f64);
    for _ in 0..MOST_STEPS {
        let middle = f64::midpoint(lo, hi);
        if (lowest.at - middle).abs() + 0.5 * (hi - lo) <= 2.0 * tolerance {
            break;
        }
        let bracket = (lo + 2.0 * tolerance)..=(hi - 2.0 * tolerance);
        let vertex = vertex(lowest, second, third);
        let halves =
            |to_vertex: &f64| to_vertex.abs() < 0.5 * before.abs() && (lo..hi).contains(&(lowest.at + to_vertex));
        let golden = SECTION * if lowest.at < middle { hi - lowest.at } else { lo - lowest.at };
        (before, step) = match vertex.filter(halves) {
            // Not so near to an end that nothing would be learnt.
            Some(to_vertex) if bracket.contains(&(lowest.at + to_vertex)) => (step, to_vertex),
            Some(_) => (step, tolerance.copysign(middle - lowest.at)),
            None => (golden / SECTION, golden),
        };
        let next = point(lowest.at + if step.abs() >= tolerance { step } else { tolerance.copysign(step) });
        let end = if next.value <= lowest.value { lowest.at } else { next.at };
        if (next.at < lowest.at) == (next.value <= lowest.value) {
            hi = end
        } else {
            lo = end
        }
        if next.value <= lowest.value {
            (third, second, lowest) = (second, lowest, next);
        } else if next.value <= second.value || second.at == lowest.at {
            (third, second) = (second, next);
        } else if next.value <= third.value || third.at == lowest.at || third.at == second.at {
            third = next;
        }
    }
    lowest
}

/// From the first of three points to the vertex of the parabola through them; `None` where there is none below.
fn vertex(a: LowestPoint, b: LowestPoint, c: LowestPoint) -> Option<f64> {
    let (to_b, to_c) = (b.at - a.at, c.at - a.at);
    let (of_b, of_c) = (to_c * (b.value - a.value), to_b * (c.value - a.value));
    let to_vertex = 0.5 * (to_c * of_b - to_b * of_c) / (of_b - of_c);
    let opens_upwards = (of_b - of_c) * to_b * to_c * (to_b - to_c) > 0.0;
    (opens_upwards && to_vertex.is_finite()).then_some(to_vertex)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// cosh(x − 1) has its minimum at 1; |x − 1| and a rising line have theirs in a corner and at an end.
    #[test]
    fn finds_smooth_minima_corners_and_ends() {
        let calls = Cell::new(0);
        let counted = |f: fn(f64) -> f64| {
            calls.set(0);
            minimum(-5.0, 9.0, 1e-4, |x| {
                calls.set(calls.get() + 1);
                f(x)
            })
        };
        let smooth = counted(|x| (x - 1.0).cosh());
        assert!((smooth.at - 1.0).abs() < 1e-4 && (smooth.value - 1.0).abs() < 1e-8, "{smooth:?}");
        assert!(calls.get() <= 16, "{}", calls.get());
        assert!((counted(|x| (x - 1.0).abs()).at - 1.0).abs() < 2e-4);
        assert!((counted(|x| x).at + 5.0).abs() < 3e-4);
        assert!(calls.get() <= 30, "{}", calls.get());
        assert!((counted(|x| -x).at - 9.0).abs() < 3e-4);
    }

    /// Infinite where nothing can be fitted, or the same everywhere: it ends, and within the bracket.
    #[test]
    fn ends_where_the_function_is_infinite_or_flat() {
        for f in [|_| f64::INFINITY, |_| f64::NAN, |_| 3.0, |x: f64| if x < 0.5 { f64::INFINITY } else { x }] {
            let found = minimum(0.0, 1.0, 1e-3, f);
            assert!((0.0..=1.0).contains(&found.at), "{found:?}");
        }
        assert!((minimum(0.0, 1.0, 1e-3, |x| if x < 0.5 { f64::INFINITY } else { x }).at - 0.5).abs() < 3e-3);
    }
}
