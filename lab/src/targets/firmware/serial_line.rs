//! The emulated board on its serial line, next to the same board on this machine: frames equal byte for byte, and a signed upload.

use std::fs;
use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use sagnac_board::frame::FrameReader;
use sagnac_board::{
    Change, CommandHandler, Commit, MemoryFlash, Message, OutputFrame, POWER_ON, Reply, ReplyCode, RigSettings, Row,
    run,
};
use sagnac_core::{Banks, Gyro, Image, Origin};
use sagnac_loops::LoopTable;
use sagnac_signature::Signer;
use xtask::shell::{root, text};

use super::build::{build, emulate};
use super::prices::Measured;
use super::unit::{FirmwareUnit, sagnac};
use crate::program::Program;
use crate::targets::vector_files::image;

/// Sends the ten-minute log over the emulated board's serial line and through the same board on this machine.
pub(super) fn line_of(
    folder: &Path,
    unit: &FirmwareUnit,
    name: &str,
    dither_counts: u32,
    seconds: usize,
) -> Result<()> {
    let output = folder.join(format!("line-{}.bin", name.replace(' ', "-")));
    let (bytes, rows) = messages(unit, dither_counts, seconds)?;
    let here = here(unit, &bytes)?;
    let (there, stdout) = over_the_line(folder, bytes)?;
    fs::write(&output, &there)?;
    let both = here.len().min(there.len());
    let first = here.iter().zip(&there).position(|(a, b)| a != b).or((here.len() != there.len()).then_some(both));
    if let Some(at) = first {
        bail!("{name}: {} bytes here, {} from the target; the first difference is at {at}", here.len(), there.len());
    }
    println!(
        "check: {name}: {rows} rows, {} bytes of frames from the target equal the host's; {}",
        there.len(),
        stdout.trim()
    );
    let csv = folder.join("frames.csv");
    let summary = frames_summary(&output, &csv)?;
    println!("check: {name}: {summary}");
    if dither_counts == 0 {
        against_compensate(folder, unit, &csv)?;
    }
    Ok(())
}

/// Sends the bytes to the emulated board; returns its answer and its last message.
fn over_the_line(folder: &Path, bytes: Vec<u8>) -> Result<(Vec<u8>, String)> {
    let socket = folder.join("line.socket");
    let _ = fs::remove_file(&socket);
    let listener = UnixListener::bind(&socket).with_context(|| format!("{}", socket.display()))?;
    let port = format!("socket,id=line,path={}", text(&socket)?);
    // The emulated clock jumps to the next tick as soon as the processor waits.
    let ours = socket.clone();
    let emulated = std::thread::spawn(move || {
        let args = ["-chardev", &port, "-serial", "chardev:line", "-icount", "shift=0,sleep=off"];
        let stdout = emulate("gyro", &args, &root(), 900);
        // If the emulator failed to start, connect in its place so that the other side does not wait forever.
        let _ = UnixStream::connect(ours);
        stdout
    });
    let (mut line, _) = listener.accept()?;
    let mut writing = line.try_clone()?;
    // The emulator may end before it has read everything; the check of its answer detects that.
    let sent = std::thread::spawn(move || writing.write_all(&bytes));
    let mut back = Vec::new();
    line.read_to_end(&mut back)?;
    let stdout = emulated.join().map_err(|_| anyhow::anyhow!("the emulator's thread"))??;
    let _ = sent.join();
    fs::remove_file(&socket)?;
    Ok((back, stdout))
}

/// `sagnac line read` reads the line; returns its summary.
fn frames_summary(line: &Path, csv: &Path) -> Result<String> {
    let output = Command::new(Program::beside_the_lab()?.path())
        .args(["line", "read", text(line)?, "-o", text(csv)?])
        .output()?;
    let summary = String::from_utf8_lossy(&output.stderr).trim().replace('\n', "; ");
    ensure!(
        output.status.success() && summary.contains(" 0 missing") && !summary.contains("belong to no frame"),
        "frames: {summary}"
    );
    for expected in [
        "commit of an image: refused: not an image",
        "refused: for another gyro",
        "refused: not newer",
        "roll back: done",
    ] {
        ensure!(summary.contains(expected), "no {expected:?} from the target: {summary}");
    }
    Ok(summary)
}

