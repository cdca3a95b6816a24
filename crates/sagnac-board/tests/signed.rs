//! A board with a key: what is not signed for it, in order, and asked for, changes nothing.

use embedded_storage::nor_flash::{NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use sagnac_board::frame::FrameReader;
use sagnac_board::{
    Change, CommandHandler, Commit, Handled, MemoryFlash, Message, Reply, ReplyCode, RigSettings, SERVICE_S, Upload,
    run,
};
use sagnac_core::{Banks, Description, Gyro, Image, NoKey, Origin, SIGNATURE_LEN, TRIAL_STARTS, Trust};
use sagnac_loops::LoopTable;
use sagnac_signature::{Keyed, Signer};

const PAPER: &[u8] = include_bytes!("../../../testdata/image/paper.img");
const MODEL: [u8; 16] = *b"RLG-28\0\0\0\0\0\0\0\0\0\0";

/// Challenges 1, 2, 3 …
type Counted = Box<dyn FnMut() -> [u8; 16]>;

fn signer() -> Signer {
    Signer::from_seed(&[42; 32])
}

fn image(sequence: u32) -> Vec<u8> {
    let own = Image::decode(PAPER).unwrap();
    let image = Image::new(Description { sequence, ..*own.description() }).unwrap();
    let mut bytes = vec![0; image.encoded_len()];
    image.encode(&mut bytes).unwrap();
    bytes
}

fn signed(by: &Signer, image: &[u8], model: [u8; 16], counter: u32) -> Vec<u8> {
    [image, &by.sign(image, model, counter).unwrap().encode()].concat()
}

/// A board, and the tool on the other side of its line.
struct Bench<T> {
    upload: Upload<T>,
    banks: Banks<MemoryFlash>,
    gyro: Gyro,
}

impl Bench<Keyed<Counted>> {
    fn new() -> Self {
        let mut challenges = 0;
        let challenge: Counted = Box::new(move || {
            challenges += 1;
            [challenges; 16]
        });
        Self::with(Keyed { public_key: signer().public().bytes(), model: MODEL, lowest_counter: 5, challenge })
    }

    /// For an upload.
    fn open(&mut self) {
        self.open_for(Change::Commit);
    }

    fn open_for(&mut self, change: Change) {
        let Message::Challenge(challenge) = self.send(Message::Service(change)).message else { panic!("no challenge") };
        let answer = signer().answer(&self.gyro.serial, self.gyro.axis, change as u8, &challenge);
        assert_eq!(self.code(Message::Answer(answer)), ReplyCode::Done);
    }
}

impl<T: Trust> Bench<T> {
    fn with(trust: T) -> Self {
        let banks = Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK).unwrap();
        Self { upload: Upload::new(trust), banks, gyro: Gyro::of(&Image::decode(PAPER).unwrap(), 4) }
    }

    fn send(&mut self, message: Message) -> Handled {
        self.upload.handle(&message, &mut self.banks, &self.gyro).unwrap()
    }

    fn code(&mut self, message: Message) -> ReplyCode {
        let Message::Reply(Reply { code, .. }) = self.send(message).message else { panic!("no reply") };
        code
    }

    fn commit(&mut self, bytes: &[u8], trial: bool) -> ReplyCode {
        for piece in Message::pieces(bytes) {
            let code = self.code(piece);
            if code != ReplyCode::Done {
                return code;
            }
        }
        self.code(Message::Commit(Commit { len: bytes.len() as u16, trial }))
    }

    fn active(&mut self) -> (u32, Origin) {
        let loaded = self.banks.load(&self.gyro);
        (loaded.image.description().sequence, loaded.origin)
    }
}

