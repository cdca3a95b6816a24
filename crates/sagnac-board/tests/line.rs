//! Frames survive damage to others; messages come back as they were; the whole line on this machine.

use crate::given::{PAPER, loops, setup};
use proptest::prelude::*;
use sagnac_board::frame::{Frame, FrameReader, MAX_KIND, MAX_PAYLOAD};
use sagnac_board::{
    Board, BoardSetup, Change, CommandHandler, Commit, FRAME_TICKS, MemoryFlash, Message, OUTPUT_LEN, OutputFrame,
    Piece, Reply, ReplyCode, RigSettings, Row, Sample, StartCause, WatchSetup, run,
};
use sagnac_core::{BankReport, Banks, Description, Gyro, Image, Loaded, Origin, Status, UNBOUNDED, WatchSpec};
use sagnac_loops::Stripper;

fn bytes_of(message: &Message) -> Vec<u8> {
    let (bytes, len) = message.frame().unwrap().bytes();
    bytes[..len].to_vec()
}

fn frames(bytes: &[u8]) -> (Vec<Frame>, u64) {
    let mut reader = FrameReader::new();
    let mut found = Vec::new();
    for byte in bytes {
        let mut frame = reader.push(*byte);
        while let Some(one) = frame {
            found.push(one);
            frame = reader.next_buffered();
        }
    }
    (found, reader.skipped() + reader.buffered() as u64)
}

fn message() -> impl Strategy<Value = Message> {
    prop_oneof![
        (any::<[i32; 6]>(), any::<u16>(), any::<u16>(), any::<[u8; 2]>()).prop_map(|(v, n, status, [p, l])| {
            Message::Output(OutputFrame {
                sequence: n,
                tick: v[0] as u32,
                counts: v[1],
                raw: v[2],
                status: Status::from_bits(status),
                path_status: p,
                light_status: l,
                actuator: v[3],
                current: v[4],
                temperature: (n & 1 == 0).then_some(v[5]),
                lost_steps: n ^ 0x5a5a,
                origin: [Origin::Newest, Origin::Survivor, Origin::FactoryDefaults][usize::from(p % 3)],
                trial: l & 1 == 1,
                angle_nano_arcsec: i64::from(v[2]) << 20,
                error_milli_dph: v[3] as u32,
                frame_ticks: n,
                tick_ns: v[4] as u32,
            })
        }),
        (any::<u8>(), any::<u32>()).prop_map(|(to, sequence)| Message::Reply(Reply {
            to,
            code: ReplyCode::Mismatch,
            sequence,
            origin: Origin::Survivor,
            trial: sequence & 1 == 1,
        })),
        (any::<[i32; 7]>(), any::<[u8; 3]>()).prop_map(|(v, b)| {
            Message::Settings(RigSettings {
                dither_counts: v[0] as u32,
                dither_step: v[1] as u32,
                peak: v[2],
                peak_slope: v[3],
                wavelength: v[4],
                curvature: v[5] as u32,
                lamp_gain: v[6] as u32,
                lamp_lag: b[0],
                actuator_lag: b[1],
                noise_bits: b[2],
            })
        }),
        (any::<[i32; 6]>(), any::<u8>()).prop_map(|(v, present)| {
            Message::Row(Row { ticks: v[0] as u32, counts: v[1], present, codes: [v[2], v[3], v[4], v[5]] })
        }),
        any::<(u16, bool)>().prop_map(|(len, trial)| Message::Commit(Commit { len, trial })),
        Just(Message::RollBack),
        Just(Message::Confirm),
        prop_oneof![Just(Change::Commit), Just(Change::RollBack), Just(Change::Confirm)].prop_map(Message::Service),
        any::<[u8; 16]>().prop_map(Message::Challenge),
        any::<[u8; 32]>().prop_map(|half| {
            let mut signature = [0; 64];
            signature[..32].copy_from_slice(&half);
            signature[32..].copy_from_slice(&half);
            Message::Answer(signature)
        }),
        Just(Message::Stop),
    ]
}