/// Seconds of each of the two rows of the signed upload.
const ROW_SECONDS: u32 = 20;

/// A board with a key, whose ticks run while it takes, checks and stores an image: no frame and no count is lost, what is not signed for
/// it is refused, and the image is in force before the row has ended.
pub(super) fn signed_while_ticks_run(sysroot: &Path, folder: &Path, unit: &FirmwareUnit) -> Result<()> {
    let signer = Signer::from_seed(&[42; 32]);
    fs::write(folder.join("unit.key"), signer.public().bytes())?;
    build(sysroot, &unit.image, &unit.loops, &["--features", "signed,live", "--bin", "measure", "--bin", "gyro"])?;
    let verification = Measured::of(&image("compensator-full")?, folder)?.number("verification")?;
    println!("check: a signature of 836 bytes takes {verification} instructions");
    let (answers, frames) = said(&over_the_line(folder, signed_messages(unit, &signer)?)?.0);
    let refused_and_done = [
        Message::Challenge([1; 16]),
        answer_to(Message::ANSWER, ReplyCode::Done, 0),
        answer_to(Message::COMMIT, ReplyCode::Unsigned, 0),
        answer_to(Message::COMMIT, ReplyCode::BadSignature, 0),
        answer_to(Message::COMMIT, ReplyCode::Done, 1),
    ];
    let answers: Vec<(usize, Message)> = answers
        .into_iter()
        .filter(|(_, m)| !matches!(m, Message::Reply(r) if r.to == Message::PIECE || r.to == POWER_ON))
        .collect();
    let (locked, rest) = answers.split_first().context("no answer")?;
    ensure!(locked.1 == answer_to(Message::COMMIT, ReplyCode::Locked, 0), "outside of the service mode: {locked:?}");
    ensure!(rest.iter().map(|(_, m)| *m).eq(refused_and_done), "the board answers {rest:?}");
    let stored_at = rest.last().map_or(usize::MAX, |(frame, _)| *frame);
    let whole = ROW_SECONDS as usize * 100;
    ensure!(frames.len() == 2 * whole, "{} frames of {}", frames.len(), 2 * whole);
    ensure!(frames.iter().zip(0_u16..).all(|(frame, at)| frame.sequence == at), "a frame is missing");
    let raw: i64 = frames.iter().map(|frame| i64::from(frame.raw)).sum();
    ensure!(raw == i64::from(2 * ROW_COUNTS), "{raw} counts of {}", 2 * ROW_COUNTS);
    ensure!(stored_at < whole, "stored after frame {stored_at}, when the first row had ended");
    let corrected = frames.iter().position(|frame| frame.origin == Origin::Newest).context("never corrected")?;
    ensure!(corrected < whole, "corrected from frame {corrected}, when the first row had ended");
    println!(
        "check: signed upload while ticks run: stored and in force at frame {corrected} of the first row's {whole}, no frame or count lost"
    );
    println!("check: an unsigned, a forged and an unasked image are refused on the way");
    Ok(())
}

/// Counts of each of the two rows.
const ROW_COUNTS: i32 = 80_000;

fn answer_to(to: u8, code: ReplyCode, sequence: u32) -> Message {
    let origin = if sequence == 0 { Origin::FactoryDefaults } else { Origin::Newest };
    Message::Reply(Reply { to, code, sequence, origin, trial: false })
}