#[test]
fn a_signed_image_is_stored_and_raises_the_counter() {
    let mut bench = Bench::new();
    bench.open();
    assert_eq!(bench.commit(&signed(&signer(), &image(1), MODEL, 9), false), ReplyCode::Done);
    assert_eq!((bench.active(), bench.upload.trust().lowest_counter), ((1, Origin::Newest), 9));
    // The service mode ended with it.
    assert_eq!(bench.commit(&signed(&signer(), &image(2), MODEL, 9), false), ReplyCode::Locked);
    bench.open();
    assert_eq!(
        bench.commit(&signed(&signer(), &image(2), MODEL, 8), false),
        ReplyCode::NotNewer,
        "the counter went back"
    );
    assert_eq!(bench.commit(&signed(&signer(), &image(2), MODEL, 9), false), ReplyCode::Done);
    assert_eq!(bench.active(), (2, Origin::Newest));
}

#[test]
fn what_is_not_signed_for_this_board_is_refused() {
    let other = Signer::from_seed(&[43; 32]);
    let mut renamed = signed(&other, &image(1), MODEL, 9);
    // The key id of the right key over the signature of another one.
    let block = renamed.len() - SIGNATURE_LEN;
    renamed[block + 16..block + 32].copy_from_slice(&signer().public().id());
    let mut later = signed(&signer(), &image(1), MODEL, 9);
    later[block + 12] = 200;
    let cases = [
        (image(1), ReplyCode::Unsigned),
        (signed(&other, &image(1), MODEL, 9), ReplyCode::BadSignature),
        (renamed, ReplyCode::BadSignature),
        (later, ReplyCode::BadSignature),
        (signed(&signer(), &image(1), *b"RLG-29\0\0\0\0\0\0\0\0\0\0", 9), ReplyCode::Mismatch),
        (signed(&signer(), &image(1), MODEL, 4), ReplyCode::NotNewer),
        (signed(&signer(), b"no image", MODEL, 9), ReplyCode::NotAnImage),
    ];
    for (bytes, code) in cases {
        let mut bench = Bench::new();
        bench.open();
        assert_eq!(bench.commit(&bytes, false), code);
        assert_eq!((bench.active().1, bench.upload.trust().lowest_counter), (Origin::FactoryDefaults, 5));
        // A refusal does not end the service mode: the right image may follow.
        assert_eq!(bench.commit(&signed(&signer(), &image(1), MODEL, 9), false), ReplyCode::Done);
    }
}

/// Every byte of the image and of its block is under the signature or is checked by itself.
#[test]
fn every_flipped_bit_is_refused() {
    let whole = signed(&signer(), &image(1), MODEL, 9);
    let mut bench = Bench::new();
    bench.open();
    for at in 0..whole.len() {
        let mut bytes = whole.clone();
        bytes[at] ^= 1 << (at % 8);
        assert_ne!(bench.commit(&bytes, false), ReplyCode::Done, "byte {at}");
    }
    assert_eq!(bench.commit(&whole, false), ReplyCode::Done);
}

#[test]
fn nothing_changes_outside_of_the_service_mode() {
    let mut bench = Bench::new();
    bench.open();
    assert_eq!(bench.commit(&signed(&signer(), &image(1), MODEL, 9), true), ReplyCode::Done);
    assert_eq!(bench.commit(&signed(&signer(), &image(2), MODEL, 9), false), ReplyCode::Locked);
    assert_eq!((bench.code(Message::Confirm), bench.code(Message::RollBack)), (ReplyCode::Locked, ReplyCode::Locked));
    // An answer without a challenge; one of another gyro; one twice; one before power-off.
    let answer = |challenge: u8, axis: u8| {
        let gyro = Bench::new().gyro;
        Message::Answer(signer().answer(&gyro.serial, axis, Message::CONFIRM, &[challenge; 16]))
    };
    let axis = bench.gyro.axis;
    assert_eq!(bench.code(answer(2, axis)), ReplyCode::Locked);
    assert!(matches!(bench.send(Message::Service(Change::Confirm)).message, Message::Challenge([2, ..])));
    assert_eq!(bench.code(answer(2, axis ^ 1)), ReplyCode::BadSignature);
    assert_eq!(bench.code(answer(2, axis)), ReplyCode::Locked, "one try a challenge");
    assert!(matches!(bench.send(Message::Service(Change::Confirm)).message, Message::Challenge([3, ..])));
    assert_eq!(bench.code(answer(2, axis)), ReplyCode::BadSignature, "an old answer");
    bench.open_for(Change::Confirm);
    let loaded = bench.banks.load(&bench.gyro);
    bench.upload.power_on(&loaded);
    assert_eq!(bench.code(Message::Confirm), ReplyCode::Locked);
    bench.open_for(Change::Confirm);
    assert_eq!(bench.code(Message::Confirm), ReplyCode::Done);
    bench.open_for(Change::Confirm);
    assert_eq!(bench.code(Message::Confirm), ReplyCode::NotOnTrial);
    bench.open_for(Change::RollBack);
    assert_eq!(bench.code(Message::RollBack), ReplyCode::NoOlderImage);
}

