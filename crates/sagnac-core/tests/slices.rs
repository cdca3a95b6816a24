//! A slow update in slices has the bits of a whole one, however the slices lie between the ticks.

use crate::support;
use crate::support::any_image_of_four;
use proptest::prelude::*;
use sagnac_core::{Compensator, Misuse, State};

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// SAG-CORE-026
    #[test]
    fn slices_have_the_bits_of_a_whole(
        image in any_image_of_four(),
        updates in prop::collection::vec((prop::array::uniform4(prop::option::weighted(0.9, any::<i32>())), 0_u32..50, 0_usize..6, any::<i16>()), 1..40),
        warm in any::<bool>(),
    ) {
        let gyro = Compensator::new(image);
        let start = if warm { State::warm() } else { State::new() };
        let (mut whole, mut sliced) = (start, start);
        let inputs = gyro.image().inputs().len();
        for (codes, ahead, per_tick, raw) in updates {
            let codes = &codes[..inputs];
            // Some ticks before the update is due, with the codes of then.
            let ahead = ahead.min(sliced.ticks_to_update());
            let quiet = sliced.ticks_to_update() - ahead;
            prop_assert_eq!(gyro.advance(&mut whole, 0, quiet), gyro.advance(&mut sliced, 0, quiet));
            let mut update = gyro.begin_update(&sliced, codes).unwrap();
            for _ in 0..ahead {
                prop_assert_eq!(gyro.tick(&mut whole, raw.into()), gyro.tick(&mut sliced, raw.into()));
                for _ in 0..per_tick {
                    gyro.advance_update(&mut update);
                }
            }
            prop_assert_eq!(gyro.update(&mut whole, codes), gyro.apply_update(&mut sliced, &mut update));
            prop_assert_eq!(whole, sliced);
        }
    }

    /// A slow update has as many slices as it says, no more.
    #[test]
    fn the_slices_end(image in any_image_of_four(), codes in prop::array::uniform4(any::<i32>())) {
        let gyro = Compensator::new(image);
        let codes = codes.map(Some);
        let mut update = gyro.begin_update(&State::new(), &codes[..gyro.image().inputs().len()]).unwrap();
        let made = std::iter::from_fn(|| (!gyro.advance_update(&mut update)).then_some(())).count();
        prop_assert!(made <= gyro.slices() && gyro.advance_update(&mut update));
    }
}

/// An update that belongs to another state, or that is too early, changes nothing.
#[test]
fn what_is_outdated_is_refused() {
    let image = sagnac_core::Image::decode(include_bytes!("../../../testdata/image/paper.img")).unwrap();
    let gyro = Compensator::new(image);
    let mut state = State::new();
    let codes = [Some(20 << 24)];
    let mut early = gyro.begin_update(&state, &codes).unwrap();
    assert!(gyro.begin_update(&state, &[]).is_err());
    gyro.update(&mut state, &codes).unwrap();
    let before = state;
    let left = state.ticks_to_update();
    assert_eq!(gyro.apply_update(&mut state, &mut early), Err(Misuse::UpdateNotDue { ticks_left: left }));
    gyro.skip(&mut state, left).unwrap();
    assert_eq!(gyro.apply_update(&mut state, &mut early), Err(Misuse::Outdated));
    assert_eq!(state, {
        let mut same = before;
        gyro.skip(&mut same, left).unwrap();
        same
    });
    // A new image between begin and apply.
    let mut of_old = gyro.begin_update(&state, &codes).unwrap();
    let mut migrated = gyro.migrate_state(&state);
    assert_eq!(gyro.apply_update(&mut migrated, &mut of_old), Err(Misuse::Outdated));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// A gap of whole periods in closed form: the state of as many updates and skips.
    #[test]
    fn a_rest_is_as_many_updates(
        image in any_image_of_four(),
        before in prop::collection::vec(prop::array::uniform4(prop::option::weighted(0.9, any::<i32>())), 0..6),
        codes in prop::array::uniform4(prop::option::weighted(0.8, any::<i32>())),
        periods in prop_oneof![0_u64..20, 1000_u64..6000],
    ) {
        let gyro = Compensator::new(image);
        let (inputs, period) = (gyro.image().inputs().len(), gyro.image().description().period_ticks);
        let mut one = State::new();
        for codes in before {
            gyro.update(&mut one, &codes[..inputs]).unwrap();
            gyro.skip(&mut one, period).unwrap();
        }
        let mut other = one;
        for _ in 0..periods {
            gyro.update(&mut one, &codes[..inputs]).unwrap();
            gyro.skip(&mut one, period).unwrap();
        }
        gyro.rest(&mut other, &codes[..inputs], periods).unwrap();
        prop_assert_eq!(one, other);
    }
}

/// A month at 1 s and τ of 20 min ends at once, with the lag settled to the bit.
#[test]
fn a_month_of_rest_is_closed() {
    let image = support::image(
        &[support::term(sagnac_core::Kind::Bias, 1, sagnac_core::Multiplier::Rate, 1 << 20, 40)],
        10_000,
        100,
    );
    let gyro = Compensator::new(image);
    let inputs = gyro.image().inputs().len();
    let mut state = State::new();
    gyro.update(&mut state, &[Some(0); 4][..inputs]).unwrap();
    gyro.skip(&mut state, 10_000).unwrap();
    gyro.rest(&mut state, &[Some(10 << 24); 4][..inputs], 100_000_000_000).unwrap();
    assert_eq!((state.ticks_to_update(), state.increment()), (0, 0));
}