/// The frames that damage of the byte at `at` can destroy.
///
/// In a sequence of equal bytes the lost one cannot be identified: if a checksum ends in `S` before the `S` of the next
/// frame, either frame may be the damaged one.
fn frames_touched(starts: &[usize], bytes: &[u8], at: usize) -> std::ops::RangeInclusive<usize> {
    let last = at + bytes[at..].iter().take_while(|byte| **byte == bytes[at]).count() - 1;
    let frame_of = |place: usize| starts.iter().rposition(|start| *start <= place).unwrap();
    frame_of(at)..=frame_of(last)
}

/// Found by chance in CI: the checksum of the first frame ends in `S`.
#[test]
fn one_of_two_equal_bytes_lost_costs_one_frame() {
    let payload = [234, 86, 135, 41, 181, 201, 117, 202, 117, 38, 246, 84, 146, 143];
    let (first, second) = (Frame::new(1, &payload).unwrap().of_axis(b'z'), Frame::new(0, &[0; 9]).unwrap());
    let (first_bytes, len) = first.bytes();
    assert_eq!(first_bytes[len - 1], b'S');
    let (second_bytes, second_len) = second.bytes();
    let mut bytes = [&first_bytes[..len - 1], &second_bytes[..second_len]].concat();
    bytes.extend([0; 80]);
    assert_eq!(frames(&bytes).0, [first], "the second frame lacks its first byte");
}

proptest! {
    #[test]
    fn messages_come_back(message in message()) {
        let bytes = bytes_of(&message);
        if matches!(message, Message::Output(_)) {
            prop_assert_eq!(bytes.len(), OUTPUT_LEN);
        }
        let (found, skipped) = frames(&bytes);
        prop_assert_eq!(skipped, 0);
        prop_assert_eq!(found.iter().map(Message::parse).collect::<Vec<_>>(), vec![Some(message)]);
    }

    #[test]
    fn images_come_back_in_pieces(image in prop::collection::vec(any::<u8>(), 0..772)) {
        let mut back = vec![0; image.len()];
        for piece in Message::pieces(&image) {
            let bytes = bytes_of(&piece);
            let (found, _) = frames(&bytes);
            let Some(Message::Piece(Piece { offset, len, bytes })) = Message::parse(&found[0]) else { panic!("{piece:?}") };
            back[usize::from(offset)..][..usize::from(len)].copy_from_slice(&bytes[..usize::from(len)]);
        }
        prop_assert_eq!(back, image);
    }

    /// A damaged byte, a lost byte, bytes between: the frames around come out.
    #[test]
    fn damage_costs_the_frames_it_hits(
        payloads in prop::collection::vec((0..=MAX_KIND, prop::collection::vec(any::<u8>(), 0..=MAX_PAYLOAD)), 3..12),
        hit in any::<prop::sample::Index>(),
        how in 0..3_u8,
        noise in prop::collection::vec(any::<u8>(), 1..9),
    ) {
        let all: Vec<Frame> = payloads.iter().map(|(kind, payload)| Frame::new(*kind, payload).unwrap()).collect();
        let mut bytes = Vec::new();
        let mut starts = Vec::new();
        for frame in &all {
            starts.push(bytes.len());
            let (frame_bytes, len) = frame.bytes();
            bytes.extend_from_slice(&frame_bytes[..len]);
        }
        let at = hit.index(bytes.len());
        let struck = frames_touched(&starts, &bytes, at);
        match how {
            0 => bytes[at] ^= noise[0].max(1),
            1 => { bytes.remove(at); }
            _ => { bytes.splice(at..at, noise); }
        }
        // A damaged head may hold back the frames after it until enough bytes have arrived.
        bytes.extend(std::iter::repeat_n(0, 80));
        let (found, _) = frames(&bytes);
        let mut lost = 0;
        for (index, frame) in all.iter().enumerate() {
            let out = found.contains(frame);
            prop_assert!(out || struck.contains(&index), "frame {index} of {}, struck {struck:?}", all.len());
            lost += usize::from(!out);
        }
        prop_assert!(lost <= 1, "{lost} frames lost by one damage to {struck:?}");
    }

    /// Any bytes: no panic, and the handler continues.
    #[test]
    fn any_bytes_are_survived(bytes in prop::collection::vec(any::<u8>(), 0..600), messages in prop::collection::vec(message(), 0..12)) {
        let mut input = bytes;
        for message in messages {
            // A row of hours would be run.
            let message = match message {
                Message::Row(row) => Message::Row(Row { ticks: row.ticks % 3000, ..row }),
                other => other,
            };
            input.extend(bytes_of(&message));
        }
        let mut out = 0;
        run(&mut handler(), input.into_iter(), |bytes| out += bytes.len());
        prop_assert!(out > 0);
    }
}