/// An answer opens the mode for the change that it names, and for no other; a signature for another change is refused.
#[test]
fn the_service_mode_is_open_for_one_change_alone() {
    let changes = [Change::Commit, Change::RollBack, Change::Confirm];
    for change in changes {
        let mut bench = Bench::new();
        for other in changes.into_iter().filter(|other| *other != change) {
            let Message::Challenge(challenge) = bench.send(Message::Service(change)).message else {
                panic!("no challenge")
            };
            let answer = signer().answer(&bench.gyro.serial, bench.gyro.axis, other as u8, &challenge);
            assert_eq!(bench.code(Message::Answer(answer)), ReplyCode::BadSignature);
        }
        bench.open_for(change);
        let bytes = signed(&signer(), &image(1), MODEL, 9);
        let commit = bench.commit(&bytes, false);
        assert_eq!(commit == ReplyCode::Locked, change != Change::Commit, "{change:?}");
        if change == Change::Commit {
            continue;
        }
        let codes = (bench.code(Message::RollBack), bench.code(Message::Confirm));
        assert_eq!(codes.0 == ReplyCode::Locked, change != Change::RollBack);
        assert_eq!(codes.1 == ReplyCode::Locked, change != Change::Confirm);
    }
}

/// The mode of a session that was left ends by itself: 20 stray roll backs came hours later.
#[test]
fn the_service_mode_ends_by_itself() {
    let mut bench = Bench::new();
    for seconds in [1, SERVICE_S - 1, SERVICE_S, 255] {
        bench.open_for(Change::RollBack);
        (0..seconds).for_each(|_| bench.upload.second());
        assert_eq!(bench.code(Message::RollBack) == ReplyCode::Locked, seconds >= SERVICE_S, "{seconds} s");
        // A challenge that was not answered, too.
        let Message::Challenge(challenge) = bench.send(Message::Service(Change::RollBack)).message else { panic!() };
        (0..seconds).for_each(|_| bench.upload.second());
        let answer = signer().answer(&bench.gyro.serial, bench.gyro.axis, Message::ROLL_BACK, &challenge);
        assert_eq!(bench.code(Message::Answer(answer)) == ReplyCode::Locked, seconds >= SERVICE_S, "{seconds} s");
    }
}

/// Flash without power from a step of the store on.
struct Cut(MemoryFlash, u32);

impl embedded_storage::nor_flash::ErrorType for Cut {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Cut {
    const READ_SIZE: usize = MemoryFlash::READ_SIZE;
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        self.0.read(offset, bytes).map_err(|e| e.kind())
    }
    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl Cut {
    fn step(&mut self) -> Result<(), NorFlashErrorKind> {
        self.1 = self.1.checked_sub(1).ok_or(NorFlashErrorKind::Other)?;
        Ok(())
    }
}

impl NorFlash for Cut {
    const WRITE_SIZE: usize = MemoryFlash::WRITE_SIZE;
    const ERASE_SIZE: usize = MemoryFlash::ERASE_SIZE;
    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        self.step()?;
        self.0.erase(from, to).map_err(|e| e.kind())
    }
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        self.step()?;
        self.0.write(offset, bytes).map_err(|e| e.kind())
    }
}

