//! Random numbers of the tests of this folder.

/// A stream of normal values: Marsaglia's polar method on a 64-bit generator of Vigna (splitmix64).
pub(super) struct Draws(pub(super) u64);

impl Draws {
    pub(super) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * 2f64.powi(-53)
    }

    pub(super) fn normal(&mut self) -> f64 {
        loop {
            let [a, b] = [self.uniform(), self.uniform()].map(|u| 2.0 * u - 1.0);
            let s = a * a + b * b;
            if s > 0.0 && s < 1.0 {
                return a * (-2.0 * s.ln() / s).sqrt();
            }
        }
    }
}
