//! The verdict of the loader in `sagnac_image.v` on the bytes of an image, by the table in docs/explanation/fpga.md.

/// What a hardware was built with.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Hardware {
    pub(super) inputs: u8,
    pub(super) pieces: bool,
    pub(super) harmonics: bool,
    pub(super) derived: bool,
    pub(super) step_limits: bool,
}

impl Hardware {
    pub(super) const WHOLE: Self = Self { inputs: 4, pieces: true, harmonics: true, derived: true, step_limits: true };
    /// A single thermometer with polynomials: the paper's image and the like.
    pub(super) const SMALL: Self =
        Self { inputs: 1, pieces: false, harmonics: false, derived: false, step_limits: true };
    /// The fault of an image that needs more.
    pub(super) const FAULT: u32 = 6;

    /// The parameters of the module.
    pub(super) fn parameters(self) -> [(&'static str, u8); 5] {
        [
            ("INPUTS", self.inputs),
            ("PIECES", self.pieces.into()),
            ("HARMONICS", self.harmonics.into()),
            ("DERIVED", self.derived.into()),
            ("STEP_LIMITS", self.step_limits.into()),
        ]
    }
}

const NOT_AN_IMAGE: u32 = 1;
const VERSION: u32 = 2;
const LENGTH: u32 = 3;
const CRC: u32 = 4;
const FIELD: u32 = 5;
const NEEDS_MORE: u32 = Hardware::FAULT;

/// The fault that the loader finds first, or 0. `bytes` are whole words.
pub(super) fn verdict(bytes: &[u8], hardware: Hardware) -> u32 {
    let word = |at: usize| bytes.get(4 * at..4 * at + 4).map_or(0, |w| u32::from_le_bytes([w[0], w[1], w[2], w[3]]));
    if !bytes.starts_with(b"SAGNACIM") {
        return NOT_AN_IMAGE;
    }
    if word(2) & 0xffff != 1 || word(2) >> 16 > 5 {
        return VERSION;
    }
    if !(132..=772).contains(&word(3)) || word(3) % 4 != 0 {
        return LENGTH;
    }
    let (body, crc) = bytes.split_at(bytes.len() - 4);
    // Another length sums other words.
    if word(3) as usize != bytes.len() || sagnac_core::bytes::crc32(body).to_le_bytes() != crc {
        return CRC;
    }
    let head: Vec<u32> = (0..32).map(word).collect();
    let fault = of_head(&head, bytes.len(), hardware);
    if fault != 0 {
        return fault;
    }
    let [_, inputs, terms, _] = head[12].to_le_bytes();
    let inputs_at = |n: u8| 32 + 16 * usize::from(n);
    let of_inputs = (0..inputs).map(|n| {
        let words: Vec<u32> = (0..16).map(|place| word(inputs_at(n) + place)).collect();
        of_input(&words, n, hardware)
    });
    let of_terms = (0..usize::from(terms)).map(|n| {
        let at = inputs_at(inputs) + 3 * n;
        of_term([word(at), word(at + 1), word(at + 2)], inputs, hardware)
    });
    of_inputs.chain(of_terms).find(|fault| *fault != 0).unwrap_or(0)
}

/// The first rule that is broken.
fn first(rules: &[(bool, u32)]) -> u32 {
    rules.iter().find(|(broken, _)| *broken).map_or(0, |(_, fault)| *fault)
}

fn of_head(word: &[u32], len: usize, hardware: Hardware) -> u32 {
    let [_, inputs, terms, zero] = word[12].to_le_bytes();
    let announced = 132 + 64 * usize::from(inputs) + 12 * usize::from(terms);
    first(&[
        (inputs > 4 || terms > 32 || zero != 0 || announced != len, FIELD),
        (inputs > hardware.inputs, NEEDS_MORE),
        (word[13] == 0, FIELD),
        (word[14] == 0 || word[14] > 1 << 24, FIELD),
        (word[15] > word[14], FIELD),
        (word[16] == 0 && word[17] == 0, FIELD),
        (word[18] == 0 && word[19] == 0, FIELD),
        (word[22] == 0 || word[22] > i32::MAX as u32, FIELD),
        (word[31] != 0, FIELD),
    ])
}

fn of_input(word: &[u32], index: u8, hardware: Hardware) -> u32 {
    let [gain_shift, x_shift, alpha_shift, rate_shift] = word[2].to_le_bytes();
    let [y_shift, source, of, less] = word[3].to_le_bytes();
    let [_, step_low, step_high, growth] = word[15].to_le_bytes();
    let grows_by_steps = growth <= 16 && (growth == 0 || (step_low, step_high) != (0, 0));
    let is_source = match source {
        0 | 3 => (of, less) == (0, 0),
        1 => of < index && less < index,
        2 => of < index && less == 0,
        _ => false,
    };
    let is_lag =
        if alpha_shift == 0 { rate_shift == 0 } else { (31..=62).contains(&alpha_shift) && rate_shift < alpha_shift };
    first(&[
        (word[1] == 0, FIELD),
        (gain_shift > 62 || x_shift > 15 || !is_lag, FIELD),
        (y_shift > 31 || !is_source, FIELD),
        (source != 0 && !hardware.derived, NEEDS_MORE),
        (word[9] > 1 << 31 || (word[9] == 0) != (alpha_shift == 0), FIELD),
        (!grows_by_steps, FIELD),
        ((step_low, step_high) != (0, 0) && !hardware.step_limits, NEEDS_MORE),
    ])
}

fn of_term(word: [u32; 3], inputs: u8, hardware: Hardware) -> u32 {
    let [kind, input, order, multiplier] = word[0].to_le_bytes();
    let [shift, shape, ..] = word[2].to_le_bytes();
    let knot = word[2] >> 16;
    let is_shape = match shape {
        0 => order <= 8 && knot == 0,
        1 | 2 => order == 0,
        3 | 4 => true,
        _ => false,
    };
    let is_built = match shape {
        1 | 2 => hardware.pieces,
        3 | 4 => hardware.harmonics,
        _ => true,
    };
    first(&[
        (!(1..=2).contains(&kind) || input >= inputs || multiplier > 1, FIELD),
        (word[1] == 1 << 31, FIELD),
        (!(8..=62).contains(&shift) || !is_shape, FIELD),
        (!is_built, NEEDS_MORE),
    ])
}