fn handler() -> CommandHandler<MemoryFlash> {
    let gyro = Gyro::of(&Image::decode(PAPER).unwrap(), 4);
    CommandHandler::new(Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK).unwrap(), gyro, loops())
}

fn outputs(input: &[Message]) -> Vec<Message> {
    let bytes: Vec<u8> = input.iter().flat_map(bytes_of).collect();
    let mut out = Vec::new();
    run(&mut handler(), bytes.into_iter(), |bytes| out.extend_from_slice(bytes));
    frames(&out).0.iter().map(|frame| Message::parse(frame).unwrap()).collect()
}

/// Without an image counts pass through with the status UNCORRECTED; with one the same counts are corrected.
#[test]
fn a_new_image_takes_effect_between_two_ticks() {
    let settings = RigSettings { wavelength: 121_363, ..RigSettings::default() };
    let row = Row { ticks: 100_000, counts: 400, present: 1, codes: [20 << 24, 0, 0, 0] };
    let mut input = vec![Message::Settings(settings), Message::Row(row)];
    input.extend(Message::pieces(PAPER));
    input.extend([
        Message::Commit(Commit { len: PAPER.len() as u16, trial: false }),
        Message::Row(row),
        Message::RollBack,
    ]);
    let out = outputs(&input);
    let of = |from: usize| -> Vec<&OutputFrame> {
        let frames = out.iter().skip(from).filter_map(|m| if let Message::Output(o) = m { Some(o) } else { None });
        frames.take(1000).collect()
    };
    let (before, after) = (of(0), of(1003));
    assert_eq!(before.iter().map(|o| o.counts).sum::<i32>(), 400);
    assert!(before.iter().all(|o| o.status == Status::UNCORRECTED));
    // The paper's drift at 20 °C is about 2.5 counts of 0.25 per 10 s against 25 °C.
    let corrected = after.iter().map(|o| o.counts).sum::<i32>();
    assert_eq!(after.iter().map(|o| o.raw).sum::<i32>(), 400);
    assert!((370..400).contains(&corrected), "{corrected}");
    assert!(after.iter().skip(2).all(|o| o.status == Status::OK));
    let replies: Vec<&Reply> =
        out.iter().filter_map(|m| if let Message::Reply(r) = m { Some(r) } else { None }).collect();
    let commit = replies.iter().find(|r| r.to == 0x21).unwrap();
    assert_eq!((commit.code, commit.sequence), (ReplyCode::Done, 1));
    assert_eq!(replies.last().unwrap().code, ReplyCode::NoOlderImage);
}