/// The power goes at any step of a store: no image runs whose counter is above the lowest one that the board still takes, and the same
/// upload can be sent again.
#[test]
fn the_counter_is_raised_before_the_image_is_in_force() {
    let mut cut = 0;
    for steps in 0.. {
        let mut challenges = 0;
        let challenge = move || {
            challenges += 1;
            [challenges; 16]
        };
        let trust = Keyed { public_key: signer().public().bytes(), model: MODEL, lowest_counter: 5, challenge };
        let gyro = Gyro::of(&Image::decode(PAPER).unwrap(), 4);
        let mut banks = Banks::new(Cut(MemoryFlash::new(), steps), 0, MemoryFlash::BANK).unwrap();
        let mut upload = Upload::new(trust);
        let mut say = |message: Message, banks: &mut Banks<Cut>| upload.handle(&message, banks, &gyro).unwrap().message;
        let Message::Challenge(asked) = say(Message::Service(Change::Commit), &mut banks) else { panic!() };
        say(Message::Answer(signer().answer(&gyro.serial, gyro.axis, Message::COMMIT, &asked)), &mut banks);
        let bytes = signed(&signer(), &image(1), MODEL, 9);
        for piece in Message::pieces(&bytes) {
            say(piece, &mut banks);
        }
        let commit = Message::Commit(Commit { len: bytes.len() as u16, trial: false });
        let done = matches!(say(commit, &mut banks), Message::Reply(reply) if reply.code == ReplyCode::Done);
        let runs = banks.load(&gyro).origin == Origin::Newest;
        assert!(!runs || upload.trust().lowest_counter == 9, "cut after {steps}");
        // With power again.
        let mut banks = Banks::new(Cut(banks.into_flash().0, u32::MAX), 0, MemoryFlash::BANK).unwrap();
        if !runs {
            let again = upload.handle(&commit, &mut banks, &gyro).unwrap().message;
            assert!(matches!(again, Message::Reply(reply) if reply.code == ReplyCode::Done), "cut after {steps}");
        }
        assert_eq!(upload.trust().lowest_counter, 9);
        if done {
            break;
        }
        cut += 1;
    }
    assert!(cut > 10, "{cut}");
}

/// An intact image that the banks refuse does not raise the counter: one for another gyro would shut out this one's.
#[test]
fn a_refused_image_does_not_raise_the_counter() {
    let mut bench = Bench::new();
    bench.open();
    let own = Image::decode(&image(1)).unwrap();
    let other = Image::new(Description { axis: b'y', ..*own.description() }).unwrap();
    let mut bytes = vec![0; other.encoded_len()];
    other.encode(&mut bytes).unwrap();
    assert_eq!(bench.commit(&signed(&signer(), &bytes, MODEL, 9), false), ReplyCode::Mismatch);
    assert_eq!(bench.upload.trust().lowest_counter, 5);
}

/// A trial over a trial would erase the only confirmed image.
#[test]
fn an_upload_over_a_trial_is_refused() {
    let mut bench = Bench::with(NoKey);
    assert_eq!(bench.commit(&image(1), false), ReplyCode::Done);
    assert_eq!(bench.commit(&image(2), true), ReplyCode::Done);
    assert_eq!(bench.commit(&image(3), true), ReplyCode::OnTrial);
    assert_eq!(bench.commit(&image(3), false), ReplyCode::OnTrial);
    assert_eq!(bench.code(Message::RollBack), ReplyCode::Done);
    assert_eq!(bench.active(), (1, Origin::Newest));
    assert_eq!(bench.commit(&image(3), true), ReplyCode::Done);
}

/// An image signature is no answer and an answer no image signature, whatever the bytes: the first 16 tell them apart.
#[test]
fn a_signed_image_is_not_an_answer() {
    let mut bench = Bench::new();
    let Message::Challenge(_) = bench.send(Message::Service(Change::Commit)).message else { panic!("no challenge") };
    let block = signer().sign(&image(1), MODEL, 9).unwrap();
    assert_eq!(bench.code(Message::Answer(block.signature)), ReplyCode::BadSignature);
}