/// A row of the rig, and while it runs: an image without service mode, then unsigned, forged and signed images in it.
fn signed_messages(unit: &FirmwareUnit, signer: &Signer) -> Result<Vec<u8>> {
    let image = fs::read(&unit.image)?;
    let decoded = Image::decode(&image)?;
    let d = decoded.description();
    let block = signer.sign(&image, *b"EMULATED\0\0\0\0\0\0\0\0", 7).context("too long an image")?;
    let signed = [image.as_slice(), &block.encode()].concat();
    let mut forged = signed.clone();
    forged[140] ^= 1;
    let crc = sagnac_core::bytes::crc32(&forged[..image.len() - 4]);
    forged[image.len() - 4..image.len()].copy_from_slice(&crc.to_le_bytes());
    let loops = LoopTable::decode(&fs::read(&unit.loops)?)?;
    let row = Row { ticks: ROW_SECONDS * 10_000, counts: ROW_COUNTS, present: 1, codes: [20 << 24, 0, 0, 0] };
    let upload = |bytes: &[u8]| -> Vec<Message> {
        Message::pieces(bytes).chain([Message::Commit(Commit { len: bytes.len() as u16, trial: false })]).collect()
    };
    let mut messages = vec![Message::Settings(settings(&loops, 0)), Message::Row(row)];
    messages.extend(upload(&image));
    let answer = signer.answer(&d.serial, d.axis, Message::COMMIT, &[1; 16]);
    messages.extend([Message::Service(Change::Commit), Message::Answer(answer)]);
    for bytes in [&image, &forged, &signed] {
        messages.extend(upload(bytes));
    }
    messages.extend([Message::Row(row), Message::Stop]);
    let mut out = Vec::new();
    for message in messages {
        let (bytes, len) = message.frame().context("a message without a frame")?.bytes();
        out.extend_from_slice(&bytes[..len]);
    }
    Ok(out)
}

/// The answers of a board, each with the number of frames before it, and the frames.
fn said(bytes: &[u8]) -> (Vec<(usize, Message)>, Vec<OutputFrame>) {
    let (mut reader, mut answers, mut frames) = (FrameReader::new(), Vec::new(), Vec::new());
    for message in bytes.iter().filter_map(|byte| reader.push(*byte)).filter_map(|frame| Message::parse(&frame)) {
        match message {
            Message::Output(output) => frames.push(output),
            answer => answers.push((frames.len(), answer)),
        }
    }
    (answers, frames)
}

/// The log as rows for the rig, with good and bad images in between.
///
/// A slow update uses the newest temperature whose row has ended, as a replay does; so each row carries the temperature of
/// the row before.
fn messages(unit: &FirmwareUnit, dither_counts: u32, seconds: usize) -> Result<(Vec<u8>, usize)> {
    let log = fs::read_to_string(&unit.log)?;
    let loops = LoopTable::decode(&fs::read(&unit.loops)?)?;
    let mut rows = rows(&log)?;
    ensure!(rows.len() >= seconds, "the log has {} rows", rows.len());
    rows.truncate(seconds);
    let image = fs::read(&unit.image)?;
    let with = |change: &dyn Fn(&mut sagnac_core::Description)| -> Result<Vec<u8>> {
        let mut description = *Image::decode(&image)?.description();
        change(&mut description);
        Ok(sagnac::export::image_bytes(&Image::new(description)?))
    };
    let second = with(&|d| d.sequence = 2)?;
    let other = with(&|d| d.serial[0] ^= 1)?;
    let mut damaged = second.clone();
    damaged[150] ^= 4;
    let mut out = Vec::new();
    let mut send = |message: Message| -> Result<()> {
        let (bytes, len) = message.frame().context("a message without a frame")?.bytes();
        out.extend_from_slice(&bytes[..len]);
        Ok(())
    };
    send(Message::Settings(settings(&loops, dither_counts)))?;
    for (second_of_run, row) in rows.iter().enumerate() {
        // The first image is sent before the first row, so that a replay with it agrees from the start.
        let images: &[&Vec<u8>] = match second_of_run {
            0 => &[&image],
            row if row == seconds / 3 => &[&damaged, &other, &image, &second],
            _ => &[],
        };
        for image in images {
            Message::pieces(image).try_for_each(&mut send)?;
            send(Message::Commit(Commit { len: image.len() as u16, trial: false }))?;
        }
        if second_of_run == seconds * 2 / 3 {
            send(Message::RollBack)?;
        }
        let mut row = *row;
        if let Some(before) = second_of_run.checked_sub(1).and_then(|before| rows.get(before))
            && (!images.is_empty() || second_of_run == seconds * 2 / 3)
        {
            // Another image has its update at once: with the codes that the replay has at this time, those of the row before.
            send(Message::Row(Row { ticks: 1, counts: 0, codes: before.codes, ..row }))?;
            row.ticks -= 1;
        }
        send(Message::Row(row))?;
    }
    send(Message::Stop)?;
    Ok((out, rows.len()))
}

