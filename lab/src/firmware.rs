//! `cargo xtask firmware`: builds the firmware and compares it with the host, a line per check.
//!
//! ```text
//! simulate ─▶ calibrate ─▶ image ─┐
//! scenario ─▶ loops ──────────────┴▶ firmware (thumbv7em) ─▶ QEMU ─▶ vectors, instructions, frames
//! ten-minute log ─▶ messages ─┬─▶ serial line of the emulated board ─▶ frames ─┐
//!                             └─▶ the same board on this machine ─────▶ frames ┴▶ equal, byte for byte
//! ```

use std::fs;
use std::io::{Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use sagnac::model::PRICED_WITHIN;
use sagnac_board::frame::FrameReader;
use sagnac_board::{
    ANSWER, COMMIT, CommandHandler, MemoryFlash, Message, Output, PIECE, POWER_ON, Reply, ReplyCode, RigSettings, Row,
    run,
};
use sagnac_core::{Banks, Description, Gyro, Image, InputSpec, Kind, Multiplier, Origin, Shape, Term};
use sagnac_loops::LoopTable;
use sagnac_signature::Signer;
use xtask::debian::{self, need};
use xtask::shell::{root, sh_in, stdout_of, text};

use crate::program::Program;

const TARGET: &str = "thumbv7em-none-eabihf";
const SCENARIO: &str = "firmware/gyro/ten-minutes.toml";
/// Largest numbers of instructions: tick with slew, tick with both loops, slow update.
const MOST: [u32; 3] = [60, 1000, 2000];

pub(crate) fn firmware() -> Result<()> {
    need(debian::FIRMWARE)?;
    let folder = root().join("target/firmware");
    fs::create_dir_all(&folder)?;
    let sysroot = sysroot(&folder)?;
    let unit = unit(&folder)?;
    let refused = build(&sysroot, &unit.image, &unit.loops, &["--features", "broken", "--bin", "gyro"])
        .err()
        .context("a firmware with a panic path links")?;
    let reason = format!("{refused:#}");
    ensure!(reason.contains("sagnac_firmware_has_a_panic_path"), "it fails for another reason: {reason}");
    build(&sysroot, &unit.image, &unit.loops, &[])?;
    println!("check: no panic path in the linked programs, and with one they do not link");
    for line in emulate("vectors", &["-serial", "null"], &folder, 300)?.lines() {
        println!("check: Rust on the target: {line}");
    }
    instructions(&folder)?;
    costs(&folder)?;
    prices(&folder)?;
    line_of(&folder, &unit, "without dither", 0, 600)?;
    line_of(&folder, &unit, "dithered", 60, 60)?;
    signed_while_ticks_run(&sysroot, &folder, &unit)?;
    stm32f407(&sysroot)?;
    println!("firmware: every check passed");
    Ok(())
}

/// Builds core and compiler_builtins for the target once, from Debian's source of the same compiler version.
pub(crate) fn sysroot(folder: &Path) -> Result<PathBuf> {
    let versions = ["rustc-web", "rust-web-src"].map(|package| {
        let version = stdout_of(60, "dpkg-query", &["-W", "-f", "${Version}", package], &root())?;
        Ok::<_, anyhow::Error>(version)
    });
    let [compiler, source] = versions;
    let (compiler, source) = (compiler?, source?);
    ensure!(compiler == source, "rustc-web {compiler} and rust-web-src {source} are not of one version");
    let sysroot = folder.join(format!("sysroot-{compiler}"));
    let libraries = sysroot.join(format!("lib/rustlib/{TARGET}/lib"));
    let core = libraries.join("libcore.rlib");
    if !libraries.join("libcompiler_builtins.rlib").exists() {
        fs::create_dir_all(&libraries)?;
        let library = Path::new("/usr/lib/rustlib/src/rust/library");
        let common = ["--target", TARGET, "--edition=2024", "--crate-type", "rlib", "-O", "-C", "panic=abort"];
        let common = [&common[..], &["-C", "embed-bitcode=yes", "--cap-lints", "allow"]].concat();
        let common = [&common[..], &["-Z", "force-unstable-if-unmarked", "--out-dir", text(&libraries)?]].concat();
        let env = [("RUSTC_BOOTSTRAP", "1")];
        let source = library.join("core/src/lib.rs");
        sh_in(folder, "/usr/bin/rustc", &[&common[..], &["--crate-name", "core", text(&source)?]].concat(), &env)?;
        let source = library.join("compiler-builtins/compiler-builtins/src/lib.rs");
        let external = format!("core={}", text(&core)?);
        let features = ["--cfg", "feature=\"compiler-builtins\"", "--cfg", "feature=\"mem\"", "--extern", &external];
        let name = ["--crate-name", "compiler_builtins", "-C", "codegen-units=1"];
        let all = [&common[..], &name, &features, &[text(&source)?]].concat();
        sh_in(folder, "/usr/bin/rustc", &all, &env)?;
    }
    println!("check: core for {TARGET} from rust-web-src {compiler}, the compiler's own version");
    Ok(sysroot)
}

/// The unit that the firmware is built for.
struct Unit {
    image: PathBuf,
    loops: PathBuf,
    log: PathBuf,
}

/// Made by the program itself: a calibration from the long log, its image, the loops, the ten-minute log.
fn unit(folder: &Path) -> Result<Unit> {
    let file = |name: &str| folder.join(name);
    let unit = Unit { image: file("unit.img"), loops: file("unit.loops"), log: file("ten-minutes.csv") };
    let (thermal, calibration) = (file("thermal.csv"), file("unit.cal.json"));
    sagnac(&["simulate", "scenarios/paper/paper.toml", "-o", text(&thermal)?])?;
    let calibrate = ["calibrate", text(&thermal)?, "--setup", "scenarios/paper/bench.toml", "-o"];
    sagnac(&[&calibrate[..], &[text(&calibration)?]].concat())?;
    sagnac(&["export", text(&calibration)?, "--to", "image", "-o", text(&unit.image)?])?;
    sagnac(&["export", SCENARIO, "--to", "loops", "-o", text(&unit.loops)?])?;
    sagnac(&["simulate", SCENARIO, "-o", text(&unit.log)?])?;
    Ok(unit)
}

fn sagnac(args: &[&str]) -> Result<String> {
    Program::beside_the_lab()?.stdout(args)
}

pub(crate) fn build(sysroot: &Path, image: &Path, loops: &Path, features: &[&str]) -> Result<()> {
    let files = [("SAGNAC_IMAGE", image), ("SAGNAC_LOOPS", loops)];
    cargo_build(sysroot, "firmware/gyro", features, &files)
}

fn cargo_build(sysroot: &Path, package: &str, features: &[&str], files: &[(&str, &Path)]) -> Result<()> {
    let flags = format!("-C link-arg=-Tlink.x -C linker=arm-none-eabi-ld --sysroot {}", text(sysroot)?);
    let target = root().join("target/firmware/build");
    let args = ["build", "--release", "--locked", "--target", TARGET, "--target-dir", text(&target)?];
    let output = Command::new("cargo")
        .args(args)
        .args(features)
        .current_dir(root().join(package))
        .env("RUSTC", "/usr/bin/rustc")
        .env("RUSTFLAGS", &flags)
        .envs(files.iter().copied())
        .env("SAGNAC_KEY", root().join("target/firmware/unit.key"))
        .output()
        .context("cannot start cargo")?;
    ensure!(output.status.success(), "{package} does not build:\n{}", String::from_utf8_lossy(&output.stderr));
    Ok(())
}

/// Builds the board of the STM32F407 and looks where its parts lie: the vectors in sector 0 of the flash, the program from sector 4 on, and
/// nothing in the sectors of the banks and of the loops.
fn stm32f407(sysroot: &Path) -> Result<()> {
    const SECTOR_1: u64 = 0x0800_4000;
    const SECTOR_4: u64 = 0x0801_0000;
    const END: u64 = 0x0810_0000;
    cargo_build(sysroot, "firmware/stm32f407", &[], &[])?;
    let program = root().join(format!("target/firmware/build/{TARGET}/release/sagnac-stm32f407"));
    let headers = stdout_of(60, "arm-none-eabi-readelf", &["--wide", "--program-headers", text(&program)?], &root())?;
    let mut stored = Vec::new();
    for line in headers.lines().filter(|line| line.trim_start().starts_with("LOAD")) {
        let hex = |column: usize| {
            let digits = line.split_whitespace().nth(column).and_then(|word| word.strip_prefix("0x"));
            u64::from_str_radix(digits.with_context(|| format!("no number in: {line}"))?, 16).context("a number")
        };
        // Physical address and size in the file.
        stored.push((hex(3)?, hex(4)?));
    }
    stored.retain(|(_, size)| *size > 0);
    for (from, size) in &stored {
        let to = from + size;
        let fits = to <= SECTOR_1 || (*from >= SECTOR_4 && to <= END);
        ensure!(fits, "STM32F407: {from:#x} to {to:#x} lies in the sectors of the banks, or beyond the flash");
    }
    ensure!(stored.iter().any(|(from, _)| *from >= SECTOR_4), "STM32F407: no program in {headers}");
    let size: u64 = stored.iter().map(|(_, size)| size).sum();
    println!(
        "check: the board of the STM32F407 links without a panic path: {} KB of flash beside its banks",
        size.div_ceil(1024)
    );
    Ok(())
}

/// A program that [`build`] made.
pub(crate) fn built(program: &str) -> PathBuf {
    root().join(format!("target/firmware/build/{TARGET}/release/{program}"))
}

/// Runs a program in the emulator, in a folder, and returns its output. The exit status is the program's own verdict.
fn emulate(program: &str, args: &[&str], folder: &Path, seconds: u32) -> Result<String> {
    let path = built(program);
    let machine = ["-M", "mps2-an386", "-cpu", "cortex-m4", "-nographic", "-monitor", "none"];
    let hosting = ["-semihosting-config", "enable=on,target=native", "-kernel", text(&path)?];
    stdout_of(seconds, "qemu-system-arm", &[&machine[..], &hosting, args].concat(), folder)
}

/// Instructions and stack, as a program that measures has printed them.
struct Measured(String);

impl Measured {
    /// Writes the image where the program looks for it, and runs the one in Rust.
    fn of(image: &Image, folder: &Path) -> Result<Self> {
        fs::write(folder.join(MEASURED), sagnac::export::image_bytes(image))?;
        Ok(Self(emulate("measure", &["-serial", "null", "-icount", "shift=0"], folder, 120)?))
    }

    fn number(&self, name: &str) -> Result<u32> {
        let line = self.0.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        Ok(line.with_context(|| format!("no {name}: {}", self.0))?.trim().parse()?)
    }
}

/// The image of both programs that measure, in the emulator's working folder.
const MEASURED: &str = "measured.img";

/// Instructions of the image with bias 5, rate 1 and scale 2, which the vectors hold.
fn instructions(folder: &Path) -> Result<()> {
    let measured = Measured::of(&image_of("compensator-full")?, folder)?;
    let [tick, limited] = [measured.number("tick")?, measured.number("tick-limited")?];
    let [slewing, whole, slow] = ["tick-slewing", "tick-whole", "slow-update"].map(|name| measured.number(name));
    let (slewing, whole, slow) = (slewing?, whole?, slow?);
    println!("check: compensation tick {tick} instructions, {slewing} while slewing (at most {})", MOST[0]);
    println!("check: tick at the output limit, slewing: {limited} instructions");
    println!("check: tick with stripping, both loops and frame {whole} instructions on average (at most {})", MOST[1]);
    println!("check: slow update at bias 5, rate 1, scale 2: {slow} instructions (at most {})", MOST[2]);
    println!("       instructions, not cycles: a 100 MHz part has 10,000 cycles per tick");
    for (name, found, most) in
        [("tick", slewing, MOST[0]), ("whole tick", whole, MOST[1]), ("slow update", slow, MOST[2])]
    {
        ensure!(found <= most, "{name}: {found} instructions, at most {most}");
    }
    Ok(())
}

/// Largest numbers of instructions of a slice: Rust and C.
const MOST_SLICE: [u32; 2] = [700, 1600];

/// Best, typical and worst image: instructions and stack, in Rust and in C.
fn prices(folder: &Path) -> Result<()> {
    let full = image_of("compensator-full")?;
    let images = [("best", with_terms(&full, 1, |_| false)?), ("typical", full), ("worst", worst(&full)?)];
    let c = c_measure(folder)?;
    for (name, image) in images {
        let rust = Measured::of(&image, folder)?;
        let hosting = format!("enable=on,target=native,arg=measure,arg={MEASURED}");
        let machine = ["-M", "mps2-an386", "-cpu", "cortex-m4", "-nographic", "-monitor", "none", "-serial", "null"];
        let rest = ["-icount", "shift=0", "-semihosting-config", &hosting, "-kernel", text(&c)?];
        let c = Measured(stdout_of(120, "qemu-system-arm", &[&machine[..], &rest].concat(), folder)?);
        for ((language, said), most) in [("Rust", rust), ("C", c)].into_iter().zip(MOST_SLICE) {
            let [update, slice] = [said.number("slow-update")?, said.number("slice")?];
            println!(
                "check: price: {name}, {language}: slow update {update}, largest slice {slice}, tick {} / {} slewing / {} limited; \
                 stack {} B update, {} B tick",
                said.number("tick")?,
                said.number("tick-slewing")?,
                said.number("tick-limited")?,
                said.number("stack-update")?,
                said.number("stack-tick")?
            );
            ensure!(slice <= most, "{name}, {language}: a slice of {slice} instructions, at most {most}");
        }
    }
    Ok(())
}

/// Four inputs with lags and 32 harmonics of their rates: no legal image takes more instructions.
fn worst(full: &Image) -> Result<Image> {
    let mut description: Description = *full.description();
    description.inputs = [description.inputs[0]; sagnac_core::MAX_INPUTS];
    description.input_count = sagnac_core::MAX_INPUTS as u8;
    for (at, term) in (0_u8..).zip(&mut description.terms) {
        let shape = Shape::Sine { turns_q18: 1 << 18 };
        *term =
            Term { kind: Kind::Bias, input: at % 4, shape, multiplier: Multiplier::Rate, mantissa: 1 << 20, shift: 40 };
    }
    description.term_count = sagnac_core::MAX_TERMS as u8;
    Image::new(description).map_err(|e| anyhow::anyhow!("the worst image: {e}"))
}

/// The C export with `firmware/c/measure.c`, for the emulated Cortex-M4F.
fn c_measure(folder: &Path) -> Result<PathBuf> {
    let elf = folder.join("measure.elf");
    let sources = root().join("ports/c");
    let include = format!("-I{}", text(&sources)?);
    let files = ["sagnac_compensator.c", "sagnac_integer.c"].map(|name| sources.join(name));
    let own = ["measure.c", "vectors_mps2.c"].map(|name| root().join("firmware/c").join(name));
    let part = ["-O2", "-std=c99", "-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"];
    let link = ["--specs=rdimon.specs", "-Wl,--section-start=.vectors=0x0", "-o", text(&elf)?];
    let files = [text(&files[0])?, text(&files[1])?, text(&own[0])?, text(&own[1])?];
    stdout_of(300, "arm-none-eabi-gcc", &[&part[..], &[&include], &files, &link].concat(), folder)?;
    Ok(elf)
}

/// An image with a part of its terms and the first of its inputs; without a rate term no filter runs.
fn with_terms(of: &Image, inputs: u8, kept: impl Fn(&Term) -> bool) -> Result<Image> {
    let mut description: Description = *of.description();
    let kept: Vec<Term> = of.terms().iter().filter(|term| term.input < inputs && kept(term)).copied().collect();
    description.terms = [Term::ZERO; sagnac_core::MAX_TERMS];
    description.terms[..kept.len()].copy_from_slice(&kept);
    description.term_count = u8::try_from(kept.len())?;
    description.input_count = inputs;
    for (at, input) in (0_u8..).zip(description.inputs.iter_mut()) {
        if kept.iter().all(|term| term.multiplier != Multiplier::Rate || term.input != at) {
            input.lag = InputSpec::UNUSED.lag;
        }
        if at >= inputs {
            *input = InputSpec::UNUSED;
        }
    }
    Image::new(description).map_err(|e| anyhow::anyhow!("an image with fewer terms: {e}"))
}

/// The images whose slow update is counted.
fn priced(full: &Image, inputs: &Image, harmonic: &Image, lags: &Image) -> Result<Vec<(&'static str, Image)>> {
    let order = |term: &Term| term.shape.order().unwrap_or(0);
    let series = |term: &Term| term.kind == Kind::Bias && term.multiplier == Multiplier::One;
    let rate = |term: &Term, most: u8| term.multiplier == Multiplier::Rate && order(term) <= most;
    // The codes of the measurement are valid for every input.
    let with_first_gain = |image: &Image, input: usize| {
        let mut valid = *image.description();
        (valid.inputs[input].gain, valid.inputs[input].offset_q24) = (valid.inputs[0].gain, valid.inputs[0].offset_q24);
        Image::new(valid)
    };
    let (inputs, lags) = (&with_first_gain(inputs, 3)?, &with_first_gain(lags, 2)?);
    Ok(vec![
        ("nothing", with_terms(full, 1, |_| false)?),
        ("bias 1", with_terms(full, 1, |term| series(term) && order(term) <= 1)?),
        ("bias 5", with_terms(full, 1, series)?),
        ("bias 5, rate 0", with_terms(full, 1, |term| series(term) || rate(term, 0))?),
        ("bias 5, rate 1", with_terms(full, 1, |term| series(term) || rate(term, 1))?),
        ("bias 5, rate 1, scale 2", with_terms(full, 1, |_| true)?),
        ("bias 2 and zones", with_terms(inputs, 1, |term| term.multiplier == Multiplier::One)?),
        ("two thermometers", with_terms(inputs, 2, |term| term.multiplier == Multiplier::One)?),
        ("and their difference", with_terms(inputs, 3, |term| term.kind == Kind::Bias)?),
        ("and a voltage with steps", with_terms(inputs, 4, |_| true)?),
        ("bias 3 and harmonics", with_terms(harmonic, 1, |term| term.multiplier == Multiplier::One)?),
        ("harmonics of two thermometers and their rates", with_terms(harmonic, 2, |_| true)?),
        ("two lags", with_terms(lags, 2, |_| true)?),
        ("two lags of two thermometers", with_terms(lags, 4, |_| true)?),
    ])
}

/// Checks the cost formula of `calibrate --tradeoff` against the counted instructions of several images.
fn costs(folder: &Path) -> Result<()> {
    let [full, inputs, harmonic, lags] =
        ["full", "inputs", "harmonic", "lags"].map(|name| image_of(&format!("compensator-{name}")));
    let mut wrong = Vec::new();
    for (name, image) in priced(&full?, &inputs?, &harmonic?, &lags?)? {
        let work = image.work();
        let (counted, priced) = (Measured::of(&image, folder)?.number("slow-update")?, work.instructions());
        println!(
            "check: {name}: slow update of {counted} instructions, {priced} by the formula of docs/explanation/method.md ({work:?})"
        );
        if (f64::from(priced) / f64::from(counted) - 1.0).abs() > PRICED_WITHIN {
            wrong.push(format!("{name}: {priced} instructions by the formula, {counted} counted"));
        }
    }
    ensure!(wrong.is_empty(), "{}", wrong.join("; "));
    Ok(())
}

/// The image of a file of vectors.
fn image_of(name: &str) -> Result<Image> {
    let vectors = fs::read(root().join(format!("testdata/vectors/{name}.hex")))?;
    let mut words = sagnac_vectors::Words::new(&vectors);
    let head = words.head()?;
    let mut bytes = [0; sagnac_vectors::MAX_TABLE];
    Image::decode(words.table(&head, &mut bytes)?).map_err(|e| anyhow::anyhow!("the image of {name}: {e}"))
}

/// Sends the ten-minute log over the emulated board's serial line and through the same board on this machine.
fn line_of(folder: &Path, unit: &Unit, name: &str, dither_counts: u32, seconds: usize) -> Result<()> {
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

/// `sagnac frames` reads the line; returns its summary.
fn frames_summary(line: &Path, csv: &Path) -> Result<String> {
    let output =
        Command::new(Program::beside_the_lab()?.path()).args(["frames", text(line)?, "-o", text(csv)?]).output()?;
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
fn signed_while_ticks_run(sysroot: &Path, folder: &Path, unit: &Unit) -> Result<()> {
    let signer = Signer::from_seed(&[42; 32]);
    fs::write(folder.join("unit.key"), signer.public().bytes())?;
    build(sysroot, &unit.image, &unit.loops, &["--features", "signed,live", "--bin", "measure", "--bin", "gyro"])?;
    let verification = Measured::of(&image_of("compensator-full")?, folder)?.number("verification")?;
    println!("check: a signature of 836 bytes takes {verification} instructions");
    let (answers, frames) = said(&over_the_line(folder, signed_messages(unit, &signer)?)?.0);
    let refused_and_done = [
        Message::Challenge([1; 16]),
        answer_to(ANSWER, ReplyCode::Done, 0),
        answer_to(COMMIT, ReplyCode::Unsigned, 0),
        answer_to(COMMIT, ReplyCode::BadSignature, 0),
        answer_to(COMMIT, ReplyCode::Done, 1),
    ];
    let answers: Vec<(usize, Message)> = answers
        .into_iter()
        .filter(|(_, m)| !matches!(m, Message::Reply(r) if r.to == PIECE || r.to == POWER_ON))
        .collect();
    let (locked, rest) = answers.split_first().context("no answer")?;
    ensure!(locked.1 == answer_to(COMMIT, ReplyCode::Locked, 0), "outside of the service mode: {locked:?}");
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
fn signed_messages(unit: &Unit, signer: &Signer) -> Result<Vec<u8>> {
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
        Message::pieces(bytes).chain([Message::Commit { len: bytes.len() as u16, trial: false }]).collect()
    };
    let mut messages = vec![Message::Settings(settings(&loops, 0)), Message::Row(row)];
    messages.extend(upload(&image));
    messages.extend([Message::Service, Message::Answer(signer.answer(&d.serial, d.axis, &[1; 16]))]);
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
fn said(bytes: &[u8]) -> (Vec<(usize, Message)>, Vec<Output>) {
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
fn messages(unit: &Unit, dither_counts: u32, seconds: usize) -> Result<(Vec<u8>, usize)> {
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
            send(Message::Commit { len: image.len() as u16, trial: false })?;
        }
        if second_of_run == seconds * 2 / 3 {
            send(Message::RollBack)?;
        }
        send(Message::Row(*row))?;
    }
    send(Message::Stop)?;
    Ok((out, rows.len()))
}

fn rows(log: &str) -> Result<Vec<Row>> {
    let mut rows: Vec<Row> = Vec::new();
    let (mut before_ticks, mut before_code) = (0_i64, None);
    for line in log.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let [time, counts, _, temperature, ..] = cells[..] else { bail!("a row of the log: {line}") };
        let ticks = (time.parse::<f64>()? * 1e4).round() as i64;
        let code = (temperature.parse::<f64>()? * f64::from(1 << 24)).round() as i32;
        let codes = [before_code.unwrap_or(code), 0, 0, 0];
        rows.push(Row { ticks: (ticks - before_ticks) as u32, counts: counts.parse()?, present: 1, codes });
        (before_ticks, before_code) = (ticks, Some(code));
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

fn here(unit: &Unit, input: &[u8]) -> Result<Vec<u8>> {
    let gyro = Gyro::of(&Image::decode(&fs::read(&unit.image)?)?, 4);
    let loops = LoopTable::decode(&fs::read(&unit.loops)?)?;
    let banks = Banks::new(MemoryFlash::new(), 0, MemoryFlash::BANK).context("the banks do not fit")?;
    let mut out = Vec::new();
    run(&mut CommandHandler::new(banks, gyro, loops), input.iter().copied(), |bytes| out.extend_from_slice(bytes));
    Ok(out)
}

/// The frames of each second add up to the row of `sagnac compensate`. The second image has the same correction as the
/// first, and the change of images between two ticks loses no count.
fn against_compensate(folder: &Path, unit: &Unit, frames: &Path) -> Result<()> {
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