/// A board without a key takes images as before, signed or not, and needs no service mode.
#[test]
fn a_board_without_a_key_is_open() {
    let mut bench = Bench::with(NoKey);
    assert_eq!(bench.code(Message::Service(Change::Commit)), ReplyCode::Done);
    assert_eq!(bench.commit(&image(1), false), ReplyCode::Done);
    assert_eq!(bench.commit(&signed(&signer(), &image(2), MODEL, 1), false), ReplyCode::Done);
    assert_eq!(bench.active(), (2, Origin::Newest));
    assert_eq!(bench.code(Message::Answer([0; 64])), ReplyCode::Locked, "nothing was asked");
}

/// A trial over the line: said in every reply, ended by power-ons without a confirmation.
#[test]
fn a_trial_over_the_line_ends_by_itself() {
    let text = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/vectors/intensity.hex")).unwrap();
    let mut words = sagnac_vectors::Words::new(&text);
    let head = words.head().unwrap();
    let loops = LoopTable::decode(words.table(&head, &mut [0; sagnac_vectors::MAX_TABLE]).unwrap()).unwrap();
    let banks = Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK).unwrap();
    let mut board = CommandHandler::new(banks, Gyro::of(&Image::decode(PAPER).unwrap(), 4), loops);
    let mut said = |messages: &[Message]| -> Vec<(u8, u32, bool)> {
        let bytes: Vec<u8> = messages
            .iter()
            .flat_map(|m| m.frame().unwrap().bytes().0.into_iter().take(m.frame().unwrap().bytes().1))
            .collect();
        let (mut reader, mut out) = (FrameReader::new(), Vec::new());
        run(&mut board, bytes.into_iter(), |bytes| out.extend_from_slice(bytes));
        let frames = out.iter().filter_map(|byte| reader.push(*byte)).map(|frame| Message::parse(&frame).unwrap());
        frames
            .filter_map(|m| if let Message::Reply(r) = m { Some((r.to, r.sequence, r.trial)) } else { None })
            .collect()
    };
    let upload = |sequence: u32, trial: bool| -> Vec<Message> {
        let bytes = image(sequence);
        Message::pieces(&bytes).chain([Message::Commit(Commit { len: bytes.len() as u16, trial })]).collect()
    };
    let on = Message::Settings(RigSettings::default());
    // Each run is a power-on too.
    assert_eq!(said(&upload(1, false)).last(), Some(&(Message::COMMIT, 1, false)));
    assert_eq!(said(&upload(2, true)).last(), Some(&(Message::COMMIT, 2, true)));
    let starts = said(&[on; 4]);
    assert_eq!(starts, [(0, 2, true), (0, 2, true), (0, 2, true), (0, 2, true), (0, 1, false)]);
    assert_eq!(starts.len() as u32, TRIAL_STARTS + 1);
    assert_eq!(said(&upload(3, true)).last(), Some(&(Message::COMMIT, 3, true)));
    assert_eq!(said(&[on, Message::Confirm]).last(), Some(&(Message::CONFIRM, 3, false)));
    assert_eq!(said(&[on; 9]), [(0, 3, false); 10]);
    assert_eq!(said(&[Message::RollBack]).last(), Some(&(Message::ROLL_BACK, 1, false)));
    assert_eq!(said(&[Message::Answer([0; 64])]).last().map(|(to, ..)| *to), Some(Message::ANSWER));
}

/// The beginning of a frame that never ends does not hold up the next one, once the line has been quiet.
#[test]
fn a_partial_frame_times_out() {
    let mut reader = FrameReader::new();
    let frame = Message::RollBack.frame().unwrap();
    let (bytes, len) = frame.bytes();
    // A head that promises 60 bytes, then silence, then a whole frame: without a timeout the reader waits for the 60.
    let begun = [b'S', b'G', 0x20, 60, 1, 2];
    assert!(begun.iter().chain(&bytes[..len]).all(|byte| reader.push(*byte).is_none()));
    assert_eq!(reader.next_quiet(), Some(frame));
    assert_eq!((reader.next_quiet(), reader.buffered()), (None, 0));
    assert!(begun.iter().all(|byte| reader.push(*byte).is_none()));
    assert_eq!(reader.next_quiet(), None);
    assert_eq!(bytes[..len].iter().filter_map(|byte| reader.push(*byte)).collect::<Vec<_>>(), [frame]);
}