/// Stripping removes the dither completely: whole periods contain the counts of the rate only.
#[test]
fn dither_is_stripped() {
    let settings =
        RigSettings { dither_counts: 60, dither_step: 171_956_000, wavelength: 121_363, ..RigSettings::default() };
    let row = Row { ticks: 600_000, counts: 6000, present: 1, codes: [25 << 24, 0, 0, 0] };
    let out = outputs(&[Message::Settings(settings), Message::Row(row)]);
    let frames: Vec<&OutputFrame> =
        out.iter().filter_map(|m| if let Message::Output(o) = m { Some(o) } else { None }).collect();
    assert_eq!(frames.len(), 6000);
    let sum: i32 = frames.iter().map(|o| o.raw).sum();
    assert!((5998..=6000).contains(&sum), "{sum}");
    // A frame of 10 ms holds four periods of 0.25 counts; unstripped it would hold up to 120.
    assert!(frames.iter().all(|o| (0..=3).contains(&o.raw)), "{:?}", frames.iter().map(|o| o.raw).max());
    assert!(frames.iter().all(|o| o.lost_steps == 0));
}

/// Frames of a board over some ticks: the quarter fringes and the pickoff of each.
fn on_board(
    origin: Origin,
    stripper: Option<Stripper>,
    ticks: impl Iterator<Item = (Vec<u8>, Sample)>,
) -> Vec<OutputFrame> {
    let image = Image::decode(PAPER).unwrap();
    let mut board = Board::new(StartCause::PowerOn, image, origin, &setup(stripper), (false, false));
    let levels = |quarter: u8| (matches!(quarter & 3, 1 | 2), matches!(quarter & 3, 2 | 3));
    ticks.filter_map(|(quarters, sample)| board.tick(quarters.into_iter().map(levels), &sample).1).collect()
}

const AT_20_C: Sample = Sample { codes: [Some(20 << 24), None, None, None], pickoff: 0, light: 0, status: Status::OK };

/// No dither is lock-in: the status says so in the frame in which two dither periods have passed without it, and until it returns.
#[test]
fn a_lost_dither_is_in_the_status() {
    // 25 ticks a period; at rest from tick 5,010 to 7,510, a little off zero.
    let pickoff = |tick: u32| match tick {
        5010..7510 => 12,
        _ => (1e6 * (f64::from(tick) * std::f64::consts::TAU / 25.0).sin()) as i32,
    };
    let ticks = (0..12_500_u32).map(|tick| (Vec::new(), Sample { pickoff: pickoff(tick), ..AT_20_C }));
    let frames = on_board(Origin::Newest, Some(Stripper::new(50, 250_000)), ticks);
    let without: Vec<usize> = (0..frames.len()).filter(|at| frames[*at].status.contains(Status::NO_DITHER)).collect();
    assert_eq!(without, (50..76).collect::<Vec<_>>());
}

#[test]
fn a_step_of_unknown_direction_is_in_the_status_of_its_frame() {
    let ticks = (0..1000_u32).map(|tick| (if tick == 250 { vec![1, 3] } else { vec![] }, AT_20_C));
    let frames = on_board(Origin::Newest, None, ticks);
    let lost: Vec<usize> = (0..frames.len()).filter(|at| frames[*at].status.contains(Status::COUNTS_LOST)).collect();
    assert_eq!((lost, frames[9].lost_steps), (vec![250 / usize::from(FRAME_TICKS)], 1));
}

/// The frame tells a missing thermometer from the code 0, and where the image comes from.
#[test]
fn a_frame_says_what_its_numbers_are() {
    let of = |origin: Origin, code: Option<i32>| {
        let sample = Sample { codes: [code, None, None, None], ..AT_20_C };
        on_board(origin, None, (0..100).map(|_| (Vec::new(), sample)))[0]
    };
    assert_eq!(of(Origin::Newest, Some(0)).temperature, Some(0));
    assert_eq!(of(Origin::Newest, None).temperature, None);
    for (origin, status) in [
        (Origin::Newest, Status::OK),
        (Origin::Survivor, Status::SURVIVOR),
        (Origin::FactoryDefaults, Status::UNCORRECTED),
    ] {
        let frame = of(origin, Some(20 << 24));
        assert_eq!((frame.origin, frame.status), (origin, status));
        let message = Message::Output(frame);
        assert_eq!(Message::parse(&message.frame().unwrap()), Some(message));
    }
}

