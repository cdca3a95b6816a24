//! Counts of a hardware counter give the frames that the levels of the comparators give.

use crate::given::{PAPER, setup};
use sagnac_board::{Board, Sample, StartCause};
use sagnac_core::{Image, Origin, Status};
use sagnac_loops::{Counting, Quadrature, QuadratureState, Stripper};

fn levels(quarter: u8) -> (bool, bool) {
    (matches!(quarter & 3, 1 | 2), matches!(quarter & 3, 2 | 3))
}

/// 20,000 ticks forward, back and over double steps, with and without dither: every actuator code and every frame.
#[test]
fn a_hardware_counter_is_as_good_as_levels() {
    for strips in [false, true] {
        let stripper = || strips.then(|| Stripper::new(50, 1000));
        let image = Image::decode(PAPER).unwrap();
        let mut decoded = Board::new(StartCause::PowerOn, image, Origin::Newest, &setup(stripper()), levels(0));
        let mut counted = Board::new(StartCause::PowerOn, image, Origin::Newest, &setup(stripper()), levels(0));
        let (counter, mut state) = (Quadrature { counting: Counting::X4 }, QuadratureState::new());
        counter.update(&mut state, false, false);
        let (mut quarter, mut dice, mut frames, mut lost) = (0_u8, 1_u32, 0, false);
        for tick in 0..20_000_u32 {
            dice = dice.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let steps = (0..dice >> 29)
                .map(|step| if dice >> (3 * step) & 63 == 0 { 2 } else { 1 + 2 * (dice >> 20 & 1) as u8 });
            let path: Vec<(bool, bool)> = steps
                .map(|step| {
                    quarter = quarter.wrapping_add(step);
                    levels(quarter)
                })
                .collect();
            let pickoff = if tick % 25 < 12 { 100_000 } else { -100_000 };
            let codes = [Some(20 << 24), None, None, None];
            let sample = Sample { codes, pickoff, light: (dice >> 9).cast_signed(), status: Status::OK };
            let counts = path.iter().map(|(a, b)| counter.update(&mut state, *a, *b)).sum();
            let wanted = decoded.tick(path.into_iter(), &sample);
            assert_eq!(counted.tick_counts(counts, state.lost, &sample), wanted, "tick {tick}");
            frames += usize::from(wanted.1.is_some());
            lost |= wanted.1.is_some_and(|frame| frame.status.contains(Status::COUNTS_LOST) && frame.lost_steps > 0);
        }
        assert!(frames == 200 && lost);
    }
}

/// A counter gives more than a call takes: the excess is lost, and the status says so.
#[test]
fn counts_beyond_a_call_are_reported() {
    let mut board =
        Board::new(StartCause::PowerOn, Image::decode(PAPER).unwrap(), Origin::Newest, &setup(None), levels(0));
    let frames: Vec<_> = (0..100)
        .filter_map(|tick| board.tick_counts(if tick == 0 { i32::MIN } else { 0 }, 0, &Sample::default()).1)
        .collect();
    assert!(frames.len() == 1 && frames[0].status.contains(Status::OVERFLOW));
    assert_eq!(frames[0].raw, -sagnac_core::MAX_RAW);
}
