//! Sessions on the serial line: the octets that a whole board in Rust sends, which a whole board in C must send too.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use sagnac_board::{Change, CommandHandler, Commit, MemoryFlash, Message, RigSettings, Row, run};
use sagnac_core::{Banks, Description, Gyro, Image, Trust};
use sagnac_signature::{Keyed, Signer};
use xtask::shell::{root, stdout_of, text};

use super::Machine;
use crate::targets::vector_files::{loops, table};

const MODEL: [u8; 16] = *b"RLG-28\0\0\0\0\0\0\0\0\0\0";

/// What is sent to a board, and what it must answer.
pub(super) struct Session {
    pub(super) input: PathBuf,
    expected: Vec<u8>,
}

/// The generator of the vectors.
struct Throws(u32);

impl Throws {
    fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        self.0 >> 4
    }

    fn below(&mut self, n: u32) -> u32 {
        self.next() % n
    }
}

fn paper() -> Result<Vec<u8>> {
    Ok(fs::read(root().join("testdata/image/paper.img"))?)
}

/// Sessions of a board without a key.
pub(super) fn sessions(folder: &Path, count: u32) -> Result<Vec<Session>> {
    fs::write(folder.join("line.img"), paper()?)?;
    fs::write(folder.join("line.loops"), table("path-length-mirror")?)?;
    (0..count).map(|seed| session(folder, seed, None)).collect()
}

/// Sessions of a board with a key.
pub(super) fn keyed(folder: &Path, count: u32) -> Result<Vec<Session>> {
    let signer = Signer::from_seed(&[42; 32]);
    fs::write(folder.join("line.key"), [&signer.public().bytes()[..], &MODEL].concat())?;
    (0..count).map(|seed| session(folder, seed + 10_000, Some(&signer))).collect()
}

/// The same with a key: signed, forged, unasked and repeated, over the Ed25519 of libsodium.
pub(super) fn with_a_key(machine: &Machine, folder: &Path, sessions: &[Session]) -> Result<()> {
    let program = machine.build(folder, "check_line", &["-DWITH_KEY", "-lsodium"])?;
    let (mut bytes, mut stored) = (0, 0);
    for (number, session) in sessions.iter().enumerate() {
        let out = folder.join("line.out");
        let key = folder.join("line.key");
        let args = ["line.img", "line.loops", text(&session.input)?, text(&out)?, text(&key)?];
        stdout_of(120, text(&program)?, &args, folder)?;
        ensure!(fs::read(&out)? == session.expected, "C, with a key: session {number} differs");
        bytes += session.expected.len();
        // Kind, length, kind of the message, code: a commit that is done.
        let is_done = |bytes: &&[u8]| bytes.starts_with(b"SG\x42") && bytes.ends_with(&[7, 0x21, 0]);
        stored += session.expected.windows(6).filter(is_done).count();
    }
    ensure!(stored > 20, "only {stored} signed images were stored");
    println!(
        "check: C, with a key: {} sessions on the line, {bytes} bytes equal, {stored} signed images stored",
        sessions.len()
    );
    Ok(())
}

/// Every session on a machine.
pub(super) fn check(machine: &Machine, folder: &Path, sessions: &[Session]) -> Result<()> {
    let program = machine.build(folder, "check_line", &[])?;
    let (out, mut bytes) = (folder.join("line.out"), 0);
    for (number, session) in sessions.iter().enumerate() {
        machine.run(folder, &program, &["line.img", "line.loops", text(&session.input)?, text(&out)?])?;
        ensure!(fs::read(&out)? == session.expected, "C, {}: session {number} differs", machine.name);
        bytes += session.expected.len();
    }
    println!("check: C, {}: {} sessions on the line, {bytes} bytes equal", machine.name, sessions.len());
    Ok(())
}

fn session(folder: &Path, seed: u32, signer: Option<&Signer>) -> Result<Session> {
    let (paper, mut throws) = (Image::decode(&paper()?)?, Throws(seed));
    let gyro = Gyro::of(&paper, 4);
    let mut input = Vec::new();
    let (mut number, mut challenges, mut asked) = (0, 0_u8, Change::Commit);
    for _ in 0..10 + throws.below(30) {
        let mut messages = messages(&mut throws, &paper, signer, &mut number)?;
        // Lost, doubled and out of order.
        match throws.below(12) {
            0 => drop(messages.pop()),
            1 => messages.reverse(),
            2 => messages.extend_from_within(..),
            _ => {}
        }
        for mut message in messages {
            match (&mut message, signer) {
                (Message::Service(change), _) => {
                    challenges = challenges.wrapping_add(1);
                    asked = *change;
                }
                (Message::Answer(answer), Some(signer)) => {
                    *answer = answered(&mut throws, &gyro, signer, asked, challenges);
                }
                _ => {}
            }
            // For every gyro of the line, for this one, or for another.
            let axis = match throws.below(400) {
                0 => b'y',
                1 => b'z',
                near if near < 200 => gyro.axis,
                _ => 0,
            };
            let (bytes, len) = message.frame().context("every message has a frame")?.of_axis(axis).bytes();
            input.extend_from_slice(&bytes[..len]);
            noise(&mut throws, &mut input);
        }
    }
    let file = folder.join(format!("session-{seed}.bin"));
    fs::write(&file, &input)?;
    let banks = Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK).context("they fit")?;
    let expected = match signer {
        None => answers(CommandHandler::new(banks, gyro, loops()?), input),
        Some(signer) => {
            let mut asked = 0_u8;
            let challenge = move || {
                asked = asked.wrapping_add(1);
                [asked; 16]
            };
            let trust = Keyed { public_key: signer.public().bytes(), model: MODEL, lowest_counter: 1, challenge };
            answers(CommandHandler::with_trust(banks, gyro, loops()?, trust), input)
        }
    };
    Ok(Session { input: file, expected })
}