/// Two thermometers in a ramp, the second stuck from the fifth minute on: STUCK in every frame from the time at which the first has gone
/// 2 °C away, and not before; and what the caller knows of its codes is there too.
#[test]
fn a_stuck_thermometer_is_in_the_status() {
    let paper = *Image::decode(PAPER).unwrap().description();
    let mut two = Description { input_count: 2, period_ticks: 10, slew_ticks: 0, ..paper };
    two.inputs[1] = two.inputs[0];
    let image = Image::new(two).unwrap();
    let spec = WatchSpec { shows: 2 << 24, still: 1 << 22, command_shows: 0 };
    let setup = BoardSetup { watch: Some(WatchSetup { spec, heats: false }), ..setup(None) };
    let mut board = Board::new(StartCause::PowerOn, image, Origin::Newest, &setup, (false, false));
    let mut frames = Vec::new();
    for tick in 0..60_000 {
        // From 20 °C, 4 °C in all; one code a tick.
        let ramp = (20 << 24) + tick * 1118;
        let second = ramp.min((20 << 24) + 20_000 * 1118);
        let status = if tick == 100 { Status::OUTVOTED } else { Status::OK };
        let sample = Sample { codes: [Some(ramp), Some(second), None, None], status, ..AT_20_C };
        frames.extend(board.tick(std::iter::empty(), &sample).1);
    }
    let stuck: Vec<usize> = (0..frames.len()).filter(|at| frames[*at].status.contains(Status::STUCK)).collect();
    // 2 °C are 30,015 ticks of the ramp, after the last move of a quarter of a degree.
    let first = stuck[0];
    assert!((490..=502).contains(&first), "{first}");
    assert_eq!(stuck, (first..600).collect::<Vec<_>>());
    assert_eq!(board.standing_still(), 2);
    let outvoted: Vec<usize> = (0..frames.len()).filter(|at| frames[*at].status.contains(Status::OUTVOTED)).collect();
    assert_eq!(outvoted, [1]);
    // Another image may have other thermometers in these places: the watch begins again with it.
    let other = Image::new(Description { sequence: two.sequence + 1, ..two }).unwrap();
    let loaded = Loaded::new(other, Origin::Newest, [BankReport::Uncommitted; 2], false);
    board.use_loaded(&loaded);
    assert_eq!(board.standing_still(), 0);
    let sample = Sample { codes: [Some(24 << 24), Some(20 << 24), None, None], ..AT_20_C };
    for _ in 0..1000 {
        board.tick(std::iter::empty(), &sample);
    }
    assert_eq!(board.standing_still(), 0);
}

/// Frames of any length: their angles add up to the counts times the scale factor exactly, whatever is left of the division, and each has the
/// tick at its end.
#[test]
fn angles_of_frames_lose_nothing() {
    let paper = Image::decode(PAPER).unwrap();
    for (frame_ticks, femto) in [(1, 1_513_333_333_337_u64), (7, 999_999), (100, 264_750_000_000_001), (0, 3)] {
        let description = Description { scale_factor_femto_arcsec: femto, ..*paper.description() };
        let image = Image::new(description).unwrap();
        let setup = BoardSetup { frame_ticks, ..setup(None) };
        let mut board = Board::new(StartCause::PowerOn, image, Origin::Newest, &setup, (false, false));
        let (mut counts, mut nano, mut frames) = (0_i64, 0_i64, 0);
        for tick in 0..20_000_u32 {
            let sample = Sample { codes: [Some(20 << 24), None, None, None], ..Sample::default() };
            let of_tick = if tick % 3 == 0 { -40 } else { 7 };
            let Some(frame) = board.tick_counts(of_tick, 0, &sample).1 else { continue };
            (counts, nano, frames) = (counts + i64::from(frame.counts), nano + frame.angle_nano_arcsec, frames + 1);
            // Closed form: the floor of the whole angle.
            let whole = i128::from(counts) * i128::from(femto);
            assert_eq!(i128::from(nano), whole.div_euclid(1_000_000), "frame {frames} of {frame_ticks} ticks");
            assert_eq!(frame.tick, tick + 1);
            assert_eq!((frame.frame_ticks, frame.tick_ns), (frame_ticks.max(1), description.tick_ns));
        }
        assert_eq!(frames, 20_000 / u32::from(frame_ticks.max(1)));
    }
}