fn rows(log: &str) -> Result<Vec<Row>> {
    let mut rows: Vec<Row> = Vec::new();
    let mut before_ticks = 0_i64;
    for line in log.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let [time, counts, _, temperature, ..] = cells[..] else { bail!("a row of the log: {line}") };
        let ticks = (time.parse::<f64>()? * 1e4).round() as i64;
        let code = (temperature.parse::<f64>()? * f64::from(1 << 24)).round() as i32;
        // The slices of the update at the end of a row begin within it: they read its codes, as a replay does.
        let codes = [code, 0, 0, 0];
        rows.push(Row { ticks: (ticks - before_ticks) as u32, counts: counts.parse()?, present: 1, codes });
        before_ticks = ticks;
    }
    Ok(rows)
}

/// A plant that the loops can control: that of the vectors, with a drift of a tenth of a wavelength per °C.
pub(crate) fn settings(loops: &LoopTable, dither_counts: u32) -> RigSettings {
    let wavelength = loops.path_length.wavelength();
    let field = |wanted: &str| {
        let all = loops.intensity.fields();
        all.iter().find(|(name, _)| *name == wanted).map_or(0.0, |(_, value)| *value as f64)
    };
    let light = field("set_point") / field("ticks");
    RigSettings {
        dither_counts,
        // Slightly over 400 Hz, so that the dither phase moves relative to the frames.
        dither_step: (400.37e-4 * 32_f64.exp2()) as u32,
        peak: wavelength / 7,
        // 2^-16 codes for a °C.
        peak_slope: wavelength / 10 * 65_536,
        wavelength,
        curvature: (3.9 / f64::from(wavelength).powi(2) * 48_f64.exp2()) as u32,
        lamp_gain: (light / (0.6 * field("most")) * 65_536.0) as u32,
        lamp_lag: 4,
        actuator_lag: 0,
        noise_bits: (light.log2() as u8).saturating_sub(10),
    }
}

fn here(unit: &FirmwareUnit, input: &[u8]) -> Result<Vec<u8>> {
    let gyro = Gyro::of(&Image::decode(&fs::read(&unit.image)?)?, 4);
    let loops = LoopTable::decode(&fs::read(&unit.loops)?)?;
    let banks = Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK).context("the banks do not fit")?;
    let mut out = Vec::new();
    run(&mut CommandHandler::new(banks, gyro, loops), input.iter().copied(), |bytes| out.extend_from_slice(bytes));
    Ok(out)
}

/// The frames of each second add up to the row of `sagnac compensate`. The second image has the same correction as the
/// first, and the change of images between two ticks loses no count.
fn against_compensate(folder: &Path, unit: &FirmwareUnit, frames: &Path) -> Result<()> {
    let corrected = folder.join("corrected.csv");
    sagnac(&["compensate", text(&unit.image)?, text(&unit.log)?, "-o", text(&corrected)?])?;
    let table = |path: &Path, column: &str| -> Result<Vec<i64>> {
        let text = fs::read_to_string(path)?;
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        let header = lines.next().context("no header")?;
        let at = header.split(',').position(|name| name == column).with_context(|| format!("{column} in {header}"))?;
        lines.map(|line| Ok(line.split(',').nth(at).context("a short row")?.parse::<f64>()? as i64)).collect()
    };
    let rows = table(&corrected, "compensated_counts")?;
    let frames = table(frames, "counts")?;
    let seconds: Vec<i64> = frames.chunks(100).map(|second| second.iter().sum()).collect();
    let same = rows.iter().zip(&seconds).take_while(|(row, second)| row == second).count();
    ensure!(
        same == rows.len(),
        "the frames of second {same} add up to {:?}, compensate has {:?}",
        seconds.get(same),
        rows.get(same)
    );
    println!("check: the frames of each of the first {same} s add up to the rows of `sagnac compensate`");
    Ok(())
}