fn answers<T: Trust>(mut board: CommandHandler<MemoryFlash, T>, input: Vec<u8>) -> Vec<u8> {
    let mut out = Vec::new();
    run(&mut board, input.into_iter(), |bytes| out.extend_from_slice(bytes));
    out
}

/// Damage: a byte changes, goes or comes, or the beginning of a frame stands alone.
fn noise(throws: &mut Throws, input: &mut Vec<u8>) {
    let at = input.len().saturating_sub(1 + throws.below(40) as usize);
    match throws.below(60) {
        0 => input[at] ^= 1 << throws.below(8),
        1 => drop(input.remove(at)),
        2 => input.insert(at, throws.next() as u8),
        3 => input.extend([b'S', b'G', 0x20, 60, 1, 2]),
        4 => input.extend([b'S', b'S', b'G', 0x20, 200]),
        _ => {}
    }
}

fn messages(throws: &mut Throws, paper: &Image, signer: Option<&Signer>, number: &mut u32) -> Result<Vec<Message>> {
    // Both are open or closed to a change alike; a session with a key asks more often.
    let asks = signer.is_some() && throws.below(2) == 0;
    Ok(match if asks { 9 } else { throws.below(10) } {
        0 => vec![Message::Settings(settings(throws))],
        1..=4 => vec![Message::Row(row(throws))],
        5 | 6 => upload(throws, paper, signer, number)?,
        7 => vec![Message::RollBack],
        8 => vec![Message::Confirm],
        // The answer is signed when it is sent; most often the change that it is for follows.
        _ => {
            let change = [Change::Commit, Change::Commit, Change::RollBack, Change::Confirm][throws.below(4) as usize];
            let mut messages = vec![Message::Service(change), Message::Answer([7; 64])];
            match (throws.below(5), change) {
                (0, _) => {}
                (1, _) | (_, Change::Commit) => messages.extend(upload(throws, paper, signer, number)?),
                (_, Change::RollBack) => messages.push(Message::RollBack),
                (_, Change::Confirm) => messages.push(Message::Confirm),
            }
            messages
        }
    })
}

fn settings(throws: &mut Throws) -> RigSettings {
    let dithered = throws.below(2) == 0;
    RigSettings {
        dither_counts: if dithered { 200 + throws.below(400) } else { 0 },
        // 25 ticks a period; now and then no dither that a stripper would know.
        dither_step: if throws.below(4) == 0 { 1 } else { u32::MAX / 25 + throws.below(10_000) },
        peak: 10_000 + throws.below(50_000).cast_signed(),
        peak_slope: throws.below(2_000_000).cast_signed() - 1_000_000,
        wavelength: 200_000,
        curvature: 20_000 + throws.below(20_000),
        lamp_gain: 50_000 + throws.below(100_000),
        lamp_lag: throws.below(8) as u8,
        actuator_lag: throws.below(6) as u8,
        noise_bits: throws.below(12) as u8,
    }
}

fn row(throws: &mut Throws) -> Row {
    let codes = [0; 4].map(|_: i32| (throws.next() & 0x3fff_ffff).cast_signed() - (1 << 28));
    let counts = (throws.next() & 0xf_ffff).cast_signed() - (1 << 19);
    Row { ticks: throws.below(1500), counts, present: throws.below(16) as u8, codes }
}

/// An image in pieces, with its commit: newer than the last or not, of this gyro or another one, signed or not.
fn upload(throws: &mut Throws, paper: &Image, signer: Option<&Signer>, number: &mut u32) -> Result<Vec<Message>> {
    *number += throws.below(3);
    let mut d = Description { sequence: *number, ..*paper.description() };
    match throws.below(10) {
        0 => d.axis = b'y',
        1 => d.serial[31] = b'1',
        2 => d.terms[0].mantissa = 1 << 29,
        _ => {}
    }
    // A term of its own, so that images differ in more than their number.
    d.terms[1].mantissa = d.terms[1].mantissa.wrapping_add(throws.below(1000).cast_signed());
    let image = Image::new(d).unwrap_or(*paper);
    let mut bytes = vec![0; image.encoded_len()];
    image.encode(&mut bytes).context("it fits its own length")?;
    if throws.below(10) == 0 {
        let at = throws.below(bytes.len() as u32) as usize;
        bytes[at] ^= 4;
    }
    if let Some(signer) = signer.filter(|_| throws.below(8) != 0) {
        let other = Signer::from_seed(&[43; 32]);
        let by = if throws.below(12) == 0 { &other } else { signer };
        let model = if throws.below(12) == 0 { *b"RLG-29\0\0\0\0\0\0\0\0\0\0" } else { MODEL };
        let mut block = by.sign(&bytes, model, throws.below(5)).context("an image fits")?.encode();
        if throws.below(8) == 0 {
            let at = throws.below(112) as usize;
            block[at] ^= 1;
        }
        bytes.extend(block);
    }
    let commit = Message::Commit(Commit { len: bytes.len() as u16, trial: throws.below(3) == 0 });
    Ok(Message::pieces(&bytes).chain([commit]).collect())
}

/// The answer to the challenge of this number: now and then that of another challenge, for another gyro, or for another change.
fn answered(throws: &mut Throws, gyro: &Gyro, signer: &Signer, asked: Change, challenge: u8) -> [u8; 64] {
    let challenge = if throws.below(8) == 0 { challenge.wrapping_sub(1) } else { challenge };
    let axis = if throws.below(10) == 0 { b'z' } else { gyro.axis };
    let change = if throws.below(12) == 0 { Change::RollBack } else { asked };
    signer.answer(&gyro.serial, axis, change as u8, &[challenge; 16])
}