/// The number next to the status: none without an image in force, then the most of a frame's slow updates.
#[test]
fn a_frame_has_the_bound_of_its_error() {
    let mut limited = *Image::decode(PAPER).unwrap().description();
    (limited.inputs[0].largest_step_q8, limited.inputs[0].step_growth) = (128, 8);
    let paper = Image::new(limited).unwrap();
    let mut board = Board::new(StartCause::PowerOn, paper, Origin::Newest, &setup(None), (false, false));
    let mut next = |code: Option<i32>| {
        let sample = Sample { codes: [code, None, None, None], ..Sample::default() };
        std::iter::repeat_with(|| board.tick_counts(3, 0, &sample).1).find_map(|frame| frame).unwrap()
    };
    assert_eq!(next(Some(20 << 24)).error_milli_dph, UNBOUNDED, "before the first bound");
    let period_frames = paper.description().period_ticks / u32::from(FRAME_TICKS);
    let calm = (0..20 * period_frames).map(|_| next(Some(20 << 24))).last().unwrap();
    assert!(calm.status == Status::OK && (100..1000).contains(&calm.error_milli_dph), "{calm:?}");
    let held = (0..20 * period_frames).map(|_| next(None)).last().unwrap();
    assert!(held.status.contains(Status::HELD) && held.error_milli_dph > calm.error_milli_dph, "{held:?}");
    let outside = (0..3 * period_frames).map(|_| next(Some(120 << 24))).last().unwrap();
    assert!(outside.status != Status::OK && outside.error_milli_dph > held.error_milli_dph, "{outside:?}");
}

/// A message for another axis is for somebody else; one for every axis is answered, with the axis of this gyro.
#[test]
fn a_gyro_reads_the_messages_for_its_axis() {
    let image = Image::decode(PAPER).unwrap();
    let own = image.description().axis;
    let other = *b"xyz".iter().find(|letter| **letter != own).unwrap();
    let answers = |letter: u8| {
        let banks = Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK).unwrap();
        let (input, len) = Message::RollBack.frame().unwrap().of_axis(letter).bytes();
        let mut out = Vec::new();
        let mut handler = CommandHandler::new(banks, Gyro::of(&image, 4), loops());
        run(&mut handler, input[..len].iter().copied(), |bytes| out.extend_from_slice(bytes));
        frames(&out).0
    };
    let code = sagnac_board::frame::axis_code(own);
    assert!(answers(own).iter().chain(&answers(0)).all(|frame| frame.axis == code));
    assert_eq!([own, 0, other].map(|letter| answers(letter).len()), [2, 2, 1]);
}

/// More counts than 32 bits hold in a long frame: the status says it, and the number next to it is none.
#[test]
fn a_frame_that_wraps_says_so() {
    let image = Image::decode(PAPER).unwrap();
    let setup = BoardSetup { frame_ticks: 10, ..setup(None) };
    for (of_tick, wraps) in [(1 << 28, true), (200_000_000, false), (-(1 << 28), true)] {
        let mut board = Board::new(StartCause::PowerOn, image, Origin::Newest, &setup, (false, false));
        let sample = Sample { codes: [Some(20 << 24), None, None, None], ..Sample::default() };
        let mut ticks = std::iter::repeat_with(|| board.tick_counts(of_tick, 0, &sample).1);
        let frame = ticks.by_ref().flatten().nth(1).unwrap();
        assert_eq!(frame.status.contains(Status::OVERFLOW), wraps, "{of_tick}: {frame:?}");
        assert!(!wraps || frame.error_milli_dph == UNBOUNDED);
    }
}
